"""Mechanical plants in continuous time to start from: pendulums, an arm, masses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.lazy import door

if TYPE_CHECKING:
    from blocks.plants.arms import PlanarArm, TwoLinkArm
    from blocks.plants.masses import DoubleIntegrator, MassSpringDamper
    from blocks.plants.pendulums import CartPole, Pendulum
else:
    __getattr__ = door(__name__)

__all__ = ["CartPole", "DoubleIntegrator", "MassSpringDamper", "Pendulum", "PlanarArm"]
__all__ += ["TwoLinkArm"]
