"""A loop of continuous blocks in other packages and here:  python -m benchmarks --only continuous

Ten integrators in a ring, closed with a gain of -1: x_1' = -x_10, x_i' = x_(i-1). The error is the
largest of any state at any step against the matrix exponential. All take steps of one length and
are compared with the solver of ours that has the same error: RK4 with rk4; packages that use
scipy's ``solve_ivp`` get RK45 with this largest step and loose tolerances, which is dopri5.
"""

from __future__ import annotations

import contextlib
import io
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.linalg import expm

from benchmarks.tables import Goal, faster, goals, microseconds, table
from benchmarks.timing import machine, take_turns
from blocks.core import FloatArray

BLOCKS, DT, STEPS = 10, 0.02, 250
COMPILED_STEPS = 100 * STEPS
Solved = tuple[float, FloatArray]


def matrix() -> FloatArray:
    """A of x' = A x."""
    a = np.diag(np.ones(BLOCKS - 1), -1)
    a[0, -1] = -1.0
    return a


def start() -> FloatArray:
    return np.linspace(1.0, 0.1, BLOCKS)


def exact(steps: int, dt: float) -> FloatArray:
    """The states (steps, blocks)."""
    step, x, rows = expm(dt * matrix()), start(), []
    for _ in range(steps):
        rows.append(x)
        x = step @ x
    return np.array(rows)


def ours(engine: str, solver: str, steps: int, dt: float) -> Solved:
    """The ring as a graph; its last block is recorded."""
    import runtime

    names = [f"x{i}" for i in range(BLOCKS)]
    blocks = {
        name: {"type": "Integrator", "initial": float(x)}
        for name, x in zip(names, start(), strict=True)
    }
    graph = {
        "run": {"dt": dt, "until": steps * dt, "engine": engine, "solver": solver}
        | ({"rtol": 0.1, "atol": 0.1} if solver == "dopri5" else {}),
        "blocks": {**blocks, "back": {"type": "Gain", "gain": -1.0, "signal": "Scalar"}},
        "wires": {
            "back": {"input": f"{names[-1]}.out"},
            **{
                name: {"input": f"{before}.out"}
                for before, name in zip(["back", *names], names, strict=False)
            },
        },
        "probes": {"x": {"of": [f"{name}.out" for name in names]}},
    }
    result = runtime.load(graph).run()
    seconds = result.manifest["us_per_tick"] * 1e-6 * steps
    return seconds, np.asarray(result["x"])


def pathsim(steps: int, dt: float) -> Solved:
    from pathsim import Connection, Simulation
    from pathsim.blocks import Amplifier, Integrator, Scope
    from pathsim.solvers import RK4

    ring = [Integrator(float(x)) for x in start()]
    back, scope = Amplifier(-1.0), Scope()
    wires = [Connection(a, b, scope[i]) for i, (a, b) in enumerate(pairwise(ring))]
    wires += [Connection(ring[-1], back, scope[BLOCKS - 1]), Connection(back, ring[0])]
    simulation = Simulation([*ring, back, scope], wires, dt=dt, Solver=RK4, log=False)
    began = time.perf_counter()
    simulation.run(steps * dt)
    took = time.perf_counter() - began
    return took, scope.read()[1].T[:steps]


def bdsim(steps: int, dt: float) -> Solved:
    with contextlib.redirect_stdout(io.StringIO()):
        import bdsim as package

        simulator = package.BDSim(
            sysargs=False, graphics=False, quiet=True, progress=False, banner=False
        )
    diagram = simulator.blockdiagram()
    ring = [diagram.INTEGRATOR(x0=float(x)) for x in start()]
    back = diagram.GAIN(-1.0)
    for a, b in zip(ring, [*ring[1:], back], strict=True):
        diagram.connect(a, b)
    diagram.connect(back, ring[0])
    diagram.compile()
    tolerances = {"rtol": 0.1, "atol": 0.1, "first_step": dt}
    began = time.perf_counter()
    out = simulator.run(diagram, steps * dt, dt=dt, max_step=dt, solver_args=tolerances)
    return time.perf_counter() - began, np.asarray(out.x)[:steps]


def python_control(steps: int, dt: float) -> Solved:
    import control

    systems = [
        control.nlsys(
            lambda t, x, u, params: u,
            lambda t, x, u, params: x,
            inputs=[f"y{i - 1}" if i else "u"],
            outputs=[f"y{i}"],
            states=1,
            name=f"x{i}",
        )
        for i in range(BLOCKS)
    ]
    back = control.nlsys(
        None, lambda t, x, u, params: -u, inputs=[f"y{BLOCKS - 1}"], outputs=["u"], name="back"
    )
    outputs = [f"y{i}" for i in range(BLOCKS)]
    loop = control.interconnect([*systems, back], inputs=[], outputs=outputs)
    t = dt * np.arange(steps)
    options = {"rtol": 0.1, "atol": 0.1, "max_step": dt, "first_step": dt}
    began = time.perf_counter()
    response = control.input_output_response(loop, t, 0.0, start(), solve_ivp_kwargs=options)
    return time.perf_counter() - began, response.states.T


RK4, RK45 = "rk4", "dopri5"
PEERS: dict[str, tuple[Callable[[int, float], Solved], str]] = {
    "PathSim, RK4": (pathsim, RK4),
    "bdsim, RK45": (bdsim, RK45),
    "python-control, RK45": (python_control, RK45),
}
TEXT = f"""
## A loop of continuous blocks

{BLOCKS} integrators in a ring, closed with a gain of -1, in steps of {DT} s
(`benchmarks/continuous.py`). The error is the largest of any state at any of {STEPS} steps against
the matrix exponential. Packages that integrate with scipy's RK45 are compared with `dopri5`, which
is the same method; all take the same steps.

"""


def name_of(engine: str, solver: str) -> str:
    return f"spikeblocks, {engine}, {solver}"


def error_of(solved: Solved) -> float:
    """The largest error of the first steps."""
    return float(abs(solved[1][:STEPS] - exact(STEPS, DT)).max())


def contestants(quick: bool = False) -> dict[str, tuple[Callable[[], Solved], int]]:
    """Runs of the ring by name, each with its number of steps; of the peers that are installed."""
    found: dict[str, tuple[Callable[[], Solved], int]] = {}
    for solver in (RK4, RK45):
        for engine, steps in (("python", STEPS), ("compiled", STEPS if quick else COMPILED_STEPS)):
            found[name_of(engine, solver)] = partial(ours, engine, solver, steps, DT), steps
    for name, (peer, _) in PEERS.items():
        found[name] = partial(peer, STEPS, DT), STEPS
    return {name: entry for name, entry in found.items() if _is_installed(entry[0])}


def _is_installed(run: Callable[[], Solved]) -> bool:
    try:
        run()
    except ImportError:
        return False
    return True


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md: time per step and error of each contestant."""
    entered = contestants(quick)
    errors = {name: error_of(run()) for name, (run, _) in entered.items()}
    turns = {
        name: (lambda run=run, steps=steps: run()[0] / steps)
        for name, (run, steps) in entered.items()
    }
    timings = take_turns(turns, rounds)
    rows = [[n, microseconds(timing), f"{errors[n]:.3g}"] for n, timing in timings.items()]
    wanted = []
    for name, (_, solver) in PEERS.items():
        for engine, times in (("python", 3.0), ("compiled", 100.0)):
            text = f"{engine} engine against {name}, at least {times:g}x"
            wanted.append(faster(text, timings, name_of(engine, solver), name, times))
        ratio = errors[name_of("python", solver)] / errors[name] if name in errors else None
        text = f"our error over that of {name}, at most 1.001"
        wanted.append(Goal(text, ratio, most=1.001))
    return f"{TEXT}{table(['', 'per step', 'error'], rows)}{goals(wanted)}"


if __name__ == "__main__":
    print(machine())
    print(section(int(sys.argv[1]) if len(sys.argv) > 1 else 5))
