"""What an ensemble publishes about its neurons, for the decoders that read its spikes.

In: the model, gains, biases and encoders that were drawn. Out: the rates of the neurons at any
points, from which decoders are solved and tuning curves plotted::

    tuning.rates(points)      # (m, d) to (m, n), in Hz
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blocks.core import FloatArray, product
from blocks.neural.neurons import NeuronModel

# Where responses are computed: places along each neuron's encoder, in radii.
PLACES: FloatArray = np.linspace(-1.0, 1.0, 401)
PLACES.setflags(write=False)


@dataclass(frozen=True)
class Tuning:
    """The tuning of an ensemble's neurons; it does not change during a run.

    neuron : the model. gain, bias : (groups * n,). encoders : (groups * n, d), of length 1 unless
    given otherwise. radius : inputs are divided by it. groups : each of n neurons and d dimensions.
    ahead : whether the spikes are those of the coming step, and not of the last one.
    """

    neuron: NeuronModel
    gain: FloatArray
    bias: FloatArray
    encoders: FloatArray
    radius: float
    groups: int = 1
    ahead: bool = False

    @property
    def neurons(self) -> int:
        """Neurons per group."""
        return len(self.gain) // self.groups

    @property
    def dimensions(self) -> int:
        """Dimensions per group."""
        return int(self.encoders.shape[1])

    def currents(self, points: FloatArray, group: int = 0) -> FloatArray:
        """Input currents (p, n) of a group's neurons at points (p, d)."""
        mine = slice(group * self.neurons, (group + 1) * self.neurons)
        scaled = self.encoders[mine] / self.radius
        drive = product(points, scaled.T)
        return drive * self.gain[mine] + self.bias[mine]

    def rates(self, points: FloatArray, group: int = 0) -> FloatArray:
        """Steady firing rates (p, n) in Hz of a group's neurons at points (p, d)."""
        return self.neuron.responses(self.currents(points, group))

    def table(self) -> FloatArray:
        """Encoders and responses (groups * n, d + 401): the rates (Hz) at :data:`PLACES`."""
        # Along its own encoder a neuron's current grows by gain times the encoder's length.
        lengths = np.sqrt(np.square(self.encoders).sum(axis=1))
        drive = (self.gain * lengths)[:, None] * PLACES + self.bias[:, None]
        return np.hstack([self.encoders, self.neuron.responses(drive)])


def table_shape(lengths: Mapping[str, int]) -> tuple[int, int]:
    """The shape of :meth:`Tuning.table`, given the lengths of an ensemble's ports."""
    return lengths["total"], lengths["d"] // lengths["groups"] + len(PLACES)
