"""Blocks with continuous states, which the run's solver integrates: integrators, linear systems."""

from blocks.dynamics.integrator import Integrator
from blocks.dynamics.linear import StateSpace

__all__ = ["Integrator", "StateSpace"]
