"""A robot vacuum in MuJoCo, a rigid-body simulator; needs the extra ``physics``.

It offers the block ``MujocoVacuum``, and the verb ``render`` of ``rendering``, which draws what the
block computes. To delete it, remove this folder, tests/bridges/mujoco, tests/studies/*physics.py,
its lines in pyproject.toml, examples/physics.py, benchmarks/physics.py, docs/physics.md and the
graphs whose names have ``mujoco``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from spikeblocks.mujoco.robot_model import SEEN_GROUP, BeamCaster, model_of
    from spikeblocks.mujoco.vacuum import POSITION, MujocoVacuum, state_parts
else:
    __getattr__ = door(__name__)

__all__ = ["POSITION", "SEEN_GROUP", "BeamCaster", "MujocoVacuum", "model_of", "state_parts"]
