"""Probes with a synapse: the values of all ticks pass a filter, of which the rows are recorded.

In: the values of some ticks, as buffers give them. Out: the rows that they complete. With ``every:
4``, values of ticks 0 to 5 give rows 0 and 1, of ticks 0 and 4; tick 6 goes on with the filter's
memory of tick 5.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray
from blocks.neural import Synapse
from runtime.observation import Probe


class ProbeFilter:
    """The synapse of a probe during a run; it starts from zero.

    Parameters
    ----------
    probe : the filtered probe. synapse : its filter. dt : base step (s).

    ``taken`` are the values that were filtered, ``made`` the rows that they completed.
    """

    def __init__(self, probe: Probe, synapse: Synapse, dt: float) -> None:
        self.probe = probe
        self.width = math.prod(probe.shape)
        self.filter = synapse.filtering(probe.inputs[0] * dt, self.width)
        self.taken = self.made = 0

    def take(self, values: FloatArray) -> FloatArray:
        """Filter the next values (n, ...) in place; returns the rows that they complete."""
        self.filter(values.reshape(len(values), self.width))
        first, self.taken = self.taken, self.taken + len(values)
        # The last value before row r, or at its tick, is number (late + r * every) // sampled.
        every, (sampled, begin) = self.probe.every, self.probe.inputs
        late = self.probe.first - begin
        stop = max(0, -(-(self.taken * sampled - late) // every))
        at = (late + np.arange(self.made, stop) * every) // sampled - first
        self.made = stop
        return np.asarray(values[at])

    def saved(self) -> FloatArray:
        """What moves, as numbers."""
        counts = self.taken, self.made, self.filter.taken
        return np.concatenate([counts, self.filter.memory.ravel()])

    def restore(self, saved: FloatArray) -> None:
        """Put back what :meth:`saved` returned."""
        self.taken, self.made, self.filter.taken = map(int, saved[:3])
        self.filter.memory[...] = saved[3:].reshape(self.filter.memory.shape)
