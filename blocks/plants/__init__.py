"""Mechanical plants in continuous time: pendulums, an arm, masses, a body in space, a quadrotor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.plants.arms import PlanarArm, TwoLinkArm
    from blocks.plants.bodies import Quadrotor, RigidBody, RotorMixer
    from blocks.plants.masses import DoubleIntegrator, MassSpringDamper
    from blocks.plants.pendulums import CartPole, Pendulum
else:
    __getattr__ = door(__name__)

__all__ = ["CartPole", "DoubleIntegrator", "MassSpringDamper", "Pendulum", "PlanarArm"]
__all__ += ["Quadrotor", "RigidBody", "RotorMixer", "TwoLinkArm"]
