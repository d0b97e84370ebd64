"""The Riccati equation of :mod:`blocks.control.lqr` as kernels for small matrices."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray


def turned(q: FloatArray, heading: float) -> FloatArray:
    """A weight on x, y and theta as it is in a frame with this heading, (3, 3)."""
    c, s = math.cos(heading), math.sin(heading)
    turn = identity(3)
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = c, -s, s, c
    return product(product(transposed(turn), q), turn)


def riccati_kernel(
    a: FloatArray,
    b: FloatArray,
    q: FloatArray,
    r: FloatArray,
    tolerance: float,
    max_iterations: int,
) -> FloatArray:
    n = len(a)
    g = transposed(b)
    eliminate(r.copy(), g)
    g, power, p, iterations = product(b, g), a.copy(), q.copy(), 1
    while iterations < max_iterations:
        w = identity(n)
        if not eliminate(total(identity(n), product(g, p)), w):
            break
        pw, back = product(power, w), transposed(power)
        change = product(product(product(back, p), w), power)
        g = total(g, product(product(pw, g), back))
        power = product(pw, power)
        grown = 0.0
        for i in range(n):
            for j in range(n):
                p[i, j] += 0.5 * (change[i, j] + change[j, i])
                if not math.isfinite(p[i, j]):
                    raise ValueError("the Riccati equation has overflowed at this heading")
                grown = max(grown, abs(change[i, j]))
        iterations *= 2
        if grown <= tolerance * greatest(p):
            return p
    raise ValueError("the Riccati equation has not converged at this heading")


def refined_kernel(
    a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray, p: FloatArray
) -> FloatArray:
    n = len(a)
    k = feedback_gain_kernel(a, b, r, p)
    bk = product(b, k)
    f = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            f[i, j] = a[i, j] - (1.0 if i == j else 0.0) - bk[i, j]
    back, cost = transposed(f), product(product(transposed(k), r), k)
    left, right = product(back, p), product(p, f)
    both = product(left, f)
    operator, step = np.empty((n * n, n * n)), np.empty((n * n, 1))
    for row in range(n * n):
        i, h = row // n, row % n
        step[row, 0] = -(q[i, h] + cost[i, h] + left[i, h] + right[i, h] + both[i, h])
        for column in range(n * n):
            j, m = column // n, column % n
            entry = back[i, j] * back[h, m]
            entry += back[i, j] if h == m else 0.0
            entry += back[h, m] if i == j else 0.0
            operator[row, column] = entry
    if not eliminate(operator, step) or greatest(step) > 1e-6 * greatest(p):
        return p
    better = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            better[i, j] = p[i, j] + 0.5 * (step[i * n + j, 0] + step[j * n + i, 0])
    return better


def feedback_gain_kernel(a: FloatArray, b: FloatArray, r: FloatArray, p: FloatArray) -> FloatArray:
    back = product(transposed(b), p)
    k = product(back, a)
    eliminate(total(r, product(back, b)), k)
    return k


def eliminate(matrix: FloatArray, sides: FloatArray) -> bool:
    """Solve matrix x = sides (n, m) by Gauss-Jordan elimination; x replaces sides.

    Returns
    -------
    bool : False if the matrix is singular; both arrays are then invalid.
    """
    n = len(matrix)
    for column in range(n):
        best = column
        for row in range(column + 1, n):
            if abs(matrix[row, column]) > abs(matrix[best, column]):
                best = row
        pivot = matrix[best, column]
        if pivot == 0.0:
            return False
        exchange(matrix, best, column)
        exchange(sides, best, column)
        for row in range(n):
            if row != column:
                factor = matrix[row, column] / pivot
                reduce(matrix, row, column, factor)
                reduce(sides, row, column, factor)
    for row in range(n):
        for j in range(sides.shape[1]):
            sides[row, j] /= matrix[row, row]
    return True


def reduce(matrix: FloatArray, row: int, by: int, factor: float) -> None:
    """Take a multiple of one row from another, in place."""
    for j in range(matrix.shape[1]):
        matrix[row, j] -= factor * matrix[by, j]


def exchange(matrix: FloatArray, first: int, second: int) -> None:
    """Exchange two rows in place."""
    for j in range(matrix.shape[1]):
        matrix[first, j], matrix[second, j] = matrix[second, j], matrix[first, j]


def identity(n: int) -> FloatArray:
    matrix = np.zeros((n, n))
    for i in range(n):
        matrix[i, i] = 1.0
    return matrix


def transposed(matrix: FloatArray) -> FloatArray:
    """A copy, rows for columns."""
    copy = np.empty((matrix.shape[1], matrix.shape[0]))
    for i in range(copy.shape[0]):
        for j in range(copy.shape[1]):
            copy[i, j] = matrix[j, i]
    return copy


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    found = np.empty((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            entry = 0.0
            for k in range(a.shape[1]):
                entry += a[i, k] * b[k, j]
            found[i, j] = entry
    return found


def total(a: FloatArray, b: FloatArray) -> FloatArray:
    found = np.empty(a.shape)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            found[i, j] = a[i, j] + b[i, j]
    return found


def greatest(matrix: FloatArray) -> float:
    """The largest size of an entry."""
    found = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            found = max(found, abs(matrix[i, j]))
    return found
