"""The world around the robot: walls and obstacles, their distances and contours, and a LiDAR."""

from blocks.world.lidar import Lidar, bearings, window_problems
from blocks.world.surfaces import TOUCH, Surfaces, nearest
from blocks.world.world import World, misplaced, required_world, world_of

__all__ = [
    "TOUCH",
    "Lidar",
    "Surfaces",
    "World",
    "bearings",
    "misplaced",
    "nearest",
    "required_world",
    "window_problems",
    "world_of",
]
