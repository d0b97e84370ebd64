"""Shapes of a block's states, and a state outside of a run.

In: a block and its context. Out: the shape of a declared state, e.g. ``("d", "n")`` of a Decoder's
weights as (2, 100); or a :class:`BlockState` that has started, as the plant of a controller needs.
"""

from __future__ import annotations

import numpy as np

from blocks.core.block import Block
from blocks.core.block_state import BlockContext, BlockState
from blocks.core.declarations import State
from blocks.core.signals import SignalType


def state_shape(block: Block, state: State, context: BlockContext) -> tuple[int, ...]:
    """The shape of a declared state, with symbolic lengths resolved."""
    lengths = state_lengths(block, context)
    like = context.types[state.like].shape if state.like else ()
    return (*(n if isinstance(n, int) else lengths[n] for n in state.shape), *like)


def state_lengths(block: Block, context: BlockContext) -> dict[str, int]:
    """The symbolic lengths of a block that are known."""
    lengths = {**context.lengths, **block.sizes_in(context)}
    for name, port in block.spec.ports.items():
        if isinstance(port.type, SignalType) and port.type.symbol and name in context.types:
            lengths[port.type.symbol] = context.types[name].shape[0]
    return lengths


def started(block: Block, context: BlockContext) -> BlockState:
    """A state of a block as after ``start``, without a run."""
    shapes = {name: state_shape(block, each, context) for name, each in block.spec.states.items()}
    arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
    state = BlockState(context, np.random.SeedSequence(0), arrays)
    block.start(state)
    return state
