"""Statistics of a running sweep, in memory that does not grow with the number of trials."""

from __future__ import annotations

import math
import random
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace

import pytest

from runtime.experiments.analysis.groups import BEST, REASONS, Tally, gather
from runtime.experiments.design.objective import Objective
from runtime.experiments.execution.index import Row

SEEDS = 3


def row(trial: int, value: float | None, status: str = "ok") -> Row:
    reason = "" if status == "ok" else f"at tick {trial}"
    return Row(trial, (str(trial // SEEDS),), trial % SEEDS, status, reason, (value,), 0.1)


def tally(goal: str = "minimize") -> Tally:
    return Tally(SEEDS, 0, Objective("m", goal))  # type: ignore[arg-type]


def shuffled(count: int, reach: int = 8) -> Iterator[int]:
    """Points in the order in which workers end them: never far from the order of the plan."""
    moments = random.Random(1)
    yield from sorted(range(count), key=lambda number: number + moments.uniform(0, reach))


@pytest.mark.parametrize("goal", ["minimize", "maximize"])
def test_the_best_configurations_are_those_with_the_best_means(goal: str) -> None:
    moments = random.Random(2)
    values = {trial: moments.gauss(0.0, 1.0) for trial in range(300)}
    found = tally(goal)
    for trial in shuffled(300):
        found.add(row(trial, values[trial]))
    means = {k: sum(values[SEEDS * k + i] for i in range(SEEDS)) / SEEDS for k in range(100)}
    expected = sorted(means, key=lambda k: means[k], reverse=goal == "maximize")[:BEST]
    assert [int(ranked.cells[0]) for ranked in found.best] == expected
    assert found.best[0].objective.mean == pytest.approx(means[expected[0]])
    assert found.best[0].objective.n == SEEDS
    assert found.line(["k"]).startswith(f"best m {means[expected[0]]:.4g} at k={expected[0]}")


def test_a_setting_with_a_hole_is_not_the_best() -> None:
    found = tally()
    for trial, value in enumerate([None, -9.0, -9.0, 1.0, 1.0, 1.0]):
        found.add(row(trial, value))
    assert [ranked.cells for ranked in found.best] == [("1",)]


def test_rows_are_grouped_in_any_order() -> None:
    groups = list(gather((row(trial, float(trial)) for trial in shuffled(29)), SEEDS))
    assert sorted(group.number for group in groups) == list(range(10))
    whole = {group.number: [row.metrics[0] for row in group.rows] for group in groups}
    assert whole[4] == [12.0, 13.0, 14.0]
    assert whole[9] == [27.0, 28.0]
    assert {group.number: group.estimate(0).mean for group in groups}[4] == 13.0


def test_what_is_never_reached_comes_last_and_the_fewer_the_better() -> None:
    inf = math.inf
    found = tally("maximize")
    for trial, value in enumerate([inf] * 3 + [1.0, inf, 9.0] + [2.0, 3.0, 4.0]):
        found.add(row(trial, value))
    assert [ranked.cells for ranked in found.best] == [("2",), ("1",), ("0",)]
    assert [ranked.objective.never for ranked in found.best] == [0, 1, 3]
    alone = tally()
    for trial in range(3):
        alone.add(row(trial, inf))
    assert alone.line(["k"]) == "best m never, 0 of 3 at k=0"


def test_runs_that_recorded_the_same_are_one() -> None:
    found = tally()
    for trial in range(6):
        same = "abcd" if trial < SEEDS else f"abc{trial}"
        found.add(replace(row(trial, 3.0), signals=(same,)))
    one, three = (ranked.objective for ranked in found.best)
    assert (one.n, one.is_same, three.n, three.is_same) == (1, True, SEEDS, False)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_sweep() -> None:
    found = tally()
    peaks = []
    tracemalloc.start()
    try:
        for trial in range(15_000):
            found.add(row(trial, float(-trial), "failed" if trial % 7 else "ok"))
            if trial % 5_000 == 4_999:
                peaks.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert len(found.reasons) == REASONS
    assert found.counts == {"ok": 2143, "failed": 12857}
    assert max(peaks) - peaks[0] < 20_000
