"""Means, paired differences and their significance.

In: one value per seed, None where a run has none, infinity where something was never reached. Out:
an :class:`Estimate`, a :class:`PairedDifference`, or p values::

    estimate([1.0, 2.0, 3.0])                          ->  mean 2, [-0.48, 4.48]
    difference([2.0, 2.1, math.inf], [1.0, 1.2, 1.1])  ->  mean 0.95; the sign test, since one never

Why these tests. Variants run with the same seeds, so that a pair shares its noise and its neurons;
a test of two independent samples would count that shared noise as scatter, and find less. Student's
t is the default: with the 3 to 20 seeds of an experiment a percentile bootstrap covers the mean too
rarely (70 instead of 95 % with three values). Without normal differences, or with infinite ones,
signs are all that remains (Lehmann and Romano, Testing Statistical Hypotheses, 4.9).

``scipy.stats`` takes 0.6 s to import, so it is used for what is not a line of ``scipy.special``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from blocks.core import FloatArray

CONFIDENCE = 0.95
LEVEL = 1.0 - CONFIDENCE  # of significance
RESAMPLES = 9999
Test = Literal["t", "bootstrap"]
TESTS: dict[Test, str] = {
    "t": "paired t",
    "bootstrap": "bootstrap (BCa) with a sign-flip permutation test",
}
CORRECTION = "Benjamini-Hochberg"
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

    def to_dict(self) -> dict[str, float | bool | None]:
        """The estimate as plain data."""
        ends = {name: number_or_none(getattr(self, name)) for name in ("mean", "low", "high")}
        return {"n": self.n, **ends, "never": self.never, "identical": self.is_same}

    def is_over(self, runs: int) -> bool:
        """Whether the mean is over that many runs."""
        return self.n == (1 if self.is_same else runs)


@dataclass(frozen=True)
class PairedDifference(Estimate):
    """A mean paired difference; ``p`` is the probability of one as large by chance alone.

    Parameters
    ----------
    pairs : that were tested, with those in which one is infinite.
    needed : so many pairs are needed for any result of the test to be significant.
    """

    p: float = math.nan
    pairs: int = 0
    needed: int = 0

    def to_dict(self) -> dict[str, float | bool | None]:
        tested = {"p": number_or_none(self.p), "pairs": self.pairs, "needed": self.needed}
        return {**super().to_dict(), **tested}

    @property
    def is_too_small(self) -> bool:
        """Whether there are too few pairs for any result to be significant."""
        return 0 < self.pairs < self.needed and not self.is_same


def estimate(
    values: Sequence[float], test: Test = "t", ends: Ends = ANY, is_same: bool = False
) -> Estimate:
    """The mean of independent values, by Student's t or by a bootstrap.

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
    # reaches hundreds of times too far up with two values, and a percentile bootstrap of three
    # covers 70 instead of 95 %.
    low, high = np.clip(_interval(finite, test), *ends).tolist()
    return Estimate(len(finite), float(finite.mean()), low, high, never, is_same)


def difference(
    values: Values, baseline: Values, test: Test = "t", is_same: bool = False
) -> PairedDifference:
    """The mean of ``values - baseline`` over the seeds on which both have a value.

    Parameters
    ----------
    values, baseline : one value per seed, in the same order of seeds; None for a missing value,
        infinity for one that is never reached.
    test : ``t`` for a paired t test; ``bootstrap`` for a BCa interval, with the p value of a
        permutation test that flips signs. If a value is infinite, or all differences are equal,
        neither applies: the test is the sign test, for which only the direction counts.
    is_same : both sides repeat one run with every seed; there is nothing to test.
    """
    if is_same:
        values, baseline = values[:1], baseline[:1]
    pairs = [(a, b) for a, b in zip(values, baseline, strict=True) if None not in (a, b)]
    # Never reached on both sides: no difference, as inf - inf is not.
    differences = np.array(
        [0.0 if a == b else a - b for a, b in pairs if a is not None and b is not None], dtype=float
    )
    finite = [a - b for a, b in pairs if a is not None and b is not None and math.isfinite(a - b)]
    paired = estimate(finite, test, is_same=is_same)
    only_signs = len(finite) < len(pairs) or (len(differences) > 1 and _is_constant(differences))
    return PairedDifference(
        *(paired.n, paired.mean, paired.low, paired.high, len(differences) - len(finite), is_same),
        p=_p(differences, test, only_signs),
        pairs=len(differences),
        needed=fewest() if test == "bootstrap" or only_signs else 2,
    )


def is_same_run(signals: Sequence[str]) -> bool:
    """Whether several runs recorded the same signals, to the bit: the seed changes nothing.

    Parameters
    ----------
    signals : a hash of what each run recorded; '' where it is not known.
    """
    return len(signals) > 1 and signals[0] != "" and len(set(signals)) == 1


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


def _is_constant(data: FloatArray) -> bool:
    # After a subtraction, equal numbers may differ by rounding.
    return bool(np.ptp(data) <= 1e-12 * np.abs(data).max())


def _interval(data: FloatArray, test: Test) -> tuple[float, float]:
    mean = float(data.mean())
    if len(data) < 2 or _is_constant(data):
        return math.nan, math.nan
    if test == "bootstrap":
        from scipy import stats

        # BCa (Efron, 1987) corrects the percentile interval for bias and skewness.
        ends = stats.bootstrap(
            (data,),
            np.mean,
            confidence_level=CONFIDENCE,
            n_resamples=RESAMPLES,
            random_state=_generator(),
        ).confidence_interval
        return float(ends.low), float(ends.high)
    from scipy import special

    half = float(special.stdtrit(len(data) - 1, 0.5 + 0.5 * CONFIDENCE)) * _standard_error(data)
    return mean - half, mean + half


def _standard_error(data: FloatArray) -> float:
    """That of the mean of independent values."""
    return float(data.std(ddof=1)) / math.sqrt(len(data))


def _p(differences: FloatArray, test: Test, only_signs: bool) -> float:
    if len(differences) < 2:
        return math.nan
    # A rank test (Wilcoxon's) would use more than signs, but assumes that differences are
    # symmetric about their median, which they are not where one side can be infinite.
    if only_signs:
        return sign_test(int((differences > 0.0).sum()), int((differences < 0.0).sum()))
    if test == "bootstrap":
        from scipy import stats

        result = stats.permutation_test(
            (differences,),
            lambda x, axis: x.mean(axis=axis),
            permutation_type="samples",
            vectorized=True,
            n_resamples=RESAMPLES,
            random_state=_generator(),
        )
        return float(result.pvalue)
    from scipy import special

    t = abs(float(differences.mean())) / _standard_error(differences)
    return 2.0 * float(special.stdtr(len(differences) - 1, -t))


def _generator() -> np.random.Generator:
    """A generator with a fixed seed, so that a table is reproducible."""
    return np.random.default_rng(0)
