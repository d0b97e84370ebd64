"""What own blocks keep beside their declared states, in one run.

In: the states of a run. Out: a :class:`Kept` that can be put back in place, and copies for other
runs, by block and attribute. What other runs see as well, as attributes of a class, belongs to no
copy: a run that has changed such memory cannot be copied::

    block 'b' keeps memory in the class attribute 'Counts.total', which all runs share; declare ...
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blocks.core import Block, BlockState, FloatArray
from runtime.engine.naming import undeclared
from runtime.engine.program import Program
from runtime.errors import NotCopiedError
from runtime.memory import (
    Copier,
    Place,
    Record,
    Run,
    SharedPlaces,
    owner_of,
    same_content,
)

Array = np.ndarray[Any, Any]
ADVICE = "declare a State for what changes"


@dataclass
class Kept:
    """What own blocks keep undeclared, as it was.

    record : the contents. attributes : of the states, by block.
    places, shared : what other runs see as well: by block and place, the object that was there;
        by block, the place, and the identity of an object with content.
    blocks : the names of the attributes of blocks that may change.
    """

    record: Record
    attributes: dict[str, dict[str, Any]] = field(default_factory=dict)
    places: list[tuple[str, Place, Any]] = field(default_factory=list)
    shared: list[tuple[str, Place, int]] = field(default_factory=list)
    blocks: dict[str, frozenset[str]] = field(default_factory=dict)

    def apart(self, block: str) -> Iterator[tuple[str, Array, Array]]:
        """The arrays among a block's attributes: name, the array, and what it was."""
        for key, value in self.attributes[block].items():
            if isinstance(value, np.ndarray) and not value.dtype.hasobject:
                copy = self.record.copy_of(value)
                if copy is not None:
                    yield key, value, copy


class OwnState:
    """The undeclared memory of the own blocks of a run.

    Parameters
    ----------
    states : by block. own : the blocks. memory : of all declared states.
    """

    def __init__(
        self,
        program: Program,
        states: Mapping[str, BlockState],
        own: Collection[str],
        memory: FloatArray,
    ) -> None:
        self.states, self.own, self.memory = states, sorted(own), owner_of(memory)
        self.entries: Mapping[str, Any] = program.network.entries
        packages = {self.entries[name].cls.__module__.partition(".")[0] for name in own}
        self.shared = SharedPlaces(frozenset(packages))
        # What all runs share: as it was when this one began; and as it left it, once another goes
        # on from the same memory.
        self.first: Kept | None = None
        self.left: Kept | None = None

    @functools.cached_property
    def outer(self) -> dict[int, Any]:
        """The objects of the run itself, by identity."""
        found: list[Any] = [*self.states.values()]
        found += [entry.block for entry in self.entries.values()]
        for state in self.states.values():
            found += [state.context, state.context.world]
        return {id(value): value for value in found if value is not None}

    def begin_again(self, entries: Mapping[str, Any]) -> None:
        """Let other blocks have the states."""
        self.entries = entries
        self.__dict__.pop("outer", None)

    def kept(self, compiled: Collection[str], shared_alone: bool = False) -> Kept:
        """What there is now.

        Parameters
        ----------
        compiled : the blocks whose code can only change arrays of their state.
        shared_alone : without what belongs to this run.

        Raises
        ------
        NotCopiedError : a block keeps something that cannot be copied.
        """
        outer = dict(self.outer)
        for name in self.own:
            drawn = vars(self.states[name]).values()
            outer |= {id(each): each for each in drawn if isinstance(each, np.random.Generator)}
        kept = Kept(Record(outer, self.memory))
        for name in self.own:
            try:
                if not shared_alone:
                    held = vars(self.states[name])
                    mine = kept.attributes[name] = {
                        k: held[k] for k in undeclared(self.states[name])
                    }
                    for key, value in mine.items():
                        kept.record.add(value, f"state.{key}")
                if name not in compiled:
                    self._share(kept, name)
            except NotCopiedError as error:
                raise NotCopiedError(f"block '{name}' {error}; {ADVICE}") from None
        return kept

    def _share(self, kept: Kept, name: str) -> None:
        """Record what other runs see as well: of a block, its class, and what it refers to."""
        block, record = self.entries[name].block, kept.record
        for key, value in vars(block).items():
            self._place(kept, name, _attribute(block, key), value)
        kept.blocks[name] = frozenset(vars(block))
        record.add(vars(block), "self")
        record.entered.append(type(block))
        while record.entered:
            for place in self.shared.of(record.entered.pop()):
                self._place(kept, name, place, place.value)

    def _place(self, kept: Kept, name: str, place: Place, value: Any) -> None:
        kept.places.append((name, place, value))
        new = kept.record.add(value, place.label, shared=True)
        kept.shared += [(name, place, key) for key in new]

    def restore(self, kept: Kept) -> None:
        """Put everything back in place."""
        for name, attributes in kept.attributes.items():
            held = vars(self.states[name])
            for key in undeclared(self.states[name]) - attributes.keys():
                del held[key]
            held.update(attributes)
        for _, place, value in kept.places:
            place.put(value)
        kept.record.restore()

    def begun(self, compiled: Collection[str]) -> dict[str, Mapping[str, Any]]:
        """Copies before the first tick, by block; of blocks that can be copied."""
        found: dict[str, Mapping[str, Any]] = {}
        self.first = None
        try:
            self.first = self.kept(compiled, shared_alone=True)
            for name in self.own:
                found[name] = self.copies(name)
        except NotCopiedError:
            pass  # said where a copy is asked for
        return found

    def copies(self, name: str) -> dict[str, Any]:
        """A copy of what a block keeps undeclared, but for generators; it belongs to no run.

        Raises
        ------
        NotCopiedError : something cannot be copied.
        """
        held, copied = vars(self.states[name]), Copier(self._run(name))
        found = {}
        for key in sorted(undeclared(self.states[name])):
            if not isinstance(held[key], np.random.Generator):
                try:
                    found[key] = copied(held[key])
                except (NotCopiedError, RecursionError) as error:
                    text = f"block '{name}' keeps in state.{key} {error}; {ADVICE}"
                    raise NotCopiedError(text) from error
        return found

    def take(self, name: str, values: Mapping[str, Any]) -> None:
        """Put copies in place: in arrays that are there, which others may refer to."""
        held, copied = vars(self.states[name]), Copier(None, self._run(name))
        for key, value in values.items():
            there = held.get(key)
            if isinstance(there, np.ndarray) and isinstance(value, np.ndarray):
                same = (there.shape, there.dtype) == (value.shape, value.dtype)
                if same and there.flags.writeable and owner_of(there) is not self.memory:
                    copied.place(value, there)
        for key, value in values.items():
            setattr(self.states[name], key, copied(value))

    def _run(self, name: str) -> Run:
        state = self.states[name]
        objects = {"block": self.entries[name].block, "state": state, "context": state.context}
        if state.context.world is not None:
            objects["world"] = state.context.world
        held = vars(state)
        drawn = {k: v for k, v in held.items() if isinstance(v, np.random.Generator)}
        states = {key: held[key] for key in held["_declared"]}
        return Run(objects | drawn, states, self.memory)

    def shared_now(self) -> Kept:
        """What all runs share, as it is now."""
        return self.kept((), shared_alone=True)

    def check_shared(self, moves: bool = False) -> None:
        """Raise the error of a run that has changed what other runs see as well.

        Parameters
        ----------
        moves : whether it goes on elsewhere, with other blocks: only what these have is lost.

        Raises
        ------
        NotCopiedError : naming the block, and what it has changed.
        """
        for name, place in self._changed(self.first):
            if not moves or place.owner is vars(self.entries[name].block):
                text = f"block '{name}' keeps memory in {place.label}, which all runs share"
                raise NotCopiedError(f"{text}; {ADVICE}")

    def check_left(self) -> None:
        """Raise the error of a run whose shared memory another one has changed.

        Raises
        ------
        NotCopiedError : naming the block, and what was changed.
        """
        for name, place in self._changed(self.left):
            text = f"block '{name}' keeps memory in {place.label}, which another run has changed"
            raise NotCopiedError(f"{text} since; {ADVICE}")

    def leave(self) -> None:
        """Remember what all runs share: from now on, another one may change it."""
        with suppress(NotCopiedError):
            self.left = self.shared_now() if self.own else None

    def _changed(self, kept: Kept | None) -> Iterator[tuple[str, Place]]:
        """What all runs share and is not as it was then: blocks and places."""
        if kept is None:
            return
        for name, place, value in kept.places:
            if place.value is not value and not same_content(place.value, value):
                yield name, place
        for name, before in kept.blocks.items():
            block = self.entries[name].block
            for key in vars(block).keys() - before:
                found = inspect.getattr_static(type(block), key, None)
                if not isinstance(found, functools.cached_property):
                    yield name, _attribute(block, key)
        for name, place, identity in kept.shared:
            if kept.record.has_changed(identity):
                yield name, place

    def restore_shared(self) -> None:
        """Put what all runs share back to what it was when this one began."""
        if self.first is not None:
            self.restore(self.first)


def _attribute(block: Block, key: str) -> Place:
    return Place(vars(block), key, f"its attribute 'self.{key}'")
