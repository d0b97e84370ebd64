"""From wall curves to a reference path: offset, trim, bridge, fillet, resample.

A line is a polyline, an (m, 2) array of x and y (m) in the robot's frame, walked with the wall on
the right; the robot is at the origin. Rows (m, 4) are points with the direction of travel along the
wall that they lie beside, a unit vector: x, y, ux, uy.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from blocks.core import BoolArray, FloatArray, directions
from blocks.wall_fitting.bspline import arc_length, interpolate

JOINT = 0.1
SHARPEST = math.cos(math.radians(100.0))
END = 0.08
BLUR = 3  # points on either side from which a line's direction is computed to round its kinks


def left(direction: FloatArray) -> FloatArray:
    """Vectors (m, 2) turned left by 90 degrees."""
    return np.column_stack((-direction[:, 1], direction[:, 0]))


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (m, 2) made unit length; zero stays zero."""
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def resampled(line: FloatArray, samples: int) -> FloatArray:
    """A line's points at that many even arc lengths, both ends included."""
    arc = arc_length(line)
    return interpolate(np.linspace(0.0, float(arc[-1]), samples), arc, line)


def tangents(line: FloatArray, reach: int) -> FloatArray:
    """Directions (m, 2), unit length, between the points ``reach`` samples before and after."""
    index = np.arange(len(line))
    ahead = np.minimum(index + reach, len(line) - 1)
    return unit(line[ahead] - line[np.maximum(index - reach, 0)])


def nearest(points: FloatArray, others: FloatArray) -> FloatArray:
    """Distance (m) from each of the points (m, 2) to the nearest of the others (n, 2), (m,)."""
    # |p - q|^2 = p.p - 2 p.q + q.q: one matrix product instead of two (m, n) differences.
    (x, y), (ox, oy) = points.T, -2.0 * others.T
    square = np.multiply.outer(x, ox)
    square += np.multiply.outer(y, oy)
    square += np.einsum("ij,ij->i", others, others)
    closest = square.min(axis=1) + np.einsum("ij,ij->i", points, points)
    return np.asarray(np.sqrt(np.maximum(closest, 0.0)))


def cap(
    end: FloatArray, tangent: FloatArray, distance: float, step: float, begin: bool
) -> FloatArray:
    """Offset rows around an edge, where a wall ends and beams pass it, (n, 4).

    The rest of the wall is hidden behind the beam that passes the edge, so the wall turns by at
    least the angle between beam and tangent there. Over that angle the level set follows a circle
    around the edge.

    Parameters
    ----------
    end, tangent : the wall's last point (m) and unit tangent, (2,); its first if ``begin``.
    distance : the circle's radius (m).
    step : spacing of the points (m).
    begin : whether the wall begins here; the circle then leads to it.
    """
    # The angle is 0 where the beam grazes the wall's end, pi / 2 where it is perpendicular.
    (x, y), (tx, ty) = end.tolist(), tangent.tolist()
    sweep = max(0.0, math.atan2(x * ty - y * tx, x * tx + y * ty))
    if begin and sweep > 0.0:
        sweep = math.pi - sweep
    turned = np.linspace(0.0, sweep, math.ceil(sweep * distance / step) + 1)[1:]
    normal = math.atan2(tx, -ty)
    angle = normal + turned[::-1] if begin else normal - turned
    outward = directions(angle)
    return np.column_stack((end + distance * outward, outward[:, 1], -outward[:, 0]))


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """First and past-the-last index of each run of True."""
    change = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    flat = change.tolist()
    return list(zip(flat[::2], flat[1::2], strict=True))


def followed(pieces: list[FloatArray], bridge: float) -> FloatArray:
    """The piece of rows nearest to the robot, joined with those that it links to.

    On either side the piece at the smallest gap is next, see :func:`gap`. Pieces between them are
    left out: they belong to another object.
    """
    away = [float((piece[:, 0] ** 2 + piece[:, 1] ** 2).min()) for piece in pieces]
    # Pieces of a few points are joined, but never chosen as the one to follow.
    main = min(range(len(pieces)), key=lambda index: (len(pieces[index]) < 6, away[index]))
    chosen = [main]
    while gaps := [gap(pieces[chosen[-1]], piece, bridge) for piece in pieces[chosen[-1] + 1 :]]:
        if min(gaps) == math.inf:
            break
        chosen.append(chosen[-1] + 1 + gaps.index(min(gaps)))
    while gaps := [gap(piece, pieces[chosen[0]], bridge) for piece in pieces[: chosen[0]]]:
        if min(gaps) == math.inf:
            break
        chosen.insert(0, gaps.index(min(gaps)))
    return np.concatenate([pieces[index] for index in chosen])


def gap(before: FloatArray, after: FloatArray, bridge: float) -> float:
    """Length (m) of the gap between the end of one piece of rows and the beginning of another.

    Infinite beyond ``bridge`` (m), and where it would turn by more than 100 degrees at either end,
    except for gaps up to 10 cm, which are kinks of one contour.
    """
    before, after = before[:, :2], after[:, :2]
    end, begin = before[-1], after[0]
    dx, dy = (begin - end).tolist()
    width = math.hypot(dx, dy)
    if width <= JOINT:
        return width
    if width > bridge:
        return math.inf
    leaving = (end - before[-min(len(before), 6)]).tolist()
    meeting = (after[min(len(after), 6) - 1] - begin).tolist()
    turns = (dx * x + dy * y < SHARPEST * width * math.hypot(x, y) for x, y in (leaving, meeting))
    return math.inf if any(turns) else width


def onward(rows: FloatArray) -> FloatArray:
    """The rows (m, 4) without those that step back behind an earlier one.

    Progress is measured along the wall. Offsets of a noisy curve fold back and forth by more than
    their spacing, which a path must not: a fold's own direction is that of its way back.
    """
    step, along = rows[1:, :2] - rows[:-1, :2], rows[1:, 2:] + rows[:-1, 2:]
    progress = np.cumsum(np.einsum("ij,ij->i", step, along))
    furthest = np.maximum.accumulate(np.concatenate(([0.0], progress)))
    ahead = np.concatenate(([True], progress > furthest[:-1]))
    return rows[ahead]


def against(line: FloatArray, heading: FloatArray, rows: FloatArray, near: float) -> BoolArray:
    """Whether points (n, 2) that lie on the rows (m, 4) head against the direction of travel there.

    ``heading`` is the points' (rad, (n,)); on the rows is what is within ``near`` (m) of one.
    """
    square = (line[:, :1] - rows[:, 0]) ** 2 + (line[:, 1:] - rows[:, 1]) ** 2
    beside = square.argmin(axis=1)
    on = square[np.arange(len(line)), beside] < near * near
    return np.asarray(on & (np.einsum("ij,ij->i", directions(heading), rows[beside, 2:]) < 0.0))


def filleted(line: FloatArray, radius: float, spacing: float, tolerance: float) -> FloatArray:
    """Round the left turns of a path that are tighter than a radius: a rolling disc.

    The disc rolls along the path's left. Where it cannot touch a point because it touches others
    first, its rim replaces the path. Its centres are the path offset to the left by the radius,
    without those that are nearer to the path than that.

    Parameters
    ----------
    line : the path, evenly spaced.
    radius : the disc's (m); 0 leaves the path as it is.
    spacing : of the line's points (m).
    tolerance : by how much centres may be too near (m); a path's noise is not a kink.
    """
    if radius == 0.0 or len(line) < 3:
        return line
    direction = tangents(line, BLUR)
    centres = line + radius * left(direction)
    free = [
        run for run in runs(nearest(centres, line) >= radius - tolerance) if run[1] - run[0] > 3
    ]
    if not free:
        return line
    parts = [line[slice(*free[0])]]
    for (_, stop), (begin, end) in pairwise(free):
        last = stop - 1
        (tx, ty), (ux, uy) = direction[last].tolist(), direction[begin].tolist()
        apart = math.hypot(*(centres[begin] - centres[last]).tolist())
        if tx * uy < ty * ux and apart > 0.25 * radius:
            # A right turn: its centres are too near because tangents are blurred around a kink.
            parts.append(line[stop:begin])
        else:
            centre = 0.5 * (centres[last] + centres[begin])
            parts.append(_rim(centre, line[last], line[begin], radius, spacing))
        parts.append(line[begin:end])
    return np.concatenate(parts)


def _rim(
    centre: FloatArray, start: FloatArray, stop: FloatArray, radius: float, spacing: float
) -> FloatArray:
    """Points on the disc's rim between two points of the path, counterclockwise."""
    (ax, ay), (bx, by) = (start - centre).tolist(), (stop - centre).tolist()
    first = math.atan2(ay, ax)
    turn = math.remainder(math.atan2(by, bx) - first, math.tau)
    if turn <= 0.0:
        return np.empty((0, 2))
    n = max(1, round(turn * radius / spacing))
    angle = first + turn * np.arange(1, n) / n
    return centre + radius * directions(angle)


def stretch(line: FloatArray, start: float, length: float, samples: int) -> FloatArray:
    """``samples`` even points of the ``length`` (m) of a line from arc length ``start`` (m).

    Beyond its ends the line is continued straight, in the direction of its last 8 cm.
    """
    arc = arc_length(line)
    total = float(arc[-1])
    inner = interpolate(np.array([min(END, total), max(0.0, total - END)]), arc, line)
    before, after = max(0.0, -start), max(0.0, start + length - total)
    first = line[:1] + before * unit(line[:1] - inner[:1])
    last = line[-1:] + after * unit(line[-1:] - inner[1:])
    arc = np.concatenate(([-before], arc, [total + after]))
    wanted = np.linspace(start, start + length, samples)
    return interpolate(wanted, arc, np.concatenate((first, line, last)))
