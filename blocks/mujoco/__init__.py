"""A robot vacuum in MuJoCo, a rigid-body simulator; needs the extra ``physics``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.lazy import door

if TYPE_CHECKING:
    from blocks.mujoco.robot_model import SEEN_GROUP, BeamCaster, model_of
    from blocks.mujoco.vacuum import POSITION, MujocoVacuum, state_parts
else:
    __getattr__ = door(__name__)

__all__ = ["POSITION", "SEEN_GROUP", "BeamCaster", "MujocoVacuum", "model_of", "state_parts"]
