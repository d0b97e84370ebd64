"""Blocks that learn online from an error: ensembles of neurons under PES, and an integrator."""

from blocks.learning.learner import AdaptiveBias
from blocks.learning.mrac import MRAC
from blocks.learning.neurons import AdaptiveEnsemble, RateEnsemble

__all__ = ["MRAC", "AdaptiveBias", "AdaptiveEnsemble", "RateEnsemble"]
