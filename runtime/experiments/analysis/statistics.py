"""Means, paired differences and their significance.

In: one value per seed, None where a run has none, infinity where something was never reached or the
run failed. Out: an :class:`Estimate`, a :class:`PairedDifference`, or p values::

    estimate([1.0, 2.0, 3.0])                          ->  mean 2, [-0.48, 4.48]
    difference([2.0, 2.1, math.inf], [1.0, 1.2, 1.1])  ->  3 pairs by ranks, of which 6 are needed

Why these tests. Variants run with the same seeds, so that a pair shares its noise and its neurons;
a test of two independent samples would count that shared noise as scatter, and find less. Student's
t is the default. Where a few large values decide a mean, or one side failed, only the order of the
differences counts (``ranks``); of positive quantities, that of the ratios (``log ranks``), which
are as often above 1 as below where one side varies more than the other. A bootstrap of three to
ten differences covers 73 to 87 instead of 95 %, and a test of them with signs flipped agrees with
ranks but depends on the largest value. docs/experiments.md has the error rates of each, simulated.

``scipy.stats`` takes 0.6 s to import, so a few lines of ``scipy.special`` are used instead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from blocks.core import FloatArray
from runtime.experiments.analysis.estimates import (
    ANY,
    FEWEST_T,
    LEVEL,
    ROUNDING,
    Ends,
    Estimate,
    Margin,
    PairedDifference,
    Scale,
    standard_error,
    t_interval,
    t_p,
)
from runtime.experiments.analysis.ranks import fewest, signed_rank_p, walsh_interval

Test = Literal["auto", "t", "ranks"]
TESTS: dict[Test, str] = {
    "auto": "paired t, or signed ranks where values are skewed or runs failed",
    "t": "paired t",
    "ranks": "signed ranks",
}
CORRECTION = "Benjamini-Hochberg"
SKEWED = 1.0  # the skewness above which auto takes ranks; that of an exponential distribution is 2
JUDGED = 12  # values, of both sides together, from which skewness can be judged
Values = Sequence[float | None]


def estimate(
    values: Values, ends: Ends = ANY, is_same: bool = False, *, failed: int = 0
) -> Estimate:
    """The mean of independent values, with Student's t interval.

    Parameters
    ----------
    values : infinite where something is never reached, None or NaN where there is none; the mean
        is over the others.
    ends : no value of this quantity lies outside.
    is_same : the values are those of one run, repeated.
    failed : so many of the values that are infinite or missing are those of runs that failed.

    A single value has no interval, nor have values that are all equal: their scatter is unknown.
    """
    data = np.array(values[:1] if is_same else values, dtype=float)  # None becomes NaN
    finite = data[np.isfinite(data)]
    infinite = int(np.isinf(data).sum())
    failed = min(failed, len(data) - len(finite))
    counts = max(0, infinite - failed), is_same, failed
    if not len(finite):
        return Estimate(0, math.nan, math.nan, math.nan, *counts)
    # The interval of a time or of an error ends where the quantity does. Cut there, it covers the
    # true mean exactly as often as before, since that lies inside, too. A t interval of logarithms
    # reaches hundreds of times too far up with two values.
    low, high = np.clip(_t_interval(finite), *ends).tolist()
    return Estimate(len(finite), float(finite.mean()), low, high, *counts)


def difference(
    values: Values,
    baseline: Values,
    test: Test = "auto",
    *,
    is_same: bool = False,
    is_skewed: bool | None = None,
    margin: Margin | float | str = 0.0,
) -> PairedDifference:
    """The difference ``values - baseline`` over the seeds on which both have a value.

    Parameters
    ----------
    values, baseline : one value per seed, in the same order of seeds; None for a missing value,
        infinity for one that is never reached, or that of a run that failed.
    is_same : both sides repeat one run with every seed; there is nothing to test.
    is_skewed : whether ``auto`` takes ranks; by default, whether the values look skewed.
    margin : the smallest difference that counts, as :meth:`Margin.of` takes it.

    Of fewer pairs than the test needs there is no interval, and by t no p value: the scatter of two
    pairs is one number.
    """
    margin = Margin.of(margin)
    if is_same:
        values, baseline = values[:1], baseline[:1]
    pairs = [(a, b) for a, b in zip(values, baseline, strict=True) if None not in (a, b)]
    first, second = np.array(pairs, dtype=float).reshape(len(pairs), 2).T
    apart = _apart(first, second)
    scale = _scale(first, second, apart, test, is_skewed, margin)
    if scale == "log ranks":
        with np.errstate(divide="ignore", invalid="ignore"):  # inf / inf, which is equal
            apart = np.where(apart == 0.0, 0.0, np.log(np.where(apart == 0.0, 1.0, first / second)))
    centre, low, high = _middle(apart, scale)
    against = _count_against(apart, centre)
    needed = FEWEST_T if scale == "t" else fewest(LEVEL, against)
    p, is_negligible = math.nan, False
    if scale == "t" and len(apart) < needed:
        low = high = math.nan
    else:
        p, is_negligible = _test_beyond(apart, second, scale, margin, centre)
    if scale == "log ranks":
        low, high = math.expm1(low), math.expm1(high)
        centre = math.expm1(centre) if math.isfinite(centre) else centre
    finite = int(np.isfinite(apart).sum())
    return PairedDifference(
        n=finite,
        mean=centre,
        low=low,
        high=high,
        never=len(apart) - finite,
        is_same=is_same,
        p=p,
        pairs=len(apart),
        needed=needed,
        scale=scale,
        margin=margin.in_unit(second, scale == "log ranks"),
        is_equal=len(apart) > 0 and not apart.any(),
        is_negligible=is_negligible and len(apart) >= needed,
        against=against,
    )


def _count_against(apart: FloatArray, centre: float) -> int:
    """How many differences are infinite in the direction that the middle does not have."""
    if not math.isfinite(centre):
        return 0
    return int((np.isinf(apart) & (np.sign(apart) == -np.sign(centre))).sum())


def _apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """Differences; 0 where both are equal but for rounding, or both infinite."""
    size = np.maximum(np.abs(first), np.abs(second))
    with np.errstate(invalid="ignore"):
        differences = first - second
        is_equal = (first == second) | (np.abs(differences) <= ROUNDING * size)
    is_equal &= np.isfinite(differences) | (first == second)
    return np.where(is_equal, 0.0, differences)


def _scale(
    first: FloatArray,
    second: FloatArray,
    apart: FloatArray,
    test: Test,
    is_skewed: bool | None,
    margin: Margin,
) -> Scale:
    """The test to take."""
    both = np.concatenate([first, second])
    is_unit = margin.size > 0.0 and not margin.is_share  # which no ratio can be held against
    finite = both[np.isfinite(both)]
    if test == "auto" and is_skewed is None:
        # Of both sides together, which are the same numbers if the sides of a pair are exchanged:
        # a choice that looked at the differences would make the exact test inexact.
        is_skewed = looks_skewed(finite)
    is_positive = (both > 0.0).all() and np.isfinite(second).any()
    if test == "auto" and is_skewed and is_positive and not is_unit:
        return "log ranks"
    if test == "ranks" or (test == "auto" and is_skewed):
        return "ranks"
    # Neither t nor its interval has a meaning with infinite differences, or without scatter.
    if not np.isfinite(apart).all():
        return "ranks"
    is_constant = len(apart) > 1 and float(np.ptp(apart)) <= ROUNDING * float(np.abs(apart).max())
    return "ranks" if is_constant else "t"


def looks_skewed(data: FloatArray) -> bool:
    """Whether there are enough values to judge, and they are skewed."""
    return len(data) >= JUDGED and abs(_skewness(data)) > SKEWED


def _skewness(data: FloatArray) -> float:
    centred = data - data.mean()
    spread = float(np.sqrt((centred**2).mean()))
    return float((centred**3).mean()) / spread**3 if spread > ROUNDING * abs(data).max() else 0.0


def _middle(data: FloatArray, scale: Scale) -> tuple[float, float, float]:
    if not len(data):
        return math.nan, math.nan, math.nan
    if scale == "t":
        return float(data.mean()), *_t_interval(data)
    centre, low, high = walsh_interval(data, LEVEL)
    return (centre, math.nan, math.nan) if low == high else (centre, low, high)


def _test_beyond(
    apart: FloatArray, second: FloatArray, scale: Scale, margin: Margin, centre: float
) -> tuple[float, bool]:
    """p of a difference beyond the margin, NaN with nothing to test; and whether it is within."""
    if len(apart) < 2 or not apart.any():
        return math.nan, False
    if not margin.size:
        return _p(apart, scale), False
    # Two runs that failed are as equal with a margin as without one.
    known = np.isfinite(second)
    up, down = margin.offsets(np.where(known, second, 0.0), scale == "log ranks")
    is_tie = ~known & (apart == 0.0)
    above, below = np.where(is_tie, 0.0, apart - up), np.where(is_tie, 0.0, apart + down)
    is_within = _middle(above, scale)[2] <= 0.0 <= _middle(below, scale)[1]
    # Against the end of the margin on the side of the difference.
    side = above if centre > 0.0 else below
    is_beyond = centre * _middle(side, scale)[0] > 0.0
    return (_p(side, scale) if is_beyond else 1.0), is_within


def _p(apart: FloatArray, scale: Scale) -> float:
    """p of no difference."""
    if scale != "t":
        return signed_rank_p(apart)
    error, freedom = standard_error(apart)
    return t_p(float(apart.mean()) / error, freedom)


def _t_interval(data: FloatArray) -> tuple[float, float]:
    if len(data) < 2 or np.ptp(data) <= ROUNDING * np.abs(data).max():
        return math.nan, math.nan
    return t_interval(float(data.mean()), *standard_error(data))


def is_same_run(signals: Sequence[str]) -> bool:
    """Whether several runs recorded the same signals, to the bit: the seed changes nothing.

    Parameters
    ----------
    signals : a hash of what each run recorded; '' where it is not known.
    """
    return len(signals) > 1 and signals[0] != "" and len(set(signals)) == 1


def sign_test(larger: int, smaller: int) -> float:
    """p value of the exact two-sided sign test, which leaves out ties.

    A tie says nothing of the direction. Counted as half of each side, ties would make the test
    conservative where a change affects few seeds.
    """
    from scipy import special

    return min(1.0, 2.0 * float(special.bdtr(min(larger, smaller), larger + smaller, 0.5)))


def benjamini_hochberg(p: Sequence[float]) -> list[float]:
    """p values corrected for multiple comparisons (Benjamini-Hochberg); NaN stays NaN."""
    # The false discovery rate (Benjamini and Hochberg, 1995), not Bonferroni's bound: an ablation
    # asks which of some ten parts matter, and a bound on any error at all would hide most of them.
    # The step-up procedure holds for independent tests and for positively dependent ones
    # (Benjamini and Yekutieli, 2001); metrics of one run are mostly the latter.
    values = np.asarray(p, dtype=float)
    finite = np.flatnonzero(np.isfinite(values))
    falling = finite[np.argsort(-values[finite], kind="stable")]
    ranks = np.arange(len(finite), 0, -1)
    values[falling] = np.minimum.accumulate(values[falling] * len(finite) / ranks).clip(0.0, 1.0)
    return [float(value) for value in values]


def mcnemar_test(values: Values, baseline: Values) -> float:
    """p value of McNemar's exact test: do both have a value equally often?

    Only seeds on which one side alone has a value count (McNemar, 1947). A chi-squared test of the
    two shares would take the pairs for independent samples, and is not exact for ten seeds.
    """
    pairs = list(zip(values, baseline, strict=True))
    gained = sum(a is not None and b is None for a, b in pairs)
    missed = sum(a is None and b is not None for a, b in pairs)
    return sign_test(gained, missed)
