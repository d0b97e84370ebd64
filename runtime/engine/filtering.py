"""Probes with a synapse: the values of all ticks pass a filter, of which the rows are recorded."""

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
    probe : the filtered probe. synapse : its filter. ticks : of the whole run. dt : base step (s).
    """

    def __init__(self, probe: Probe, synapse: Synapse, ticks: int, dt: float) -> None:
        self.probe, self.rows = probe, probe.rows(ticks)
        self.width = math.prod(probe.shape)
        self.filter = synapse.filtering(probe.input_every * dt, self.width)
        self.taken = self.made = 0

    def take(self, values: FloatArray) -> FloatArray:
        """Filter the next values (n, ...) in place; returns the rows that they complete."""
        self.filter(values.reshape(len(values), self.width))
        first, self.taken = self.taken, self.taken + len(values)
        # Row r belongs to tick r * every, at which the last value is number r * every // sampled.
        every, sampled = self.probe.every, self.probe.input_every
        stop = min(self.rows, -(-self.taken * sampled // every))
        at = np.arange(self.made, stop) * every // sampled - first
        self.made = stop
        return np.asarray(values[at])
