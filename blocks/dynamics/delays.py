"""Delays, holds and averages over the recent past, component by component."""

from __future__ import annotations

from abc import ABC
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    State,
    check_flat,
    check_sized,
    param,
)

# A delay that is this near to whole steps, in steps, is one of whole steps.
WHOLE = 1e-6


class Recalling(Block, ABC):
    """A block that keeps numbers for each component of its input."""

    signal = Input(Same("T"), name="input", doc="a number, a record or a vector")

    initial: FloatArray = param(
        0.0, shape=[(), (None,)], doc="value before the first tick, or one per component"
    )

    def validate_in(self, context: BlockContext) -> None:
        kind = context.types["out"]
        check_flat(kind, "input")
        check_sized(kind, "initial", self.initial)

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.first = np.broadcast_to(self.initial, (state.size,)).copy()

    def packed(self, state: BlockState, cells: FloatArray) -> Any:
        """Numbers, one per component, in the signal's own form."""
        if state.form == "scalar":
            return float(cells[0])
        if state.form == "array":
            return cells
        return state.pack(cells)

    def store(self, state: BlockState, cells: FloatArray, input: Any) -> None:
        """Write a signal into numbers, one per component."""
        if state.form == "scalar":
            cells[0] = input
        else:
            for i in range(state.size):
                cells[i] = input[i]


class _Ring(Recalling, ABC):
    """A block that keeps the last inputs in the rows of ``ring``, written in turn at ``head``.

    Moving a head costs one row a tick, where moving the rows would cost all of them.
    """

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rows = len(state.ring)
        state.cells = state.ring.reshape(state.rows, -1)
        state.cells[:] = state.first

    def update(self, state: BlockState, t: float, input: Any) -> None:
        row = int(state.head[0])
        if state.form == "scalar":
            state.cells[row, 0] = input
        else:
            for i in range(state.size):
                state.cells[row, i] = input[i]
        state.head[0] = (row + 1) % state.rows


class Delay(_Ring):
    """Delay a signal by a time; breaks algebraic loops.

        input ─▶ [ Delay ] ─▶ out

    out(t) = input(t - delay), each component. A delay of whole steps is exact; otherwise the input
    counts as a straight line between two ticks. Before the first tick it was ``initial``. The
    delay is at least one step of the block.
    """

    out = Output(Same("T"), through="input", doc="the input of the past")

    delay: float = param(unit="s", above=0.0, doc="by how much, at least one step")

    ring = State("rows", like="out", ring="head", doc="the last inputs, one row per tick")
    head = State(1, doc="the row that the next input goes to")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        # Two more than whole steps: the earlier row that interpolation needs, and the one that is
        # written in this tick.
        return {"rows": int(self.delay / context.dt + WHOLE) + 2}

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        if self.delay < context.dt * (1.0 - WHOLE):
            message = f"expected at least one step, {context.dt:g} s, got {self.delay:g} s"
            raise ParameterError([("delay", message)])

    def start(self, state: BlockState) -> None:
        super().start(state)
        steps = self.delay / state.dt
        state.whole = int(steps + WHOLE)
        part = steps - state.whole
        state.part = part if part > WHOLE else 0.0

    def output(self, state: BlockState, t: float) -> Any:
        near = (int(state.head[0]) - state.whole) % state.rows
        far = (near - 1) % state.rows
        out = np.empty(state.size)
        for i in range(state.size):
            out[i] = state.cells[near, i]
            if state.part > 0.0:
                out[i] += state.part * (state.cells[far, i] - state.cells[near, i])
        return self.packed(state, out)


class Hold(Recalling):
    """Sample a signal and hold it, for instance ahead of a controller in discrete time.

        input ─▶ [ Hold ] ─▶ out

    out(t) = input(t_k) for t_k <= t < t_k+1, each component, with the ticks t_k of the block's own
    ``dt``. ``initial`` is never seen.
    """

    out = Output(Same("T"), through="input", doc="the input of this block's last tick")

    held = State(like="out", doc="the value that was sampled")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.cells = state.held.reshape(-1)
        state.cells[:] = state.first

    def output(self, state: BlockState, t: float, input: Any) -> Any:
        return input

    def update(self, state: BlockState, t: float, input: Any) -> None:
        self.store(state, state.cells, input)


class MovingAverage(_Ring):
    """The mean of the last values.

        input ─▶ [ MovingAverage ] ─▶ out

    out(t_k) = (input(t_k) + ... + input(t_k-n+1)) / n with n = samples, each component; before the
    first tick the input was ``initial``.
    """

    out = Output(Same("T"), through="input", doc="the mean")

    samples: int = param(at_least=1, doc="how many values count")

    ring = State("rows", like="out", ring="head", doc="the last inputs, one row per tick")
    head = State(1, doc="the row that the next input goes to")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        return {"rows": max(1, self.samples - 1)}

    def output(self, state: BlockState, t: float, input: Any) -> Any:
        out = np.zeros(state.size)
        self.store(state, out, input)
        for i in range(state.size):
            for j in range(self.samples - 1):
                out[i] += state.cells[j, i]
            out[i] /= self.samples
        return self.packed(state, out)
