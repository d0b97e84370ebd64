"""The diagram in pathsim: Function blocks about an ODE block, forward Euler."""

from __future__ import annotations

import time

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import ODE, Adder, Constant, Function, Scope
from pathsim.solvers import EUF

from benchmarks import tracking
from benchmarks.agreement import Run


def poses(steps: int, dt: float) -> Run:
    k = tracking.gain(dt)

    def slope(x, u, t):  # type: ignore[no-untyped-def]
        return np.array(tracking.slope(x.item(2), *u.tolist()))

    robot = ODE(slope, np.array(tracking.X0))
    line = Function(tracking.line)
    error = Function(tracking.error)
    feedback = Function(lambda dx, dy, dtheta: tracking.feedback(k, dx, dy, dtheta))
    forward_v, forward_omega = (Constant(value) for value in tracking.FORWARD)
    total_v, total_omega = Adder(), Adder()
    limit = Function(tracking.saturate)
    fault = Function(tracking.fault)
    scope = Scope()
    simulation = Simulation(
        [
            *(robot, line, error, feedback, forward_v, forward_omega, total_v, total_omega),
            *(limit, fault, scope),
        ],
        [
            Connection(robot[:3], line[:3], error[:3], scope[:3]),
            Connection(line[:3], error[3:6]),
            Connection(error[:3], feedback[:3]),
            Connection(feedback[0], total_v[0]),
            Connection(forward_v, total_v[1]),
            Connection(feedback[1], total_omega[0]),
            Connection(forward_omega, total_omega[1]),
            Connection(total_v, limit[0]),
            Connection(total_omega, limit[1]),
            Connection(limit[:2], fault[:2]),
            Connection(fault[:2], robot[:2]),
        ],
        dt=dt,
        Solver=EUF,
        log=False,
    )
    began = time.perf_counter()
    simulation.run(steps * dt)
    took = time.perf_counter() - began
    _, data = scope.read()
    return Run(took, data.T[:steps])
