"""What a configuration is worth: its costs and violations over the runs that it had.

In: the rows of a configuration. Out: a :class:`Score`, and the front of several::

    errors 1, 3 under condition a and 4, 8 under b  ->  cost 4 over the mean, 6 over the worst
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from runtime.experiments.design import Objective, RunSet, TuningSettings
from runtime.experiments.execution import Row

ENOUGH = 5  # complete configurations, before others are stopped early
Status = Literal["complete", "stopped", "no value"]
Run = tuple[str, int]  # a condition and a seed


@dataclass(frozen=True)
class Score:
    """A configuration's costs (the smaller the better), violations (at most 0 if it holds), means.

    A cost is infinite where a run has no value. ``metrics`` are over the seeds and conditions.
    """

    costs: tuple[float, ...]
    violations: tuple[float, ...]
    metrics: Mapping[str, float]

    @property
    def is_feasible(self) -> bool:
        return all(violation <= 0.0 for violation in self.violations)

    @property
    def has_values(self) -> bool:
        return all(map(math.isfinite, self.costs))

    @property
    def violation(self) -> float:
        """How much it violates in all."""
        return sum(max(0.0, violation) for violation in self.violations)

    def beats(self, other: Score) -> bool:
        """Whether it is better in each objective, or violates less."""
        if not self.is_feasible or not other.is_feasible:
            return self.violation < other.violation
        return all(a < b for a, b in zip(self.costs, other.costs, strict=True))

    def improves_on(self, other: Score) -> bool:
        """Whether it is better: it holds the constraints where the other does not, or costs less.

        With several objectives it must not be dominated: it may be another trade-off.
        """
        if not self.is_feasible or not self.has_values:
            return False
        if not other.is_feasible or not other.has_values:
            return True
        return not other.dominates(self) and self.costs != other.costs

    def dominates(self, other: Score) -> bool:
        """Whether it is at least as good in each objective, and better in one."""
        pairs = list(zip(self.costs, other.costs, strict=True))
        return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


@dataclass
class Candidate:
    """A configuration and its runs so far; ``values`` is None for the graph's own."""

    number: int
    values: Sequence[Any] | None
    rows: dict[Run, Row] = field(default_factory=dict)
    status: Status = "complete"
    score: Score | None = None


class Scorer:
    """Turns the runs of a configuration into its score."""

    def __init__(self, tuning: TuningSettings, metrics: Sequence[str]) -> None:
        self.tuning = tuning
        self.columns = {name: i for i, name in enumerate(metrics)}

    def score(self, rows: Mapping[Run, Row], runs: RunSet, seeds: Iterable[int]) -> Score:
        """The score over every condition and these seeds."""
        chosen = list(seeds)
        values = {
            name: self._over(name, self.values(name, rows, runs, chosen))
            for name in self.tuning.metrics
        }
        costs = tuple(_cost(o, values[o.metric]) for o in self.tuning.objectives)
        violations = tuple(
            math.inf if math.isnan(values[c.metric]) else c.violation(values[c.metric])
            for c in self.tuning.constraints
        )
        return Score(costs, violations, values)

    def values(
        self, metric: str, rows: Mapping[Run, Row], runs: RunSet, seeds: Iterable[int]
    ) -> list[list[float | None]]:
        """A metric of each run, condition by condition; None where it has no value."""
        column = self.columns[metric]
        chosen = list(seeds)
        return [
            [rows[name, seed].metrics[column] if (name, seed) in rows else None for seed in chosen]
            for name in runs.names
        ]

    def _over(self, metric: str, values: list[list[float | None]]) -> float:
        """The mean over the seeds, and over the conditions the mean or the worst; NaN for none."""
        means = []
        for row in values:
            known = [value for value in row if value is not None]
            # The mean of the other runs would reward a configuration for failing in hard ones.
            if len(known) < len(row):
                return math.nan
            means.append(float(np.mean(known)))
        if self.tuning.over == "mean":
            return float(np.mean(means))
        return max(means) if self._larger_is_worse(metric) else min(means)

    def _larger_is_worse(self, metric: str) -> bool:
        for objective in self.tuning.objectives:
            if objective.metric == metric:
                return objective.goal == "minimize"
        return any(c.side == "below" for c in self.tuning.constraints if c.metric == metric)

    def should_stop(
        self, candidate: Candidate, others: Iterable[Candidate], seeds: Sequence[int]
    ) -> bool:
        """Whether half of the complete configurations beat this one on the runs that it had.

        One without a value is always stopped. The baseline is not.
        """
        if candidate.values is None:
            return False
        # The median stopping rule (Golovin et al., Google Vizier, 2017, 3.2.2), on the same runs of
        # all: means over other seeds would compare the seeds. With several objectives only what
        # is worse in each is stopped, since the ends of a front are bad in one of them.
        runs = self.tuning.training
        score = self.score(candidate.rows, runs, seeds)
        if not score.has_values or any(map(math.isinf, score.violations)):
            return True
        complete = [other for other in others if other.status == "complete"]
        if not self.tuning.stop_early or len(complete) < ENOUGH:
            return False
        better = sum(self.score(o.rows, runs, seeds).beats(score) for o in complete)
        return 2 * better >= len(complete)


def _cost(objective: Objective, value: float) -> float:
    return math.inf if math.isnan(value) else objective.of(value)


def front(candidates: Iterable[Candidate]) -> list[Candidate]:
    """The complete, feasible configurations that no other dominates, by their first objective.

    With one objective it is the best one. The baseline competes: with one objective it is alone in
    the front if nothing is better, and of equal costs the first that was tried is kept.
    """
    scored = [
        (one, one.score) for one in candidates if one.status == "complete" and one.score is not None
    ]
    scored = [(one, score) for one, score in scored if score.is_feasible and score.has_values]
    best: list[tuple[Candidate, Score]] = []
    for one, score in scored:
        if any(other.dominates(score) for _, other in scored):
            continue
        if all(other.costs != score.costs for _, other in best):
            best.append((one, score))
    return [one for one, _ in sorted(best, key=lambda pair: pair[1].costs)]
