"""Differences between contestants: tunings, conditions and seeds are all samples.

In: the values of two contestants, by tuning, condition and seed. Out: their difference, with the
interval and the p value of other tunings, other conditions and other seeds::

    A: (2 tunings, 6 conditions, 3 seeds)   B: the same conditions and seeds, tunings of its own
    ->  A - B  -0.12 [-0.2, -0.04]

The three are crossed: every tuning meets every condition with every seed. The variance of the mean
difference is the sum of that of the mean over tunings (of either contestant, which are not paired),
over conditions and over seeds (of the paired difference). Each of these means holds a share of the
rest as well, so that the sum is a little too large rather than too small. Student's t with
Satterthwaite's degrees of freedom (1946) gives the interval. Conditions alone would take what a
tuning happened to find for what its method is worth: equal contestants of one tuning each would
differ significantly in half of all contests.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from blocks.core import BoolArray, FloatArray
from runtime.experiments.analysis.estimates import (
    ANY,
    FEWEST_T,
    LEVEL,
    ROUNDING,
    Ends,
    Estimate,
    Margin,
    PairedDifference,
    standard_error,
    t_interval,
    t_p,
    t_quantile,
)
from runtime.experiments.analysis.ranks import fewest, signed_rank_p, walsh_interval
from runtime.experiments.analysis.statistics import estimate, looks_skewed


@dataclass(frozen=True)
class Contestant:
    """The values of one metric on the held-out runs.

    Parameters
    ----------
    values : (tunings, conditions, seeds); NaN where there is none, infinite of a run that failed.
    is_tuned : its tunings are samples of what a method finds; without factors to tune, all of them
        are the same controller.
    is_same : the seed changes nothing.
    failed : the infinite values that are those of runs that failed, as ``values``; the others were
        never reached.
    """

    values: FloatArray
    is_tuned: bool
    is_same: bool = False
    failed: BoolArray | None = None

    @property
    def is_one_run(self) -> bool:
        """Whether each tuning has been measured by a single run, repeated."""
        return self.is_same and self.values.shape[1] == 1

    @property
    def units(self) -> tuple[float | None, ...]:
        """The mean of each condition, or of a single one with each seed, over the runs that have a
        value; None where a run has none, infinite where all have failed.
        """
        found = []
        for unit in np.moveaxis(self.values, _axis(self.values), 0):
            finite = unit[np.isfinite(unit)]
            one = float(finite.mean()) if finite.size else float(unit.flat[0])
            found.append(None if np.isnan(unit).any() else one)
        return tuple(found)

    def estimate(self, ends: Ends = ANY) -> Estimate:
        """The mean, with the interval of other tunings, conditions and seeds."""
        units, failed = self.units, 0
        if self.failed is not None:
            by_unit = np.moveaxis(self.failed, _axis(self.values), 0)
            pairs = zip(units, by_unit, strict=True)
            failed = sum(not _is_finite(unit) and bool(lost.any()) for unit, lost in pairs)
        plain = estimate(units, ends, self.is_one_run, failed=failed)
        known = np.where(np.isfinite(self.values), self.values, np.nan)
        if self.is_one_run or plain.n < 2 or np.isnan(known).any():
            return plain
        error, freedom = _error(known, np.zeros_like(known[:1]), (self.is_tuned, False))
        if not error:
            return plain
        low, high = np.clip(t_interval(plain.mean, error, freedom), *ends).tolist()
        return replace(plain, low=low, high=high)


def _is_finite(unit: float | None) -> bool:
    return unit is not None and math.isfinite(unit)


def crossed_difference(
    one: Contestant,
    other: Contestant,
    is_skewed: bool | None = None,
    margin: Margin | float | str = 0.0,
) -> PairedDifference:
    """The difference of two contestants on the same conditions and seeds.

    Parameters
    ----------
    is_skewed : whether a ratio is taken; by default, whether the values look skewed.
    margin : the smallest difference that counts.

    A run that failed counts as the worst value of both in its condition, and of all conditions
    where all runs of one of them failed. If a method was tuned only once, ``is_of_these`` says that
    the result holds for these controllers, and not for what else the method would have found.
    """
    margin = Margin.of(margin)
    if one.is_one_run and other.is_one_run:
        apart = float(one.values[:, 0, 0].mean() - other.values[:, 0, 0].mean())
        mean = apart if math.isfinite(apart) else math.nan
        is_equal = bool(np.array_equal(one.values[0], other.values[0])) and apart == 0.0
        return PairedDifference(1, mean, math.nan, math.nan, 0, True, pairs=1, is_equal=is_equal)
    a, b = _select_known(one.values, other.values)
    pairs = a.shape[_axis(a)]
    failed = int(np.isinf(a).sum()), int(np.isinf(b).sum())
    a, b = _cap_failed(a, b)
    both = np.concatenate([a.ravel(), b.ravel()])
    is_unit = margin.size > 0.0 and not margin.is_share
    is_log = looks_skewed(both) if is_skewed is None else is_skewed
    is_log = bool(is_log and both.size and (both > 0.0).all() and not is_unit)
    if is_log:
        a, b = np.log(a), np.log(b)
    tuned = one.is_tuned, other.is_tuned
    result = _compare_finite(a, b, tuned, margin, is_log)
    is_once = any(x.is_tuned and len(x.values) < 2 for x in (one, other))
    return replace(
        result,
        pairs=pairs,
        is_of_these=is_once,
        # Who fails more than the other is not as good.
        is_negligible=result.is_negligible and failed[0] / a[:, 0].size == failed[1] / b[:, 0].size,
    )


def _axis(values: FloatArray) -> int:
    """What is independent: the conditions if there are several, else the seeds."""
    return 1 if values.shape[1] > 1 else 2


def _select_known(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Only conditions, or seeds, in which every run of both has a value, or failed."""
    axis = _axis(a)
    rest = tuple(i for i in range(3) if i != axis)
    known = ~(np.isnan(a).any(axis=rest) | np.isnan(b).any(axis=rest))
    return np.compress(known, a, axis=axis), np.compress(known, b, axis=axis)


def _cap_failed(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Finite values in place of those of runs that failed."""
    failed = np.concatenate([a[np.isinf(a)], b[np.isinf(b)]])
    if not len(failed):
        return a, b
    worst = math.copysign(1.0, float(failed[0]))
    both = worst * np.concatenate([a, b])
    finite = np.where(np.isfinite(both), both, -np.inf)
    by_condition = finite.max(axis=(0, 2))
    is_gone = np.isinf(a).all(axis=(0, 2)) | np.isinf(b).all(axis=(0, 2))
    overall = float(finite.max()) if np.isfinite(both).any() else 0.0
    cap = worst * np.where(is_gone | ~np.isfinite(by_condition), overall, by_condition)[:, None]
    return np.where(np.isinf(a), cap, a), np.where(np.isinf(b), cap, b)


def _compare_finite(
    a: FloatArray, b: FloatArray, tuned: tuple[bool, bool], margin: Margin, is_log: bool
) -> PairedDifference:
    """The difference of finite values, of logarithms as a ratio less 1."""
    axis = _axis(a)
    n = a.shape[axis]
    centre = float(a.mean() - b.mean()) if n else math.nan
    size = float(max(np.abs(a).max(), np.abs(b).max())) if n else 0.0
    is_equal = n > 0 and float(np.abs(a.mean(axis=0) - b.mean(axis=0)).max()) <= ROUNDING * size
    error, freedom = _error(a, b, tuned) if n else (0.0, math.nan)
    is_constant = error <= ROUNDING * size
    needed = fewest(LEVEL) if is_constant else FEWEST_T
    low = high = p = math.nan
    is_within = False
    if n >= FEWEST_T and not is_equal:
        units = (a.mean(axis=0) - b.mean(axis=0)).mean(axis=2 - axis)
        if is_constant:
            centre, low, high = walsh_interval(units, LEVEL)
            p = signed_rank_p(units)
        else:
            low, high = t_interval(centre, error, freedom)
            p = t_p(centre / error, freedom)
        if margin.size:
            p, is_within = _beyond(a, b, tuned, margin, is_log)
    shown = margin.in_unit(b.mean(axis=0).ravel(), is_log) if n else 0.0
    if is_log:
        centre, low, high = (math.expm1(x) for x in (centre, low, high))
    return PairedDifference(
        n=n,
        mean=centre,
        low=low,
        high=high,
        p=p,
        needed=needed,
        scale="log t" if is_log else "t",
        margin=shown,
        is_equal=is_equal,
        is_negligible=is_within and n >= needed,
    )


def _beyond(
    a: FloatArray, b: FloatArray, tuned: tuple[bool, bool], margin: Margin, is_log: bool
) -> tuple[float, bool]:
    """p of a difference larger than a margin, and whether it is within."""
    up, down = margin.offsets(b, is_log)
    found = []
    for sign, end in ((1.0, b + up), (-1.0, b - down)):
        error, freedom = _error(a, end, tuned)
        by = sign * float(a.mean() - end.mean()) / error if error else math.inf
        found.append((by, t_p(by, freedom), bool(error) and by <= -t_quantile(freedom)))
    beyond = max(found)
    return beyond[1] if 0.0 < beyond[0] < math.inf else 1.0, found[0][2] and found[1][2]


def _error(a: FloatArray, b: FloatArray, tuned: Sequence[bool]) -> tuple[float, float]:
    """The standard error of the mean of a - b, and its degrees of freedom."""
    place = a.mean(axis=0) - b.mean(axis=0)  # conditions x seeds, paired
    means = [x.mean(axis=(1, 2)) for x, is_sample in zip((a, b), tuned, strict=True) if is_sample]
    means += [place.mean(axis=1), place.mean(axis=0)]
    return standard_error(*means)
