"""blocks.mujoco."""

from blocks.mujoco.lidar import Beams
from blocks.mujoco.model import SEEN_GROUP, model_of
from blocks.mujoco.vacuum import POSITION, MujocoVacuum, state_parts

__all__ = ["POSITION", "SEEN_GROUP", "Beams", "MujocoVacuum", "model_of", "state_parts"]
