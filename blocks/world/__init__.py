"""blocks.world."""

from blocks.world.lidar import Lidar, bearings, required_world, window_problems
from blocks.world.surfaces import Surfaces, nearest
from blocks.world.world import World, world_of

__all__ = [
    "Lidar",
    "Surfaces",
    "World",
    "bearings",
    "nearest",
    "required_world",
    "window_problems",
    "world_of",
]
