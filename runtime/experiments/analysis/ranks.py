"""The signed-rank test and its interval: paired differences of which only the order counts.

In: differences, infinite where one side failed. Out: an exact p value, an estimate, an interval::

    signed_rank_p([0.3, 0.1, 0.2, 0.5, inf, 0.4])  ->  2 / 2^6: all of one sign
    walsh_interval([1, 2, 3, 4, 5, 6])             ->  3.5, [1, 6]

If the two sides of a pair could be exchanged, each sign is + or - with equal probability, whatever
the distribution: the p value is exact for any number of pairs, with ties and infinite differences
(Wilcoxon, 1945; Lehmann and Romano, Testing Statistical Hypotheses, 6.8 and 15.2). Inverted, the
test gives an interval for the centre of symmetric differences (Hodges and Lehmann, 1963).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from blocks.core import FloatArray

MOST_EXACT = 200  # pairs; of more, the sum of ranks is normal to four digits


def signed_rank_p(differences: FloatArray) -> float:
    """Two-sided p value of Wilcoxon's signed-rank test; 1 if no difference is left.

    Differences of 0 say nothing of the direction and are left out. Infinite ones have the largest
    ranks, which they share.
    """
    data = differences[differences != 0.0]
    if not len(data):
        return 1.0
    ranks = _doubled_ranks(np.abs(data))
    positive, total = int(ranks[data > 0.0].sum()), int(ranks.sum())
    less = min(positive, total - positive)
    if len(data) > MOST_EXACT:
        from scipy import special

        deviation = math.sqrt(float((ranks.astype(float) ** 2).sum()) / 4.0)
        return min(1.0, 2.0 * float(special.ndtr((less - total / 2.0) / deviation)))
    return min(1.0, 2.0 * float(_cumulative(tuple(sorted(ranks.tolist())))[less]))


@lru_cache
def fewest(level: float, against: int = 0) -> int:
    """The smallest number of pairs for which the test can be significant.

    With n pairs, 2 of the 2^n equally likely patterns of signs are the most extreme: p >= 2 / 2^n.

    Parameters
    ----------
    against : infinite differences that have the other sign than all the others.
    """
    pairs = against + 1
    while signed_rank_p(np.array([-np.inf] * against + [*range(1, pairs - against + 1)])) >= level:
        pairs += 1
    return pairs


def walsh_interval(data: FloatArray, level: float) -> tuple[float, float, float]:
    """The Hodges-Lehmann estimate with its interval, NaN if there are too few values for one.

    The estimate is the median of the means of all pairs of values, each with itself included. With
    infinite values it may be infinite, and so may the ends of the interval, which are values in
    this order: it still covers as often as the test says.
    """
    n = len(data)
    first, second = np.triu_indices(n)
    with np.errstate(invalid="ignore"):
        means = 0.5 * (data[first] + data[second])
        means = np.sort(np.where(np.isnan(means), 0.0, means))  # infinite of either sign
    inner = means[(len(means) - 1) // 2 : len(means) // 2 + 1]
    centre = float(inner.mean()) if np.isfinite(inner).all() else float(inner[np.isinf(inner)][0])
    if n > MOST_EXACT:
        half = 1.96 * math.sqrt(n * (n + 1) * (2 * n + 1) / 24.0)
        out = max(0, int(n * (n + 1) / 4.0 - half))
        return centre, float(means[out]), float(means[-1 - out])
    # Without ties; doubled ranks are even, so every second sum has a probability.
    below = _cumulative(tuple(range(2, 2 * n + 1, 2)))[::2]
    out = int(np.searchsorted(below, 0.5 * level, side="right")) - 1
    if out < 0:
        return centre, math.nan, math.nan
    return centre, float(means[out]), float(means[-1 - out])


def _doubled_ranks(sizes: FloatArray) -> NDArray[np.int_]:
    """Twice the rank of each size, equal ones sharing theirs: whole numbers."""
    _, inverse, counts = np.unique(sizes, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    shared: NDArray[np.int_] = (2 * last - counts + 1)[inverse]
    return shared


@lru_cache(512)
def _cumulative(ranks: tuple[int, ...]) -> FloatArray:
    """P(sum of the positive ones <= s) for s = 0, 1, ..., if all signs are equally likely."""
    chances = np.ones(1)
    for rank in ranks:
        longer = np.zeros(len(chances) + rank)
        longer[: len(chances)] = 0.5 * chances
        longer[rank:] += 0.5 * chances
        chances = longer
    cumulative: FloatArray = np.cumsum(chances)
    return cumulative
