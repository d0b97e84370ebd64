"""Mechanical plants in continuous time to start from: pendulums, an arm, masses."""

from blocks.plants.arms import TwoLinkArm
from blocks.plants.masses import DoubleIntegrator, MassSpringDamper
from blocks.plants.pendulums import CartPole, Pendulum

__all__ = ["CartPole", "DoubleIntegrator", "MassSpringDamper", "Pendulum", "TwoLinkArm"]
