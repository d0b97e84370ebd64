"""Four problems for solvers, as numbers and functions that every package can be given.

* smooth: x'' = -x from x = 1
* edges: x' = u - x from 0, where u is a train of pulses none of whose edges is at a tick
* events: x'' = -x from x = 1 with a wall at -0.3 that returns 0.8 of the speed
* stiff: Robertson's reaction

``EXACT["smooth"](times)`` gives x at the times; the stiff problem has no closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from blocks.core import FloatArray

UNTIL = 6.0
WALL, SHARE = -0.3, 0.8
PULSE = {"start": 0.137, "period": 0.731, "width": 0.3137}
START = {"smooth": [1.0, 0.0], "edges": [0.0], "events": [1.0, 0.0], "stiff": [1.0, 0.0, 0.0]}


class Solved(NamedTuple):
    """The first state at the times, evaluations of the rates (None: not told), CPU seconds."""

    x: FloatArray
    evaluations: int | None
    seconds: float


def reaction(t: float, x: Sequence[float]) -> tuple[float, float, float]:
    """The rates of Robertson's reaction."""
    slow, fast, square = 0.04 * x[0], 1e4 * x[1] * x[2], 3e7 * x[1] * x[1]
    return -slow + fast, slow - fast - square, square


def edges() -> FloatArray:
    """The times at which the pulse jumps."""
    starts = PULSE["start"] + PULSE["period"] * np.arange(20.0)  # type: ignore[operator]
    return np.sort(np.concatenate([starts, starts + PULSE["width"]]))


def lagging(t: FloatArray) -> FloatArray:
    """x' = u - x from 0: the sum of the answers to all edges before t."""
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


EXACT: dict[str, Callable[[FloatArray], FloatArray]] = {
    "smooth": np.cos,
    "edges": lagging,
    "events": bouncing,
}


def ticks(title: str) -> FloatArray:
    """The times at which solutions are compared: 0.5 s apart, of the stiff problem 4 s."""
    return 4.0 * np.arange(10) if title == "stiff" else 0.5 * np.arange(round(UNTIL / 0.5))
