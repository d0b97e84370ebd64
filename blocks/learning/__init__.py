"""Blocks that learn online from an error: ensembles of neurons under PES, and an integrator."""

from blocks.learning.learner import AdaptiveBias
from blocks.learning.neurons import AdaptiveEnsemble, RateEnsemble

__all__ = ["AdaptiveBias", "AdaptiveEnsemble", "RateEnsemble"]
