"""The world's surfaces as arrays: what is nearest to a point, and what rays hit first.

Ranges of all rays to all shapes are linear in the rays' unit vectors up to a division or a root,
and so begin with one product of matrices, shapes by rays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np

from blocks.core import FloatArray, IntArray, kernel_of, product
from blocks.world.curves import Line, LineOrArc, wrapped

Edge = tuple[float, float, float, float, float, float]
# Edges (e, 6), see World; what each edge ends (e,), see below; circles (c, 3); curves (s, 6).
Surfaces = tuple[FloatArray, IntArray, FloatArray, FloatArray]
Nearest = tuple[float, float, float]

# Nearer than this (m), the direction to a surface does not determine the side.
TOUCHING = 1e-9
# A body this near (m) to a surface touches it.
TOUCH = 1e-6
# Angles (rad) smaller than this are rounding.
CUSP = 1e-9
# What ends with an edge: nothing, since its polygon continues; an obstacle; the room.
FOLLOWED, OBSTACLE, ROOM = 0, 1, 2


def as_arrays(
    polygons: Iterable[tuple[bool, tuple[Edge, ...]]],
    circles: FloatArray,
    curves: Iterable[LineOrArc],
) -> Surfaces:
    """The surfaces as arguments of :func:`nearest_kernel` and :func:`cast_kernel`.

    Parameters
    ----------
    polygons : whether each is the room, and its edges.
    circles : x, y and r (m), (c, 3).
    curves : the boundary of free space.
    """
    edges: list[Edge] = []
    ends: list[int] = []
    for is_room, sides in polygons:
        edges += sides
        ends += [FOLLOWED] * (len(sides) - 1) + [ROOM if is_room else OBSTACLE]
    rows = [
        (0.0, c.start.real, c.start.imag, c.along.real, c.along.imag, c.length)
        if isinstance(c, Line)
        else (1.0, c.centre.real, c.centre.imag, c.radius, c.begin, c.sweep)
        for c in curves
    ]
    return (
        np.array(edges, dtype=np.float64).reshape(-1, 6),
        np.array(ends, dtype=np.int64),
        np.array(circles, dtype=np.float64).reshape(-1, 3),
        np.array(rows, dtype=np.float64).reshape(-1, 6),
    )


class _Nearby(Protocol):
    def nearest(self, x: float, y: float) -> Nearest: ...


def nearest(world: _Nearby, x: float, y: float) -> Nearest:
    """Signed distance to the nearest surface, and the normal there: :meth:`World.nearest`."""
    return world.nearest(x, y)


@kernel_of(nearest)
def nearest_kernel(world: Surfaces, x: float, y: float) -> Nearest:
    """:func:`nearest` by :attr:`World.arrays` in place of the world itself."""
    edges, ends, circles, curves = world
    square, bx, by, solid, inside = math.inf, 0.0, 0.0, False, False
    for i in range(len(edges)):
        ax, ay, ex, ey = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        px, py = x - ax, y - ay
        end = edges[i, 5]
        if (ay > y) != (end > y) and (px * ey < py * ex) == (end > ay):
            inside = not inside
        s = (px * ex + py * ey) * edges[i, 4]
        s = 0.0 if s < 0.0 else 1.0 if s > 1.0 else s
        px -= s * ex
        py -= s * ey
        if px * px + py * py < square:
            square, bx, by = px * px + py * py, px, py
        if ends[i] != FOLLOWED:
            solid = solid or inside != (ends[i] == ROOM)
            inside = False
    gap = span = math.sqrt(square)
    for i in range(len(circles)):
        px, py, r = x - circles[i, 0], y - circles[i, 1], circles[i, 2]
        from_centre = math.hypot(px, py)
        if from_centre - r < gap:
            gap, span, bx, by = from_centre - r, from_centre, px, py
    if solid or gap < TOUCHING:
        return from_surface(curves, x, y, solid or gap < 0.0)
    return gap, bx / span, by / span


def from_surface(curves: FloatArray, x: float, y: float, solid: bool) -> Nearest:
    """What is nearest, and the normal there, on a surface or behind it.

    There, free space is not straight away from the surface.
    """
    least, fx, fy = math.inf, 0.0, 0.0
    for i in range(len(curves)):
        qx, qy, _, _, _, _ = foot_on(curves, i, x, y)
        gap = math.hypot(qx - x, qy - y)
        if gap < least:
            least, fx, fy = gap, qx, qy
    if least >= TOUCHING:
        side = 1.0 if solid else -1.0
        nx, ny = side * (fx - x) / least, side * (fy - y) / least
    else:
        nx, ny = outward(curves, x, y)
    return -least if solid else least, nx, ny


def outward(curves: FloatArray, x: float, y: float) -> tuple[float, float]:
    """The normal at a point of the surface: the bisector of the widest free sector there.

    Sectors lie between the curves that meet in the point, one alone leaves half a turn. Along the
    bisector of a sector phi the distance to what bounds it grows at the rate 1, or at sin(phi / 2)
    where phi is below pi: no direction leads away faster.
    """
    widest, normal = -1.0, 0.0
    for i in range(len(curves)):
        qx, qy, ux, uy, goes_on, _ = foot_on(curves, i, x, y)
        if goes_on and math.hypot(qx - x, qy - y) < TOUCHING:
            # Free space begins to the left of a curve that leaves the point, and ends at the
            # next one, counterclockwise, that comes to it.
            begin, sector = math.atan2(uy, ux), 2.0 * math.pi
            for k in range(len(curves)):
                qx, qy, ux, uy, _, comes = foot_on(curves, k, x, y)
                if comes and math.hypot(qx - x, qy - y) < TOUCHING:
                    turn = (math.atan2(-uy, -ux) - begin) % (2.0 * math.pi)
                    # Where surfaces are tangent, rounding must not make a full turn of nothing.
                    sector = min(sector, turn if turn < 2.0 * math.pi - CUSP else 0.0)
            if sector > widest + CUSP:
                widest, normal = sector, begin + 0.5 * sector
    return math.cos(normal), math.sin(normal)


def foot_on(
    curves: FloatArray, i: int, x: float, y: float
) -> tuple[float, float, float, float, bool, bool]:
    """The point of a curve nearest to (x, y), the curve's direction there, and whether it goes on
    from there and comes from before.
    """
    cx, cy = float(curves[i, 1]), float(curves[i, 2])
    px, py = x - cx, y - cy
    if curves[i, 0] == 0.0:
        ux, uy, length = float(curves[i, 3]), float(curves[i, 4]), float(curves[i, 5])
        s = min(max(px * ux + py * uy, 0.0), length)
        return cx + s * ux, cy + s * uy, ux, uy, length - s > TOUCHING, s > TOUCHING
    radius, begin, sweep = float(curves[i, 3]), float(curves[i, 4]), float(curves[i, 5])
    middle, half, turn = begin + 0.5 * sweep, 0.5 * abs(sweep), math.copysign(1.0, sweep)
    off = min(max(wrapped(math.atan2(py, px) - middle), -half), half)
    c, s = math.cos(middle + off), math.sin(middle + off)
    is_closed = half > math.pi - CUSP
    goes_on = is_closed or radius * (half - turn * off) > TOUCHING
    comes = is_closed or radius * (half + turn * off) > TOUCHING
    return cx + radius * c, cy + radius * s, -turn * s, turn * c, goes_on, comes


def cast_kernel(
    surfaces: Surfaces, x: float, y: float, theta: float, bearings: FloatArray
) -> FloatArray:
    """Range (m) from (x, y) along each ray to the first surface: the kernel of :meth:`World.cast`.

    The equations are those of :func:`to_edges` and :func:`to_circles`.

    Parameters
    ----------
    theta, bearings : the rays' directions are ``theta + bearings`` (rad), (n,).

    Returns
    -------
    array : (n,); inf where a ray hits nothing.
    """
    edges, _, circles, _ = surfaces
    ranges = np.empty(len(bearings))
    for i in range(len(bearings)):
        ux, uy = math.cos(bearings[i] + theta), math.sin(bearings[i] + theta)
        first = math.inf
        for k in range(len(edges)):
            ax, ay, ex, ey = edges[k, 0] - x, edges[k, 1] - y, edges[k, 2], edges[k, 3]
            reach = ax * ey - ay * ex
            crossed = ey * ux - ex * uy if reach >= 0.0 else ex * uy - ey * ux
            off_middle = (ax + 0.5 * ex) * uy - (ay + 0.5 * ey) * ux
            if abs(off_middle) < (0.5 + OVERHANG) * crossed:
                first = min(first, abs(reach) / crossed)
        for k in range(len(circles)):
            cx, cy, r = circles[k, 0] - x, circles[k, 1] - y, circles[k, 2]
            along, across = ux * cx + uy * cy, ux * cy - uy * cx
            square = r * r - across * across
            if square >= 0.0:
                half = math.sqrt(square)
                hit = along + half if cx * cx + cy * cy < r * r else along - half
                if hit >= 0.0:
                    first = min(first, hit)
        ranges[i] = first
    return ranges


# How far beyond its ends an edge still stops a ray, as a share of its length: rounding must not
# let one slip through a corner.
OVERHANG = 1e-12


def to_edges(
    x: float, y: float, units: FloatArray, corner: FloatArray, edge: FloatArray
) -> FloatArray:
    """Range (m) from (x, y) along each ray to the first edge, (n,); inf where none is hit.

    The range t and the place s on the edge solve x + t u = a + s e. Crossed with e and with u,
    t = (a - x) x e / u x e and s = (a - x) x u / u x e. With the edge turned round so that t's
    numerator is not negative, 0 <= s <= 1 and t >= 0 are one condition,
    abs((a + e / 2 - x) x u) <= (u x e) / 2.

    Parameters
    ----------
    units : the rays' unit vectors, (2, n).
    corner, edge : where each edge begins, and the vector to its end (m), (2, s).
    """
    ex, ey = edge
    ax, ay = corner[0] - x, corner[1] - y
    reach = ax * ey - ay * ex
    facing = np.where(reach < 0.0, -1.0, 1.0)
    rows = np.concatenate((facing * (ey, -ex), (-ay - 0.5 * ey, ax + 0.5 * ex)), axis=1).T
    crossed, off_middle = product(rows, units).reshape(2, -1, units.shape[1])
    hit = np.abs(off_middle) < (0.5 + OVERHANG) * crossed
    t = np.full(crossed.shape, np.inf)
    np.divide(np.abs(reach)[:, None], crossed, out=t, where=hit)
    nearest: FloatArray = t.min(axis=0)
    return nearest


def to_circles(x: float, y: float, units: FloatArray, circles: FloatArray) -> FloatArray:
    """Range (m) from (x, y) along each ray to the first circle, (n,); inf where none is hit.

    With c the centre as seen from (x, y), t = u . c - sqrt(r^2 - (u x c)^2).

    Parameters
    ----------
    units : the rays' unit vectors, (2, n).
    circles : x, y and r (m), (3, c).
    """
    cx, cy, r = circles[0] - x, circles[1] - y, circles[2]
    rows = np.concatenate(((cx, cy), (cy, -cx)), axis=1).T
    along, across = product(rows, units).reshape(2, -1, units.shape[1])
    # From inside a circle, only the exit lies ahead.
    side = np.where(cx * cx + cy * cy < r * r, -1.0, 1.0)
    with np.errstate(invalid="ignore"):
        t = along - side[:, None] * np.sqrt((r * r)[:, None] - across * across)
    nearest: FloatArray = np.where(t >= 0.0, t, np.inf).min(axis=0)
    return nearest
