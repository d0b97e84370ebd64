"""A sweep read back for drawing: as many settings as a page can show, however many there are."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blocks.core import FloatArray
from runtime.document import flow_yaml, from_python, parse_yaml
from runtime.errors import Problems, UsageError
from runtime.experiments.analysis.groups import Group, gather
from runtime.experiments.analysis.statistics import Estimate, estimate
from runtime.experiments.design import Factor, Objective, Range, parse_knob, parse_seeds
from runtime.experiments.execution import INDEX, Columns, read_plan, read_rows

MOST = 4000


@dataclass(frozen=True)
class Axis:
    """A knob as an axis: a number for each setting, and names where the values are no numbers."""

    path: str
    places: FloatArray
    names: tuple[str, ...]
    is_log: bool

    @property
    def distinct(self) -> FloatArray:
        """The places that occur, in order."""
        return np.unique(self.places)


@dataclass(frozen=True)
class SweepData:
    """A sweep's settings: where each lies on each axis, and each metric's mean over the seeds.

    ``metrics`` maps a metric to one estimate a setting. ``skipped`` settings were left out, evenly
    over the whole, where there are more than a page can show.
    """

    name: str
    method: str
    seeds: int
    axes: tuple[Axis, ...]
    metrics: dict[str, list[Estimate]]
    objective: Objective | None
    skipped: int

    def means(self, metric: str) -> FloatArray:
        """One mean a setting; NaN where no run has a value."""
        return np.array([found.mean for found in self.metrics[metric]])

    def is_partial(self, metric: str) -> NDArray[np.bool_]:
        """Whether each setting's mean is over some of the seeds only."""
        return np.array([0 < found.n < self.seeds for found in self.metrics[metric]])


def read_sweep(folder: Path) -> SweepData:
    """Read a sweep for drawing, complete or not.

    Raises
    ------
    UsageError : its files cannot be read.
    """
    plan = read_plan(folder)
    problems = Problems()
    vary = from_python(plan.get("vary", {}))
    factors = [parse_knob(path, node, path, problems) for path, node in vary.items()]
    seeds = parse_seeds(from_python(plan.get("seeds")), "seeds", problems)
    if plan.get("kind") != "sweep" or problems.found or seeds is None:
        raise UsageError(f"'{folder}' holds no sweep that can be read")
    known = [factor for factor in factors if factor is not None]
    metrics = tuple(map(str, plan.get("metrics", ())))
    columns = Columns(tuple(factor.path for factor in known), metrics)
    groups, skipped = _some(gather(read_rows(folder / INDEX, columns), len(seeds)))
    goals = ((plan.get(goal), goal) for goal in ("minimize", "maximize"))
    chosen = next(((str(metric), goal) for metric, goal in goals if metric), None)
    return SweepData(
        name=str(plan.get("experiment")),
        method=next((method for method in ("random", "sobol") if method in plan), "grid"),
        seeds=len(seeds),
        axes=tuple(
            _axis(factor, [group.cells[i] for group in groups]) for i, factor in enumerate(known)
        ),
        metrics={
            name: [estimate(group.values(i)) for group in groups] for i, name in enumerate(metrics)
        },
        objective=None if chosen is None else Objective(*chosen),  # type: ignore[arg-type]
        skipped=skipped,
    )


def _some(groups: Iterable[Group]) -> tuple[list[Group], int]:
    """Every n-th setting, with an n that lets at most ``MOST`` through."""
    kept: list[Group] = []
    every, count = 1, 0
    for group in groups:
        count += 1
        if group.number % every == 0:
            kept.append(group)
        if len(kept) > MOST:
            every *= 2
            kept = [group for group in kept if group.number % every == 0]
    kept.sort(key=lambda group: group.number)
    return kept, count - len(kept)


def _axis(factor: Factor, cells: list[str]) -> Axis:
    values = [parse_yaml(cell, factor.path).plain() for cell in cells]
    if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
        is_log = isinstance(factor, Range) and factor.scale == "log"
        places = np.array(values, dtype=float)
        if np.isfinite(places).all():
            return Axis(factor.path, places, (), is_log)
    # In the order in which they were given; a sampled sweep meets them in another.
    given = [flow_yaml(value) for value in factor.values] or sorted(set(cells))
    order = {name: i for i, name in enumerate(dict.fromkeys([*given, *cells]))}
    return Axis(factor.path, np.array([order[cell] for cell in cells], float), tuple(order), False)


def spread(found: Estimate) -> tuple[float, float]:
    """The ends of an interval; the mean itself where there is none."""
    if math.isnan(found.low):
        return found.mean, found.mean
    return found.low, found.high
