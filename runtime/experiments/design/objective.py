"""Objectives and constraints: what a configuration is judged by.

In: a metric's value. Out: a cost to minimise, or by how much a bound is violated::

    Objective("speed", "maximize").of(2.0)  ->  -2.0
    Constraint("effort", "below", 0.3).violation(0.4)  ->  0.1
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Objective:
    """A metric, and whether smaller or larger is better."""

    metric: str
    goal: Literal["minimize", "maximize"] = "minimize"

    def cost(self, metrics: Mapping[str, float | None]) -> float | None:
        """The cost to minimize; None where the metric has no value."""
        value = metrics.get(self.metric)
        return None if value is None else self.of(value)

    def of(self, value: float) -> float:
        """The cost of a value; applied twice it gives the value again, if it is finite.

        Infinity stands for what is never reached, which is the worst of all.
        """
        if math.isinf(value):
            return math.inf
        return value if self.goal == "minimize" else -value


@dataclass(frozen=True)
class Constraint:
    """A metric that must be below or above a bound."""

    metric: str
    side: Literal["below", "above"]
    bound: float

    def violation(self, value: float) -> float:
        """By how much a value violates it; at most 0 if it does not."""
        return value - self.bound if self.side == "below" else self.bound - value

    def __str__(self) -> str:
        return f"{self.metric} {self.side} {self.bound:g}"
