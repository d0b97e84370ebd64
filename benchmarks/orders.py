"""How fast errors fall with the step, with edges off the grid and with events; and what they cost.

``python -m benchmarks.orders`` writes the tables into docs/time.md. Problems have closed forms:

* smooth: x'' = -x from x = 1
* edges: x' = u - x, where u is a train of pulses none of whose edges is at a tick
* events: x'' = -x from x = 1 with a wall at -0.3 that returns 0.8 of the speed

and a stiff one, Robertson's reaction, is compared with scipy's Radau at 1e-12. Cost is how often
the rates of change are evaluated. An order is the slope of the error between the two shortest of
the steps 0.05, 0.025 and 0.0125 s; solvers that choose their steps take just these (loose
tolerances, ``max_step``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import runtime
from blocks import Block, Input, Output, Pulse, Scalar, State
from blocks.core import FloatArray

PAGE = Path(__file__).parent.parent / "docs" / "time.md"
MARK = "<!-- python -m benchmarks.orders -->"
SOLVERS = {"euler": 1, "heun": 2, "rk4": 4, "dopri5": 5, "rodas4": 4}
STEPS = (0.05, 0.025, 0.0125)
UNTIL = 6.0
WALL, SHARE = -0.3, 0.8
PULSE = {"start": 0.137, "period": 0.731, "width": 0.3137}
RTOLS = (1e-4, 1e-6, 1e-8)
ADAPTIVE = ("dopri5", "rodas4")
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
        return reaction(t, state.state.tolist())


def reaction(t: float, x: Sequence[float]) -> tuple[float, float, float]:
    global calls
    calls += 1
    slow, fast, square = 0.04 * x[0], 1e4 * x[1] * x[2], 3e7 * x[1] * x[1]
    return -slow + fast, slow - fast - square, square


def edges() -> FloatArray:
    """The times at which the pulse jumps."""
    starts = PULSE["start"] + PULSE["period"] * np.arange(20.0)  # type: ignore[operator]
    return np.sort(np.concatenate([starts, starts + PULSE["width"]]))


def lagging(t: FloatArray) -> FloatArray:
    x = np.zeros_like(t)
    for i, edge in enumerate(edges()):
        x += np.where(t > edge, (1.0 - 2.0 * (i % 2)) * (1.0 - np.exp(-np.maximum(t - edge, 0))), 0)
    return x


def bouncing(t: FloatArray) -> FloatArray:
    """Between impacts x = size cos(t - shift); the wall is met where x falls to it."""
    x, size, shift = np.cos(t), 1.0, 0.0
    while (impact := shift + math.acos(WALL / size)) < UNTIL:
        size = math.hypot(WALL, SHARE * size * math.sin(math.acos(WALL / size)))
        shift = impact + math.acos(WALL / size)
        x = np.where(t >= impact, size * np.cos(t - shift), x)
    return x


PROBLEMS: dict[str, tuple[Block, Callable[[FloatArray], FloatArray]]] = {
    "smooth": (Swing(), np.cos),
    "edges": (Lag(), lagging),
    "events": (Bouncing(), bouncing),
}


def solved(title: str, **run: Any) -> tuple[FloatArray, int]:
    """What we compute of a problem, and how many evaluations it takes."""
    global calls
    block = Robertson() if title == "stiff" else PROBLEMS[title][0]
    graph = runtime.Graph(dt=run.pop("dt"), until=run.pop("until", UNTIL)).add("b", block)
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
        loose = {"rtol": 1e9, "atol": 1e9, "max_step": dt} if solver in ADAPTIVE else {}
        x, _ = solved(title, dt=dt, solver=solver, **loose)
        errors.append(np.abs(x - PROBLEMS[title][1](dt * np.arange(len(x)))).max())
    return math.log2(errors[0] / errors[1])


def orders() -> str:
    """The table of orders."""
    lines = ["| solver | nominal | " + " | ".join(PROBLEMS) + " |", "|---|---|---|---|---|"]
    for solver, nominal in SOLVERS.items():
        found = [f"{order(title, solver):.2f}" for title in PROBLEMS]
        lines.append(f"| {solver} | {nominal} | {' | '.join(found)} |")
    return "\n".join(lines)


def by_scipy(title: str, method: str, rtol: float, times: FloatArray) -> tuple[FloatArray, int]:
    """What scipy computes, begun again at each edge and event, and its evaluations."""
    x: Any = {"edges": [0.0], "stiff": [1.0, 0.0, 0.0]}.get(title, [1.0, 0.0])
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
    return np.concatenate([*found, x[:1]]), count


def costs() -> str:
    """The table of errors and evaluations."""
    lines = ["| problem | solver | " + " | ".join(f"rtol {r:g}" for r in RTOLS) + " |"]
    lines.append("|---|---|" + "---|" * len(RTOLS))
    for title in (*PROBLEMS, "stiff"):
        dt, until = (4.0, 40.0) if title == "stiff" else (0.5, UNTIL)
        times = dt * np.arange(round(until / dt))
        exact = PROBLEMS[title][1](times) if title in PROBLEMS else None
        if exact is None:
            exact, _ = by_scipy("stiff", "Radau", 1e-12, times)
        ours, theirs = ("rodas4", "Radau") if title == "stiff" else ("dopri5", "RK45")
        rows: dict[str, list[str]] = {ours: [], f"scipy, {theirs}": []}
        for rtol in RTOLS:
            run = {"dt": dt, "until": until, "solver": ours, "rtol": rtol, "atol": rtol / 1000}
            for key, (x, count) in {
                ours: solved(title, **run),
                f"scipy, {theirs}": by_scipy(title, theirs, rtol, times),
            }.items():
                rows[key].append(f"{np.abs(x - exact).max():.0e} in {count}")
        lines += [f"| {title} | {key} | {' | '.join(row)} |" for key, row in rows.items()]
    return "\n".join(lines)


def main() -> None:
    """Write both tables between the marks of the page."""
    before, *_, after = PAGE.read_text(encoding="utf-8").split(MARK)
    cost = "Largest error at the ticks, and evaluations of the rates in 6 s (stiff: 40 s):"
    text = f"{MARK}\n\n{orders()}\n\n{cost}\n\n{costs()}\n\n{MARK}"
    PAGE.write_text(before + text + after, encoding="utf-8")


if __name__ == "__main__":
    main()
