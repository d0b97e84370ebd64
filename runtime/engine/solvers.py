"""Solvers of the continuous states: Runge-Kutta methods as their coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method (Hairer, Norsett, Wanner, Solving ODEs I, section II.1).

    nodes : the time of each stage as a share of the step.
    rows : how the slopes of the stages so far are weighted to reach the next stage; the last row
        gives the end of the step.
    order : the error of a whole run is proportional to this power of the step.
    """

    nodes: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]
    order: int

    @property
    def stages(self) -> int:
        return len(self.nodes)

    @property
    def terms(self) -> tuple[tuple[tuple[int, float], ...], ...]:
        """The rows as (stage, weight) where the weight is not zero."""
        return tuple(tuple((j, w) for j, w in enumerate(row) if w) for row in self.rows)

    @property
    def table(self) -> FloatArray:
        """The rows as a square array."""
        table = np.zeros((self.stages, self.stages))
        for i, row in enumerate(self.rows):
            table[i, : len(row)] = row
        return table


METHODS = {
    "euler": Method((0.0,), ((1.0,),), 1),
    "heun": Method((0.0, 1.0), ((1.0,), (0.5, 0.5)), 2),
    "rk4": Method(
        (0.0, 0.5, 0.5, 1.0),
        ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
        4,
    ),
}


def blend(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    terms: tuple[tuple[tuple[int, float], ...], ...],
    stage: int,
    h: float,
) -> None:
    """Move the states to the next stage: start + h times the weighted slopes so far."""
    (j, weight), *rest = terms[stage]
    total = slopes[j] * (h * weight)
    for j, weight in rest:
        total += slopes[j] * (h * weight)
    np.add(start, total, states)


def joined(rates: Any) -> FloatArray:
    """The rates of change of several states, or of a table, as one row."""
    parts = rates if isinstance(rates, tuple) else (rates,)
    return np.concatenate([np.ravel(part) for part in parts])
