"""The noise of each measured signal, and what it makes of the fitted numbers.

In: residuals and their slopes at the minimum, signal by signal. Out: the variance of each number,
and its degrees of freedom::

    a position with 0.001 of white noise, a rate with 0.1 that follows itself with r = 0.8
    ->  each with its own variance and correlation, and none for both

Least squares takes every residual for equally good. What that costs where signals are not is in the
covariance (J'J)^-1 (sum of J_k' V_k J_k) (J'J)^-1 (the sandwich: White, 1980; Seber and Wild,
Nonlinear Regression, 6.3), in which V_k is that of signal k: its variance, and a correlation of r
from one value to the next, r^2 to the one after it, and so on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blocks.core import FloatArray

EXACT = 1e-6  # of a signal's deviation: smaller differences come from the solver, not the data
# Of the standard error of a correlation that is added to it: an interval loses more by one that is
# too small than it gains by one that is as much too large.
CAUTION = 0.3


@dataclass(frozen=True)
class Noise:
    """What one signal's residuals say of its noise.

    Parameters
    ----------
    variance : of each value.
    seen : the correlation of a residual with the next one, 0 for errors of the solver.
    correlation : that of the noise: fitting takes some of it away.
    independent : so many independent values would tell as much.
    free : degrees of freedom of the variance.
    """

    variance: float
    seen: float
    correlation: float
    independent: float
    free: float


def noise_of(residuals: FloatArray, slopes: FloatArray) -> Noise:
    """The noise of one signal.

    Parameters
    ----------
    residuals : (values,) at the minimum.
    slopes : (values, numbers), their derivatives.

    It is what no change of the numbers could take away from this signal alone: what another signal
    with more noise does to the numbers is no noise of this one.
    """
    n = len(residuals)
    basis, sizes, _ = np.linalg.svd(slopes, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * max(float(sizes[0]), 1e-300)]
    own = residuals - basis @ (basis.T @ residuals)
    total, used = float(own @ own), basis.shape[1]
    if n < used + 3:  # a few values tell nothing of their own
        variance = float(residuals @ residuals) / n
        return Noise(variance, 0.0, 0.0, float(n), 1.0)
    seen = float(own[1:] @ own[:-1]) / total if total > EXACT**2 * n else 0.0
    r = 0.0
    if total > EXACT**2 * n:
        # Each fitted number takes about (1 + r) / n from it, as a mean does (Kendall, 1954).
        r = (seen + used / n) / max(1.0 - (used + 2) / n, 0.2)
        r += CAUTION * math.sqrt(max(1.0 - r * r, 0.0) / n)
        r = min(max(r, 0.0), 1.0 - 2.0 / n)
    independent = n * (1.0 - r) / (1.0 + r)
    expected = n - float(np.sum(basis * along(basis, r)))
    variance = total / max(expected, 1e-3 * n)
    return Noise(variance, max(seen, 0.0), r, independent, max(independent - used, 1.0))


def along(columns: FloatArray, r: float) -> FloatArray:
    """R @ columns, where R has r^|i - j| in row i and column j."""
    from scipy.signal import lfilter

    before = lfilter([1.0], [1.0, -r], columns, axis=0)
    after = lfilter([1.0], [1.0, -r], columns[::-1], axis=0)[::-1]
    found: FloatArray = before + after - columns
    return found


def variances(
    noises: Sequence[Noise], parts: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """The variance of each number, and its degrees of freedom (Satterthwaite, 1946).

    Parameters
    ----------
    parts : of each signal, (values, numbers): how the numbers change with each of its values.
    """
    own = [
        noise.variance * np.sum(part * along(part, noise.correlation), axis=0)
        for noise, part in zip(noises, parts, strict=True)
    ]
    total = np.sum(own, axis=0)
    shares = np.array(own) / np.where(total > 0.0, total, 1.0)
    free = np.array([[noise.free] for noise in noises])
    return total, 1.0 / np.maximum(np.sum(shares**2 / free, axis=0), 1e-12)
