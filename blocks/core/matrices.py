"""Matrices times vectors, with the same bits on every processor."""

from __future__ import annotations

import numpy as np

from blocks.core.kernels import kernel_of
from blocks.core.signals import FloatArray


def times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """The product (m,) of a matrix (m, n) and a vector (n,); see ``portable.product``."""
    return np.asarray(np.einsum("ij,j->i", matrix, vector))


def covariance_fault(matrix: FloatArray, definite: bool = False) -> str:
    """Why a square matrix (n, n) is no covariance; '' if it is one.

    A covariance is symmetric and has no negative eigenvalue, and where it is inverted
    (``definite``), none that is zero. Rounding, 1e-9 of the largest number, is no fault.
    """
    if not np.isfinite(matrix).all():
        return "expected finite numbers"
    small = 1e-9 * float(np.abs(matrix).max(initial=0.0))
    if (np.abs(matrix - matrix.T) > small).any():
        i, j = np.argwhere(np.abs(matrix - matrix.T) > small)[0].tolist()
        a, b = float(matrix[i, j]), float(matrix[j, i])
        return f"a covariance is symmetric, but [{i}][{j}] is {a:g} and [{j}][{i}] is {b:g}"
    least = float(np.linalg.eigvalsh(matrix).min(initial=np.inf))
    if least < -small or (definite and least <= 0.0):
        word = "positive" if definite else "not negative"
        return f"the variances of a covariance are {word} in all directions; one is {least:g}"
    return ""


@kernel_of(times)
def _times_kernel(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    out = np.zeros(len(matrix))
    for i in range(len(matrix)):
        total = 0.0
        for j in range(len(vector)):
            total += matrix[i, j] * vector[j]
        out[i] = total
    return out
