"""Shapes of a block's states, and a state outside of a run.

In: a block and its context. Out: the shape of a declared state, e.g. ``("d", "n")`` of a Decoder's
weights as (2, 100); or a :class:`BlockState` that has started, as the plant of a controller needs.

``retune`` gives a running state the parameters of another block, and leaves its memory alone::

    retune(PID(kp=2.0), state)     # of a PID(kp=1.0): state.kp is 2.0, the integral what it was
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from blocks.core.block import Block
from blocks.core.block_state import BlockContext, BlockState
from blocks.core.declarations import State
from blocks.core.signals import FloatArray, SignalType


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


def retune(block: Block, state: BlockState) -> None:
    """Let a state of a running block follow from the parameters of another block of its type.

    What ``start`` derives from parameters, cached states and attributes, is computed anew; all
    other states and the generator of random numbers stay as they are. The arrays are the same.

    Raises
    ------
    ValueError : the block has states of other shapes, or does not start; the state is unchanged.
    """
    held = vars(state)
    before = dict(held)
    arrays = {name: held[name].copy() for name in block.spec.states}
    memory = {name: array for name, array in arrays.items() if not block.spec.states[name].cached}

    def put(values: Mapping[str, FloatArray]) -> None:
        for name, array in values.items():
            held[name][...] = array

    for name, declared in block.spec.states.items():
        shape = state_shape(block, declared, state.context)
        if shape != arrays[name].shape:
            message = f"state '{name}' would have the shape {shape}, not {arrays[name].shape}"
            raise ValueError(f"{message}; this takes a new block")
    # ``start`` expects zeros, and draws what it drew at the start of the run.
    held.pop("rng", None)
    try:
        for name in arrays:
            held[name][...] = 0.0
        block.start(state)
        put(memory)
        # What follows from states, as from weights of an earlier run, which start has drawn anew.
        block.resume(state)
    except Exception:
        held.clear()
        held.update(before)
        put(arrays)
        raise
    put(memory)
    held.pop("rng", None)
    if "rng" in before:
        held["rng"] = before["rng"]
