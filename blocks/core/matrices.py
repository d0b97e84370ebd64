"""Matrices times vectors, with the same bits on every processor."""

from __future__ import annotations

import numpy as np

from blocks.core.kernels import kernel_of
from blocks.core.signals import FloatArray


def times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """The product (m,) of a matrix (m, n) and a vector (n,); see ``portable.product``."""
    return np.asarray(np.einsum("ij,j->i", matrix, vector))


@kernel_of(times)
def _times_kernel(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    out = np.zeros(len(matrix))
    for i in range(len(matrix)):
        total = 0.0
        for j in range(len(vector)):
            total += matrix[i, j] * vector[j]
        out[i] = total
    return out
