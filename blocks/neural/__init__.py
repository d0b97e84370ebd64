"""Populations of neurons, and what learns online from an error.

The Neural Engineering Framework as blocks: an :class:`Ensemble` represents a vector by spikes, a
:class:`Decoder` computes a function of it and learns by an error, and :class:`Weights` lead from
neurons straight to neurons. :class:`AdaptiveEnsemble` is the paper's learner, encoder to rule in
one block; RateEnsemble, AdaptiveBias and MRAC have its ports and can replace it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

# At once: a neuron's model is looked up by its name among those that are imported.
from blocks.neural.lif import LIF, AdaptiveLIF, AdaptiveLIFRate, LIFRate
from blocks.neural.models import Direct, Izhikevich, ReLU, Sigmoid, SpikingReLU, Tanh

if TYPE_CHECKING:
    from blocks.neural.adaptive import AdaptiveEnsemble, RateEnsemble
    from blocks.neural.decoder import Decoder
    from blocks.neural.decoder_solvers import DecoderSolver
    from blocks.neural.ensemble import Ensemble
    from blocks.neural.feedthrough import FeedthroughEnsemble
    from blocks.neural.filter import SynapticFilter
    from blocks.neural.learner import AdaptiveBias
    from blocks.neural.mrac import MRAC
    from blocks.neural.neurons import NeuronModel
    from blocks.neural.pointers import SemanticPointer, Similarity, Superposition
    from blocks.neural.published_tuning import PLACES, Tuning, table_shape
    from blocks.neural.synapses import Synapse
    from blocks.neural.weights import Weights
else:
    __getattr__ = door(__name__)

__all__ = ["LIF", "MRAC", "PLACES", "AdaptiveBias", "AdaptiveEnsemble", "AdaptiveLIF", "Decoder"]
__all__ += ["AdaptiveLIFRate", "Direct", "SemanticPointer", "Similarity", "Superposition"]
__all__ += ["Ensemble", "Izhikevich", "LIFRate", "NeuronModel", "RateEnsemble", "ReLU", "Sigmoid"]
__all__ += [
    "DecoderSolver",
    "FeedthroughEnsemble",
    "SpikingReLU",
    "Synapse",
    "SynapticFilter",
    "Tanh",
    "Tuning",
    "Weights",
    "table_shape",
]
