"""Probes whose rows are made of the values of all ticks: through a synapse, a mean, or an offset.

In: the values of some ticks, as buffers give them. Out: the rows that they complete. With ``every:
4``, values of ticks 0 to 5 give rows 0 and 1, of ticks 0 and 4; tick 6 goes on with the filter's
memory of tick 5.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.observation import Probe

IntArray = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]


class ProbeFilter:
    """What makes the rows of a probe during a run; a synapse starts from zero.

    Parameters
    ----------
    probe : the filtered probe. dt : base step (s).

    ``taken`` are the values that were filtered, ``made`` the rows that they completed; ``total``
    is the sum of the values since the last row, ``count`` their number.
    """

    def __init__(self, probe: Probe, dt: float) -> None:
        self.probe = probe
        self.width = math.prod(probe.shape)
        synapse = probe.synapse
        self.filter = (
            None if synapse is None else synapse.filtering(probe.inputs[0] * dt, self.width)
        )
        self.total, self.count = np.zeros(self.width if probe.mean else 0), 0
        self.taken = self.made = 0

    def take(self, values: FloatArray) -> FloatArray:
        """Filter the next values (n, ...) in place; returns the rows that they complete."""
        if self.filter is not None:
            self.filter(values.reshape(len(values), self.width))
        first, self.taken = self.taken, self.taken + len(values)
        # The last value before row r, or at its tick, is number (late + r * every) // sampled.
        every, (sampled, begin) = self.probe.every, self.probe.inputs
        late = self.probe.first - begin
        stop = max(0, -(-(self.taken * sampled - late) // every))
        at = (late + np.arange(self.made, stop) * every) // sampled - first
        self.made = stop
        return self._means(values, at) if self.probe.mean else np.asarray(values[at])

    def _means(self, values: FloatArray, at: IntArray) -> FloatArray:
        """The means of the values up to these, each from behind the one before."""
        rows, start = np.zeros((len(at), self.width)), 0
        flat = values.reshape(len(values), self.width)
        for row, last in zip(rows, at.tolist(), strict=True):
            self._add(flat[start : last + 1])
            row[:] = self.total / self.count
            self.total[:], self.count, start = 0.0, 0, last + 1
        self._add(flat[start:])
        return rows.reshape(len(at), *values.shape[1:])

    def _add(self, values: FloatArray) -> None:
        # In the order of time, so that it does not matter in which parts the values come.
        self.total[:] = np.add.accumulate(np.concatenate([self.total[None], values]))[-1]
        self.count += len(values)

    def saved(self) -> FloatArray:
        """What moves, as numbers."""
        filtered = 0 if self.filter is None else self.filter.taken
        memory = np.zeros(0) if self.filter is None else self.filter.memory.ravel()
        return np.concatenate([(self.taken, self.made, filtered, self.count), self.total, memory])

    def restore(self, saved: FloatArray) -> None:
        """Put back what :meth:`saved` returned."""
        self.taken, self.made, filtered, self.count = map(int, saved[:4])
        self.total[:], memory = saved[4 : 4 + len(self.total)], saved[4 + len(self.total) :]
        if self.filter is not None:
            self.filter.taken = filtered
            self.filter.memory[...] = memory.reshape(self.filter.memory.shape)
