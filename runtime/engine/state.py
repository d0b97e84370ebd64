"""The state of a run: everything that moves from tick to tick, under names, with one owner.

A checkpoint is a copy of it. Restoring one puts all values back in place: arrays keep their
addresses, which compiled code holds, and generators stay the objects that blocks have.

Everything that changes is in declared states, the blocks' generators, the solver's control, the
search for a stop, the variables that outlive a tick, and the numbers of a compiled plan. A block of
the user's own may keep more, against the rules that :func:`runtime.check_block` checks: whatever
else is in its state is copied, too. Recorded rows are none of it: a tick writes its own rows.
"""

from __future__ import annotations

import copy
import hashlib
import math
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blocks.core import BlockState, FloatArray
from blocks.registry import is_built_in
from runtime.engine.events import BEFORE, SEARCH, UNKNOWN
from runtime.engine.program import Program

Held = tuple[Any, ...]
Array = np.ndarray[Any, Any]
Restored = Callable[[], None]
# What an engine gives every block, and what cannot change.
GIVEN = frozenset(("_declared", "context", "dt", "seed", "published"))
FIXED: tuple[type, ...] = (int, float, complex, str, bytes, type(None), np.generic)
FIXED += (type, types.FunctionType, types.BuiltinFunctionType, types.ModuleType)
FIXED += (np.random.SeedSequence,)


class NotCopiedError(Exception):
    """A block keeps something that cannot be copied: the text says where and why."""


def seed_of(seed: int, name: str) -> np.random.SeedSequence:
    """The seed of one block; it depends only on the run's seed and the block's name.

    Removing a block leaves the neurons and the noise of every other block unchanged.
    """
    digest = hashlib.sha256(name.encode()).digest()
    words = tuple(int.from_bytes(digest[i : i + 4], "little") for i in (0, 4, 8, 12))
    return np.random.SeedSequence(seed, spawn_key=words)


@dataclass(frozen=True)
class Checkpoint:
    """What a run's state was before a tick.

    arrays : copies by the names of :attr:`RunState.arrays`.
    apart : arrays that own blocks keep undeclared, by ``block.attribute``, with their copies.
    generators : by ``block.attribute``, with the state of the bit generator.
    others : what puts back the rest of the states of own blocks.
    """

    tick: int
    held: Held
    arrays: Mapping[str, Array]
    apart: Mapping[str, tuple[Array, Array]]
    generators: Mapping[str, tuple[np.random.Generator, Mapping[str, Any]]]
    others: tuple[Restored, ...]


@dataclass
class RunState:
    """The state of one run of a program.

    ``blocks`` are the states by block; ``own`` names the blocks that are not built in, and
    ``compiled`` those that are compiled, of which only arrays and generators can move;
    ``continuous`` is the row of all continuous states, of which the blocks' arrays are views;
    ``held`` are the variables that go into the next tick, as the runner has them; ``stop`` says
    whether and where ``run.stop`` ended the run. ``arrays`` are all arrays that move, by
    ``block.state`` or by ``run/name``, each in place for the whole run. ``rows`` are the states of
    blocks that are computed together, a row per block, of which the blocks' arrays are views.
    """

    program: Program
    seed: int
    tick: int = 0
    held: Held = ()
    blocks: dict[str, BlockState] = field(init=False)
    continuous: FloatArray = field(init=False)
    stop: FloatArray = field(init=False)
    arrays: dict[str, Array] = field(init=False)
    rows: dict[tuple[str, ...], dict[str, FloatArray]] = field(init=False)
    own: set[str] = field(init=False)
    compiled: set[str] = field(init=False, default_factory=set)

    def __post_init__(self) -> None:
        entries = self.program.network.entries
        self.continuous = np.zeros(self.program.plan.row.size)
        self.stop = np.zeros(4)
        self.stop[BEFORE] = math.nan
        self.arrays = {"run/continuous": self.continuous, "run/stop": self.stop}
        part = self.program.plan.integration
        if part is not None and part.ends_steps:
            self.arrays["run/search"] = np.zeros(SEARCH)
            self.arrays["run/sides"] = np.where(part.directions > 1.0, -1.0, UNKNOWN)
            self.arrays["run/guards"] = np.zeros(len(part.directions))
            self.arrays["run/count"] = np.zeros(1)
        self.rows = {
            members: {
                state.name: np.zeros((len(members), *state.shape))
                for state in self.program.plan.states[members[0]]
            }
            for members in self.program.stacking.members
        }
        self._row_of = {name: (m, i) for m in self.rows for i, name in enumerate(m)}
        self.blocks = {name: self._block(name) for name in entries}
        self.own = {name for name, entry in entries.items() if not is_built_in(entry.cls)}

    def _block(self, name: str) -> BlockState:
        states, slots = self.program.plan.states[name], self.program.plan.row.of(name)
        if name in self._row_of:
            members, i = self._row_of[name]
            arrays = {key: array[i, ...] for key, array in self.rows[members].items()}
        else:
            arrays = {state.name: np.zeros(state.shape) for state in states}
        for slot in slots:
            arrays[slot.name] = self.continuous[slot.start : slot.stop].reshape(slot.shape)
        apart = arrays.keys() - {slot.name for slot in slots}
        self.arrays |= {f"{name}.{key}": arrays[key] for key in arrays if key in apart}
        own = self.program.network.entries[name].seed
        seed = seed_of(self.seed if own is None else own, name)
        return BlockState(self.program.contexts[name], seed, arrays)

    def stacks(self) -> dict[str, Any]:
        """What computes equal blocks together, by its name in the plan's text."""
        found = {}
        for number, (members, arrays) in enumerate(self.rows.items()):
            blocks = [self.program.network.entries[name].block for name in members]
            states = [self.blocks[name] for name in members]
            found[f"stack_{number}"] = type(blocks[0]).stacked(blocks, states, arrays)
        return found

    def checkpoint(self) -> Checkpoint:
        """A copy of the state.

        Raises
        ------
        NotCopiedError : an own block keeps something that cannot be copied.
        """
        arrays = {name: array.copy() for name, array in self.arrays.items()}
        apart = {
            f"{name}.{key}": (a, a.copy()) for name in self.own for key, a in self._apart(name)
        }
        generators = {
            f"{name}.{key}": (generator, generator.bit_generator.state)
            for name in self.blocks
            for key, generator in self.generators(name).items()
        }
        others = tuple(map(self._others, sorted(self.own - self.compiled)))
        return Checkpoint(self.tick, self.held, arrays, apart, generators, others)

    def restore(self, saved: Checkpoint) -> None:
        """Put back what a checkpoint of this run holds; it may be restored again."""
        self.tick, self.held = saved.tick, saved.held
        for name, array in self.arrays.items():
            array[...] = saved.arrays[name]
        for name, state in self.blocks.items():
            if f"{name}.rng" not in saved.generators:
                vars(state).pop("rng", None)  # made when it is first used
        for put_back in saved.others:
            put_back()
        for array, numbers in saved.apart.values():
            array[...] = numbers
        for key, (generator, bits) in saved.generators.items():
            name, _, attribute = key.rpartition(".")
            # An earlier checkpoint may have removed it: the block had not drawn yet.
            vars(self.blocks[name])[attribute] = generator
            generator.bit_generator.state = bits

    def generators(self, name: str) -> dict[str, np.random.Generator]:
        """The generators in a block's state: its own, and others of an own block."""
        held = vars(self.blocks[name])
        keys = held if name in self.own else ("rng",) if "rng" in held else ()
        return {key: held[key] for key in keys if isinstance(held[key], np.random.Generator)}

    def _apart(self, name: str) -> Iterator[tuple[str, Array]]:
        """The arrays in a block's state that nothing declares, and that can be written to."""
        for key in self._undeclared(name):
            value = getattr(self.blocks[name], key)
            if isinstance(value, np.ndarray) and value.flags.writeable and not _is_copied(value):
                yield key, value

    def _undeclared(self, name: str) -> set[str]:
        """The attributes of a block's state that nothing declares."""
        declared = {state.name for state in self.program.plan.states[name]}
        return vars(self.blocks[name]).keys() - declared - GIVEN - {"rng"}

    def _others(self, name: str) -> Restored:
        """What puts back the undeclared attributes of a block's state."""
        held, undeclared = vars(self.blocks[name]), self._undeclared(name)
        found = {key: held[key] for key in undeclared}
        loose = {key: value for key, value in found.items() if _is_copied(value)}
        # What belongs to the run stays the same object where a copied one refers to it.
        run = [value for key, value in held.items() if key not in loose]
        run += [self.program.network.entries[name].block, held["context"].world]
        memo = {id(value): value for value in run}
        for key, value in loose.items():
            try:
                loose[key] = copy.deepcopy(value, memo)
            except Exception as error:  # copying runs code of the object
                raise NotCopiedError(
                    f"block '{name}' keeps in state.{key} what cannot be copied "
                    f"({type(value).__name__}: {error})"
                ) from error

        def restored() -> None:
            for key in self._undeclared(name) - found.keys():
                del held[key]
            # Copied again, so that a checkpoint can be restored twice.
            held.update(found | copy.deepcopy(loose, dict(memo)))

        return restored


def _is_copied(value: Any) -> bool:
    """Whether a value can only be put back as a copy."""
    if isinstance(value, tuple):
        return any(isinstance(part, np.ndarray) or _is_copied(part) for part in value)
    if isinstance(value, np.ndarray):
        return bool(value.dtype.hasobject)
    return not isinstance(value, (*FIXED, np.random.Generator))
