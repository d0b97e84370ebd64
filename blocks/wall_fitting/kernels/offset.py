"""Kernels of :mod:`blocks.wall_fitting.offset`."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray, IntArray
from blocks.wall_fitting.kernels.bspline import interpolate_kernel
from blocks.wall_fitting.offset import BLUR, END, JOINT, SHARPEST


def unit(x: float, y: float) -> tuple[float, float]:
    """A vector made unit length; zero stays zero."""
    length = math.hypot(x, y)
    return (x / length, y / length) if length > 0.0 else (0.0, 0.0)


def tangents_kernel(line: FloatArray, reach: int) -> FloatArray:
    """Directions (m, 2), unit length, between the points ``reach`` samples before and after."""
    result = np.empty((len(line), 2))
    for i in range(len(line)):
        ahead, back = min(i + reach, len(line) - 1), max(i - reach, 0)
        result[i, 0], result[i, 1] = unit(
            line[ahead, 0] - line[back, 0], line[ahead, 1] - line[back, 1]
        )
    return result


def nearest_kernel(points: FloatArray, others: FloatArray) -> FloatArray:
    """Distance (m) from each of the points (m, 2) to the nearest of the others (n, 2), (m,)."""
    x, y, least = points[:, 0].copy(), points[:, 1].copy(), np.full(len(points), math.inf)
    for k in range(len(others)):
        ox, oy = others[k, 0], others[k, 1]
        # The inner loop is over the points, since that one is vectorised.
        for i in range(len(x)):
            dx, dy = x[i] - ox, y[i] - oy
            square = dx * dx + dy * dy
            least[i] = square if square < least[i] else least[i]
    for i in range(len(least)):
        least[i] = math.sqrt(least[i])
    return least


def cap_kernel(
    end: FloatArray, distance: float, step: float, side: float, rows: FloatArray, n: int
) -> int:
    """Put rows around an edge into ``rows`` from row ``n`` on; returns the row after them.

    ``end`` is x, y, tx, ty of the wall's end; ``side`` is 1 where it begins, -1 where it ends.
    """
    x, y, tx, ty = end[0], end[1], end[2], end[3]
    sweep = max(0.0, math.atan2(x * ty - y * tx, x * tx + y * ty))
    if side > 0.0 and sweep > 0.0:
        sweep = math.pi - sweep
    normal = math.atan2(tx, -ty)
    count = math.ceil(sweep * distance / step)
    for k in range(1, count + 1):
        at = count + 1 - k if side > 0.0 else k
        turned = at * (sweep / count) if at < count else sweep
        angle = normal + side * turned
        c, s = math.cos(angle), math.sin(angle)
        rows[n, 0], rows[n, 1] = x + distance * c, y + distance * s
        rows[n, 2], rows[n, 3] = s, -c
        n += 1
    return n


def followed_kernel(rows: FloatArray, pieces: IntArray, bridge: float) -> FloatArray:
    """The piece nearest to the robot, joined with those that it links to."""
    if len(pieces) == 0:
        return np.empty((0, 4))
    main = main_piece(rows, pieces)
    chosen = np.zeros(len(pieces), np.bool_)
    for side in (1, -1):
        at = main
        while at >= 0:
            chosen[at] = True
            at = next_piece(rows, pieces, at, side, bridge)
    total = 0
    for p in range(len(pieces)):
        total += pieces[p, 1] - pieces[p, 0] if chosen[p] else 0
    joined = np.empty((total, 4))
    n = 0
    for p in range(len(pieces)):
        if chosen[p]:
            for i in range(pieces[p, 0], pieces[p, 1]):
                for c in range(4):
                    joined[n, c] = rows[i, c]
                n += 1
    return joined


def main_piece(rows: FloatArray, pieces: IntArray) -> int:
    """The piece that comes nearest to the robot; one of a few points only if there is no other."""
    best, least, scrap = 0, math.inf, True
    for p in range(len(pieces)):
        near = math.inf
        for i in range(pieces[p, 0], pieces[p, 1]):
            near = min(near, rows[i, 0] * rows[i, 0] + rows[i, 1] * rows[i, 1])
        few = pieces[p, 1] - pieces[p, 0] < 6
        if (scrap and not few) or (scrap == few and near < least):
            best, least, scrap = p, near, few
    return best


def next_piece(rows: FloatArray, pieces: IntArray, at: int, side: int, bridge: float) -> int:
    """The piece at the smallest gap after (``side`` 1) or before (-1) a piece; -1 for none."""
    best, least = -1, math.inf
    for p in range(at + 1 if side > 0 else 0, len(pieces) if side > 0 else at):
        first, second = (at, p) if side > 0 else (p, at)
        width = gap_kernel(rows, pieces[first], pieces[second], bridge)
        if width < least:
            best, least = p, width
    return best


def gap_kernel(rows: FloatArray, before: IntArray, after: IntArray, bridge: float) -> float:
    """How far (m) a path goes from the end of one piece to the begin of another."""
    end, begin = before[1] - 1, after[0]
    dx, dy = rows[begin, 0] - rows[end, 0], rows[begin, 1] - rows[end, 1]
    width = math.hypot(dx, dy)
    if width <= JOINT:
        return width
    if width > bridge:
        return math.inf
    back = max(before[0], end - 5)
    ahead = min(after[1] - 1, begin + 5)
    for first, last in ((back, end), (begin, ahead)):
        x, y = rows[last, 0] - rows[first, 0], rows[last, 1] - rows[first, 1]
        if dx * x + dy * y < SHARPEST * width * math.hypot(x, y):
            return math.inf
    return width


def onward_kernel(rows: FloatArray) -> FloatArray:
    """The rows (m, 4) without those that step back behind an earlier one."""
    result = np.empty((len(rows), 4))
    progress, furthest, n = 0.0, 0.0, 0
    for i in range(len(rows)):
        if i > 0:
            dx, dy = rows[i, 0] - rows[i - 1, 0], rows[i, 1] - rows[i - 1, 1]
            progress += dx * (rows[i, 2] + rows[i - 1, 2]) + dy * (rows[i, 3] + rows[i - 1, 3])
        if i == 0 or progress > furthest:
            furthest = progress
            for c in range(4):
                result[n, c] = rows[i, c]
            n += 1
    return result[:n]


def filleted_kernel(
    line: FloatArray, radius: float, spacing: float, tolerance: float
) -> FloatArray:
    """Round the left turns of a path that are tighter than a radius: a rolling disc."""
    if radius == 0.0 or len(line) < 3:
        return line
    direction = tangents_kernel(line, min(BLUR, len(line)))
    centres = np.empty((len(line), 2))
    for i in range(len(line)):
        centres[i, 0] = line[i, 0] - radius * direction[i, 1]
        centres[i, 1] = line[i, 1] + radius * direction[i, 0]
    free = free_runs(nearest_kernel(centres, line), radius - tolerance)
    if len(free) == 0:
        return line
    rim = math.ceil(math.pi * radius / spacing) + 1
    result = np.empty((len(line) + len(free) * rim, 2))
    n = free[0, 0] - free[0, 0]
    for p in range(len(free)):
        first = free[p, 0]
        if p > 0:
            last = free[p - 1, 1] - 1
            cross = direction[last, 0] * direction[first, 1]
            cross -= direction[first, 0] * direction[last, 1]
            dx, dy = centres[first, 0] - centres[last, 0], centres[first, 1] - centres[last, 1]
            if cross < 0.0 and math.hypot(dx, dy) > 0.25 * radius:
                first = last + 1
            else:
                x = 0.5 * (centres[last, 0] + centres[first, 0])
                y = 0.5 * (centres[last, 1] + centres[first, 1])
                n = rim_points(x, y, line[last], line[first], radius, spacing, result, n)
        for i in range(first, free[p, 1]):
            result[n, 0], result[n, 1] = line[i, 0], line[i, 1]
            n += 1
    return result[:n]


def free_runs(away: FloatArray, wanted: float) -> IntArray:
    """First and past-the-last index of each run of more than three at least ``wanted`` away."""
    result = np.empty((len(away), 2), np.int64)
    n, begin = 0, 0
    for i in range(len(away) + 1):
        if i == len(away) or away[i] < wanted:
            if i - begin > 3:
                result[n, 0], result[n, 1] = begin, i
                n += 1
            begin = i + 1
    return result[:n]


def rim_points(
    x: float,
    y: float,
    start: FloatArray,
    stop: FloatArray,
    radius: float,
    spacing: float,
    rows: FloatArray,
    n: int,
) -> int:
    """Put points on a disc's rim, counterclockwise, into ``rows``; returns the row after them."""
    first = math.atan2(start[1] - y, start[0] - x)
    turn = math.remainder(math.atan2(stop[1] - y, stop[0] - x) - first, math.tau)
    if turn <= 0.0:
        return n
    count = max(1, round(turn * radius / spacing))
    for k in range(1, count):
        angle = first + turn * k / count
        rows[n, 0] = x + radius * math.cos(angle)
        rows[n, 1] = y + radius * math.sin(angle)
        n += 1
    return n


def stretch_kernel(
    line: FloatArray, arc: FloatArray, start: float, length: float, samples: int
) -> FloatArray:
    """``samples`` even points of the ``length`` (m) of a line from arc length ``start`` (m).

    ``arc`` is that of the line's points. Beyond its ends it is continued straight.
    """
    total = arc[-1]
    result = interpolate_kernel(start, start + length, samples, arc, line)
    ax, ay, bx, by = outward(line, arc)
    for i in range(samples):
        wanted = start + i * (length / max(1, samples - 1))
        if wanted < 0.0:
            result[i, 0] -= wanted * ax
            result[i, 1] -= wanted * ay
        elif wanted > total:
            result[i, 0] += (wanted - total) * bx
            result[i, 1] += (wanted - total) * by
    return result


def outward(line: FloatArray, arc: FloatArray) -> tuple[float, float, float, float]:
    """Unit vectors (x, y, x, y) that prolong a line's begin and its end; 0 for a point."""
    end = len(line) - 1
    x, y = point_at(line, arc, min(END, arc[end]))
    ax, ay = unit(line[0, 0] - x, line[0, 1] - y)
    x, y = point_at(line, arc, max(0.0, arc[end] - END))
    bx, by = unit(line[end, 0] - x, line[end, 1] - y)
    return ax, ay, bx, by


def point_at(line: FloatArray, arc: FloatArray, wanted: float) -> tuple[float, float]:
    """The point of a line at an arc length (m) that it reaches."""
    j = 0
    while j < len(arc) - 1 and arc[j + 1] <= wanted:
        j += 1
    if j == len(arc) - 1:
        return line[j, 0], line[j, 1]
    share = (wanted - arc[j]) / (arc[j + 1] - arc[j])
    x = line[j, 0] + share * (line[j + 1, 0] - line[j, 0])
    return x, line[j, 1] + share * (line[j + 1, 1] - line[j, 1])
