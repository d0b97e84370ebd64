"""A body and the surfaces of the world: a round one slides along them, any one may touch them.

x, y, gap = slide(world, x, y, gap, dx, dy, radius)    # a step of a robot
x, y = free_place(surfaces, x, y, radius)              # out of what a solver stepped into
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from blocks.core import BlockContext, ParameterError
from blocks.messages import Message
from blocks.world import TOUCH, misplaced, nearest, nearest_kernel, world_of

if TYPE_CHECKING:
    from blocks.world import Surfaces, World

# How deep (m) a body may be in a surface after sliding: rounding.
DEPTH = 1e-11
# Positions are tried at this spacing, as a share of the radius, so that no wall is skipped; their
# number is limited, which bounds the time for an extreme command.
STRIDE = 0.25
TRIES = 64
PUSHES = 8

BodyPosition = tuple[float, float, float]


def slide(
    world: World, x: float, y: float, gap: float, dx: float, dy: float, radius: float
) -> BodyPosition:
    """Move a body from a free position by (dx, dy), sliding without friction along surfaces.

    It moves in strides that each end in free space: where one would end in a surface, the body is
    pushed back along the surface's normal, which leaves the tangential part. A step of
    less than the gap ahead cannot touch anything and is taken at once.

    Parameters
    ----------
    x, y : the body's centre (m), in a free position.
    gap : between body and nearest surface (m).
    dx, dy : the commanded displacement (m).
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
        there = _free_position(world, x, y, x + step * ux, y + step * uy, radius)
        if there is None:
            # In a corner: halve the stride as long as there is room, then stop.
            stride *= 0.5
            if stride < TOUCH * radius:
                break
            continue
        x, y, gap = there
        left -= step
        if left <= 0.0:
            break
    return x, y, gap


def _free_position(
    world: World, x: float, y: float, to_x: float, to_y: float, radius: float
) -> BodyPosition | None:
    """The free position after pushing the body out of surfaces, with its gap; None if none."""
    for pushes in range(PUSHES + 1):
        distance, nx, ny = nearest(world, to_x, to_y)
        depth = radius - distance
        if depth <= DEPTH:
            # In a narrow place, pushing could move it to the other side of a wall.
            near = pushes == 0 or math.hypot(to_x - x, to_y - y) < radius
            return (to_x, to_y, -depth) if near else None
        to_x += depth * nx
        to_y += depth * ny
    return None


def free_place(surfaces: Surfaces, x: float, y: float, radius: float) -> tuple[float, float]:
    """The place next to (x, y) where a round body is in no surface; (x, y) if there is room.

    A body in a passage that is narrower than itself is left where it is after the last push.
    """
    for _ in range(PUSHES):
        distance, nx, ny = nearest_kernel(surfaces, x, y)
        if distance >= radius - DEPTH:
            break
        x += (radius - distance) * nx
        y += (radius - distance) * ny
    return x, y


def check_body(context: BlockContext, x0: tuple[float, float], radius: float) -> None:
    """Check that a graph has a world in which a round body fits where it starts.

    Raises
    ------
    ParameterError : it does not.
    """
    world = world_of(context)
    if world is None:
        message = "a body needs a world, but the graph has no world: section"
        raise ParameterError([("body_radius", Message(message, "missing-world"))])
    message = misplaced(world, "body", x0[0], x0[1], radius)
    if message:
        raise ParameterError([("x0", message)])
