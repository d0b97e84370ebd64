"""From the rows of an index to what is compared: one value per seed, or per setting.

In: the rows of each variant. Out: a :class:`Sample` for each metric, setting and variant. A
*setting* is one combination of the factors' values::

    error of soft at wind 0 and 2, seeds 0 and 1: 1, 3 and 2, 6
    ->  over all settings: 1.5, 4.5 (one value per seed)
        wind=0: 1, 3       wind=2: 2, 6       error per wind: 0.5, 1.5 (the slope of each seed)
        worst: 2, 6 (of each seed over the settings; of one setting it is one number of all seeds)

Values that the file lists are all that is asked about, and seeds are what chance draws; where the
settings are samples themselves, they are what is drawn, and each counts once, however many seeds it
has: runs of one setting are no independent observations of what other settings would give.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from runtime.document import parse_yaml
from runtime.experiments.analysis.comparison import PER, WORST, Sample
from runtime.experiments.analysis.groups import Value, failed_value, sample_of
from runtime.experiments.design import value_label
from runtime.experiments.execution import ExperimentPlan, Row

MOST_SETTINGS = 12  # that have lines of their own
Samples = dict[tuple[str, str], dict[str, Sample]]


def samples_of(
    plan: ExperimentPlan, rows: Mapping[str, Sequence[Row]], removed: set[tuple[str, str]]
) -> Samples:
    """The samples of an ablation.

    Parameters
    ----------
    rows : by variant, in the order of trials.
    removed : (variant, metric) where the variant removes what the metric measures.
    """
    samples: Samples = {}
    for column, metric in enumerate(plan.metrics):
        worst = plan.worst(metric)
        for variant, own in rows.items():
            table = _Table(plan, own, column, worst)
            for name, setting, sample in table.samples(metric):
                if (variant, metric) in removed:
                    sample = Sample((None,) * len(sample.values), is_removed=True)
                samples.setdefault((name, setting), {})[variant] = sample
    # All of a metric together, and settings before trends.
    order = {metric: i for i, metric in enumerate(plan.metrics)}
    keys = sorted(samples, key=lambda key: (order[key[0].split(PER)[0]], PER in key[0]))
    return {key: samples[key] for key in keys}


@dataclass(frozen=True)
class _Table:
    """One metric of one variant: its runs by setting and seed."""

    plan: ExperimentPlan
    rows: Sequence[Row]
    column: int
    worst: Value

    @property
    def settings(self) -> dict[tuple[str, ...], list[Row]]:
        settings: dict[tuple[str, ...], list[Row]] = {}
        for row in self.rows:
            settings.setdefault(row.cells[1:], []).append(row)
        return settings

    def samples(self, metric: str) -> Iterator[tuple[str, str, Sample]]:
        """(name, place, sample): all settings together, their tails, each alone, and trends."""
        settings = self.settings
        is_sampled = self.plan.design.method != "grid"
        whole = self._sample(list(settings.values()), is_sampled)
        yield metric, "", whole
        for tail in self._tails(whole, is_sampled or len(settings) == 1):
            yield metric, tail.statistic, tail
        if is_sampled or len(settings) == 1:
            return
        paths = [factor.path for factor in self.plan.design.factors]
        if len(settings) <= MOST_SETTINGS:
            for cells, rows in settings.items():
                labels = (f"{p}={value_label(c)}" for p, c in zip(paths, cells, strict=True))
                yield metric, ", ".join(labels), self._sample([rows])
        for i, path in enumerate(paths):
            places = [parse_yaml(cells[i], path).plain() for cells in settings]
            if all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in places):
                units = zip(*map(self._values, settings.values()), strict=True)
                slopes = tuple(slope_of(places, unit) for unit in units)
                yield f"{metric}{PER}{path}", "", _of_values(whole, slopes)

    def _tails(self, whole: Sample, is_single: bool) -> Iterator[Sample]:
        """The quantiles and the worst value: of each seed over the settings, or of all values."""
        settings = map(self._values, self.settings.values())
        units = [whole.values] if is_single else list(zip(*settings, strict=True))
        found: dict[str, Callable[[Sequence[Value]], Value]] = {
            f"{q:g}-quantile": partial(quantile_of, q=q) for q in self.plan.quantiles
        }
        if self.plan.with_worst and self.worst is not None:
            # The sorted values end with the largest one, or begin with the smallest.
            found[WORST] = partial(quantile_of, q=1.0 if self.worst > 0.0 else 0.0)
        for name, of in found.items():
            sample = _of_values(whole, tuple(map(of, units)))
            yield replace(sample, statistic=name, is_single=is_single)

    def _values(self, rows: Sequence[Row]) -> list[Value]:
        return [failed_value(row, self.column, self.worst) for row in rows]

    def _sample(self, settings: Sequence[Sequence[Row]], is_sampled: bool = False) -> Sample:
        return sample_of(settings, self.column, self.worst, is_sampled)


def _of_values(whole: Sample, values: tuple[Value, ...]) -> Sample:
    """What is computed from the runs of a sample; where one failed it is infinite or missing."""
    lost = sum(value is None or math.isinf(value) for value in values)
    return replace(whole, values=values, failed=min(whole.failed, lost))


def quantile_of(values: Sequence[Value], q: float) -> Value:
    """A quantile, linear between values as numpy's; None if one has none.

    Infinite values are the ends: between one and a finite value, the quantile is infinite.
    """
    if None in values:
        return None
    ordered = np.sort(np.array(values, dtype=float))
    place = round(q * (len(ordered) - 1), 9)  # without its rounding, which infinity would enlarge
    share = place - int(place)
    low, high = float(ordered[int(place)]), float(ordered[math.ceil(place)])
    found = float((1.0 - share) * low + share * high) if low < high else low
    return None if math.isnan(found) else found


def slope_of(places: Sequence[float], values: Sequence[Value]) -> Value:
    """The slope of a straight line through values (least squares); None if one has none.

    With infinite values it is the limit for ever larger ones: where runs fail at large places, the
    slope is steeper than any. None if all are infinite.
    """
    known = np.array([math.nan if value is None else value for value in values])
    x = np.asarray(places, dtype=float) - float(np.mean(places))
    infinite = np.isinf(known)
    if np.isnan(known).any() or infinite.all() or not x.any():
        return None
    pull = float(x @ np.where(infinite, np.sign(known), 0.0))
    if abs(pull) > 1e-9 * float(np.abs(x).max()):
        return math.copysign(math.inf, pull)
    return float(x @ np.where(infinite, 0.0, known) / (x @ x))
