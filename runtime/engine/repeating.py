"""A prepared engine that runs again from tick 0: with other numbers of blocks, another seed.

In: an engine with ``repeats`` whose blocks have started, and blocks with other parameters in the
place of some. Out: the same engine as a new one for these blocks would be, with the same bits. Only
the blocks that changed start again; all others get back what they had before the first tick::

    seed   block that changes     starts again
    7      pid                    pid: no decoder is solved, no neuron drawn
    8      none                   those that draw: populations, but no controller
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from blocks.core import Block
from runtime.engine.engine import Engine
from runtime.engine.naming import undeclared
from runtime.engine.state import RunState, seed_of
from runtime.errors import SimulationError


def begin_again(engine: Engine, blocks: Mapping[str, Block], seed: int) -> bool:
    """Let an engine begin again; False if that takes a new engine, and this one is of no use then.

    Its recordings are overwritten, those in results included.

    Parameters
    ----------
    blocks : by name; those that are not the engine's have other parameters, but the structure that
        the plan was made of, and publish nothing.

    Raises
    ------
    UsageError : recordings that are too large for memory cannot be written.
    """
    state, before = engine.state, engine.network
    if engine.first is None:
        return False
    state.restore(engine.first)
    entries = dict(before.entries)
    for name, block in blocks.items():
        entries[name] = replace(entries[name], block_or_none=block)
    network = before.changed(entries=entries, seed=seed)
    if state.own:
        state.own_state.begin_again(entries)
    anew = [n for n, each in entries.items() if each.block is not before.entries[n].block]
    changed = set(anew)
    if seed != state.seed:
        state.seed = seed
        anew = [name for name in entries if name in changed or _draws(state, name)]
        for name in entries.keys() - set(anew):  # one may draw for the first time in this run
            state.blocks[name].reseed(_seed(state, name, entries[name].seed))
    engine.network = engine.diagnosis.network = engine.starting.network = network
    for name in changed:
        engine.namespace[engine.program.names.blocks[name]] = entries[name].block
    for name in anew:
        _forget(state, name, entries[name].seed)
    engine.recorder.begin_again()
    engine.diagnosis.begin_again()
    engine.is_checked, engine.wall_s, engine.ready_s = False, 0.0, 0.0
    try:
        engine.starting.begin_again(anew)
    except SimulationError:
        return False  # said, with its place, by a new engine
    return engine.run_again(changed, anew)


def _forget(state: RunState, name: str, own_seed: int | None) -> None:
    """Put a block's state back to what it is before ``start``."""
    block = state.blocks[name]
    held = vars(block)
    for key in (undeclared(block) | {"rng"}) & held.keys():
        del held[key]
    for key in held["_declared"]:
        held[key][...] = 0.0
    block.reseed(_seed(state, name, own_seed))


def _draws(state: RunState, name: str) -> bool:
    """Whether what a block has before the first tick may depend on the seed of the run.

    Of an own block nobody knows: it may have a generator that is not of its state. What a block
    reads when it starts may be of one that draws, as a decoder's neurons are.
    """
    block = state.blocks[name]
    return name in state.own or block.is_seed_read or bool(block.published)


def _seed(state: RunState, name: str, own_seed: int | None) -> Callable[[], np.random.SeedSequence]:
    return partial(seed_of, state.seed if own_seed is None else own_seed, name)
