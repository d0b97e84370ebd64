"""The diagram in python-control: discrete nonlinear systems, interconnected by signal names."""

from __future__ import annotations

import time

import control
import numpy as np

from benchmarks import tracking
from benchmarks.agreement import Run

POSE, REFERENCE, ERROR = ["x", "y", "theta"], ["x_r", "y_r", "theta_r"], ["dx", "dy", "dtheta"]


def poses(steps: int, dt: float) -> Run:
    k = tracking.gain(dt)

    def step(t, x, u, params):  # type: ignore[no-untyped-def]
        return x + dt * np.array(tracking.slope(x.item(2), *u.tolist()))

    def box(name, function, inputs, outputs):  # type: ignore[no-untyped-def]
        def output(t, x, u, params):  # type: ignore[no-untyped-def]
            return np.array(function(*u.tolist()))

        return control.nlsys(None, output, inputs=inputs, outputs=outputs, dt=dt, name=name)

    robot = control.nlsys(
        step,
        lambda t, x, u, params: x,
        inputs=["v_done", "omega_done"],
        outputs=POSE,
        states=3,
        dt=dt,
        name="robot",
    )
    total = box(
        "total",
        lambda v, omega, v_f, omega_f: (v + v_f, omega + omega_f),
        ["v_u", "omega_u", "v_f", "omega_f"],
        ["v_sum", "omega_sum"],
    )
    loop = control.interconnect(
        [
            robot,
            box("line", tracking.line, POSE, REFERENCE),
            box("error", tracking.error, POSE + REFERENCE, ERROR),
            box("feedback", lambda *e: tracking.feedback(k, *e), ERROR, ["v_u", "omega_u"]),
            total,
            box("limit", tracking.saturate, ["v_sum", "omega_sum"], ["v_s", "omega_s"]),
            box("fault", tracking.fault, ["v_s", "omega_s"], ["v_done", "omega_done"]),
        ],
        inputs=["v_f", "omega_f"],
        outputs=POSE,
    )
    times = np.arange(steps) * dt
    forward = np.repeat(np.array(tracking.FORWARD)[:, None], steps, axis=1)
    began = time.perf_counter()
    response = control.input_output_response(loop, times, forward, list(tracking.X0))
    return Run(time.perf_counter() - began, response.outputs.T)
