"""Rows grouped by configuration, in any order of arrival; complete groups are not kept.

In: the rows of an index, as trials end. Out: the groups of each configuration, and a tally with the
best ones. A sweep of millions of trials holds only the groups whose trials are still running::

    rows 0, 3, 1 of two seeds  ->  group 0 (rows 0 and 1); row 3 waits for row 2
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from runtime.experiments.analysis.comparison import Sample
from runtime.experiments.analysis.estimates import (
    ANY,
    Ends,
    Estimate,
)
from runtime.experiments.analysis.statistics import (
    is_same_run,
)
from runtime.experiments.analysis.words import NEVER, mean_of
from runtime.experiments.design import Objective
from runtime.experiments.execution import Row

FAILURES = ("failed", "timeout")
Value = float | None
T = TypeVar("T")
BEST = 10
REASONS, REASONS_SHOWN = 200, 5


@dataclass(frozen=True)
class TrialGroup:
    """The rows of one configuration, in the order of its seeds."""

    number: int
    cells: tuple[str, ...]
    rows: tuple[Row, ...]

    def estimate(self, column: int, ends: Ends = ANY) -> Estimate:
        """The mean of a metric over the seeds that have a value."""
        return sample_of([self.rows], column).estimate(ends)


def sample_of(
    settings: Sequence[Sequence[Row]],
    column: int,
    worst: Value = math.inf,
    is_sampled: bool = False,
) -> Sample:
    """The independent observations of a metric: every table, figure and report is made of them.

    Parameters
    ----------
    settings : the rows of each setting of the factors, in the same order of seeds.
    worst : the value of a run that failed; None for a metric without a direction.
    is_sampled : the settings are drawn themselves, and each is one observation: the mean over its
        seeds. Otherwise each seed is one: its mean over the settings.
    """
    by_setting = [[failed_value(row, column, worst) for row in rows] for rows in settings]
    is_lost = [[has_failed(row, column) for row in rows] for rows in settings]
    if len(settings) == 1:
        values, failed = by_setting[0], sum(is_lost[0])
        alike = is_same(settings[0], column)
        return Sample(tuple(values), failed, alike, is_unranked=worst is None and failed > 0)
    across = list if is_sampled else _by_seed
    values = [mean_value(unit) for unit in across(by_setting)]
    failed = sum(map(any, across(is_lost)))
    alike = not is_sampled and all(is_same(rows, column) for rows in settings)
    return Sample(tuple(values), failed, alike, is_unranked=worst is None and failed > 0)


def _by_seed(by_setting: Iterable[Sequence[T]]) -> list[tuple[T, ...]]:
    return list(zip(*by_setting, strict=True))


def has_failed(row: Row, column: int) -> bool:
    """Whether a run failed or timed out, so that it has no finite value of a metric."""
    value = row.metrics[column]
    return row.status in FAILURES and (value is None or not math.isfinite(value))


def failed_value(row: Row, column: int, worst: Value) -> Value:
    """A run's value; that of a run that failed is worse than any (the rule of win ratios).

    Parameters
    ----------
    worst : infinite; None for a metric without a direction, in which no value is the worst.
    """
    # A mean of the other runs alone would reward a variant for failing with the hard seeds.
    value = row.metrics[column]
    return worst if value is None and row.status in FAILURES else value


def mean_value(values: Sequence[Value]) -> Value:
    """The mean of values; None if one has none, infinite if a run failed."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if len(known) == len(values) else None


def is_same(rows: Sequence[Row], column: int) -> bool:
    """Whether the seed changes nothing of what a metric measures."""
    return is_same_run([row.signals[column] if row.signals else "" for row in rows])


class Grouping:
    """Groups rows. Only configurations whose trials are still running are held.

    Parameters
    ----------
    seeds : number of rows of a complete configuration.
    """

    def __init__(self, seeds: int) -> None:
        self.seeds = seeds
        self._open: dict[int, list[Row]] = {}

    def add(self, row: Row) -> TrialGroup | None:
        """Add a row; returns the group if it is complete."""
        number = row.trial // self.seeds
        rows = self._open.setdefault(number, [])
        rows.append(row)
        return self._close(number) if len(rows) == self.seeds else None

    def rest(self) -> Iterator[TrialGroup]:
        """The groups that are not complete."""
        for number in sorted(self._open):
            yield self._close(number)

    def _close(self, number: int) -> TrialGroup:
        rows = sorted(self._open.pop(number), key=lambda row: row.trial)
        return TrialGroup(number, rows[0].cells, tuple(rows))


def gather(rows: Iterable[Row], seeds: int) -> Iterator[TrialGroup]:
    """The groups of an index, the incomplete ones last."""
    grouping = Grouping(seeds)
    for row in rows:
        group = grouping.add(row)
        if group is not None:
            yield group
    yield from grouping.rest()


@dataclass(frozen=True)
class RankedConfiguration:
    """A configuration with the mean of the objective over its seeds."""

    group: TrialGroup
    objective: Estimate

    @property
    def cells(self) -> tuple[str, ...]:
        """The values of the factors."""
        return self.group.cells


@dataclass
class Tally:
    """Statistics of a sweep while it runs: rows by status, reasons, and the best configurations.

    Only the first ``REASONS`` different reasons are counted. The best configurations have the best
    means, among those with a value for every seed; those with infinite values (never settled) come
    last, the fewer the better. ``ends`` are those of the objective's interval, ``never`` says what
    an infinite value means.
    """

    seeds: int
    column: int | None
    objective: Objective | None
    ends: Ends = ANY
    never: str = NEVER
    done: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(
        cls,
        seeds: int,
        metrics: Sequence[str],
        objective: Objective | None,
        ends: Mapping[str, Ends],
        never: Mapping[str, str],
    ) -> Tally:
        """The tally of a sweep with these metrics; one that lacks its objective ranks nothing."""
        if objective is None or objective.metric not in metrics:
            return cls(seeds, None, objective)
        metric, column = objective.metric, list(metrics).index(objective.metric)
        return cls(seeds, column, objective, ends.get(metric, ANY), never.get(metric, NEVER))

    def __post_init__(self) -> None:
        self._grouping = Grouping(self.seeds)
        self._heap: list[tuple[tuple[int, float], int, RankedConfiguration]] = []

    def add(self, row: Row) -> None:
        """Add a row."""
        self.done += 1
        self.counts[row.status] += 1
        if row.reason and (row.reason in self.reasons or len(self.reasons) < REASONS):
            self.reasons[row.reason] += 1
        group = self._grouping.add(row)
        if group is not None:
            self._rank(group)

    def _rank(self, group: TrialGroup) -> None:
        if self.objective is None or self.column is None:
            return
        # A mean over fewer seeds than the others' is not comparable with theirs.
        if any(row.metrics[self.column] is None for row in group.rows):
            return
        estimate = group.estimate(self.column, self.ends)
        lost = estimate.never + estimate.failed
        rank = -lost, -self.objective.of(estimate.mean) if estimate.n else -math.inf
        # The first entry of a heap is the smallest: here the worst of the best. Of equal ones the
        # first of the plan is the better one, not the one that ended first.
        push = heapq.heappush if len(self._heap) < BEST else heapq.heappushpop
        push(self._heap, (rank, -group.number, RankedConfiguration(group, estimate)))

    @property
    def best(self) -> list[RankedConfiguration]:
        """The best configurations, the best first."""
        return [ranked for _, _, ranked in sorted(self._heap, reverse=True)]

    def line(self, factors: Sequence[str]) -> str:
        """The best configuration so far, in one line."""
        failed = self.done - self.counts["ok"]
        bad = f"  ({failed} not ok)" if failed else ""
        if not self._heap or self.objective is None:
            return f"{self.done} done{bad}"
        best = self.best[0]
        values = ", ".join(f"{k}={c}" for k, c in zip(factors, best.cells, strict=True))
        place = f" at {values}" if values else ""
        mean = mean_of(best.objective, self.seeds, self.never)
        return f"best {self.objective.metric} {mean}{place}{bad}"

    def top_reasons(self) -> list[dict[str, Any]]:
        """The most frequent reasons with their counts."""
        most = self.reasons.most_common(REASONS_SHOWN)
        return [{"reason": reason, "count": count} for reason, count in most]
