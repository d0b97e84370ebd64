"""Errors at equal steps on closed loops, ours and those of other packages' own runs:
``python -m benchmarks --only accuracy``

Each problem is a graph of our blocks; PathSim and bdsim integrate the same equations with their
integrators about one function block. All take steps of one length: PathSim's RK4 is compared
with our ``rk4``; bdsim, which calls scipy's RK45 (here with loose tolerances and this largest
step), with ``dopri5``. The error is the largest of any state at any step against scipy's DOP853
with tolerances of 1e-12.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.tables import Goal, goals, table
from blocks.core import FloatArray

LOOSE = {"rtol": 0.1, "atol": 0.1}


@dataclass(frozen=True)
class Problem:
    """A closed loop: our blocks, wires and what is recorded, and the same as x' = rates(x)."""

    blocks: dict[str, Any]
    wires: dict[str, Any]
    of: Sequence[str]
    rates: Callable[..., Sequence[float]]
    start: Sequence[float]
    dt: float
    steps: int = 100


def swing(x: float, v: float) -> list[float]:
    return [v, 1.5 * (1.0 - x * x) * v - x]


def controlled(y: float, v: float, integral: float, filtered: float) -> list[float]:
    """A PID controller, kp 3, ki 2, kd 1 with a filter of 20 1/s, around y'' + y' + y = u."""
    e = 1.0 - y
    u = 3.0 * e + integral + 20.0 * (e - filtered)
    return [v, u - v - y, 2.0 * e, 20.0 * (e - filtered)]


def ride(x: float, y: float, theta: float) -> list[float]:
    steer = 0.5 * math.remainder(math.atan2(-y, -x) - theta, 2.0 * math.pi)
    return [math.cos(theta), math.sin(theta), math.tan(steer)]


PROBLEMS = {
    "oscillator": Problem(
        {
            "x": {"type": "Integrator", "initial": 1.0},
            "v": {"type": "Integrator"},
            "k": {"type": "Gain", "gain": -1.0, "signal": "Scalar"},
        },
        {"x": {"input": "v.out"}, "v": {"input": "k.out"}, "k": {"input": "x.out"}},
        ["x.out", "v.out"],
        lambda x, v: [v, -x],
        [1.0, 0.0],
        0.1,
    ),
    "van der Pol": Problem(
        {
            "x": {"type": "Integrator", "initial": 2.0},
            "v": {"type": "Integrator"},
            "bend": {
                "type": "Function",
                "names": ["x", "v"],
                "expression": "1.5*(1 - x*x)*v - x",
            },
        },
        {
            "x": {"input": "v.out"},
            "v": {"input": "bend.out"},
            "bend": {"u": ["x.out", "v.out"]},
        },
        ["x.out", "v.out"],
        swing,
        [2.0, 0.0],
        0.05,
    ),
    "PID and plant": Problem(
        {
            "one": {"type": "Constant", "value": 1.0},
            "error": {"type": "Sum", "signs": [1, -1]},
            "pid": {"type": "PID", "kp": 3.0, "ki": 2.0, "kd": 1.0, "n": 20.0},
            "plant": {
                "type": "StateSpace",
                "A": [[0, 1], [-1, -1]],
                "B": [0, 1],
                "C": [[1, 0], [0, 1]],
            },
        },
        {
            "error": {"terms": ["one.value", "plant.out[0]"]},
            "pid": {"error": "error.out"},
            "plant": {"input": "pid.out"},
        },
        ["plant.out", "pid.integral", "pid.filtered"],
        controlled,
        [0.0, 0.0, 0.0, 0.0],
        0.02,
    ),
    "bicycle to a point": Problem(
        {
            "car": {
                "type": "Bicycle",
                "x0": [5.0, 2.0, 1.0],
                "wheel_base": 1.0,
                "steering_max": 1.55,
            },
            "speed": {"type": "Constant", "value": 1.0},
            "steer": {
                "type": "Function",
                "names": ["x", "y", "theta"],
                "expression": "0.5*wrap(atan2(-y, -x) - theta)",
            },
        },
        {"car": {"v": "speed.value", "steering": "steer.out"}, "steer": {"u": "car.pose"}},
        ["car.pose"],
        ride,
        [5.0, 2.0, 1.0],
        0.04,
    ),
    "pendulum": Problem(
        {"swing": {"type": "Pendulum", "angle0": 2.0}},
        {},
        ["swing.x"],
        lambda theta, omega: [omega, -9.81 * math.sin(theta)],
        [2.0, 0.0],
        0.02,
    ),
}


def exact(problem: Problem) -> FloatArray:
    """The states (steps, n)."""
    times = problem.dt * np.arange(problem.steps)
    made = solve_ivp(
        lambda t, x: problem.rates(*x),
        (0.0, times[-1]),
        problem.start,
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-12,
    )
    return np.asarray(made.y.T)


def ours(problem: Problem, solver: str) -> FloatArray:
    import runtime

    graph = {
        "run": {"dt": problem.dt, "until": problem.steps * problem.dt, "engine": "python"}
        | {"solver": solver}
        | (LOOSE if solver == "dopri5" else {}),
        "blocks": problem.blocks,
        "wires": problem.wires,
        "probes": {"x": {"of": list(problem.of)}},
    }
    return np.asarray(runtime.load(graph).run()["x"])


def pathsim(problem: Problem) -> FloatArray:
    from pathsim import Connection, Simulation
    from pathsim.blocks import Function, Integrator, Scope
    from pathsim.solvers import RK4

    n = len(problem.start)
    states = [Integrator(x) for x in problem.start]
    slopes, scope = Function(lambda *x: tuple(problem.rates(*x))), Scope()
    wires = [Connection(state, slopes[i], scope[i]) for i, state in enumerate(states)]
    wires += [Connection(slopes[i], states[i]) for i in range(n)]
    simulation = Simulation([*states, slopes, scope], wires, dt=problem.dt, Solver=RK4, log=False)
    simulation.run(problem.steps * problem.dt)
    return np.asarray(scope.read()[1].T[: problem.steps])


def bdsim(problem: Problem) -> FloatArray:
    with contextlib.redirect_stdout(io.StringIO()):
        import bdsim as package

        simulator = package.BDSim(
            sysargs=False, graphics=False, quiet=True, progress=False, banner=False
        )
    diagram = simulator.blockdiagram()
    states = diagram.INTEGRATOR(x0=list(problem.start))
    slopes = diagram.FUNCTION(lambda x: np.array(problem.rates(*x.tolist())))
    diagram.connect(states, slopes)
    diagram.connect(slopes, states)
    diagram.compile()
    dt = problem.dt
    options = {**LOOSE, "first_step": dt}
    out = simulator.run(diagram, problem.steps * dt, dt=dt, max_step=dt, solver_args=options)
    return np.asarray(out.x)[: problem.steps]


PEERS: dict[str, tuple[Callable[[Problem], FloatArray], str]] = {
    "PathSim, RK4": (pathsim, "rk4"),
    "bdsim, RK45": (bdsim, "dopri5"),
}
TEXT = """
## Errors at equal steps

Closed loops in other packages and here (`benchmarks/accuracy.py`): an oscillator x'' = -x of
integrators and a gain, the van der Pol oscillator, a PID controller around a second-order plant, a
bicycle that steers to a point, and a pendulum, each for 100 steps. The error is
the largest of any state at any step against scipy's DOP853. PathSim integrates by RK4, bdsim by
scipy's RK45, which is `dopri5`.

"""


def error_of(problem: Problem, states: FloatArray) -> float:
    """The largest error of any state at any step."""
    return float(abs(states - exact(problem)).max())


def section(rounds: int = 1) -> str:
    """The section of docs/performance.md: errors, and goals, of the peers that are installed."""
    rows: dict[str, list[str]] = {
        title: [title, f"{problem.dt:g} s"] for title, problem in PROBLEMS.items()
    }
    head, wanted = ["", "step"], []
    for name, (peer, solver) in PEERS.items():
        head += [f"spikeblocks, {solver}", name]
        ratios = []
        for title, problem in PROBLEMS.items():
            own, other = error_of(problem, ours(problem, solver)), None
            with contextlib.suppress(ImportError):
                other = error_of(problem, peer(problem))
                ratios.append(own / other)
            rows[title] += [f"{own:.3g}", "not installed" if other is None else f"{other:.3g}"]
        worst = max(ratios, default=None)
        wanted.append(
            Goal(f"largest ratio of our error to that of {name}, at most 1.001", worst, most=1.001)
        )
    return f"{TEXT}{table(head, rows.values())}{goals(wanted)}"


if __name__ == "__main__":
    print(section())
