"""The state of a run: everything that moves from tick to tick, under names, with one owner.

In: a program and a seed. Out: arrays by name, ``state.arrays["plant.x"]``, and snapshots of all
that moves. Restoring one puts all values back in place: arrays keep their addresses, which compiled
code holds, and generators stay the objects that blocks have.

Everything that changes is in declared states, the blocks' generators, the solver's control, the
search for a stop, the variables that outlive a tick, and the numbers of a compiled plan. A block of
the user's own may keep more, against the rules that :func:`runtime.check_block` checks: that is in
the snapshot, too, see :mod:`.own_state`. Recorded rows are none of it: a tick writes its own rows.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blocks.core import BlockState, FloatArray
from blocks.library.registry import is_built_in
from runtime.engine.events import BEFORE, MEMORY, SEARCH
from runtime.engine.loops import memory_shape
from runtime.engine.program import Program
from runtime.engine.steps import controls
from runtime.network import Network
from runtime.plan import Plan

if TYPE_CHECKING:  # of a run with own blocks
    from runtime.engine.own_state import Kept, OwnState

Held = tuple[Any, ...]
Array = np.ndarray[Any, Any]
Layout = dict[str, tuple[int, tuple[int, ...]]]
LINE = 8  # the numbers of a cache line


def seed_of(seed: int, name: str) -> np.random.SeedSequence:
    """The seed of one block; it depends only on the run's seed and the block's name.

    Removing a block leaves the neurons and the noise of every other block unchanged.
    """
    digest = hashlib.sha256(name.encode()).digest()
    words = tuple(int.from_bytes(digest[i : i + 4], "little") for i in (0, 4, 8, 12))
    return np.random.SeedSequence(seed, spawn_key=words)


def run_shapes(plan: Plan) -> dict[str, tuple[int, ...]]:
    """The arrays that a plan keeps beside those of the blocks, by name."""
    found: dict[str, tuple[int, ...]] = {}
    part = plan.integration
    if part is not None:
        found["control"] = (len(controls(0.0, 0.0, 0.0)),)
    if part is not None and part.ends_steps:
        guards = len(part.directions)
        found |= {
            "search": (SEARCH,),
            "sides": (MEMORY, guards),
            "guards": (guards,),
            "count": (1,),
        }
    return found | {f"loop_{loop.number}": memory_shape(loop) for loop in plan.loops}


def _row_of(members: tuple[str, ...], state: str) -> str:
    """The name of the memory of blocks that are computed together."""
    return f"run/{members[0]} and others.{state}"


class Snapshot(NamedTuple):
    """What a run's state was before a tick: a copy that belongs to the run it was taken of.

    memory : a copy of :attr:`RunState.memory`; ``numbers`` of the compiled plan's, if there is one.
    generators : the states of bit generators, by ``block.attribute``.
    own : what own blocks keep undeclared; None without own blocks.
    """

    tick: int
    held: Held
    memory: FloatArray
    numbers: Array | None
    layout: Layout
    generators: Mapping[str, Mapping[str, Any]]
    own: Kept | None

    def array(self, name: str) -> FloatArray:
        """One of :attr:`RunState.arrays` as it was."""
        start, shape = self.layout[name]
        return self.memory[start : start + math.prod(shape)].reshape(shape)


@dataclass(frozen=True)
class Begun:
    """What a run was before its first tick: arrays, and what own blocks keep undeclared."""

    arrays: Mapping[str, FloatArray]
    own: Mapping[str, Mapping[str, Any]]


@dataclass
class RunState:
    """The state of one run of a program.

    ``blocks`` are the states by block; ``own`` names the blocks that are not built in, of which
    ``own_state`` has what they keep undeclared, and ``compiled`` those that are compiled.
    ``held`` are the variables that go into the next tick, as the runner has them; ``stop`` says
    whether and where ``run.stop`` ended the run. ``memory`` has the numbers of all ``arrays``,
    which are by ``block.state`` or by ``run/name``; so a copy of all is one. ``continuous`` is the
    row of all continuous states, ``rows`` are the states of blocks that are computed together, a
    row per block; the blocks' arrays are views of both. ``numbers`` is the memory of a compiled
    plan.
    """

    program: Program
    seed: int
    tick: int = 0
    held: Held = ()
    numbers: Array | None = None
    blocks: dict[str, BlockState] = field(init=False)
    memory: FloatArray = field(init=False)
    layout: Layout = field(init=False)
    arrays: dict[str, FloatArray] = field(init=False)
    rows: dict[tuple[str, ...], dict[str, FloatArray]] = field(init=False)
    continuous: FloatArray = field(init=False)
    stop: FloatArray = field(init=False)
    own: set[str] = field(init=False)
    compiled: set[str] = field(init=False, default_factory=set)

    def __post_init__(self) -> None:
        plan, entries = self.program.plan, self.program.network.entries
        shapes: dict[str, tuple[int, ...]] = {"run/continuous": (plan.row.size,), "run/stop": (4,)}
        shapes |= {f"run/{name}": shape for name, shape in run_shapes(plan).items()}
        groups = self.program.stacking.members
        together = {name for members in groups for name in members}
        for members in groups:
            for state in plan.states[members[0]]:
                shapes[_row_of(members, state.name)] = (len(members), *state.shape)
        for name in entries.keys() - together:
            slots = {slot.name for slot in plan.row.of(name)}
            own = [state for state in plan.states[name] if state.name not in slots]
            shapes |= {f"{name}.{state.name}": state.shape for state in own}
        self._allocate(shapes)
        self.continuous, self.stop = self.arrays["run/continuous"], self.arrays["run/stop"]
        self.stop[BEFORE] = math.nan
        self.rows = {
            members: {
                state.name: self.arrays.pop(_row_of(members, state.name))
                for state in plan.states[members[0]]
            }
            for members in groups
        }
        self._place = {name: (m, i) for m in self.rows for i, name in enumerate(m)}
        self.blocks = {name: self._block(name) for name in entries}
        self.own = {name for name, entry in entries.items() if not is_built_in(entry.cls)}

    @cached_property
    def own_state(self) -> OwnState:
        """What own blocks keep undeclared."""
        from runtime.engine.own_state import OwnState

        return OwnState(self.program, self.blocks, self.own, self.memory)

    def _allocate(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        """One memory for all arrays, each from a cache line of its own on."""
        self.layout, size = {}, 0
        for name in sorted(shapes):
            self.layout[name] = size, shapes[name]
            size += -(-math.prod(shapes[name]) // LINE) * LINE
        loose = np.zeros(size + LINE)
        first = -(loose.ctypes.data // 8) % LINE
        self.memory = loose[first : first + size]
        self.arrays = {
            name: self.memory[at : at + math.prod(shape)].reshape(shape)
            for name, (at, shape) in self.layout.items()
        }

    def _block(self, name: str) -> BlockState:
        states, slots = self.program.plan.states[name], self.program.plan.row.of(name)
        if name in self._place:
            members, i = self._place[name]
            for state in states:
                at, shape = self.layout[_row_of(members, state.name)]
                self.layout[f"{name}.{state.name}"] = at + i * math.prod(shape[1:]), shape[1:]
        at, _ = self.layout["run/continuous"]
        for slot in slots:
            self.layout[f"{name}.{slot.name}"] = at + slot.start, slot.shape
        arrays = {state.name: self._view(f"{name}.{state.name}") for state in states}
        arrays |= {slot.name: self._view(f"{name}.{slot.name}") for slot in slots}
        self.arrays |= {f"{name}.{key}": array for key, array in arrays.items()}
        own = self.program.network.entries[name].seed
        seed = seed_of(self.seed if own is None else own, name)
        return BlockState(self.program.contexts[name], seed, arrays)

    def _view(self, name: str) -> FloatArray:
        start, shape = self.layout[name]
        return self.memory[start : start + math.prod(shape)].reshape(shape)

    def is_together(self, name: str) -> bool:
        """Whether a block is computed together with others."""
        return name in self._place

    def stacks(self, network: Network) -> dict[str, Any]:
        """What computes equal blocks together, by its name in the plan's text."""
        found = {}
        for number, (members, arrays) in enumerate(self.rows.items()):
            blocks = [network.entries[name].block for name in members]
            states = [self.blocks[name] for name in members]
            found[f"stack_{number}"] = type(blocks[0]).stacked(blocks, states, arrays)
        return found

    def snapshot(self) -> Snapshot:
        """A copy of the state.

        Raises
        ------
        NotCopiedError : an own block keeps something that cannot be copied.
        """
        own = self.own_state.kept(self.compiled) if self.own else None
        numbers = None if self.numbers is None else self.numbers.copy()
        memory = self.memory.copy()
        return Snapshot(self.tick, self.held, memory, numbers, self.layout, self.drawn(), own)

    def restore(self, saved: Snapshot) -> None:
        """Put back what a snapshot of this run holds; it may be restored again."""
        self.tick, self.held = saved.tick, saved.held
        self.memory[:] = saved.memory
        if self.numbers is not None and saved.numbers is not None:
            self.numbers[...] = saved.numbers
        if saved.own is not None:
            self.own_state.restore(saved.own)
        self.set_drawn(saved.generators)

    def set_drawn(self, generators: Mapping[str, Mapping[str, Any]]) -> None:
        """Put bit generators into the states that :meth:`drawn` returned, of this run or another.

        One that is not there yet, since its block makes it when it first draws, is made.
        """
        for name, state in self.blocks.items():
            # Compiled code has its address: it stays, as it was before the block first drew.
            if "rng" in vars(state) and f"{name}.rng" not in generators:
                state.rng.bit_generator.state = np.random.PCG64(state.seed).state
        for key, bits in generators.items():
            name, _, attribute = key.rpartition(".")
            if name not in self.blocks:
                continue
            state = self.blocks[name]
            if attribute != "rng" and attribute not in vars(state):
                kind = getattr(np.random, str(bits["bit_generator"]))
                setattr(state, attribute, np.random.Generator(kind()))
            getattr(state, attribute).bit_generator.state = bits

    def begun(self) -> Begun:
        """A copy of the state before the first tick, by names."""
        return Begun(self.copies(), self.own_state.begun(self.compiled) if self.own else {})

    def copies(self) -> dict[str, FloatArray]:
        """Copies of the arrays, by name."""
        return {name: array.copy() for name, array in self.arrays.items()}

    def drawn(self) -> dict[str, Mapping[str, Any]]:
        """The states of all bit generators, by ``block.attribute``."""
        found = {}
        # In one pass, since most blocks have none: this is a part of every snapshot.
        for name, state in self.blocks.items():
            held = state.__dict__
            if "rng" in held:
                found[f"{name}.rng"] = held["rng"].bit_generator.state
        for name in self.own:
            for key, generator in self.generators(name).items():
                found[f"{name}.{key}"] = generator.bit_generator.state
        return found

    def generators(self, name: str) -> dict[str, np.random.Generator]:
        """The generators in a block's state: its own, and others of an own block."""
        held = vars(self.blocks[name])
        keys = held if name in self.own else ("rng",) if "rng" in held else ()
        return {key: held[key] for key in keys if isinstance(held[key], np.random.Generator)}
