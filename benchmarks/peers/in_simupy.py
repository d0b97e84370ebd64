"""The diagram in simupy: systems from callables, and a fixed-step integrator by its interface."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks import tracking
from benchmarks.agreement import Run
from blocks.core import FloatArray

# simupy 1.1 names what numpy 2 has dropped.
for name, value in (("Inf", np.inf), ("float_", np.float64)):
    if not hasattr(np, name):
        setattr(np, name, value)

from simupy.block_diagram import BlockDiagram  # noqa: E402
from simupy.systems import DynamicalSystem, SystemFromCallable  # noqa: E402


class Euler:
    """Fixed steps, by the interface of ``scipy.integrate.ode`` that simupy asks for."""

    def __init__(self, slope: Callable[[float, FloatArray], FloatArray]) -> None:
        self.slope = slope

    def set_integrator(self, dt: float) -> None:
        self.dt = dt

    def set_initial_value(self, y: FloatArray, t: float) -> None:
        self.y, self.t = y, t

    def set_solout(self, step_done: Callable[[float, FloatArray], int]) -> None:
        self.step_done = step_done

    def successful(self) -> bool:
        return True

    def integrate(self, until: float) -> FloatArray:
        for step in range(round(self.t / self.dt), round(until / self.dt)):
            self.y = self.y + self.dt * self.slope(self.t, self.y)
            self.t = (step + 1) * self.dt
            if self.step_done(self.t, self.y) == -1:
                break
        return self.y


def poses(steps: int, dt: float) -> Run:
    k = tracking.gain(dt)

    def box(function, inputs, outputs):  # type: ignore[no-untyped-def]
        return SystemFromCallable(lambda t, u: np.array(function(*u.tolist())), inputs, outputs)

    def motion(t, x, u):  # type: ignore[no-untyped-def]
        return np.array(tracking.slope(x.item(2), *u.tolist()))

    robot = DynamicalSystem(motion, dim_state=3, dim_input=2, initial_condition=tracking.X0)
    line = box(tracking.line, 3, 3)
    error = box(tracking.error, 6, 3)
    feedback = box(lambda *e: tracking.feedback(k, *e), 3, 2)
    forward = SystemFromCallable(lambda t: np.array(tracking.FORWARD), 0, 2)
    total = SystemFromCallable(lambda t, u: u[:2] + u[2:], 4, 2)
    limit = box(tracking.saturate, 2, 2)
    fault = box(tracking.fault, 2, 2)
    # What has no state is evaluated last to first.
    diagram = BlockDiagram(robot, fault, limit, total, forward, feedback, error, line)
    diagram.connect(robot, line)
    diagram.connect(robot, error, inputs=[0, 1, 2])
    diagram.connect(line, error, inputs=[3, 4, 5])
    diagram.connect(error, feedback)
    diagram.connect(feedback, total, inputs=[0, 1])
    diagram.connect(forward, total, inputs=[2, 3])
    diagram.connect(total, limit)
    diagram.connect(limit, fault)
    diagram.connect(fault, robot)
    began = time.perf_counter()
    result = diagram.simulate(steps * dt, integrator_class=Euler, integrator_options={"dt": dt})
    return Run(time.perf_counter() - began, result.x[:steps])
