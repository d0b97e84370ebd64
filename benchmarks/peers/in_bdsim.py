"""The diagram in bdsim: FUNCTION blocks about a clocked integrator."""

from __future__ import annotations

import contextlib
import io
import time

import numpy as np

from benchmarks import tracking
from benchmarks.agreement import Run

with contextlib.redirect_stdout(io.StringIO()):  # it lists the toolboxes that it does not find
    import bdsim

    SIMULATOR = bdsim.BDSim(sysargs=False, graphics=False, quiet=True, progress=False, banner=False)


def poses(steps: int, dt: float) -> Run:
    diagram = SIMULATOR.blockdiagram()
    k = tracking.gain(dt)

    def box(function):  # type: ignore[no-untyped-def]
        return diagram.FUNCTION(lambda a: np.array(function(*a.tolist())))

    def box_of_two(function):  # type: ignore[no-untyped-def]
        return diagram.FUNCTION(lambda a, b: np.array(function(*a.tolist(), *b.tolist())), nin=2)

    clock = diagram.clock(dt, "s")
    robot = diagram.INTEGRATOR_S(clock, x0=list(tracking.X0), name="robot")
    line = box(tracking.line)
    error = box_of_two(tracking.error)
    feedback = box(lambda *e: tracking.feedback(k, *e))
    forward = diagram.CONSTANT(np.array(tracking.FORWARD))
    total = diagram.SUM("++")
    limit = box(tracking.saturate)
    fault = box(tracking.fault)
    motion = box_of_two(lambda x, y, theta, v, omega: tracking.slope(theta, v, omega))
    diagram.connect(robot, line, error[0], motion[0])
    diagram.connect(line, error[1])
    diagram.connect(error, feedback)
    diagram.connect(feedback, total[0])
    diagram.connect(forward, total[1])
    diagram.connect(total, limit)
    diagram.connect(limit, fault)
    diagram.connect(fault, motion[1])
    diagram.connect(motion, robot)
    diagram.compile()
    began = time.perf_counter()
    out = SIMULATOR.run(diagram, steps * dt, watch=[robot])
    # Its clock ticks for the first time one period after the start.
    return Run(time.perf_counter() - began, np.array(out.y)[1:])
