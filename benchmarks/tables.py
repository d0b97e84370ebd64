"""Figures, tables and goals as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.timing import Timing

Timings = Mapping[str, Timing]


@dataclass(frozen=True)
class Goal:
    """What a figure should reach; the page says whether it does.

    Parameters
    ----------
    text : the goal in words.
    reached : the figure; None where what it hangs on is not installed.
    least, most : its bounds.
    unit : what stands behind the figure.
    """

    text: str
    reached: float | None
    least: float | None = None
    most: float | None = None
    unit: str = "x"

    @property
    def met(self) -> bool:
        return self.reached is not None and (
            (self.least is None or self.reached >= self.least)
            and (self.most is None or self.reached <= self.most)
        )

    def line(self) -> str:
        if self.reached is None:
            return f"* {self.text}: not measured.\n"
        verdict = "met" if self.met else "**missed**"
        return f"* {self.text}: {self.reached:.3g}{self.unit}, {verdict}.\n"


def faster(text: str, timings: Timings, ours: str, theirs: str, times: float) -> Goal:
    """A goal that one contestant takes ``1 / times`` of the time of another."""
    both = ours in timings and theirs in timings
    reached = timings[theirs].median / timings[ours].median if both else None
    return Goal(text, reached, least=times)


def within(text: str, timings: Timings, ours: str, theirs: str, times: float) -> Goal:
    """A goal that one contestant takes at most ``times`` the time of another."""
    both = ours in timings and theirs in timings
    reached = timings[ours].median / timings[theirs].median if both else None
    return Goal(text, reached, most=times)


def figure(timing: Timing, scale: float, unit: str, digits: int = 1) -> str:
    """``33.1 µs (32.9 to 34.0)``."""
    low, high = timing.spread
    values = [f"{scale * value:.{digits}f}" for value in (timing.median, low, high)]
    return f"{values[0]} {unit} ({values[1]} to {values[2]})"


def microseconds(timing: Timing) -> str:
    """A time per tick with three digits or so."""
    digits = 3 if timing.median < 1e-6 else 2 if timing.median < 1e-5 else 1
    return figure(timing, 1e6, "µs", digits)


def against(timings: Timings, reference: str) -> str:
    """A table of contestants: time per tick, and how it compares with one of them."""
    base = timings[reference].median
    rows = [
        [name, microseconds(timing), f"{timing.median / base:.3g}"]
        for name, timing in timings.items()
    ]
    return table(["", "per tick", f"{reference} = 1"], rows)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def goals(reached: Iterable[Goal]) -> str:
    return "\n" + "".join(goal.line() for goal in reached)
