"""Kernels of :mod:`blocks.wall_fitting.fitter`.

Lines (n, 2) and rows of x, y, theta, kappa (n, 4) go in and come out, in the robot's frame.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray, PoseValue


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


def sound(
    rows: FloatArray, step: float, sharpest: float, nearby: int, clear: int
) -> tuple[int, int]:
    """First and past-the-last row about row ``nearby`` that is ``clear`` rows from a sharp one.

    Rows are x, y, theta, kappa; sharp is what bends or turns by more than ``sharpest`` (1/m).
    """
    low, high = 0, len(rows)
    for k in range(len(rows) - 1, -1, -1):
        turn = abs(rows[k + 1, 2] - rows[k, 2]) / step if k + 1 < len(rows) else 0.0
        if max(abs(rows[k, 3]), turn) > sharpest:
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
