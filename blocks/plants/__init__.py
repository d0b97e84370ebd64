"""Plants in continuous time to start from: vehicles, pendulums, an arm, masses."""

from blocks.plants.arms import TwoLinkArm
from blocks.plants.masses import DoubleIntegrator, MassSpringDamper
from blocks.plants.pendulums import CartPole, Pendulum
from blocks.plants.vehicles import Bicycle, Unicycle

__all__ = ["Bicycle", "CartPole", "DoubleIntegrator", "MassSpringDamper", "Pendulum"]
__all__ += ["TwoLinkArm", "Unicycle"]
