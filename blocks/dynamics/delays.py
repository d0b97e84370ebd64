"""Delays, holds and averages over the recent past, component by component.

A signal goes in, values of its past come out; each is a block with a ring of the last inputs::

    belt: {type: Delay, delay: 0.25}  # out(t) = input(t - 0.25)
"""

from __future__ import annotations

import math
from abc import ABC
from typing import Any

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    Componentwise,
    FloatArray,
    Output,
    ParameterError,
    Same,
    State,
    check_sized,
    param,
)

# A delay that is this near to whole steps, in steps, is one of whole steps.
WHOLE = 1e-6
# The values through which a polynomial goes: of degree 5, the order of the best explicit solver.
POINTS = 6
# Where a signal is smooth, differences become smaller the higher they are, and this much at least.
SMOOTH = 0.5


class Recalling(Componentwise, ABC):
    """A block that keeps numbers for each component of its input."""

    initial: FloatArray = param(
        0.0, shape=[(), (None,)], doc="value before the first tick, or one per component"
    )

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        check_sized(context.types["out"], "initial", self.initial)

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.first = np.broadcast_to(self.initial, (state.size,)).copy()


class _Ring(Recalling, ABC):
    """A block that keeps the last inputs in the rows of ``ring``, written in turn.

    ``head`` counts the rows that were written. Moving a head costs one row a tick, where moving the
    rows would cost all of them.
    """

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rows = len(state.ring)
        state.cells = state.ring.reshape(state.rows, -1)
        state.cells[:] = state.first

    def update(self, state: BlockState, t: float, input: Any) -> None:
        self.append(state, input)

    def append(self, state: BlockState, input: Any) -> None:
        """Write the row of this tick."""
        row = int(state.head[0]) % state.rows
        if state.form == "scalar":
            state.cells[row, 0] = input
        else:
            for i in range(state.size):
                state.cells[row, i] = input[i]
        state.head[0] += 1.0


class Delay(_Ring):
    """Delay a signal by a time; breaks algebraic loops.

        input ─▶ [ Delay ] ─▶ out

    out(t) = input(t - delay), each component, and ``initial`` before the first tick; the delay is
    at least one step of the block. Of an input that moves between ticks, a solver gets the delayed
    signal at each of its stages. Between ticks it is the polynomial of degree 5 through six ticks:
    of all such around that time, the one whose fifth difference is least, so that none crosses a
    kink of the signal unless there are two within six ticks (after Harten et al., Uniformly high
    order accurate essentially non-oscillatory schemes, 1987); a straight line where the signal
    jumps. An input that holds between ticks is delayed from tick to tick, along a straight line if
    the delay is not one of whole steps.
    """

    out = Output(Same("T"), through="input", doc="the input of the past")

    delay: float = param(unit="s", above=0.0, doc="by how much, at least one step")

    ring = State("rows", like="out", ring="head", doc="the last inputs, one row per tick")
    head = State(2, doc="how many inputs were written, and the time of the last (s)")

    @property
    def recalls(self) -> tuple[str, ...]:
        return ("input",)

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        # Two more than whole steps: the earlier row that interpolation needs, and the one that is
        # written in this tick; and those of a polynomial to the earlier side alone.
        return {"rows": int(self.delay / context.dt + WHOLE) + POINTS}

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
        state.moves = "input" in state.context.moving
        state.head[1] = -state.dt

    def resume(self, state: BlockState) -> None:
        # The time of an earlier run, which this one begins anew.
        state.head[1] = -state.dt

    def before_differences(self, state: BlockState) -> None:
        # Straight lines between ticks, also before the first: there is no history to choose by.
        state.moves = False

    def output(self, state: BlockState, t: float) -> Any:
        out = np.empty(state.size)
        if state.moves:
            # Steps from the last input to t: 0 to 1 at a solver's stages, and 1 at the tick, which
            # is before its own input is written. More if the block's part was off.
            since = (t - state.head[1]) / state.dt
            back = state.whole + state.part - (since if since < 1.0 - WHOLE else 1.0)
            for i in range(state.size):
                out[i] = recalled(state.cells, int(state.head[0]), back, i, state.first[i])
            return self.packed(state, out)
        near = (int(state.head[0]) - state.whole) % state.rows
        far = (near - 1) % state.rows
        for i in range(state.size):
            out[i] = state.cells[near, i]
            if state.part > 0.0:
                out[i] += state.part * (state.cells[far, i] - state.cells[near, i])
        return self.packed(state, out)

    def update(self, state: BlockState, t: float, input: Any) -> None:
        self.append(state, input)
        state.head[1] = t


def recalled(cells: FloatArray, head: int, back: float, i: int, first: float) -> float:
    """Number ``i`` of a signal so many ticks, with a part of one, before its last.

    Parameters
    ----------
    cells : the last values, one row per tick; ``head`` counts all that were ever written.
    first : the value before them.
    """
    rows, known, near = len(cells), min(head, len(cells)), int(back)
    part = back - near
    if near + 1 >= known:
        return float(cells[(head - 1 - near) % rows, i]) if near < known and part == 0.0 else first
    count = min(POINTS, known)
    least, begin = math.inf, 0
    for newest in range(max(0, near + 2 - count), min(near, known - count) + 1):
        difference, factor = 0.0, 1.0
        for j in range(count):
            difference += factor * cells[(head - 1 - newest - j) % rows, i]
            factor *= -(count - 1.0 - j) / (j + 1.0)
        if abs(difference) < least:
            least, begin = abs(difference), newest
    largest = 0.0
    for j in range(count - 1):
        row = head - 1 - begin - j
        largest = max(largest, abs(cells[row % rows, i] - cells[(row - 1) % rows, i]))
    if least > SMOOTH * largest:
        count, begin = 2, near
    total = 0.0
    for j in range(count):
        weight = 1.0
        for m in range(count):
            if m != j:
                weight *= (back - begin - m) / (j - m)
        total += weight * cells[(head - 1 - begin - j) % rows, i]
    return total


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


class FirstOrderHold(Recalling):
    """Sample a signal, and move along a line from one sample to the next.

        input ─▶ [ FirstOrderHold ] ─▶ out

    out(t) = input(t_k-1) + (input(t_k) - input(t_k-1)) * (t - t_k) / T for t_k <= t <= t_k+1, each
    component, with the ticks t_k of the block's own ``dt``, T. It reaches a sample one step after
    it was taken, so that it never jumps; before the first tick the input was ``initial``. A solver
    gets points of the line at its stages.
    """

    out = Output(Same("T"), doc="the line between the last two samples")

    samples = State(2, like="out", doc="the sample before the last, and the last")
    sampled_at = State(doc="the time of the last sample (s)")

    @property
    def glides(self) -> bool:
        return True

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.cells = state.samples.reshape(2, -1)
        state.cells[:] = state.first

    def resume(self, state: BlockState) -> None:
        # The time of an earlier run, which this one begins anew: at the end of its line.
        state.sampled_at = -state.dt

    def output(self, state: BlockState, t: float) -> Any:
        share = min(1.0, (t - float(state.sampled_at)) / state.dt)
        out = np.empty(state.size)
        for i in range(state.size):
            out[i] = state.cells[0, i] + share * (state.cells[1, i] - state.cells[0, i])
        return self.packed(state, out)

    def update(self, state: BlockState, t: float, input: Any) -> None:
        state.cells[0] = state.cells[1]
        self.store(state, state.cells[1], input)
        state.sampled_at = t


class MovingAverage(_Ring):
    """The mean of the last values.

        input ─▶ [ MovingAverage ] ─▶ out

    out(t_k) = (input(t_k) + ... + input(t_k-n+1)) / n with n = samples, each component; before the
    first tick the input was ``initial``.
    """

    out = Output(Same("T"), through="input", doc="the mean")

    samples: int = param(at_least=1, doc="how many values count")

    ring = State("rows", like="out", ring="head", doc="the last inputs, one row per tick")
    head = State(1, doc="how many inputs were written")

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
