"""Linear systems in continuous time as systems in discrete time.

Numerator and denominator in s, or matrices, go in with a method and a step; those of the sampled
system come out. Of 1 / (s + 1) with a step of 0.1: by ``zoh`` 0.0952 / (z - 0.905), which is exact
where the input holds between ticks; by ``tustin`` (z + 1) / (21 z - 19); by ``matched`` the pole of
``zoh`` and its gain at rest.
"""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray

METHODS = ("tustin", "zoh", "matched")
Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def sampled_rational(
    numerator: FloatArray, denominator: FloatArray, method: str, step: float
) -> tuple[FloatArray, FloatArray]:
    """Coefficients of a transfer function in z, the highest power first."""
    if method == "matched":
        return _matched(numerator, denominator, step)
    from scipy.signal import cont2discrete

    numerators, made, _ = cont2discrete((numerator, denominator), step, method=method)
    b, a = np.atleast_2d(numerators)[0], np.asarray(made)
    # Coefficients that are zero but for rounding would be a feedthrough that closes loops.
    b = np.where(np.abs(b) < 1e-14 * np.abs(b).max(initial=0.0), 0.0, b)
    return b, a


def sampled_matrices(matrices: Matrices, method: str, step: float) -> Matrices:
    """A, B, C and D of a system in discrete time, by ``zoh`` or ``tustin``."""
    from scipy.signal import cont2discrete

    a, b, c, d, _ = cont2discrete(matrices, step, method=method)
    return a, b, c, d


def _matched(
    numerator: FloatArray, denominator: FloatArray, step: float
) -> tuple[FloatArray, FloatArray]:
    """Poles and zeros as z = exp(s step), and the gain at low frequencies.

    Of the zeros at infinity all but one are at z = -1, so that a system without feedthrough has
    none (Franklin, Powell and Workman, Digital control of dynamic systems, 1998, section 6.2).
    """
    significant = np.trim_zeros(numerator, "f")
    zeros, poles = np.roots(significant), np.roots(denominator)
    missing = len(poles) - len(zeros)
    b = np.real(np.poly(np.concatenate((np.exp(zeros * step), -np.ones(max(0, missing - 1))))))
    a = np.real(np.poly(np.exp(poles * step)))
    # Gains are compared for s near 0, where z - 1 is s times the step: factors of s cancel so.
    of_zeros = [np.abs(r * step) > 1e-9 for r in zeros]
    of_poles = [np.abs(r * step) > 1e-9 for r in poles]
    gain = significant[0] / denominator[0]
    gain *= np.real(np.prod(-zeros[of_zeros]) / np.prod(-poles[of_poles]))
    other = np.prod(1.0 - np.exp(zeros[of_zeros] * step)) * 2.0 ** max(0, missing - 1)
    other /= np.prod(1.0 - np.exp(poles[of_poles] * step))
    gain *= step ** (sum(map(int, of_zeros)) - len(zeros) + len(poles) - sum(map(int, of_poles)))
    return np.atleast_1d(gain / np.real(other) * b), a
