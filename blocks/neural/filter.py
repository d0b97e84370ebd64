"""A synapse as a block of its own, for values that come from no Decoder.

A vector goes in, the filtered vector comes out in the same tick::

    slow: {type: SynapticFilter, synapse: alpha(0.1)}
"""

from __future__ import annotations

from typing import final

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    State,
    Vector,
    param,
)
from blocks.core.portable import flush, flush_due
from blocks.neural.synapses import Synapse, passed, remember


@final
class SynapticFilter(Block):
    """Filter a vector as a synapse does, without a tick of delay.

        input ─▶ [ SynapticFilter ] ─▶ out

    out(t_k) has input(t_k) in it, as the value of a Decoder has the spikes of its tick: behind a
    Decoder with the synapse none it is that Decoder's synapse, tick by tick. A Lowpass instead is
    one tick late, and breaks loops.
    """

    signal = Input(Vector("k"), name="input", doc="what to filter")
    out = Output(Vector("k"), through="input", doc="what the synapse makes of it")

    synapse: Synapse = param(0.005, unit="s", doc="the filter")

    filtered = State("order", "k", doc="the synapse's states")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        return {"order": self.synapse.order_at(context.dt)}

    def start(self, state: BlockState) -> None:
        state.a, state.b = self.synapse.matrices(state.dt)

    def output(self, state: BlockState, t: float, input: FloatArray) -> FloatArray:
        return passed(state.filtered, state.a, state.b, input)

    def update(self, state: BlockState, t: float, input: FloatArray, out: FloatArray) -> None:
        remember(state.filtered, state.a, state.b, input, out)
        if flush_due(t, state.dt):
            flush(state.filtered)
