"""Means, paired differences and their significance.

``scipy.stats`` takes 0.6 s to import, so it is used for what is not a line of ``scipy.special``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from blocks.core import FloatArray
from runtime.terminal import number

CONFIDENCE = 0.95
LEVEL = 1.0 - CONFIDENCE  # of significance
RESAMPLES = 9999
Test = Literal["t", "bootstrap"]
TESTS: dict[Test, str] = {
    "t": "paired t",
    "bootstrap": "bootstrap (BCa) with a sign-flip permutation test",
}
CORRECTION = "Benjamini-Hochberg"


@dataclass(frozen=True)
class Estimate:
    """A mean of ``n`` values with the ends of its confidence interval, NaN where it has none."""

    n: int
    mean: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float | None]:
        """The estimate as plain data."""
        ends = {name: number_or_none(getattr(self, name)) for name in ("mean", "low", "high")}
        return {"n": self.n, **ends}


@dataclass(frozen=True)
class Difference(Estimate):
    """A mean paired difference; ``p`` is the probability of one as large by chance alone."""

    p: float


def estimate(values: Sequence[float], test: Test = "t") -> Estimate:
    """The mean of independent values, by Student's t or by a bootstrap.

    A single value has no interval; for values that are all equal it has zero width.
    """
    data = np.asarray(values, dtype=float)
    if not len(data):
        return Estimate(0, math.nan, math.nan, math.nan)
    low, high = _interval(data, test)
    return Estimate(len(data), float(data.mean()), low, high)


def difference(
    values: Sequence[float | None], baseline: Sequence[float | None], test: Test = "t"
) -> Difference:
    """The mean of ``values - baseline`` over the seeds on which both have a value.

    Parameters
    ----------
    values, baseline : one value per seed, in the same order of seeds; None for a missing value.
    test : ``t`` for a paired t test; ``bootstrap`` for a BCa interval, with the p value of a
        permutation test that flips signs.
    """
    pairs = [(a, b) for a, b in zip(values, baseline, strict=True) if None not in (a, b)]
    apart = np.array([a - b for a, b in pairs if a is not None and b is not None], dtype=float)
    found = estimate(apart.tolist(), test)
    return Difference(found.n, found.mean, found.low, found.high, _p(apart, test))


def adjusted(p: Sequence[float]) -> list[float]:
    """p values corrected for multiple comparisons (Benjamini-Hochberg); NaN stays NaN."""
    values = np.asarray(p, dtype=float)
    known = np.flatnonzero(np.isfinite(values))
    falling = known[np.argsort(-values[known], kind="stable")]
    ranks = np.arange(len(known), 0, -1)
    values[falling] = np.minimum.accumulate(values[falling] * len(known) / ranks).clip(0.0, 1.0)
    return [float(value) for value in values]


def presence(values: Sequence[float | None], baseline: Sequence[float | None]) -> float:
    """p value of McNemar's exact test: do both have a value equally often?"""
    from scipy.stats import binomtest

    pairs = list(zip(values, baseline, strict=True))
    gained = sum(a is not None and b is None for a, b in pairs)
    missed = sum(a is None and b is not None for a, b in pairs)
    if not gained + missed:
        return 1.0
    return float(binomtest(gained, gained + missed).pvalue)


def is_significant(p: float | None) -> bool:
    """Whether a p value is below the level; False if there is none."""
    return p is not None and p < LEVEL


def number_or_none(value: float) -> float | None:
    """A number as JSON holds it: None for NaN."""
    return None if math.isnan(value) else value


def interval(found: Estimate, sign: str = "") -> str:
    """The confidence interval of an estimate for users, or a dash."""
    if math.isnan(found.low):
        return "-"
    return f"[{number(found.low, sign)}, {number(found.high, sign)}]"


def _is_constant(data: FloatArray) -> bool:
    # After a subtraction, equal numbers may differ by rounding.
    return bool(np.ptp(data) <= 1e-12 * np.abs(data).max())


def _interval(data: FloatArray, test: Test) -> tuple[float, float]:
    mean = float(data.mean())
    if len(data) < 2:
        return math.nan, math.nan
    if _is_constant(data):
        return mean, mean
    if test == "bootstrap":
        from scipy import stats

        found = stats.bootstrap(
            (data,),
            np.mean,
            confidence_level=CONFIDENCE,
            n_resamples=RESAMPLES,
            random_state=_generator(),
        ).confidence_interval
        return float(found.low), float(found.high)
    from scipy import special

    half = float(special.stdtrit(len(data) - 1, 0.5 + 0.5 * CONFIDENCE)) * _standard_error(data)
    return mean - half, mean + half


def _standard_error(data: FloatArray) -> float:
    """That of the mean of independent values."""
    return float(data.std(ddof=1)) / math.sqrt(len(data))


def _p(apart: FloatArray, test: Test) -> float:
    if len(apart) < 2:
        return math.nan
    if _is_constant(apart):
        return 1.0 if not apart.any() else 0.0
    if test == "bootstrap":
        from scipy import stats

        found = stats.permutation_test(
            (apart,),
            lambda x, axis: x.mean(axis=axis),
            permutation_type="samples",
            vectorized=True,
            n_resamples=RESAMPLES,
            random_state=_generator(),
        )
        return float(found.pvalue)
    from scipy import special

    t = abs(float(apart.mean())) / _standard_error(apart)
    return 2.0 * float(special.stdtr(len(apart) - 1, -t))


def _generator() -> np.random.Generator:
    """A generator with a fixed seed, so that a table is reproducible."""
    return np.random.default_rng(0)
