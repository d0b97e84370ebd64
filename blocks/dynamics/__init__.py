"""Dynamic systems: continuous, integrated by the run's solver, and in discrete time."""

from blocks.dynamics.delays import Delay, Hold, MovingAverage
from blocks.dynamics.discrete import DiscreteIntegrator, DiscreteTransferFunction
from blocks.dynamics.integrator import Integrator
from blocks.dynamics.linear import DiscreteStateSpace, StateSpace

__all__ = ["Delay", "DiscreteIntegrator", "DiscreteStateSpace", "DiscreteTransferFunction", "Hold"]
__all__ += ["Integrator", "MovingAverage", "StateSpace"]
