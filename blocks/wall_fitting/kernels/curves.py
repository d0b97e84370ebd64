"""Kernels of :mod:`blocks.wall_fitting.curves`."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import BoolArray, FloatArray, IntArray
from blocks.wall_fitting.bspline import control_points
from blocks.wall_fitting.curves import ALONG, CALM, MOST, SMOOTHING, STEP
from blocks.wall_fitting.kernels.bspline import even_basis, fit_kernel, positions, spread
from blocks.wall_fitting.kernels.offset import cap_kernel, nearest_kernel, tangents_kernel, unit


def coarseness(arc: FloatArray, bounds: IntArray) -> float:
    """The distance (m) of samples along curves: more where there is much to sample."""
    total = 0.0
    for c in range(1, len(bounds)):
        total += arc[bounds[c] - 1]
    return max(STEP, total / MOST)


def fitted_points(
    returns: FloatArray,
    bounds: IntArray,
    arc: FloatArray,
    degree: int,
    spacing: float,
    shortest: float,
) -> tuple[FloatArray, IntArray]:
    """Control points of least-squares fits, (n, 2), and their bounds; none for a short chain."""
    control = np.empty((len(returns), 2))
    first = np.zeros(len(bounds), np.int64)
    for c in range(len(bounds) - 1):
        begin, stop = bounds[c], bounds[c + 1]
        first[c + 1] = first[c]
        length = arc[stop - 1]
        if length < shortest:
            continue
        n = min(control_points(length, spacing, degree), stop - begin)
        points = fitted(returns, arc, begin, stop, n, min(degree, n - 1))
        for i in range(n):
            control[first[c] + i, 0], control[first[c] + i, 1] = points[i, 0], points[i, 1]
        first[c + 1] += n
    return control[: first[-1]], first


def fitted(
    returns: FloatArray, arc: FloatArray, begin: int, stop: int, points: int, degree: int
) -> FloatArray:
    """Control points (points, 2) of the smoothed fit to a chain's points."""
    m = stop - begin
    data = np.empty((m, 2))
    first = np.empty(m, np.int64)
    values = np.empty((m, degree + 1))
    for i in range(m):
        data[i, 0], data[i, 1] = returns[begin + i, 2], returns[begin + i, 3]
        t = arc[begin + i] / arc[stop - 1]
        first[i] = spread(t, points - degree, degree, values[i])
    # A straight line through two points needs no fit.
    return data if points == 2 else fit_kernel(first, values, data, points, SMOOTHING * m / points)


def wall_curves_kernel(
    control: FloatArray,
    first: IntArray,
    returns: FloatArray,
    bounds: IntArray,
    arc: FloatArray,
    degree: int,
    each: int,
    shortest: float,
) -> tuple[FloatArray, IntArray]:
    """The curves of all chains and their bounds, from their control points and their bounds.

    A curve's rows are position, tangent and direction of travel, (n, 6).
    ``each`` samples for a control point; a chain shorter than ``shortest`` (m) is a post.
    """
    ends = np.zeros(len(bounds), np.int64)
    for c in range(len(bounds) - 1):
        n = first[c + 1] - first[c]
        ends[c + 1] = ends[c] + (1 if arc[bounds[c + 1] - 1] < shortest else each * n)
    curves = np.empty((ends[-1], 6))
    for c in range(len(bounds) - 1):
        if arc[bounds[c + 1] - 1] < shortest:
            post(returns, bounds[c], bounds[c + 1], curves, ends[c])
            continue
        points = control[first[c] : first[c + 1]]
        n = len(points)
        at, values = even_basis(n, min(degree, n - 1), each * n)
        position = positions(at, values, points)
        m = each * n
        tangent = tangents_kernel(position, min(CALM, m))
        reach = max(CALM, round(ALONG * m / arc[bounds[c + 1] - 1]))
        travel = tangents_kernel(position, min(reach, m))
        for i in range(m):
            row = ends[c] + i
            for d in range(2):
                curves[row, d] = position[i, d]
                curves[row, 2 + d], curves[row, 4 + d] = tangent[i, d], travel[i, d]
    return curves, ends


def post(returns: FloatArray, begin: int, stop: int, curves: FloatArray, row: int) -> None:
    """A chain too short for a curve: its middle, square to the beam, as one row."""
    x, y = 0.0, 0.0
    for i in range(begin, stop):
        x += returns[i, 2]
        y += returns[i, 3]
    x, y = x / (stop - begin), y / (stop - begin)
    curves[row, 0], curves[row, 1] = x, y
    curves[row, 2], curves[row, 3] = unit(-y, x)
    curves[row, 4], curves[row, 5] = curves[row, 2], curves[row, 3]


def offset_rows(
    curves: FloatArray, bounds: IntArray, edges: BoolArray, distance: float
) -> tuple[FloatArray, IntArray]:
    """Curves moved to the left and continued around edges: rows (m, 4) and the curves' bounds."""
    room = math.ceil(math.pi * distance / (2.0 * STEP))
    rows = np.empty((len(curves) + 2 * len(edges) * room, 4))
    ends = np.zeros(len(bounds), np.int64)
    for c in range(len(edges)):
        n = ends[c]
        if edges[c, 0]:
            n = cap_kernel(curves[bounds[c]], distance, 2.0 * STEP, 1.0, rows, n)
        for i in range(bounds[c], bounds[c + 1]):
            rows[n, 0] = curves[i, 0] - distance * curves[i, 3]
            rows[n, 1] = curves[i, 1] + distance * curves[i, 2]
            rows[n, 2], rows[n, 3] = curves[i, 4], curves[i, 5]
            n += 1
        if edges[c, 1]:
            n = cap_kernel(curves[bounds[c + 1] - 1], distance, 2.0 * STEP, -1.0, rows, n)
        ends[c + 1] = n
    return rows[: ends[-1]], ends


def offset_pieces_kernel(
    rows: FloatArray,
    ends: IntArray,
    curves: FloatArray,
    bounds: IntArray,
    returns: FloatArray,
    closest: float,
    incidence: float,
) -> IntArray:
    """First and past-the-last row of each piece to follow, (pieces, 2).

    A piece has more than two rows, none of them nearer to a wall than ``closest`` (m) or hidden.
    """
    wall = np.empty((len(curves), 2))
    m = 0
    for c in range(len(bounds) - 1):
        for i in range(bounds[c], bounds[c + 1], 2):
            wall[m, 0], wall[m, 1] = curves[i, 0], curves[i, 1]
            m += 1
    away = nearest_kernel(rows, wall[:m])
    pieces = np.empty((len(rows), 2), np.int64)
    n = 0
    for c in range(len(ends) - 1):
        begin = ends[c]
        for i in range(ends[c], ends[c + 1]):
            visible = away[i] >= closest and not is_hidden(
                rows[i, 0], rows[i, 1], returns, incidence
            )
            stop = i + 1 if visible else i
            if not visible or stop == ends[c + 1]:
                if stop - begin > 2:
                    pieces[n, 0], pieces[n, 1] = begin, stop
                    n += 1
                begin = i + 1
    return pieces[:n]


def is_hidden(x: float, y: float, returns: FloatArray, incidence: float) -> bool:
    """Whether a point lies behind the returns on either side of it."""
    phi = (math.atan2(y, x) - returns[0, 1]) % math.tau + returns[0, 1]
    low, high = 0, len(returns)
    while low < high:
        middle = (low + high) // 2
        if returns[middle, 1] < phi:
            low = middle + 1
        else:
            high = middle
    after = min(max(low, 1), len(returns) - 1)
    before, behind = returns[after - 1, 1], returns[after, 1]
    if phi < before or phi > behind or behind - before >= incidence:
        return False
    front = max(returns[after - 1, 0], returns[after, 0])
    return bool(math.hypot(x, y) > front)
