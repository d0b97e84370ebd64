"""The objective of a sweep: a metric to minimize or maximize."""

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
