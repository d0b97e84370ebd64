"""How fast errors fall with the step, with edges off the grid and with events; and what they cost.

``python -m benchmarks.orders`` writes the tables into docs/time.md. Three of the problems
(``benchmarks/problems.py``) have closed forms; the stiff one is compared with scipy's Radau at
1e-12. Cost is how often the rates of change are evaluated, and CPU time, beside scipy and those of
PathSim and diffrax that are installed. An order is the slope of the error between the two shortest
of the steps 0.05, 0.025 and 0.0125 s; solvers that choose their steps take just these (loose
tolerances, ``max_step``).
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import runtime
from benchmarks.peers import SOLVER_PEERS, installed
from benchmarks.problems import (
    EXACT,
    PULSE,
    SHARE,
    START,
    UNTIL,
    WALL,
    Solved,
    edges,
    reaction,
    ticks,
)
from blocks import Block, Input, Output, Pulse, Scalar, State
from blocks.core import FloatArray
from runtime.solvers import SOLVERS

PAGE = Path(__file__).parent.parent / "docs" / "time.md"
MARK = "<!-- python -m benchmarks.orders -->"
STEPS = (0.05, 0.025, 0.0125)
RTOLS = (1e-4, 1e-6, 1e-8)
ROUNDS = 5
TIMES = f"""\
CPU time of one run, and its ratio to ours compiled in the same process: the median of {ROUNDS} runs
after one that does not count, without building, compiling and tracing. Ours is what the run's
manifest says of the ticks after the first (elapsed, not CPU), times all evaluations by those of
these ticks. At this length it is mostly what a run costs whatever its tolerance:"""
calls = 0


class Swing(Block):
    """x'' = -x, with or without the wall; it counts how often it is asked for its rates.

    [ Swing ] ─▶ x
    """

    out = Output(Scalar, name="x", doc="the position")
    x = State(2, name="state", continuous=True)

    def start(self, state: Any) -> None:
        state.state[:] = 1.0, 0.0

    def output(self, state: Any, t: float) -> float:
        return float(state.state[0])

    def derivative(self, state: Any, t: float) -> tuple[float, float]:
        global calls
        calls += 1
        return float(state.state[1]), -float(state.state[0])


class Bouncing(Swing):
    """The same with the wall.

    [ Bouncing ] ─▶ x
    """

    def crossings(self, context: Any) -> tuple[str, ...]:
        return ("rising",)

    def guards(self, state: Any, t: float) -> FloatArray:
        return np.array([WALL - state.state[0]])

    def event(self, state: Any, t: float, which: float) -> None:
        state.state[1] *= -SHARE


class Lag(Block):
    """x' = u - x, counted.

    u ─▶ [ Lag ] ─▶ x
    """

    u = Input(Scalar, doc="the input")
    out = Output(Scalar, name="x", doc="the state")
    x = State(name="state", continuous=True)

    def output(self, state: Any, t: float) -> float:
        return float(state.state)

    def derivative(self, state: Any, t: float, u: float) -> float:
        global calls
        calls += 1
        return u - float(state.state)


class Robertson(Block):
    """Robertson's reaction, counted.

    [ Robertson ] ─▶ x
    """

    out = Output(Scalar, name="x", doc="the first concentration")
    x = State(3, name="state", continuous=True)

    def start(self, state: Any) -> None:
        state.state[:] = 1.0, 0.0, 0.0

    def output(self, state: Any, t: float) -> float:
        return float(state.state[0])

    def derivative(self, state: Any, t: float) -> tuple[float, float, float]:
        global calls
        calls += 1
        return reaction(t, state.state.tolist())


PROBLEMS: dict[str, Block] = {
    "smooth": Swing(),
    "edges": Lag(),
    "events": Bouncing(),
    "stiff": Robertson(),
}
# The same for the compiled engine, in which a block that counts has no place.
SYSTEMS: dict[str, dict[str, Any]] = {
    "smooth": {"states": ["x", "v"], "derivative": ["v", "-x"]},
    "edges": {"states": ["x"], "derivative": ["u - x"]},
    "events": {
        **{"states": ["x", "v"], "derivative": ["v", "-x"]},
        **{"when": f"x < {WALL}", "then": ["x", f"-{SHARE}*v"]},
    },
    "stiff": {
        "states": ["a", "b", "c"],
        "derivative": ["-0.04*a + 1e4*b*c", "0.04*a - 1e4*b*c - 3e7*b*b", "3e7*b*b"],
    },
}


def solved(title: str, **run: Any) -> tuple[FloatArray, int]:
    """What we compute of a problem, and how many evaluations it takes."""
    global calls
    graph = runtime.Graph(dt=run.pop("dt"), until=run.pop("until", UNTIL)).add("b", PROBLEMS[title])
    if title == "edges":
        graph = graph.add("u", Pulse(**PULSE))
        graph = graph.connect("u.out", "b.u")
    for key, value in run.items():
        graph = graph.set(f"run.{key}", value)
    calls = 0
    return np.ravel(graph.probe("b.x").run(engine="python")["b.x"]), calls


def order(title: str, solver: str) -> float:
    """The slope of the largest error between the two shortest steps."""
    errors = []
    for dt in STEPS[1:]:
        loose = {"rtol": 1e9, "atol": 1e9, "max_step": dt} if SOLVERS[solver].is_adaptive else {}
        x, _ = solved(title, dt=dt, solver=solver, **loose)
        errors.append(np.abs(x - EXACT[title](dt * np.arange(len(x)))).max())
    return math.log2(errors[0] / errors[1])


def orders() -> str:
    """The table of orders."""
    lines = ["| solver | nominal | " + " | ".join(EXACT) + " |", "|---|---|---|---|---|"]
    for solver, method in SOLVERS.items():
        found = [f"{order(title, solver):.2f}" for title in EXACT]
        lines.append(f"| {solver} | {method.order} | {' | '.join(found)} |")
    return "\n".join(lines)


def by_scipy(title: str, method: str, rtol: float, times: FloatArray) -> Solved:
    """What scipy computes, begun again at each edge and event."""
    x: Any = START[title]
    started = time.process_time()
    ends = [*edges()[edges() < times[-1]], times[-1]] if title == "edges" else [times[-1]]
    begin, count, pieces, found = 0.0, 0, 0, []

    def rates(t: float, x: FloatArray) -> Any:
        if title == "stiff":
            return reaction(t, x.tolist())
        return [float(pieces % 2) - x[0]] if title == "edges" else [x[1], -x[0]]

    def wall(t: float, x: FloatArray) -> float:
        return float(x[0] - WALL)

    wall.terminal, wall.direction = True, -1.0  # type: ignore[attr-defined]
    while begin < times[-1]:
        end = ends[min(pieces, len(ends) - 1)]
        run = solve_ivp(
            *(rates, (begin, end), x, method, None, True),
            **{"rtol": rtol, "atol": rtol / 1000, "events": [wall] if title == "events" else None},
        )
        inside = times[(times >= begin) & (times < run.t[-1])]
        found.append(run.sol(inside)[0] if len(inside) else np.empty(0))
        begin, x, count, pieces = run.t[-1], run.y[:, -1], count + run.nfev, pieces + 1
        if run.status == 1:
            x = np.array([x[0], -SHARE * x[1]])
    return Solved(
        np.concatenate([*found, x[:1]])[: len(times)], count, time.process_time() - started
    )


def by_us(title: str, solver: str, rtol: float) -> Solved:
    """What we compute, the evaluations by counting blocks in Python."""
    dt, times = ticks(title)[1], ticks(title)
    tolerances = {"rtol": rtol, "atol": rtol / 1000}
    run = {"dt": dt, "until": times[-1] + dt, "solver": solver, **tolerances}
    x, count = solved(title, **run)
    # The first tick runs in Python under either engine, and is not in the manifest's figure. It may
    # have most of the steps (a transient), so that ticks would be the wrong measure of its share.
    _, first = solved(title, **run | {"until": dt})
    seconds = compiled_seconds(title, run) * count / (count - first)
    return Solved(x[: len(times)], count, seconds)


def document(title: str, run: Mapping[str, Any]) -> dict[str, Any]:
    """The graph of a problem from shipped blocks."""
    system = {"type": "DynamicSystem", "initial": START[title], **SYSTEMS[title]}
    blocks, wires = {"b": system}, {}
    if title == "edges":
        blocks["u"], wires["b"] = {"type": "Pulse", **PULSE}, {"u": "u.out"}
    return {
        **{"run": dict(run), "blocks": blocks, "wires": wires},
        "probes": {"x": {"of": "b.out[0]" if len(START[title]) > 1 else "b.out"}},
    }


def compiled_seconds(title: str, run: Mapping[str, Any]) -> float:
    """Of the ticks after the first."""
    manifest = runtime.load(document(title, run)).run(engine="compiled").manifest
    return float(manifest["us_per_tick"] * 1e-6 * (manifest["ticks"] - 1))


def contestants(title: str) -> dict[str, Callable[[float], Solved]]:
    """Who solves a problem at a tolerance, ours first."""
    stiff = title == "stiff"
    ours, theirs = ("rodas4", "Radau") if stiff else ("dopri5", "RK45")
    solvers: dict[str, Callable[[float], Solved]] = {
        ours: lambda rtol: by_us(title, ours, rtol),
        f"scipy, {theirs}": lambda rtol: by_scipy(title, theirs, rtol, ticks(title)),
    }
    for peer, module in installed(SOLVER_PEERS)[0].items():
        name = f"{peer}, {module.SOLVERS['stiff' if stiff else 'explicit']}"
        solvers[name] = partial(module.solve, title)
    return solvers


def notes() -> list[str]:
    """What is to be known of each peer, or why it is left out."""
    modules, missing = installed(SOLVER_PEERS)
    return [
        *(f"* {peer} is left out: it {reason}." for peer, reason in missing.items()),
        *(f"* {peer}: {module.NOTE}" for peer, module in modules.items()),
    ]


def median(solve: Callable[[float], Solved], rtol: float) -> Solved | None:
    """A solution with the median of its times, after a run that does not count."""
    try:
        runs = [solve(rtol) for _ in range(ROUNDS + 1)][1:]
    except NotImplementedError:
        return None
    return runs[0]._replace(seconds=statistics.median(run.seconds for run in runs))


def plain(number: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{number:.2g}'):g}"


def costs() -> str:
    """The tables of errors and evaluations and of times, and notes below."""
    head = " | solver | " + " | ".join(f"rtol {r:g}" for r in RTOLS) + " |\n|---|---|"
    errors = ["| problem" + head + "---|" * len(RTOLS)]
    times = list(errors)
    for title in START:
        exact = EXACT[title](ticks(title)) if title in EXACT else None
        if exact is None:
            exact = by_scipy(title, "Radau", 1e-12, ticks(title)).x
        ours = dict.fromkeys(RTOLS, 0.0)
        for name, solve in contestants(title).items():
            found = {rtol: median(solve, rtol) for rtol in RTOLS}
            row, took = [], []
            for rtol, solution in found.items():
                if solution is None:
                    row.append("-")
                    took.append("-")
                    continue
                ours[rtol] = ours[rtol] or solution.seconds
                count = "-" if solution.evaluations is None else solution.evaluations
                row.append(f"{np.abs(solution.x - exact).max():.0e} in {count}")
                ratio = solution.seconds / ours[rtol]
                took.append(f"{plain(1e3 * solution.seconds)} ms, {plain(ratio)}")
            errors.append(f"| {title} | {name} | {' | '.join(row)} |")
            times.append(f"| {title} | {name} | {' | '.join(took)} |")
    return "\n".join([*errors, "", TIMES, "", *times, "", *notes()])


def main() -> None:
    """Write both tables between the marks of the page."""
    before, *_, after = PAGE.read_text(encoding="utf-8").split(MARK)
    cost = "Largest error at the ticks, and evaluations of the rates in 6 s (stiff: 40 s):"
    text = f"{MARK}\n\n{orders()}\n\n{cost}\n\n{costs()}\n\n{MARK}"
    PAGE.write_text(before + text + after, encoding="utf-8")


if __name__ == "__main__":
    main()
