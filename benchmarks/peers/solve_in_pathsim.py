"""The problems for solvers in PathSim: an ODE block, a pulse source, a zero crossing."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import ODE, PulseSource, Scope
from pathsim.events import ZeroCrossingDown
from pathsim.solvers import ESDIRK43, RKDP54

from benchmarks.problems import PULSE, SHARE, START, WALL, Solved, reaction, ticks

SOLVERS = {"explicit": "RKDP54", "stiff": "ESDIRK43"}
NOTE = (
    "its first step is a tenth of a tick, and steps end at ticks, as ours do; an event is located "
    "to 1e-10 of its signal; ESDIRK43 gets no Jacobian, and neither do the other implicit solvers."
)


def solve(title: str, rtol: float) -> Solved:
    count = 0

    def rates(x: Any, u: Any, t: float) -> Any:
        nonlocal count
        count += 1
        if title == "stiff":
            return np.array(reaction(t, x.tolist()))
        return u - x if title == "edges" else np.array([x[1], -x[0]])

    def bounce(t: float) -> None:
        x = ode.engine.state.copy()
        x[1] *= -SHARE
        ode.engine.set(x)

    times = ticks(title)
    ode, scope = ODE(rates, np.array(START[title])), Scope(sampling_period=times[1])
    blocks, wires, events = [ode, scope], [Connection(ode, scope)], []
    if title == "edges":
        period, width = PULSE["period"], PULSE["width"]
        blocks.append(PulseSource(T=period, tau=PULSE["start"], duty=width / period))
        wires.append(Connection(blocks[-1], ode))
    if title == "events":
        events = [ZeroCrossingDown(lambda t: ode.engine.state[0] - WALL, bounce, tolerance=1e-10)]
    simulation = Simulation(
        *(blocks, wires, events),
        **{"dt": times[1] / 10, "Solver": ESDIRK43 if title == "stiff" else RKDP54, "log": False},
        **{"tolerance_lte_rel": rtol, "tolerance_lte_abs": rtol / 1000},
    )
    began = time.process_time()
    simulation.run(times[-1] + times[1])
    took = time.process_time() - began
    at, data = scope.read()
    np.testing.assert_allclose(at[: len(times)], times, atol=1e-12)
    return Solved(data[0, : len(times)], count, took)
