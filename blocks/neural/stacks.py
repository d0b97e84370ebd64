"""Equal populations as stacks: one call for all of them, with the bits of a call for each.

In go blocks of one class, equal but for numbers, and their states as rows of common arrays; each
object here has their class's ``output`` and ``update``, as :meth:`blocks.core.Block.stacked` says.
Two ensembles of 100 neurons with inputs (1,) are one of (2, 100) with inputs (2,)::

    stack.update(t, (array((0.1, 0.2)),), (), (1.0, 1.0))

Nearly all of a step acts neuron by neuron and takes the blocks' own functions, on flat arrays. What
sums over neurons, or multiplies by a number of the block, is written once more, in the same order:
here, in :mod:`blocks.neural.decoder`, and as ``pes_each`` and ``decode_each``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from blocks.core import BlockState, FloatArray
from blocks.core.portable import flush_due
from blocks.neural.rules import pes_each

Arrays = Mapping[str, FloatArray]
Terms = tuple[FloatArray, ...]


def _flat(states: Sequence[BlockState], arrays: Arrays, *names: str) -> SimpleNamespace:
    """A state of all members as one block: views of all numbers, and what the first one derived."""
    common = {name: getattr(states[0], name) for name in names}
    return SimpleNamespace(**{k: a.reshape(-1) for k, a in arrays.items()}, **common)


class EnsembleStack:
    """Ensembles without learning: together they are one ensemble of more groups."""

    def __init__(self, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Arrays) -> None:
        n, rows = blocks[0].neurons, arrays["scaled_encoders"]
        members, d, total = rows.shape
        groups = members * (total // n)
        self.block, self.fired = blocks[0], arrays["fired"]
        common = ("dt", "constants", "learns", "further", "noise", "draws", "emission")
        self.state = _flat(states, arrays, *common, "amplitude", "scales")
        # All neurons of a member, not those of a group: what it is stepped with alone.
        self.state.step = blocks[0].neuron.stacked(total)
        # The encoders of a dimension are one row for all; without learning they stay what they are.
        grouped = rows.reshape(members, d, total // n, n).transpose(1, 0, 2, 3)
        self.state.row_groups = grouped.reshape(d, groups, n)
        self.state.drive_of_groups = arrays["drive"].reshape(groups, n)
        self.state.point = np.zeros((groups, d))

    def output(self, t: float) -> FloatArray:
        return self.fired.copy()

    def update(self, t: float, input: Terms, current: Terms, learn: tuple[float, ...]) -> None:
        self.block.update(self.state, t, input, current, 1.0)


class LearnerStack:
    """Learning ensembles of one kind, as :class:`blocks.neural.adaptive.LearningEnsemble`."""

    def __init__(self, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Arrays) -> None:
        self.blocks, self.states, self.arrays, first = blocks, states, arrays, states[0]
        self.state, self.dt = _flat(states, arrays, "dt", "constants", "empty"), first.dt
        # NumPy takes an array without axes much faster than a number.
        self.state.fade, self.state.pass_on = np.array(first.fade), np.array(first.pass_on)
        self.weights, self.activity = arrays["weights"], arrays["activity"][:, None]
        self.current, self.offset = arrays["current"], arrays["offset"]
        self.members, self.k, n = self.weights.shape
        self.encoder_rows = np.ascontiguousarray(arrays["scaled_encoders"].transpose(2, 0, 1))
        self.scratch = np.zeros((self.members, n))
        self.gamma = np.array([[[state.gamma]] for state in states])
        self.limits = np.array([[block.limit] for block in blocks])
        self.is_limited = bool(np.isfinite(self.limits).any())
        self.leaks = any(block.leak or block.e_leak for block in blocks)

    def output(self, t: float) -> FloatArray:
        decoded: FloatArray = np.add.reduce(self.weights * self.activity, 2)
        if self.is_limited:
            decoded = np.minimum(np.maximum(decoded, -self.limits), self.limits)
        return decoded

    def update(
        self, t: float, input: FloatArray, error: FloatArray, learn: tuple[float, ...]
    ) -> None:
        point, current = input.reshape(self.members, -1), self.current
        np.multiply(self.encoder_rows[0], point[:, :1], out=current)
        for j in range(1, len(self.encoder_rows)):
            np.multiply(self.encoder_rows[j], point[:, j, None], out=self.scratch)
            current += self.scratch
        current += self.offset
        self.blocks[0].respond_together(current.shape[1], self.state)
        errors, gamma = error.reshape(self.members, self.k, 1), self.gamma
        if self.blocks[0].normalised:
            pairs = zip(self.blocks, self.states, strict=True)
            gamma = np.array([[[block._gamma(state)]] for block, state in pairs])
        if self.leaks:
            each = zip(self.blocks, self.states, errors[:, :, 0], strict=True)
            self.weights *= np.array([[[block.keep_of(s, e)]] for block, s, e in each])
        if learn.count(1.0) < len(learn):
            gamma = gamma * np.array(learn)[:, None, None]
        pes_each(self.weights, self.activity, gamma * errors)
        if flush_due(t, self.dt):
            self.blocks[0]._flush(self.state)
