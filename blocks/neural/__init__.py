"""Populations of neurons: the Neural Engineering Framework as blocks.

An :class:`Ensemble` represents a vector by spikes, a :class:`Decoder` computes a function of it and
learns by an error, and :class:`Weights` lead from neurons straight to neurons.
"""

from blocks.neural.decoder import Decoder
from blocks.neural.ensemble import Ensemble
from blocks.neural.models import Izhikevich, ReLU, Sigmoid, SpikingReLU, Tanh
from blocks.neural.neurons import LIF, AdaptiveLIF, LIFRate, NeuronModel
from blocks.neural.synapses import Synapse
from blocks.neural.tuning import PLACES, Tuning, table_shape
from blocks.neural.weights import Weights

__all__ = [
    "LIF",
    "PLACES",
    "AdaptiveLIF",
    "Decoder",
    "Ensemble",
    "Izhikevich",
    "LIFRate",
    "NeuronModel",
]
__all__ += ["ReLU", "Sigmoid", "SpikingReLU", "Synapse", "Tanh", "Tuning", "Weights", "table_shape"]
