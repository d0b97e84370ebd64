"""A round body that slides along what it touches and never passes through it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from blocks.world import nearest

if TYPE_CHECKING:
    from blocks.world import World

# A body this near (m) to a surface touches it.
TOUCH = 1e-6
# How deep (m) a body may be in a surface after sliding: rounding.
DEPTH = 1e-11
# Positions are tried this far apart, as a share of the radius: too near to jump over a wall, and
# only so many of them, so that a senseless command costs no more than a bounded time.
STRIDE = 0.25
TRIES = 64
PUSHES = 8

BodyPosition = tuple[float, float, float]


def slide(
    world: World, x: float, y: float, gap: float, dx: float, dy: float, radius: float
) -> BodyPosition:
    """Move a body from a free place by (dx, dy), sliding without friction along surfaces.

    It goes in strides of which each ends in free space: where one would end in a surface, the
    body is pushed back along that surface's normal, which leaves the tangential part. A step of
    less than the gap ahead cannot touch anything and is taken at once.

    Parameters
    ----------
    x, y : where the body's centre is (m); the body is free there.
    gap : between body and nearest surface (m).
    dx, dy : where the motors would move it (m).
    radius : of the body (m), above 0.

    Returns
    -------
    tuple : the new x, y and gap; the gap is never below -DEPTH.
    """
    left = math.hypot(dx, dy)
    if not 0.0 < left < math.inf:
        return x, y, gap
    ux, uy = dx / left, dy / left
    stride = STRIDE * radius
    for _ in range(TRIES):
        step = min(left, max(gap, stride))
        there = _free_place(world, x, y, x + step * ux, y + step * uy, radius)
        if there is None:
            # In a corner: go as far as halving finds room, then stay.
            stride *= 0.5
            if stride < TOUCH * radius:
                break
            continue
        x, y, gap = there
        left -= step
        if left <= 0.0:
            break
    return x, y, gap


def _free_place(
    world: World, x: float, y: float, to_x: float, to_y: float, radius: float
) -> BodyPosition | None:
    """The free place that pushing the body out of surfaces leads to, and its gap; None if none."""
    for pushes in range(PUSHES + 1):
        distance, nx, ny = nearest(world, to_x, to_y)
        depth = radius - distance
        if depth <= DEPTH:
            # Pushed about in a narrow place, it could end on the other side of something.
            near = pushes == 0 or math.hypot(to_x - x, to_y - y) < radius
            return (to_x, to_y, -depth) if near else None
        to_x += depth * nx
        to_y += depth * ny
    return None
