"""Kernels of :mod:`blocks.wall_fitting.bspline`.

Of the basis, only the ``degree + 1`` functions that are not 0 at a parameter are found and kept:
``first`` (m,) is the number of the first of them at each of m parameters, ``values``
(m, degree + 1) are theirs. Normal equations are banded then.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray, IntArray
from blocks.wall_fitting.bspline import RIDGE, basis_matrices


def banded_matrices(points: int, degree: int, samples: int) -> tuple[IntArray, FloatArray]:
    """Basis and two derivatives at even parameters, their bands alone: (m,), (3, m, degree + 1).

    The numbers are those of :func:`blocks.wall_fitting.bspline.basis_matrices`. Not for
    compiled text.
    """
    dense = basis_matrices(points, degree, samples)
    first = np.minimum((dense[0] > 0.0).argmax(axis=1), points - degree - 1)
    columns = first[:, None] + np.arange(degree + 1)
    return first, np.take_along_axis(dense, columns[None], axis=2)


def knot(index: int, spans: int) -> float:
    """Knot number ``index``, counted from the last one of those at 0."""
    if index >= spans:
        return 1.0
    return index * (1.0 / spans) if index > 0 else 0.0


def spread(t: float, spans: int, degree: int, values: FloatArray) -> int:
    """Put the basis functions that are not 0 at ``t`` into ``values``; the first one's number."""
    span = min(int(t * spans), spans - 1)
    # Rounding may have put t on the other side of a knot.
    while span > 0 and t < knot(span, spans):
        span -= 1
    while span < spans - 1 and t >= knot(span + 1, spans):
        span += 1
    values[0] = 1.0
    for k in range(1, degree + 1):
        saved = 0.0
        for r in range(k):
            low, high = knot(span + 1 - k + r, spans), knot(span + 1 + r, spans)
            rising = (t - low) * (1.0 / (high - low)) * values[r]
            values[r] = saved + (values[r] - rising)
            saved = rising
        values[k] = saved
    return span


def even_basis(points: int, degree: int, samples: int) -> tuple[IntArray, FloatArray]:
    """The basis at that many even parameters."""
    first = np.empty(samples, np.int64)
    values = np.empty((samples, degree + 1))
    gap = 1.0 / (samples - 1)
    for i in range(samples):
        t = i * gap if i < samples - 1 else 1.0
        first[i] = spread(t, points - degree, degree, values[i])
    return first, values


def positions(first: IntArray, values: FloatArray, points: FloatArray) -> FloatArray:
    """The curve with control points (n, 2) where the basis was found, (m, 2)."""
    result = np.empty((len(first), 2))
    for i in range(len(first)):
        x, y = 0.0, 0.0
        for k in range(values.shape[1]):
            x += values[i, k] * points[first[i] + k, 0]
            y += values[i, k] * points[first[i] + k, 1]
        result[i, 0], result[i, 1] = x, y
    return result


def fit_kernel(
    first: IntArray, values: FloatArray, data: FloatArray, points: int, bend: float
) -> FloatArray:
    """Control points (n, 2) nearest to data (m, 2); ``bend`` weighs the squared bends, 0 for none.

    A quadratic spline at least, if bends count: the band holds three diagonals then.
    """
    width = values.shape[1]
    normal = np.zeros((points, width))
    control = np.zeros((points, 2))
    for i in range(len(data)):
        low = first[i]
        for k in range(width):
            value = values[i, k]
            control[low + k, 0] += value * data[i, 0]
            control[low + k, 1] += value * data[i, 1]
            for d in range(k + 1):
                normal[low + k, d] += value * values[i, k - d]
    if bend > 0.0:
        for i in range(points - 2):
            normal[i, 0] += bend
            normal[i + 1, 0] += 4.0 * bend
            normal[i + 2, 0] += bend
            normal[i + 1, 1] -= 2.0 * bend
            normal[i + 2, 1] -= 2.0 * bend
            normal[i + 2, 2] += bend
        for i in range(points):
            normal[i, 0] += RIDGE
    solve(normal, control)
    return control


def solve(band: FloatArray, right: FloatArray) -> None:
    """Solve a symmetric, positive definite, banded system by Cholesky, in place.

    Parameters
    ----------
    band : entry (i, d) is that of row i and column i - d, (n, width).
    right : right-hand sides, (n, 2), replaced by the solutions.
    """
    n, width = band.shape
    for i in range(n):
        for d in range(min(i, width - 1), -1, -1):
            total = band[i, d]
            for e in range(1, min(width - d, i - d + 1)):
                total -= band[i, d + e] * band[i - d, e]
            band[i, d] = total / band[i - d, 0] if d > 0 else math.sqrt(total)
        for c in range(2):
            total = right[i, c]
            for d in range(1, min(width, i + 1)):
                total -= band[i, d] * right[i - d, c]
            right[i, c] = total / band[i, 0]
    for i in range(n - 1, -1, -1):
        for c in range(2):
            total = right[i, c]
            for d in range(1, min(width, n - i)):
                total -= band[i + d, d] * right[i + d, c]
            right[i, c] = total / band[i, 0]


def arc_length_kernel(line: FloatArray) -> FloatArray:
    """Arc length (m) at each point of a polyline, (n,)."""
    arc = np.zeros(len(line))
    for i in range(1, len(line)):
        dx, dy = line[i, 0] - line[i - 1, 0], line[i, 1] - line[i - 1, 1]
        arc[i] = arc[i - 1] + math.hypot(dx, dy)
    return arc


def interpolate_kernel(
    start: float, stop: float, samples: int, at: FloatArray, values: FloatArray
) -> FloatArray:
    """Columns of ``values`` (n, c), given at rising ``at`` (n,), at even places, (samples, c)."""
    result = np.empty((samples, values.shape[1]))
    gap = (stop - start) / max(1, samples - 1)
    j = 0
    for i in range(samples):
        wanted = stop if i == samples - 1 and i > 0 else start + i * gap
        while j < len(at) - 1 and at[j + 1] <= wanted:
            j += 1
        for c in range(values.shape[1]):
            result[i, c] = values[j, c]
            if j < len(at) - 1 and wanted > at[j]:
                slope = (values[j + 1, c] - values[j, c]) / (at[j + 1] - at[j])
                result[i, c] += slope * (wanted - at[j])
    return result


def sampled_evenly_kernel(
    first: IntArray,
    bands: FloatArray,
    points: FloatArray,
    spacing: float,
    samples: int,
    start: float,
) -> FloatArray:
    """Rows of x, y, theta, kappa evenly spaced along a curve, (samples, 4).

    ``first`` and ``bands`` are those of :func:`banded_matrices`.
    """
    dense = np.zeros((len(first), 6))
    for i in range(len(first)):
        for k in range(bands.shape[2]):
            x, y = points[first[i] + k, 0], points[first[i] + k, 1]
            for d in range(3):
                dense[i, 2 * d] += bands[d, i, k] * x
                dense[i, 2 * d + 1] += bands[d, i, k] * y
    arc = arc_length_kernel(dense)
    total = arc[len(arc) - 1]
    length = (samples - 1) * spacing
    start = min(start, max(0.0, total - length))
    return directed(interpolate_kernel(start, min(start + length, total), samples, arc, dense))


def directed(samples: FloatArray) -> FloatArray:
    """Rows of x, y, theta (continuous), kappa from position and two derivatives, (n, 6)."""
    rows = np.empty((len(samples), 4))
    turns, before = 0.0, 0.0
    for i in range(len(samples)):
        dx, dy, ddx, ddy = samples[i, 2], samples[i, 3], samples[i, 4], samples[i, 5]
        theta = math.atan2(dy, dx)
        if i > 0 and abs(theta - before) >= math.pi:
            turn = (theta - before + math.pi) % math.tau - math.pi
            if turn == -math.pi and theta > before:
                turn = math.pi
            turns += turn - (theta - before)
        before = theta
        speed = math.hypot(dx, dy)
        rows[i, 0], rows[i, 1], rows[i, 2] = samples[i, 0], samples[i, 1], theta + turns
        rows[i, 3] = (dx * ddy - ddx * dy) / (speed * speed * speed) if speed > 0.0 else 0.0
    return rows
