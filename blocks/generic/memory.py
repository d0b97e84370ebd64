"""Generic blocks with memory: delay and filter. Neither has direct feedthrough."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    Same,
    State,
    check_sized,
    kernel_of,
    param,
)


class _Memory(Block, ABC):
    signal = Input(Same("T"), name="input", doc="any signal")
    out = Output(Same("T"), through="input", doc="the remembered value")

    initial: FloatArray | None = param(
        None, doc="value before the first tick, a number or one per component; default 0"
    )

    memory = State(name="memory", like="out", doc="the output of the next tick")

    def validate_in(self, context: BlockContext) -> None:
        check_sized(context.types["out"], "initial", self.initial)

    def start(self, state: BlockState) -> None:
        if self.initial is not None:
            state.memory[...] = self.initial
        kind = state.context.types["out"]
        state.pack, state.form = kind.pack, kind.form
        state.cells = state.memory.reshape(-1)

    def output(self, state: BlockState, t: float) -> Any:
        return state.pack(state.memory)

    def _update_each(self, state: BlockState, input: Any) -> None:
        """Update the memory component by component, as kernels do."""
        cells = state.cells
        if state.form == "scalar":
            cells[0] = self._updated(state, cells[0], input)
        elif state.form == "record":
            for i in range(len(input)):
                cells[i] = self._updated(state, cells[i], input[i])
        else:
            for i, value in enumerate(input.flat):
                cells[i] = self._updated(state, cells[i], value)

    @abstractmethod
    def _updated(self, state: BlockState, old: float, new: float) -> float:
        """One component of the memory after this tick."""


class UnitDelay(_Memory):
    """Delay a signal by one tick of this block; breaks algebraic loops.

        input ─▶ [ UnitDelay ] ─▶ out

    out(t_k) = input(t_k-1), and ``initial`` at the first tick.
    """

    def update(self, state: BlockState, t: float, input: Any) -> None:
        state.memory[...] = input

    @kernel_of(update)
    def _update_kernel(self, state: BlockState, t: float, input: Any) -> None:
        self._update_each(state, input)

    def _updated(self, state: BlockState, old: float, new: float) -> float:
        return new


class Lowpass(_Memory):
    """First-order lowpass with unit gain; out lags input by one tick.

        input ─▶ [ Lowpass ] ─▶ out

    out(t_k+1) = out(t_k) + (1 - exp(-dt / tau)) (input(t_k) - out(t_k)): the exact response to
    an input that holds between ticks.
    """

    tau: float = param(unit="s", above=0.0, doc="time constant")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.share = -math.expm1(-state.dt / self.tau)

    def update(self, state: BlockState, t: float, input: Any) -> None:
        state.memory -= state.share * (state.memory - input)

    @kernel_of(update)
    def _update_kernel(self, state: BlockState, t: float, input: Any) -> None:
        self._update_each(state, input)

    def _updated(self, state: BlockState, old: float, new: float) -> float:
        updated: float = old - state.share * (old - new)
        return updated
