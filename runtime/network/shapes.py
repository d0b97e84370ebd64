"""Shapes of a network's outputs and states, with symbolic lengths resolved.

In: an address. Out: the shape of its array, e.g. ``("d", "n")`` of a Decoder's weights as (2, 100),
where n is the length of the spikes that are wired to it.
"""

from __future__ import annotations

from blocks.core import state_lengths, state_shape
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
    lengths = state_lengths(entry.block, context)
    if any(isinstance(n, str) and n not in lengths for n in state.shape):
        return None
    return state_shape(entry.block, state, context)
