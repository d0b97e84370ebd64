"""Kernels of :mod:`blocks.wall_fitting.fitter`.

Lines (n, 2) and rows of x, y, theta, kappa (n, 4) go in and come out, in the robot's frame.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import BoolArray, FloatArray, PoseValue


def nearest_row(line: FloatArray) -> int:
    """The number of the line's point that is nearest to the robot."""
    best, least = 0, math.inf
    for i in range(len(line)):
        square = line[i, 0] * line[i, 0] + line[i, 1] * line[i, 1]
        if square < least:
            best, least = i, square
    return best


def between(line: FloatArray, arc: FloatArray, low: float, high: float) -> FloatArray:
    """The part of a line where its arc length is above ``low`` and below ``high`` (m)."""
    first, last = 0, len(line)
    while first < last and not arc[first] > low:
        first += 1
    while last > first and not arc[last - 1] < high:
        last -= 1
    return line[first:last]


def against_kernel(path: FloatArray, rows: FloatArray, near: float) -> BoolArray:
    """Which rows of a path (n, 4) lie on rows (m, 4) and head against the travel there, (n,)."""
    result = np.zeros(len(path), np.bool_)
    for k in range(len(path)):
        beside, least = 0, math.inf
        for i in range(len(rows)):
            dx, dy = path[k, 0] - rows[i, 0], path[k, 1] - rows[i, 1]
            square = dx * dx + dy * dy
            if square < least:
                beside, least = i, square
        if least < near * near:
            c, s = math.cos(path[k, 2]), math.sin(path[k, 2])
            result[k] = c * rows[beside, 2] + s * rows[beside, 3] < 0.0
    return result


def sound(
    rows: FloatArray, wrong: BoolArray, step: float, sharpest: float, nearby: int, clear: int
) -> tuple[int, int]:
    """First and past-the-last row about row ``nearby`` that is ``clear`` rows from a wrong one.

    Rows are x, y, theta, kappa; wrong is also what bends or turns by more than ``sharpest`` (1/m).
    """
    low, high = 0, len(rows)
    for k in range(len(rows) - 1, -1, -1):
        turn = abs(rows[k + 1, 2] - rows[k, 2]) / step if k + 1 < len(rows) else 0.0
        if wrong[k] or max(abs(rows[k, 3]), turn) > sharpest:
            if k > nearby:
                high = k - clear
            else:
                low = max(low, k + clear)
    return low, high


def copied(rows: FloatArray, low: int, high: int) -> FloatArray:
    """The positions of rows ``low`` to ``high``, (high - low, 2)."""
    line = np.empty((high - low, 2))
    for i in range(high - low):
        line[i, 0], line[i, 1] = rows[low + i, 0], rows[low + i, 1]
    return line


def with_ends(rows: FloatArray, room: float) -> FloatArray:
    """The positions of rows (m, 4), prolonged by ``room`` (m) along the travel, (m + 2, 2)."""
    m = len(rows)
    line = np.empty((m + 2, 2))
    for c in range(2):
        line[0, c] = rows[0, c] - room * rows[0, 2 + c]
        for i in range(m):
            line[i + 1, c] = rows[i, c]
        line[m + 1, c] = rows[m - 1, c] + room * rows[m - 1, 2 + c]
    return line


def ahead(samples: int, step: float, behind: float) -> FloatArray:
    """Rows of a path straight ahead, beginning so far (m) behind the robot."""
    rows = np.zeros((samples, 4))
    for i in range(samples):
        rows[i, 0] = i * step - behind
    return rows


def placed(rows: FloatArray, pose: PoseValue, mirror: float) -> FloatArray:
    """Rows of x, y, theta, kappa in the robot's (mirrored) frame, in the world."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    result = np.empty((len(rows), 4))
    for i in range(len(rows)):
        across = mirror * rows[i, 1]
        result[i, 0] = c * rows[i, 0] - s * across + x
        result[i, 1] = s * rows[i, 0] + c * across + y
        result[i, 2] = theta + mirror * rows[i, 2]
        result[i, 3] = mirror * rows[i, 3]
    return result


def shown(curves: FloatArray, points: int, pose: PoseValue, mirror: float) -> FloatArray:
    """So many of the curves' points, in the world, (points, 2)."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    result = np.empty((points, 2))
    gap = (len(curves) - 1.0) / max(1, points - 1)
    for i in range(points):
        k = len(curves) - 1 if 0 < i == points - 1 else int(i * gap)
        across = mirror * curves[k, 1]
        result[i, 0] = c * curves[k, 0] - s * across + x
        result[i, 1] = s * curves[k, 0] + c * across + y
    return result
