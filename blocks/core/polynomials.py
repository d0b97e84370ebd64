"""expm1 and log1p as polynomials without branches: the same bits on every processor, in lanes.

Numbers or arrays go in, results of the same shape come out; no error is above 1 unit in the last
place (tests/blocks/core/test_polynomials.py has the largest ones). This is the text of compiled
code, whose loops a C compiler turns into vector instructions, as it cannot do with calls of a C
library; its results also change with that library's version::

    for j in any_order(len(x)):
        x[j] = expm1(x[j])

The Python engine takes SciPy's functions (:mod:`blocks.core.portable`): one call of NumPy instead
of forty, which for a hundred neurons would take three times as long as all of the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from blocks.core.signals import FloatArray

# ln 2 in two parts: the first has 21 trailing zeros, so that its multiples by k are exact.
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
PER_LN2 = 1.0 / math.log(2.0)
SQRT2 = math.sqrt(2.0)
# exp(x) - 1 is -1 below -40, and infinite above 710.
LEAST, MOST = -40.0, 710.0


def any_order(count: int) -> Iterable[int]:
    """``range(count)`` for a loop whose rounds may be done at once, in vector instructions.

    No round reads what another one writes, and arrays that are written share no memory with
    others. That is a promise, which nobody checks: for the kernels of this package.
    """
    return range(count)


def power_of_two(k: Any) -> Any:
    """2^k for whole floats k from -1022 to 1023; of others the result has no meaning."""
    return np.ldexp(1.0, np.asarray(k, dtype=float).astype(np.int64))


def exponent_of(x: Any) -> Any:
    """The largest whole k with 2^k <= x, for normal x above 0."""
    return np.frexp(x)[1] - 1.0


def expm1(x: Any) -> Any:
    """exp(x) - 1.

    With k = round(x / ln 2) and r = x - k ln 2, it is 2^k (1 - 2^-k + expm1(r)), expm1(r) a
    polynomial. The sum is rounded once: its terms cancel in part for k = 1.
    """
    # Not np.minimum, whose test for NaN keeps gcc from vector instructions.
    within = np.where(x < LEAST, LEAST, x)
    within = np.where(within > MOST, MOST, within)
    k = np.rint(within * PER_LN2)
    high, low = within - k * LN2_HIGH, k * LN2_LOW
    r = high - low
    lost = (high - r) - low
    tail = expm1_tail(r)
    sum_high = r + tail
    sum_low = ((r - sum_high) + tail) + (lost + lost * r)
    # Below 2^-64 it changes nothing; both factors at the end stay normal up to the largest result.
    inverse = power_of_two(np.where(k > 64.0, -64.0, -k))
    whole = 1.0 - inverse
    total = whole + sum_high
    part = total - whole
    rest = (whole - (total - part)) + (sum_high - part) + ((1.0 - whole) - inverse)
    found = (total + (rest + sum_low)) * power_of_two(k - 1.0) * 2.0
    return np.copysign(np.where(k == 0.0, sum_high, found), x)


def expm1_tail(r: Any) -> Any:
    """expm1(r) - r for |r| up to ln(2) / 2, where k is 0: r^2/2 + r^3/6 + ..."""
    square = r * r
    fourth = square * square
    # Pairs of terms first, of which a processor computes several at once.
    a = r * (1.0 / 6.0) + square * (1.0 / 24.0 + r * (1.0 / 120.0))
    b = 1.0 / 720.0 + r * (1.0 / 5040.0) + square * (1.0 / 40320.0 + r * (1.0 / 362880.0))
    c = 1.0 / 3628800.0 + r * (1.0 / 39916800.0)
    c = c + square * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0))
    return 0.5 * square + square * (a + fourth * (b + fourth * c))


def log1p(x: Any) -> Any:
    """log(1 + x); -inf at -1, NaN below.

    With 1 + x = 2^k m and m between sqrt(1/2) and sqrt(2), it is k ln 2 + log(m).
    """
    u = 1.0 + x
    exponent = exponent_of(u)
    scale = power_of_two(1.0 - exponent) * 0.5
    m = u * scale
    wide = m > SQRT2
    k = np.where(wide, exponent + 1.0, exponent)
    scale = np.where(wide, 0.5 * scale, scale)
    m = np.where(wide, 0.5 * m, m)
    # What 1 + x has lost; where k is 0, x itself is f.
    lost = np.where(k > 1.0, 1.0 - (u - x), x - (u - 1.0)) * scale
    lost = np.where(k == 0.0, 0.0, lost)
    f = np.where(k == 0.0, x, m - 1.0)
    # Divided by m, of which 1 - 2 s + 2 s^2 is the inverse to 1 %.
    s = np.divide(f, 2.0 + f)
    lost = lost - lost * (2.0 * (s - s * s))
    found = log1p_head(f, k * LN2_LOW + lost) + k * LN2_HIGH
    edge = np.where(u == 0.0, -math.inf, np.where(u > 0.0, u, math.nan))
    return np.where((u > 0.0) & (u < math.inf), np.copysign(found, x), edge)


def log1p_head(f: Any, low: Any) -> Any:
    """log(1 + f) + low for 1 + f between sqrt(1/2) and sqrt(2) and a low that is very small.

    log(1 + f) = 2 atanh(s), s = f / (2 + f), by the coefficients of FreeBSD's e_log.c.
    """
    half = 0.5 * f * f
    s = np.divide(f, 2.0 + f)
    z = s * s
    w = z * z
    even = 2.222219843214978396e-01 + w * 1.531383769920937332e-01
    even = w * (3.999999999940941908e-01 + w * even)
    odd = 1.818357216161805012e-01 + w * 1.479819860510658591e-01
    odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * odd))
    return s * (half + (odd + even)) + low - half + f


def expm1_of(x: FloatArray) -> None:
    """x = expm1(x), in place, in compiled code: the same bits, faster where all are small."""
    large = 0
    for j in any_order(len(x)):
        large += 0 if abs(x[j]) < 0.34 else 1
    if large == 0:
        for j in any_order(len(x)):
            x[j] = np.copysign(x[j] + expm1_tail(x[j]), x[j])
    else:
        for j in any_order(len(x)):
            x[j] = expm1(x[j])


def log1p_of(x: FloatArray) -> None:
    """x = log1p(x), in place, in compiled code: the same bits, faster where all are small."""
    large = 0
    for j in any_order(len(x)):
        large += 0 if abs(x[j]) < 0.29 else 1
    if large == 0:
        for j in any_order(len(x)):
            x[j] = np.copysign(log1p_head(x[j], 0.0), x[j])
    else:
        for j in any_order(len(x)):
            x[j] = log1p(x[j])
