"""Linear algebra with the same bits on every processor.

Matrices go in and come out as float64 arrays. BLAS and LAPACK sum in an order that depends on the
processor and the number of threads; what enters a simulation or a metric uses these instead::

    gain = solve(r + product(product(b.T, p), b), product(product(b.T, p), a))

A function whose NumPy is not compiled has a kernel, which is the same in loops. ``small_product``
and ``small_eliminate`` are such kernels that blocks also call by name: for matrices of two or three
rows, loops cost Python no more than NumPy's calls, and both engines then round alike; so they do in
``small_times``.
"""

from __future__ import annotations

import numpy as np

from blocks.core.kernels import kernel_of
from blocks.core.signals import FloatArray


def times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """The product (m,) of a matrix (m, n) and a vector (n,)."""
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


def small_times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """As :func:`times`, with the bits of its kernel: each entry is summed from left to right."""
    out = np.zeros(len(matrix))
    for j in range(len(vector)):
        out += matrix[:, j] * vector[j]
    return out


def dot(a: FloatArray, b: FloatArray) -> float:
    """The inner product of two vectors (n,), for compiled code.

    Four independent sums, which a processor can add at the same time.
    """
    s0 = s1 = s2 = s3 = 0.0
    last = len(a) - len(a) % 4
    for i in range(0, last, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(last, len(a)):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """The matrix product of (..., m, k) and (..., k, n), an array (..., m, n).

    Without optimisation ``einsum`` sums in NumPy's own loops, compiled once for all processors.
    Compiled blocks may multiply matrices only, not stacks of them.
    """
    return np.asarray(np.einsum("...ij,...jk->...ik", a, b))


@kernel_of(product)
def small_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """The product of (m, k) and (k, n), each entry summed from left to right."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total
    return out


def transposed(a: FloatArray) -> FloatArray:
    """A copy (n, m) of a matrix (m, n), rows for columns.

    Not a view: NumPy sums a product in an order that depends on how its operands lie in memory.
    """
    return a.T.copy()


def kron(a: FloatArray, b: FloatArray) -> FloatArray:
    """The Kronecker product (m p, n q) of (m, n) and (p, q)."""
    return np.asarray(np.kron(a, b))


@kernel_of(kron)
def _kron_kernel(a: FloatArray, b: FloatArray) -> FloatArray:
    p, q = b.shape
    out = np.empty((a.shape[0] * p, a.shape[1] * q))
    for row in range(len(out)):
        for column in range(out.shape[1]):
            out[row, column] = a[row // p, column // q] * b[row % p, column % q]
    return out


def eliminate(matrix: FloatArray, sides: FloatArray) -> bool:
    """Solve matrix x = sides by Gaussian elimination with partial pivoting; x replaces sides.

    Parameters
    ----------
    matrix : (n, n), overwritten. sides : (n, m).

    Returns
    -------
    bool : False if the matrix is singular; both arrays are then invalid.
    """
    for k in range(len(matrix)):
        pivot = k + int(np.abs(matrix[k:, k]).argmax())
        if matrix[pivot, k] == 0.0:
            return False
        for rows in (matrix, sides):
            rows[[k, pivot]] = rows[[pivot, k]]
        sides[k] /= matrix[k, k]
        matrix[k, k:] /= matrix[k, k]
        below = k + 1 + matrix[k + 1 :, k].nonzero()[0]  # few, in a matrix with bands
        sides[below] -= matrix[below, k, None] * sides[k]
        matrix[below, k:] -= matrix[below, k, None] * matrix[k, k:]
    for k in range(len(matrix) - 1, 0, -1):
        above = matrix[:k, k].nonzero()[0]
        sides[above] -= matrix[above, k, None] * sides[k]
    return True


@kernel_of(eliminate)
def small_eliminate(matrix: FloatArray, sides: FloatArray) -> bool:
    """:func:`eliminate` in loops; it divides by a pivot last, which rounds otherwise."""
    n, m = matrix.shape[0], sides.shape[1]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if matrix[pivot, k] == 0.0:
            return False
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        for j in range(m):
            sides[k, j], sides[pivot, j] = sides[pivot, j], sides[k, j]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(m):
                sides[i, j] -= factor * sides[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            total = sides[k, j]
            for i in range(k + 1, n):
                total -= matrix[k, i] * sides[i, j]
            sides[k, j] = total / matrix[k, k]
    return True


def solve(a: FloatArray, b: FloatArray) -> FloatArray:
    """The solution x (n, m) of a x = b, a (n, n) and b (n, m).

    Raises
    ------
    numpy.linalg.LinAlgError : a is singular.
    """
    x = b.copy()
    if not eliminate(a.copy(), x):
        raise np.linalg.LinAlgError("Singular matrix")
    return x


def solution(matrix: FloatArray, sides: FloatArray) -> FloatArray:
    """x (n, m) with matrix x = sides, for expressions; both arguments are overwritten.

    Raises
    ------
    ArithmeticError : the matrix is singular.
    """
    if not small_eliminate(matrix, sides):
        raise ArithmeticError("a matrix that is inverted is singular")
    return sides


def determinant(matrix: FloatArray) -> float:
    """The determinant of a matrix (n, n), which is overwritten, by elimination with pivoting."""
    n = matrix.shape[0]
    result = 1.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if matrix[pivot, k] == 0.0:
            return 0.0
        if pivot != k:
            result = -result
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        result *= matrix[k, k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
    return float(result)


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
        word = "only positive eigenvalues" if definite else "no negative eigenvalue"
        kind = "positive definite" if definite else "positive semidefinite"
        return f"a covariance has {word} (it is {kind}); the least is {least:g}"
    return ""
