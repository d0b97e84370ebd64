"""The steps of a Kalman filter on covariances, in loops that round alike under both engines.

In: covariances P (n, n) and R (p, p), slopes C (p, n) and A (n, n). Out: gains and covariances::

    weight = kalman_gain(p, c, r)
    p = propagated(a, corrected_covariance(p, c, weight, r), q)
"""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray, small_eliminate, small_product, transposed


def kalman_gain(p: FloatArray, c: FloatArray, r: FloatArray) -> FloatArray:
    """K = P C' (C P C' + R)^-1, (n, p), of P (n, n), C (p, n) and R (p, p).

    Raises
    ------
    ArithmeticError : C P C' + R is singular; a definite R keeps it from that, overflow apart.
    """
    crossed = small_product(p, transposed(c))
    innovation = small_product(c, crossed) + r
    # K S = P C', so that S' K' = C P' is solved for K'.
    gain = transposed(crossed)
    if not small_eliminate(transposed(innovation), gain):
        raise ArithmeticError("the covariance of the innovation is singular")
    return transposed(gain)


def corrected_covariance(
    p: FloatArray, c: FloatArray, gain: FloatArray, r: FloatArray
) -> FloatArray:
    """(I - K C) P (I - K C)' + K R K', (n, n).

    Joseph's form: the shorter (I - K C) P loses symmetry by rounding, and in time definiteness.
    """
    rest = np.eye(len(p)) - small_product(gain, c)
    noise = small_product(small_product(gain, r), transposed(gain))
    return propagated(rest, p, noise)


def propagated(a: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """A P A' + Q, (n, n)."""
    return small_product(small_product(a, p), transposed(a)) + q
