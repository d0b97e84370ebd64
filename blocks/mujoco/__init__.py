"""A robot vacuum in MuJoCo, a rigid-body simulator; needs the extra ``physics``."""

from blocks.mujoco.robot_model import SEEN_GROUP, BeamCaster, model_of
from blocks.mujoco.vacuum import POSITION, MujocoVacuum, state_parts

__all__ = ["POSITION", "SEEN_GROUP", "BeamCaster", "MujocoVacuum", "model_of", "state_parts"]
