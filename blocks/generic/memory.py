"""Generic blocks with memory: delay and filter. Neither has direct feedthrough."""

from __future__ import annotations

from abc import ABC
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
    param,
)
from blocks.core.portable import flush, flush_due, share_of


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
        state.pack = state.context.types["out"].pack

    def output(self, state: BlockState, t: float) -> Any:
        # A copy for arrays: consumers of this tick must not see what `update` writes.
        return state.pack(state.memory)


class UnitDelay(_Memory):
    """Delay a signal by one tick of this block; breaks algebraic loops.

        input ─▶ [ UnitDelay ] ─▶ out

    out(t_k) = input(t_k-1), and ``initial`` at the first tick.
    """

    def update(self, state: BlockState, t: float, input: Any) -> None:
        state.memory[...] = input


class Lowpass(_Memory):
    """First-order lowpass with unit gain; out lags input by one tick.

        input ─▶ [ Lowpass ] ─▶ out

    out(t_k+1) = out(t_k) + (1 - exp(-dt / tau)) (input(t_k) - out(t_k)): the exact response to
    an input that holds between ticks.
    """

    tau: float = param(unit="s", above=0.0, tunable=True, doc="time constant")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.share = share_of(self.tau, state.dt)

    def update(self, state: BlockState, t: float, input: Any) -> None:
        state.memory[...] = state.memory - state.share * (state.memory - input)
        if flush_due(t, state.dt):
            flush(state.memory)
