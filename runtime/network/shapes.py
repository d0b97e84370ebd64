"""Shapes of a network's outputs and states, with symbolic lengths resolved.

In: an address. Out: the shape of its array, e.g. ``("d", "n")`` of a Decoder's weights as (2, 100),
where n is the length of the spikes that are wired to it.
"""

from __future__ import annotations

from typing import Any

from blocks.core import Block, BlockContext, SignalType, State
from runtime.network.addresses import Endpoint
from runtime.network.network import Network

MAX_BYTES = 4 * 1024**3


def whole_shape(network: Network, end: Endpoint) -> tuple[int, ...] | None:
    """Shape of the output or state at an address; None while a type, a length or the block is
    unknown.

    A state's length may be open although the types of all ports are known: a Decoder that is wired
    on both sides has the rows of its weights from the Ensemble, which may have no input yet.
    """
    entry = network.entries.get(end.block)
    if entry is None or entry.block_or_none is None:
        return None
    spec = entry.cls.spec
    if end.port in spec.outputs:
        kind = network.types.get((end.block, end.port))
        return None if kind is None else kind.shape
    if not network.is_typed(end.block):
        return None
    state, context = spec.states[end.port], network.context(end.block)
    lengths = _lengths(entry.block, context, spec)
    if any(isinstance(n, str) and n not in lengths for n in state.shape):
        return None
    return state_shape(entry.block, state, context, spec)


def state_shape(block: Block, state: State, context: BlockContext, spec: Any) -> tuple[int, ...]:
    """The shape of a declared state, with symbolic lengths resolved."""
    lengths = _lengths(block, context, spec)
    like = context.types[state.like].shape if state.like else ()
    return (*(n if isinstance(n, int) else lengths[n] for n in state.shape), *like)


def _lengths(block: Block, context: BlockContext, spec: Any) -> dict[str, int]:
    """The symbolic lengths of a block that are known."""
    lengths = {**context.lengths, **block.sizes_in(context)}
    for name, port in {**spec.inputs, **spec.outputs}.items():
        if isinstance(port.type, SignalType) and port.type.symbol and name in context.types:
            lengths[port.type.symbol] = context.types[name].shape[0]
    return lengths
