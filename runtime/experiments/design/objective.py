"""What 'best' means: one metric, to be small or large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Objective:
    """A metric and where it should go."""

    metric: str
    goal: Literal["minimize", "maximize"] = "minimize"

    def cost(self, metrics: Mapping[str, float | None]) -> float | None:
        """A number that is smaller the better; None where the metric has no value."""
        value = metrics.get(self.metric)
        return None if value is None else self.of(value)

    def of(self, value: float) -> float:
        """The cost of a value; its own inverse."""
        return value if self.goal == "minimize" else -value
