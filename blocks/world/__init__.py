"""The world around the robot: walls and obstacles, their distances and contours, and a LiDAR."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.world.lidar import Lidar, bearings, window_problems
    from blocks.world.surfaces import TOUCH, Surfaces, nearest, nearest_kernel
    from blocks.world.world import World, misplaced, required_world, world_of
else:
    __getattr__ = door(__name__)

__all__ = [
    "TOUCH",
    "Lidar",
    "Surfaces",
    "World",
    "bearings",
    "misplaced",
    "nearest",
    "nearest_kernel",
    "required_world",
    "window_problems",
    "world_of",
]
