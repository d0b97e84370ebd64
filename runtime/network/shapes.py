"""Shapes of a network's outputs and states, with symbolic lengths resolved."""

from __future__ import annotations

from typing import Any

from blocks.core import Block, BlockContext, SignalType, State
from runtime.network.addresses import Endpoint
from runtime.network.network import Network

MAX_BYTES = 4 * 1024**3


def whole_shape(network: Network, end: Endpoint) -> tuple[int, ...] | None:
    """Shape of the output or state at an address; None while a type or the block is unknown."""
    entry = network.entries.get(end.block)
    if entry is None or entry.block is None:
        return None
    spec = entry.cls.spec
    if end.port in spec.outputs:
        kind = network.types.get((end.block, end.port))
        return None if kind is None else kind.shape
    if not network.is_typed(end.block):
        return None
    return state_shape(entry.block, spec.states[end.port], network.context(end.block), spec)


def state_shape(block: Block, state: State, context: BlockContext, spec: Any) -> tuple[int, ...]:
    """The shape of a declared state, with symbolic lengths resolved."""
    lengths = {**context.lengths, **block.sizes_in(context)}
    for name, port in {**spec.inputs, **spec.outputs}.items():
        if isinstance(port.type, SignalType) and port.type.symbol and name in context.types:
            lengths[port.type.symbol] = context.types[name].shape[0]
    like = context.types[state.like].shape if state.like else ()
    return (*(n if isinstance(n, int) else lengths[n] for n in state.shape), *like)
