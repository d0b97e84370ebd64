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
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from blocks.core import FloatArray
from runtime.experiments.analysis.ranks import signed_rank_p, walsh_interval

CONFIDENCE = 0.95
LEVEL = 1.0 - CONFIDENCE  # of significance
Test = Literal["auto", "t", "ranks"]
Scale = Literal["t", "ranks", "log ranks"]  # what auto takes
TESTS: dict[Test, str] = {
    "auto": "paired t, or signed ranks where values are skewed or runs failed",
    "t": "paired t",
    "ranks": "signed ranks",
}
CORRECTION = "Benjamini-Hochberg"
SKEWED = 1.0  # the skewness above which auto takes ranks; that of an exponential distribution is 2
JUDGED = 12  # values, of both sides together, from which skewness can be judged
FEWEST_T = 3  # of two, the scatter is one number: two equal differences would be certainty
ROUNDING = 1e-9  # relative: values that differ by less are equal
Values = Sequence[float | None]
Ends = tuple[float, float]
ANY: Ends = (-math.inf, math.inf)


@dataclass(frozen=True)
class Estimate:
    """A mean of ``n`` values with the ends of its confidence interval, NaN where it has none.

    Parameters
    ----------
    never : values that are infinite (never settled); the mean is over the others.
    is_same : every seed gave the same run, so that all of them are one value.
    """

    n: int
    mean: float
    low: float
    high: float
    never: int = 0
    is_same: bool = False

    def to_dict(self) -> dict[str, Any]:
        """The estimate as plain data."""
        ends = {name: number_or_none(getattr(self, name)) for name in ("mean", "low", "high")}
        return {"n": self.n, **ends, "never": self.never, "identical": self.is_same}

    def is_over(self, runs: int) -> bool:
        """Whether the mean is over that many runs."""
        return self.n == (1 if self.is_same else runs)


@dataclass(frozen=True)
class PairedDifference(Estimate):
    """A typical paired difference; ``p`` is the probability of one as large by chance alone.

    Parameters
    ----------
    mean : by t the mean; by ranks the Hodges-Lehmann estimate, with ``log ranks`` of the ratio
        less 1.
    pairs : that were tested, with those in which one is infinite.
    needed : so many pairs are needed for any result of the test to be significant.
    scale : the test that was taken.
    margin : the smallest difference that counts; ``p`` is of a larger one.
    """

    p: float = math.nan
    pairs: int = 0
    needed: int = 0
    scale: Scale = "t"
    margin: float = 0.0
    is_equal: bool = False

    def to_dict(self) -> dict[str, Any]:
        tested = {"p": number_or_none(self.p), "pairs": self.pairs, "needed": self.needed}
        return {**super().to_dict(), **tested, "test": self.scale, "margin": self.margin}

    @property
    def is_too_small(self) -> bool:
        """Whether there are too few pairs for any result to be significant."""
        return 0 < self.pairs < self.needed and not self.is_same and not self.is_equal

    @property
    def is_negligible(self) -> bool:
        """Whether the whole interval lies within the margin (equivalence; Schuirmann, 1987)."""
        return self.margin > 0.0 and -self.margin <= self.low and self.high <= self.margin


def estimate(values: Sequence[float], ends: Ends = ANY, is_same: bool = False) -> Estimate:
    """The mean of independent values, with Student's t interval.

    Parameters
    ----------
    values : infinite where something is never reached; the mean is over the others.
    ends : no value of this quantity lies outside.
    is_same : the values are those of one run, repeated.

    A single value has no interval, nor have values that are all equal: their scatter is unknown.
    """
    data = np.asarray(values[:1] if is_same else values, dtype=float)
    finite = data[np.isfinite(data)]
    never = len(data) - len(finite)
    if not len(finite):
        return Estimate(0, math.nan, math.nan, math.nan, never, is_same)
    # The interval of a time or of an error ends where the quantity does. Cut there, it covers the
    # true mean exactly as often as before, since that lies inside, too. A t interval of logarithms
    # reaches hundreds of times too far up with two values.
    low, high = np.clip(_t_interval(finite), *ends).tolist()
    return Estimate(len(finite), float(finite.mean()), low, high, never, is_same)


def difference(
    values: Values,
    baseline: Values,
    test: Test = "auto",
    *,
    is_same: bool = False,
    is_skewed: bool | None = None,
    margin: float = 0.0,
) -> PairedDifference:
    """The difference ``values - baseline`` over the seeds on which both have a value.

    Parameters
    ----------
    values, baseline : one value per seed, in the same order of seeds; None for a missing value,
        infinity for one that is never reached, or that of a run that failed.
    is_same : both sides repeat one run with every seed; there is nothing to test.
    is_skewed : whether ``auto`` takes ranks; by default, whether the values look skewed.
    margin : the smallest difference that counts.
    """
    if is_same:
        values, baseline = values[:1], baseline[:1]
    pairs = [(a, b) for a, b in zip(values, baseline, strict=True) if None not in (a, b)]
    first, second = np.array(pairs, dtype=float).reshape(len(pairs), 2).T
    apart = _apart(first, second)
    scale = _scale(first, second, apart, test, is_skewed)
    if scale == "log ranks":
        with np.errstate(divide="ignore", invalid="ignore"):  # inf / inf, which is equal
            apart = np.where(apart == 0.0, 0.0, np.log(np.where(apart == 0.0, 1.0, first / second)))
        margin = math.log1p(margin / float(np.median(second[np.isfinite(second)])))
    finite = apart[np.isfinite(apart)]
    centre, low, high = _middle(finite, scale)
    if len(finite) < len(apart):
        low = high = math.nan  # of a part of the pairs, an interval would be biased
    p = _p(apart, scale, margin, centre)
    if scale == "log ranks":
        centre, low, high, margin = (math.expm1(x) for x in (centre, low, high, margin))
    return PairedDifference(
        *(len(finite), centre, low, high, len(apart) - len(finite), is_same),
        p=p,
        pairs=len(apart),
        needed=FEWEST_T if scale == "t" else fewest(),
        scale=scale,
        margin=margin,
        is_equal=len(apart) > 0 and not apart.any(),
    )


def _apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """Differences; 0 where both are equal but for rounding, or both infinite."""
    size = np.maximum(np.abs(first), np.abs(second))
    with np.errstate(invalid="ignore"):
        differences = first - second
        is_equal = (first == second) | (np.abs(differences) <= ROUNDING * size)
    is_equal &= np.isfinite(differences) | (first == second)
    return np.where(is_equal, 0.0, differences)


def _scale(
    first: FloatArray, second: FloatArray, apart: FloatArray, test: Test, is_skewed: bool | None
) -> Scale:
    """The test to take."""
    both = np.concatenate([first, second])
    finite = both[np.isfinite(both)]
    if test == "auto" and is_skewed is None:
        # Of both sides together, which are the same numbers if the sides of a pair are exchanged:
        # a choice that looked at the differences would make the exact test inexact.
        is_skewed = len(finite) >= JUDGED and abs(_skewness(finite)) > SKEWED
    if test == "auto" and is_skewed and (both > 0.0).all() and np.isfinite(second).any():
        return "log ranks"
    if test == "ranks" or (test == "auto" and is_skewed):
        return "ranks"
    # Neither t nor its interval has a meaning with infinite differences, or without scatter.
    if not np.isfinite(apart).all():
        return "ranks"
    is_constant = len(apart) > 1 and float(np.ptp(apart)) <= ROUNDING * float(np.abs(apart).max())
    return "ranks" if is_constant else "t"


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


def _p(apart: FloatArray, scale: Scale, margin: float, centre: float) -> float:
    """p of a difference beyond the margin; NaN if there is none, or nothing to test."""
    if len(apart) < 2 or not apart.any():
        return math.nan
    if margin:
        # Against the end of the margin on the side of most differences.
        side = centre if np.isfinite(apart).all() else float(np.sign(apart).sum())
        if side == 0.0 or (abs(centre) <= margin and np.isfinite(apart).all()):
            return 1.0
        apart = apart - math.copysign(margin, side)
    if scale != "t":
        return signed_rank_p(apart)
    from scipy import special

    t = abs(float(apart.mean())) / _standard_error(apart)
    return 2.0 * float(special.stdtr(len(apart) - 1, -t))


def _t_interval(data: FloatArray) -> tuple[float, float]:
    if len(data) < 2 or np.ptp(data) <= ROUNDING * np.abs(data).max():
        return math.nan, math.nan
    from scipy import special

    mean, t = float(data.mean()), float(special.stdtrit(len(data) - 1, 0.5 + 0.5 * CONFIDENCE))
    half = t * _standard_error(data)
    return mean - half, mean + half


def _standard_error(data: FloatArray) -> float:
    """That of the mean of independent values."""
    return float(data.std(ddof=1)) / math.sqrt(len(data))


def is_same_run(signals: Sequence[str]) -> bool:
    """Whether several runs recorded the same signals, to the bit: the seed changes nothing.

    Parameters
    ----------
    signals : a hash of what each run recorded; '' where it is not known.
    """
    return len(signals) > 1 and signals[0] != "" and len(set(signals)) == 1


@lru_cache
def fewest(level: float = LEVEL) -> int:
    """The smallest number of pairs for which an exact test of signs can be significant.

    With n pairs, 2 of the 2^n equally likely patterns of signs are the most extreme: p >= 2 / 2^n.
    """
    pairs = 1
    while sign_test(pairs, 0) >= level:
        pairs += 1
    return pairs


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


def is_significant(p: float | None) -> bool:
    """Whether a p value is below the level; False if there is none."""
    return p is not None and p < LEVEL


def number_or_none(value: float) -> float | None:
    """A number as JSON holds it: None for NaN and infinity."""
    return value if math.isfinite(value) else None
