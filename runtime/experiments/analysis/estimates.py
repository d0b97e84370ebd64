"""What statistics find: estimates and differences with their intervals, and Student's t.

In: numbers. Out: an :class:`Estimate` or a :class:`PairedDifference`, as plain data and back; every
interval by t, of one sample or of several that are crossed, is that of :func:`t_interval`::

    standard_error([1.0, 2.0, 3.0])  ->  0.577, 2 degrees of freedom
    t_interval(2.0, 0.577, 2)        ->  [-0.48, 4.48]
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np

from blocks.core import FloatArray
from runtime.experiments.analysis.ranks import fewest

CONFIDENCE = 0.95
LEVEL = 1.0 - CONFIDENCE  # of significance
Scale = Literal["t", "ranks", "log ranks", "log t"]  # what auto takes; "log t" in contests
FEWEST_T = 3  # of two, the scatter is one number: two equal differences would be certainty
ROUNDING = 1e-9  # relative: values that differ by less are equal
Ends = tuple[float, float]
ANY: Ends = (-math.inf, math.inf)


@dataclass(frozen=True)
class Margin:
    """The smallest difference that counts: in the unit of the values, or a share of the others.

    A share of 5 % holds ratios between 1/1.05 and 1.05, so that exchanging the two sides changes
    no verdict.
    """

    size: float = 0.0
    is_share: bool = False

    @classmethod
    def of(cls, written: Margin | float | str) -> Margin:
        """From an entry such as ``0.001`` or ``5%``."""
        if isinstance(written, Margin):
            return written
        if isinstance(written, str):
            return cls(float(written.removesuffix("%")) / 100.0, True)
        return cls(written)

    def offsets(self, second: FloatArray, is_log: bool) -> tuple[FloatArray, FloatArray]:
        """How far its upper and its lower end are from the values of the other side.

        Of a share, these are differences from 1.05 times each value of the other side, and not from
        a share of its estimated mean, which would be taken for exact (Fieller, 1954).
        """
        if not self.is_share or is_log:
            size = math.log1p(self.size) if is_log else self.size
            return np.full(second.shape, size), np.full(second.shape, size)
        up, down = self.size * second, second * self.size / (1.0 + self.size)
        return (-down, -up) if second.sum() < 0.0 else (up, down)

    def in_unit(self, second: FloatArray, is_log: bool) -> float:
        """The margin as differences are given: in the unit of the values, or a ratio less 1."""
        known = second[np.isfinite(second)]
        if not self.is_share or is_log:
            return self.size
        return self.size * abs(float(known.mean())) if len(known) else 0.0


@dataclass(frozen=True)
class Estimate:
    """A mean of ``n`` values with the ends of its confidence interval, NaN where it has none.

    Parameters
    ----------
    never : values that are infinite (never settled); the mean is over the others.
    is_same : every seed gave the same run, so that all of them are one value.
    failed : values that are those of runs that failed; they are not among ``never``.
    """

    n: int
    mean: float
    low: float
    high: float
    never: int = 0
    is_same: bool = False
    failed: int = 0

    def to_dict(self) -> dict[str, Any]:
        """The estimate as plain data."""
        ends = {name: number_or_none(getattr(self, name)) for name in ("mean", "low", "high")}
        counts = {"never": self.never, "failed": self.failed, "identical": self.is_same}
        return {"n": self.n, **ends, **counts}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """An estimate from its plain data, also from those of earlier versions."""
        return cls(
            n=stored["n"],
            mean=number_or_nan(stored["mean"]),
            low=number_or_nan(stored.get("low")),
            high=number_or_nan(stored.get("high")),
            never=stored.get("never", 0),
            is_same=stored.get("identical", False),
            failed=stored.get("failed", 0),
        )

    def is_over(self, runs: int) -> bool:
        """Whether the mean is over that many runs."""
        return self.n == (1 if self.is_same else runs)


@dataclass(frozen=True)
class PairedDifference(Estimate):
    """A typical paired difference; ``p`` is the probability of one as large by chance alone.

    Parameters
    ----------
    mean : by t the mean; by ranks the Hodges-Lehmann estimate, with ``log ranks`` of the ratio
        less 1. Where one side of a pair is infinite it is of all pairs, and may be infinite, too.
    pairs : that were tested, with those in which one is infinite.
    needed : so many pairs are needed for any result of the test to be significant; more if infinite
        values are against the others, since these have the largest ranks.
    against : how many are.
    scale : the test that was taken.
    margin : the smallest difference that counts; ``p`` is of a larger one.
    is_negligible : the difference lies within the margin: both one-sided tests at 2.5 % say so
        (Schuirmann, 1987).
    is_of_these : of a contest in which a method was tuned once, ``p`` is of these controllers.
    """

    p: float = math.nan
    pairs: int = 0
    needed: int = 0
    scale: Scale = "t"
    margin: float = 0.0
    is_equal: bool = False
    is_negligible: bool = False
    against: int = 0
    is_of_these: bool = False

    def to_dict(self) -> dict[str, Any]:
        p = None if self.is_of_these else number_or_none(self.p)
        tested = {"p": p, "pairs": self.pairs, "needed": self.needed}
        own = super().to_dict()
        del own["failed"]  # of two runs, either may have failed
        return {**own, **tested, "test": self.scale, "margin": self.margin}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """A difference from its plain data, also from those of earlier versions."""
        needed = stored.get("needed", 0)
        is_by_t = stored.get("test", "t") == "t"
        # So many of the others need as many pairs.
        against = 0 if is_by_t else next(i for i in range(needed + 1) if fewest(LEVEL, i) >= needed)
        return replace(
            super().from_dict({"n": 0, "mean": None, **stored}),
            p=number_or_nan(stored.get("p")),
            pairs=stored.get("pairs", 0),
            needed=needed,
            scale=stored.get("test", "t"),
            margin=stored.get("margin", 0.0),
            is_equal=stored.get("verdict") == "equal",
            against=against,
            is_of_these="p_of_these" in stored,
        )

    @property
    def is_too_small(self) -> bool:
        """Whether there are too few pairs for any result to be significant."""
        return 0 < self.pairs < self.needed and not self.is_same and not self.is_equal

    @property
    def is_ratio(self) -> bool:
        """Whether it is of a ratio, less 1."""
        return self.scale.startswith("log")

    @property
    def of(self) -> int:
        """How many pairs the difference is over: by ranks, infinite ones count."""
        return self.pairs if self.never else self.n


def standard_error(*samples: FloatArray) -> tuple[float, float]:
    """That of the sum of the means of independent samples, and its degrees of freedom.

    Of several samples these are Satterthwaite's (1946). A sample of one value adds nothing.
    """
    parts = [(float(x.std(ddof=1)) / math.sqrt(len(x)), len(x) - 1) for x in samples if len(x) > 1]
    if len(parts) == 1:
        return parts[0]
    error = math.hypot(*(part for part, _ in parts))
    if not error:
        return 0.0, math.inf
    return error, error**4 / sum(part**4 / freedom for part, freedom in parts)


def t_interval(centre: float, error: float, freedom: float) -> tuple[float, float]:
    """Student's interval of a mean with this standard error."""
    half = t_quantile(freedom) * error
    return centre - half, centre + half


def t_quantile(freedom: float) -> float:
    """How many standard errors an interval reaches to either side."""
    from scipy import special

    return float(special.stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE))


def t_p(ratio: float, freedom: float) -> float:
    """Two-sided p value of a mean of so many standard errors."""
    from scipy import special

    return 2.0 * float(special.stdtr(freedom, -abs(ratio)))


def is_significant(p: float | None) -> bool:
    """Whether a p value is below the level; False if there is none."""
    return p is not None and p < LEVEL


def number_or_none(value: float) -> float | None:
    """A number as JSON holds it: None for NaN and infinity."""
    return value if math.isfinite(value) else None


def number_or_nan(value: float | None) -> float:
    """A number from JSON: NaN for None."""
    return math.nan if value is None else value
