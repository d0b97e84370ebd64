"""A sweep read for drawing, with at most as many configurations as a page can show.

In: the folder of a sweep, complete or not. Out: :class:`SweepData`, with an array per factor and a
list of estimates per metric, one entry per configuration::

    a = 1, 2 with seeds 0, 1  ->  axes[0].positions [1, 2], metrics["error"] of length 2
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blocks.core import FloatArray
from runtime.document import flow_yaml, from_python, parse_yaml
from runtime.errors import Problems, UsageError
from runtime.experiments.analysis.estimates import (
    ANY,
    Ends,
    Estimate,
)
from runtime.experiments.analysis.groups import TrialGroup, gather
from runtime.experiments.analysis.words import NEVER, lost
from runtime.experiments.design import (
    BASELINE,
    Factor,
    Objective,
    Range,
    parse_factor,
    parse_seeds,
    value_label,
)
from runtime.experiments.execution import INDEX, VARIANT, Columns, read_plan, read_rows
from runtime.terminal import with_unit

MOST = 4000


@dataclass(frozen=True)
class Axis:
    """A factor as an axis: a number per configuration, and names if values are not numbers."""

    path: str
    positions: FloatArray
    names: tuple[str, ...]
    is_log: bool

    @property
    def distinct(self) -> FloatArray:
        """The distinct positions, in order."""
        return np.unique(self.positions)


@dataclass(frozen=True)
class SweepData:
    """A sweep's configurations: positions on each axis, and each metric's mean over the seeds.

    ``groups`` are the configurations with their runs, ``metrics`` maps a metric to one estimate for
    each. ``seeds`` is the number of observations of an estimate to which every run has given a
    value. ``skipped`` is the number of configurations that were left out, evenly, because a page
    cannot show more.
    """

    name: str
    method: str
    seeds: int
    axes: tuple[Axis, ...]
    groups: tuple[TrialGroup, ...]
    metrics: dict[str, list[Estimate]]
    units: dict[str, str]
    ends: dict[str, Ends]
    never: dict[str, str]
    objective: Objective | None
    skipped: int

    @property
    def is_sampled(self) -> bool:
        """Whether the settings are drawn themselves, so that each is one observation."""
        return self.method != "grid"

    @property
    def by_variant(self) -> dict[str, SweepData]:
        """Each variant's part, with the factors as its axes; all under '' if nothing is crossed."""
        if len(self.axes) < 2 or self.axes[0].path != VARIANT:
            return {"": self}
        first, *rest = self.axes
        parts = {}
        for i, name in enumerate(first.names):
            own = first.positions == i
            metrics = {
                metric: [each for each, is_own in zip(estimates, own, strict=True) if is_own]
                for metric, estimates in self.metrics.items()
            }
            axes = tuple(replace(axis, positions=axis.positions[own]) for axis in rest)
            groups = tuple(each for each, is_own in zip(self.groups, own, strict=True) if is_own)
            parts[name] = replace(self, axes=axes, groups=groups, metrics=metrics)
        return parts

    def label(self, metric: str) -> str:
        """A metric with its unit."""
        return with_unit(metric, self.units)

    def means(self, metric: str) -> FloatArray:
        """One mean per configuration; NaN where no trial has a value."""
        return np.array([estimate.mean for estimate in self.metrics[metric]])

    def is_partial(self, metric: str) -> NDArray[np.bool_]:
        """Whether each configuration's mean is over only some of the seeds."""
        estimates = self.metrics[metric]
        return np.array([each.n > 0 and not each.is_over(self.seeds) for each in estimates])

    def is_lost(self, metric: str) -> NDArray[np.bool_]:
        """Whether each configuration has no finite value since runs failed or reached nothing."""
        estimates = self.metrics[metric]
        return np.array([not each.n and each.never + each.failed > 0 for each in estimates])

    def words_of_lost(self, metric: str) -> list[str]:
        """What became of the runs of those configurations: ``failed``, ``never settled``."""
        never = self.never.get(metric, NEVER)
        estimates = [each for each in self.metrics[metric] if not each.n]
        return list(
            dict.fromkeys(filter(None, (lost(e.never, e.failed, never) for e in estimates)))
        )

    def is_same(self, metrics: Iterable[str]) -> bool:
        """Whether the seed changes nothing anywhere, so that all seeds are one run."""
        return all(estimate.is_same for name in metrics for estimate in self.metrics[name])


def read_sweep(folder: Path, most: float | None = None) -> SweepData:
    """Read a sweep for drawing, complete or not, with at most so many configurations
    (:data:`MOST`).

    Raises
    ------
    UsageError : its files cannot be read.
    """
    plan = read_plan(folder)
    problems = Problems()
    vary = from_python(plan.get("vary", {}))
    names = (BASELINE, *plan["variants"]) if plan.get("variants") else ()
    factors = [Factor(VARIANT, names)] * bool(names) + [
        parse_factor(path, node, path, problems) for path, node in vary.items()
    ]
    seeds = parse_seeds(from_python(plan.get("seeds")), "seeds", problems)
    if plan.get("kind") not in ("sweep", "ablation") or problems.items or seeds is None:
        raise UsageError(f"cannot read the {plan.get('kind')} in '{folder}'")
    parsed = [factor for factor in factors if factor is not None]
    metrics = tuple(map(str, plan.get("metrics", ())))
    columns = Columns(tuple(factor.path for factor in parsed), metrics)
    ends = plan["ends"]
    groups, skipped = _thin_out(
        gather(read_rows(folder / INDEX, columns), len(seeds)), most or MOST
    )
    goals = ((plan.get(goal), goal) for goal in ("minimize", "maximize"))
    chosen = next(((str(metric), goal) for metric, goal in goals if metric), None)
    return SweepData(
        name=str(plan.get("experiment")),
        method=next((method for method in ("random", "sobol") if method in plan), "grid"),
        seeds=len(seeds),
        axes=tuple(
            _axis(factor, [group.cells[i] for group in groups]) for i, factor in enumerate(parsed)
        ),
        groups=tuple(groups),
        metrics={
            name: [group.estimate(i, ends.get(name, ANY)) for group in groups]
            for i, name in enumerate(metrics)
        },
        units={str(name): str(unit) for name, unit in (plan.get("units") or {}).items()},
        ends=ends,
        never={str(name): str(words) for name, words in plan["never"].items()},
        objective=None if chosen is None else Objective(*chosen),  # type: ignore[arg-type]
        skipped=skipped,
    )


def _thin_out(groups: Iterable[TrialGroup], most: float) -> tuple[list[TrialGroup], int]:
    """Every n-th configuration, with n such that at most so many are left."""
    thinned: list[TrialGroup] = []
    every, count = 1, 0
    for group in groups:
        count += 1
        if group.number % every == 0:
            thinned.append(group)
        if len(thinned) > most:
            every *= 2
            thinned = [group for group in thinned if group.number % every == 0]
    thinned.sort(key=lambda group: group.number)
    return thinned, count - len(thinned)


def _axis(factor: Factor, cells: list[str]) -> Axis:
    if factor.path == VARIANT:
        names = [str(name) for name in factor.values]
        return Axis(
            VARIANT, np.array([names.index(cell) for cell in cells], float), tuple(names), False
        )
    values = [parse_yaml(cell, factor.path).plain() for cell in cells]
    if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
        is_log = isinstance(factor, Range) and factor.scale == "log"
        positions = np.array(values, dtype=float)
        if np.isfinite(positions).all():
            return Axis(factor.path, positions, (), is_log)
    # In the order given; a sampled sweep may have them in another order.
    names = [flow_yaml(value) for value in factor.values] or sorted(set(cells))
    order = {name: i for i, name in enumerate(dict.fromkeys([*names, *cells]))}
    places = np.array([order[cell] for cell in cells], float)
    return Axis(factor.path, places, tuple(map(value_label, order)), False)


def spread(estimate: Estimate) -> tuple[float, float]:
    """The ends of an interval; the mean itself if there is none."""
    if math.isnan(estimate.low):
        return estimate.mean, estimate.mean
    return estimate.low, estimate.high
