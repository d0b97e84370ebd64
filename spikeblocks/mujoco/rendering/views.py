"""Cameras, and the trail and the hits of beams that are added to a scene."""

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
ASPECTS = {"top": 1.0, "perspective": 4.0 / 3.0}
OPENING = 45.0
# Lines are rendered twice as bright as their colour.
TRAIL = (0.0, 0.27, 0.2, 1.0)
HIT = (0.9, 0.15, 0.1, 1.0)
TRAIL_SEGMENTS = 1500
TRAIL_PIXELS = 4.0
TRAIL_HEIGHT = 0.004
HIT_SIZE = 0.012
GLOW = 0.4
FLOOR_SQUARE = 1.0  # side of a square of the floor, m
LIGHT_HEIGHT = 3.0
SHADOW_MARGIN = 1.9  # the shadows of what is at the edge fall beyond it


@dataclass(frozen=True)
class Extent:
    """The centre of a scene and half the side of the square around it (m)."""

    x: float
    y: float
    reach: float


def extent_of(world: World, path: FloatArray) -> Extent:
    """The square around the walls and a path, (n, 2) in m."""
    low, high = world.extent(path)
    x, y = 0.5 * (low + high)
    return Extent(float(x), float(y), float(0.5 * np.max(high - low)) + MARGIN)


def bar_length(width: float) -> float:
    """The largest of 1, 2, 5 and their multiples by ten, in m, within a quarter of a width."""
    quarter = 0.25 * width
    power = 10.0 ** math.floor(math.log10(quarter))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= quarter)


def light_scene(model: Any, extent: Extent) -> None:
    """Put the light over the scene, and its shadow map on the scene alone: sharper shadows."""
    along, across, down = model.light_dir[0]
    shift = LIGHT_HEIGHT / down  # the axis of the light meets the floor in the middle
    model.light_pos[0] = extent.x + shift * along, extent.y + shift * across, LIGHT_HEIGHT
    model.vis.map.shadowclip = SHADOW_MARGIN * math.sqrt(2.0) * extent.reach / model.stat.extent


def place_camera(camera: Any, view: str, extent: Extent) -> float:
    """Set the position of a free camera for a view.

    Returns its vertical field of view for MuJoCo: degrees, or m for the orthographic view from
    above.
    """
    x, y, reach = extent.x, extent.y, extent.reach
    camera.distance = reach / math.tan(0.5 * math.radians(OPENING))
    if view == "top":
        camera.lookat[:] = x, y, 0.0
        camera.azimuth, camera.elevation, camera.orthographic = 90.0, -90.0, 1
        return 2.0 * reach
    # Near objects look larger, so the camera looks at a point before the middle of the room.
    camera.lookat[:] = x - 0.04 * reach, y - 0.12 * reach, 0.0
    camera.azimuth, camera.elevation = 70.0, -50.0
    camera.distance *= 1.25
    return OPENING


def draw_trail(mujoco: Any, scene: Any, path: FloatArray) -> None:
    """Draw the trajectory so far, (n, 2) in m, as a line on the floor."""
    stride = max(1, -(-len(path) // TRAIL_SEGMENTS))
    corners = np.concatenate((path[:-1:stride], path[-1:]))
    level = np.full((len(corners), 1), TRAIL_HEIGHT)
    points = np.hstack((corners, level))
    line = mujoco.mjtGeom.mjGEOM_LINE
    for start, end in pairwise(points):
        shape = _add_geom(mujoco, scene, line, np.zeros(3), np.zeros(3), TRAIL)
        if shape is None:
            return
        mujoco.mjv_connector(shape, line, TRAIL_PIXELS, start, end)


def draw_hits(mujoco: Any, scene: Any, points: FloatArray) -> None:
    """Mark the points that beams hit, (n, 3) in m."""
    for point in points:
        _add_geom(mujoco, scene, mujoco.mjtGeom.mjGEOM_BOX, np.full(3, HIT_SIZE), point, HIT)


def _add_geom(
    mujoco: Any, scene: Any, kind: int, size: FloatArray, at: FloatArray, colour: tuple[float, ...]
) -> Any:
    """Add a decorative geom to the scene; None if the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape = scene.geoms[scene.ngeom]
    turn, rgba = np.eye(3).ravel(), np.array(colour, dtype=np.float32)
    mujoco.mjv_initGeom(shape, kind, size, at, turn, rgba)
    shape.emission = GLOW
    scene.ngeom += 1
    return shape
