"""blocks.learning."""

from blocks.learning.bias import AdaptiveBias
from blocks.learning.neurons import AdaptiveEnsemble, RateEnsemble

__all__ = ["AdaptiveBias", "AdaptiveEnsemble", "RateEnsemble"]
