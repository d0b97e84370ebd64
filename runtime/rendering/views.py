"""What a picture shows: from where, how large, and what is drawn into the scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from blocks.core import FloatArray
from blocks.world import World

MARGIN = 0.15
# Width over height of a view.
SHAPES = {"top": 1.0, "perspective": 4.0 / 3.0}
OPENING = 45.0
# Lines come out twice as bright as their colour.
TRAIL = (0.0, 0.27, 0.2, 1.0)
HIT = (0.9, 0.15, 0.1, 1.0)
TRAIL_SEGMENTS = 1500
TRAIL_PIXELS = 4.0
TRAIL_HEIGHT = 0.004
HIT_SIZE = 0.012
GLOW = 0.4


@dataclass(frozen=True)
class Extent:
    """Where the middle of a scene is, and how far it reaches from there (m)."""

    x: float
    y: float
    reach: float


def extent_of(world: World, way: FloatArray) -> Extent:
    """The square that holds the walls and the way, (n, 2) in m."""
    shapes = [way, *world.obstacles, *([] if world.room is None else [world.room])]
    shapes += [np.array([[x - r, y - r], [x + r, y + r]]) for x, y, r in world.circles.tolist()]
    points = np.concatenate(shapes)
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = 0.5 * (low + high)
    return Extent(float(x), float(y), float(0.5 * np.max(high - low)) + MARGIN)


def place(camera: Any, view: str, extent: Extent) -> float:
    """Put a free camera where a view is taken from.

    Returns its vertical opening, as MuJoCo wants it: degrees, or m for the parallel rays from
    above.
    """
    x, y, reach = extent.x, extent.y, extent.reach
    camera.distance = reach / math.tan(0.5 * math.radians(OPENING))
    if view == "top":
        camera.lookat[:] = x, y, 0.0
        camera.azimuth, camera.elevation, camera.orthographic = 90.0, -90.0, 1
        return 2.0 * reach
    # What is near looks large: the middle of the picture is nearer than that of the room.
    camera.lookat[:] = x - 0.04 * reach, y - 0.12 * reach, 0.0
    camera.azimuth, camera.elevation = 70.0, -50.0
    camera.distance *= 1.25
    return OPENING


def draw_trail(mujoco: Any, scene: Any, way: FloatArray) -> None:
    """Draw the way gone so far, (n, 2) in m, as a line on the floor."""
    stride = max(1, -(-len(way) // TRAIL_SEGMENTS))
    corners = np.concatenate((way[:-1:stride], way[-1:]))
    level = np.full((len(corners), 1), TRAIL_HEIGHT)
    points = np.hstack((corners, level))
    line = mujoco.mjtGeom.mjGEOM_LINE
    for start, end in pairwise(points):
        shape = _next(mujoco, scene, line, np.zeros(3), np.zeros(3), TRAIL)
        if shape is None:
            return
        mujoco.mjv_connector(shape, line, TRAIL_PIXELS, start, end)


def draw_hits(mujoco: Any, scene: Any, points: FloatArray) -> None:
    """Mark where beams hit, (n, 3) in m."""
    for point in points:
        _next(mujoco, scene, mujoco.mjtGeom.mjGEOM_BOX, np.full(3, HIT_SIZE), point, HIT)


def _next(
    mujoco: Any, scene: Any, kind: int, size: FloatArray, at: FloatArray, colour: tuple[float, ...]
) -> Any:
    """A new decorative shape of the scene; None if there is no room for more."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape = scene.geoms[scene.ngeom]
    turn, rgba = np.eye(3).ravel(), np.array(colour, dtype=np.float32)
    mujoco.mjv_initGeom(shape, kind, size, at, turn, rgba)
    shape.emission = GLOW
    scene.ngeom += 1
    return shape
