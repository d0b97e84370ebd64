"""What the C text of a controller is written from: names, states, and what may fail."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import BlockState, SignalType
from runtime.codegen import stored
from runtime.engine.compiled import PlanText
from runtime.errors import UsageError
from runtime.export.names import member_name, unused
from runtime.export.selection import Selection
from runtime.export.tuning import Followed, followed
from runtime.export.units import Units
from runtime.plan import Port, numbers_in

LEARNT = ("weights", "bias", "inverse", "scaled_encoders", "theta")  # states that a reset keeps
# Members of the struct beside signals and states.
MEMBERS = frozenset(("tick", "failure", "arena", "arena_most", "none", "signals", "parameters"))
ENGINE = ""  # instead of a block: the owner of the solver's memory
SHORT = 16  # numbers of an array that is a parameter: the gain of a controller, not a table
# What the engine keeps for a solver and never changes.
FIXED = frozenset(("table", "errors", "directions", "edges", "colours", "pattern", "places"))


@dataclass(frozen=True)
class Parameter:
    """A number of a block that may be changed while a controller runs.

    name : the member of the struct of parameters. doc : what it is.
    value : what it begins with: a number, or an array.
    path : as a session names it, ``pid.kp``. unit : of its numbers.
    low, high : its bounds; ``is_above``, ``is_below``
        say whether they are themselves too small or too large.
    """

    name: str
    doc: str
    value: float | np.ndarray[Any, Any]
    path: str = ""
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    is_above: bool = False
    is_below: bool = False

    @property
    def size(self) -> int:
        return int(np.size(self.value))

    @property
    def dimension(self) -> str:
        """What follows its name in a declaration."""
        return "" if isinstance(self.value, float) else f"[{self.size}]"


@dataclass(frozen=True)
class Layout:
    """Everything that the C text is written from.

    Parameters
    ----------
    name : of the controller's struct and functions.
    units : the blocks' functions.
    plan : the plan in C, with the members of its structs.
    engine : arrays of the engine by name, as a solver's memory. blocks : states, by block.
    reset : the initial states of parts that are reset, by block.
    constants : the values of constant outputs.
    arena : bytes for local arrays of blocks.
    hold : whether inputs that are not finite keep their last value, instead of a failure.
    loose : whether all numbers of a step are parameters, also those that follow from others, and
        none follows: a page computes what follows when it is written.
    """

    name: str
    selection: Selection
    units: Units
    plan: PlanText
    engine: Mapping[str, np.ndarray[Any, Any]]
    blocks: Mapping[str, BlockState]
    reset: Mapping[str, Any]
    constants: Mapping[Port, Any]
    arena: int
    hold: bool = False
    loose: bool = False

    @cached_property
    def names(self) -> dict[Any, str]:
        """C names of signals by (block, port), of states by (block, word, "state"), of held inputs
        by (block, port, "held"), and of blocks by name."""
        taken = set(MEMBERS)
        selection = self.selection
        ports = dict.fromkeys((*selection.inputs, *selection.constants, *selection.outputs))
        found: dict[Any, str] = {}
        declared = (*selection.network.inputs.values(), *selection.network.outputs.values())
        public = {(each.end.block, each.end.port): each.name for each in declared}
        for key in (*ports, *selection.blocks):
            text = key if isinstance(key, str) else public.get((key[0], key[1])) or "_".join(key)
            found[key] = unused(member_name(text), taken)
        for block, unit in self.units.blocks.items():
            for (word, _), owned in zip(unit.words, unit.owned, strict=True):
                if owned:
                    name = f"{found[block]}__{word.removeprefix('state_')}"
                    found[block, word, "state"] = unused(name, taken)
        for block, word in self.others:
            owner = found[block] if block != ENGINE else "run"
            name = f"{owner}__{word.removeprefix('state_')}"
            found[block, word, "state"] = unused(name, taken)
        for port in selection.inputs:
            found[(*port, "held")] = unused(f"{found[port]}__held", taken)
        return found

    @property
    def arena_words(self) -> int:
        """The arena's length, in words of eight bytes."""
        return max(1, -(-self.arena // 8))

    @cached_property
    def others(self) -> dict[tuple[str, str], np.ndarray[Any, Any]]:
        """What belongs to a controller's memory beside what blocks read and write.

        The engine's arrays that are not constant, and states that are only ever set back.
        """
        found: dict[tuple[str, str], np.ndarray[Any, Any]] = {}
        for kind, owner, item in sorted(self.plan.struct.pointers.values()):
            if kind == "array" and owner not in FIXED and not owner.startswith("probe_"):
                found[ENGINE, owner] = self.engine[owner]
            key = owner, f"state_{item}"
            unit = self.units.blocks.get(owner)
            words = [word for word, _ in unit.words] if unit else []
            if kind == "state" and key[1] not in words:
                if owner not in self.selection.blocks:
                    message = (
                        "belongs to a part that is enabled; export all of the part, or no block"
                    )
                    raise UsageError(f"block '{owner}' {message} of it")
                found[key] = getattr(self.blocks[owner], item)
        return found

    def initial(self, block: str, state: str) -> np.ndarray[Any, Any]:
        """What a state is set back to."""
        return np.atleast_1d(getattr(self.reset[block], state))

    @cached_property
    def parameters(self) -> dict[tuple[str, str], Parameter]:
        """The numbers that a step takes from the struct of parameters, by block and path or word.

        Tunable parameters by path; by word, numbers that follow from a tunable parameter by what
        only the graph computes, as a gain that an LQR solves for.
        """
        if self.loose:
            return self._every_number()
        found: dict[tuple[str, str], Parameter] = {}
        taken: set[str] = set()
        for block, follows in self.followed.items():
            for one in follows.tunables:
                of, unit = one.declared, f" ({one.declared.unit})" if one.declared.unit else ""
                low, high = _bound(of.above, of.at_least, -1), _bound(of.below, of.at_most, 1)
                value = one.value.item() if one.is_scalar else np.ravel(one.value)
                path, doc = f"{block}.{one.path}", f"{block}.{one.path}: {of.doc}{unit}"
                bounds = low[0], high[0], low[1], high[1]
                made = Parameter(one.member, doc, value, path, of.unit, *bounds)
                taken.add(one.member)
                found[block, one.path] = made
            sources: dict[str, list[str]] = {}
            for path, words in follows.others.items():
                for word in words:
                    sources.setdefault(word, []).append(path)
            for word, paths in sources.items():
                value = self._settable(block, word)
                if value is not None and (block, word) not in self.tuned:
                    name = word.partition("_")[2]
                    several = len(follows.others.get(name, ())) > 1
                    name += "_in_step" * several  # one of the numbers that follow from it
                    doc = f"{block}.{name}: the graph computes it from {', '.join(paths)}"
                    member = unused(member_name(f"{block}_{name}"), taken)
                    found[block, word] = Parameter(member, doc, value, f"{block}.{name}")
        return found

    def _settable(self, block: str, word: str) -> float | np.ndarray[Any, Any] | None:
        """The value of a word that nothing in a step changes; None if it is no such number."""
        text = self.units.blocks.get(block)
        if text is None:
            return None
        for (each, c_type), value, owned in zip(text.words, text.values, text.owned, strict=True):
            is_array = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size > 0
            if each == word and (c_type == "double" or is_array):
                is_fixed = not owned or (block, word) in self.fixed
                return (value if is_array else float(value)) if is_fixed else None
        return None

    def _every_number(self) -> dict[tuple[str, str], Parameter]:
        """The numbers of the blocks and their short arrays."""
        found: dict[tuple[str, str], Parameter] = {}
        taken: set[str] = set()
        for block, text in self.units.blocks.items():
            declared = self.selection.network.entries[block].cls.spec.params
            words = zip(text.words, text.values, text.owned, strict=True)
            for (word, c_type), value, owned in words:
                if c_type == "double" or _is_short(value, owned):
                    owner, _, name = word.partition("_")
                    own = declared.get(name) if owner == "self" else None
                    doc = f"{own.doc}{f' ({own.unit})' if own.unit else ''}" if own else "derived"
                    member = unused(member_name(f"{block}_{name}"), taken)
                    begun = value if isinstance(value, np.ndarray) else float(value)
                    found[block, word] = Parameter(member, f"{block}.{name}: {doc}", begun)
        return found

    @cached_property
    def followed(self) -> dict[str, Followed]:
        """What follows from the tunable parameters of each block."""
        if self.loose:
            return {}
        entries = self.selection.network.entries
        attributes: dict[str, tuple[tuple[str, str], ...]] = {
            block: self.units.kernels[block].inputs.attributes for block in self.units.blocks
        }
        for block, port in self.constants:
            methods = [e.method for e in entries[block].block.evaluations if port in e.outputs]
            alone = not entries[block].cls.spec.inputs and len(entries[block].cls.spec.outputs) == 1
            if alone and block not in attributes:
                attributes[block] = (("output", methods[0]),)
        found, members = {}, set[str]()
        for block, of in attributes.items():
            if any(port.publishes for port in entries[block].cls.spec.outputs.values()):
                continue  # others have read from it when they started
            made = followed(block, entries[block].block, self.blocks[block], of, members)
            words = {(block, word) for word in made.words}
            if words & self._owned.keys() <= self.fixed:
                found[block] = made
        return found

    def constant_output(self, block: str) -> tuple[str, ...]:
        """The C of the numbers of an output that does not change but with its parameters."""
        of = self.followed.get(block)
        words = of.words.items() if of else ()
        outputs = [texts for word, texts in words if word.startswith("output_")]
        return tuple(text for texts in outputs for text in texts)

    @cached_property
    def tuned(self) -> dict[tuple[str, str], tuple[str, ...]]:
        """The words that follow from parameters, with the C of their numbers, by block and word."""
        return {
            (block, word): texts
            for block, follows in self.followed.items()
            for word, texts in follows.words.items()
        }

    @cached_property
    def fixed(self) -> frozenset[tuple[str, str]]:
        """The arrays among the states that nothing in a step writes to, by block and word."""
        pointers = self.plan.struct.pointers.values()
        moving = {(owner, f"state_{item}") for kind, owner, item in pointers if kind == "state"}
        moving |= self.others.keys()
        for block, text in self.units.blocks.items():
            written = stored(text.functions, text.methods.values())
            moving |= {(block, word) for word in written}
        arrays = {**self.others, **self._owned}
        changed = [arrays[key] for key in moving if key in arrays]
        return frozenset(
            key
            for key, array in self._owned.items()
            if array.dtype.kind in "fib" and not self.loose
            if not any(np.may_share_memory(array, other) for other in changed)
        )

    @cached_property
    def _owned(self) -> dict[tuple[str, str], np.ndarray[Any, Any]]:
        return {
            (block, word): value
            for block, text in self.units.blocks.items()
            for (word, _), value, owned in zip(text.words, text.values, text.owned, strict=True)
            if owned
        }

    def kind(self, port: Port) -> SignalType:
        return self.selection.network.types[port]

    def count(self, port: Port) -> int:
        """How many numbers an output has."""
        return numbers_in(self.kind(port))

    @property
    def members(self) -> tuple[tuple[tuple[str, int], ...], ...]:
        """The members for inputs and for outputs, with the lengths of arrays; 0: a number."""

        def member(port: Port) -> tuple[str, int]:
            is_number = self.kind(port).form == "scalar"
            return self.names[port], 0 if is_number else self.count(port)

        both = self.selection.inputs, self.selection.outputs
        return tuple(tuple(map(member, ports)) for ports in both)

    def declared(self, port: Port, name: str = "") -> str:
        """The declaration of a signal's member, with what it is; a held one is an array."""
        kind = self.kind(port)
        size = "" if kind.form == "scalar" and not name else f"[{self.count(port)}]"
        return (
            f"    double {name or self.names[port]}{size}; /* {comment('.'.join(port))}: {kind} */"
        )

    def is_learnt(self, member: str) -> bool:
        """Whether a reset keeps a state."""
        return self.state_names[member] in LEARNT

    @cached_property
    def learnt(self) -> dict[str, int]:
        """The members that a reset keeps, with how many numbers they have."""
        return {member: v.size for _, member, v in self.states() if self.is_learnt(member)}

    @cached_property
    def failures(self) -> dict[tuple[str, ...], tuple[int, str]]:
        """What can go wrong, with its number and message, by key.

        Keys are ("input", block, port), ("output", block, port), ("state", member), and, of
        the first of a block's own failures, ("block", block).
        """
        found: list[tuple[tuple[str, ...], str]] = [
            (("unsolved",), "an algebraic loop has no solution"),
            (("unintegrated",), "rates of change that the solver cannot integrate"),
            (("stopped",), "the condition of run.stop holds: the run has ended"),
        ]
        for block, port in self.selection.inputs:
            found.append((("input", block, port), f"input {block}.{port} is not finite"))
        states = {member: (block, state) for block, member, state, _ in self.checked_states()}
        outputs = self.selection.signals
        for name in self.selection.blocks:
            for i, message in enumerate(self.units.blocks[name].failures):
                found.append((("block", name, *([str(i)] if i else [])), f"{name}: {message}"))
            for block, port in outputs:
                if block == name:
                    found.append((("output", block, port), f"output {name}.{port} is not finite"))
            for member, (block, state) in states.items():
                if block == name:
                    found.append((("state", member), f"state {name}.{state} is not finite"))
        return {key: (number, text) for number, (key, text) in enumerate(found, 1)}

    def checked_states(self) -> Iterator[tuple[str, str, str, str]]:
        """The states that must stay finite: block, member, state, and the function that tests them.

        A state that begins as NaN or infinite says so that there is no value yet. Where a signal
        of the block may be infinite (a miss of a LiDAR), only NaN is wrong.
        """
        types = self.selection.network.types
        for block, member, values in self.states():
            if block != ENGINE and values.dtype.kind == "f" and np.isfinite(values).all():
                finite = all(kind.finite for (name, _), kind in types.items() if name == block)
                yield block, member, self.state_names[member], "all_finite" if finite else "no_nan"

    def states(self) -> Iterator[tuple[str, str, np.ndarray[Any, Any]]]:
        """The state arrays: block, member of the struct, initial values."""
        for (block, word), (member, start) in self.places.items():
            values = self.arrays[block, word]
            if not start and member == self.member(block, word) and values.size:
                yield block, member, values

    @cached_property
    def state_names(self) -> dict[str, str]:
        """The states' own names, by member."""
        own = [(member, key[1]) for key, (member, start) in self.places.items() if not start]
        return {m: w.removeprefix("state_") for m, w in reversed(own)}

    @cached_property
    def sizes(self) -> dict[str, int]:
        """How many numbers each member for a state has."""
        return {member: values.size for _, member, values in self.states()}

    @cached_property
    def arrays(self) -> dict[tuple[str, str], np.ndarray[Any, Any]]:
        """The arrays of the blocks' states, by block and word."""
        moving = {key: each for key, each in self._owned.items() if key not in self.fixed}
        return moving | self.others

    @cached_property
    def places(self) -> dict[tuple[str, str], tuple[str, int]]:
        """Where each state array is: a member of the struct, and the element of its first one.

        A state may have several names: arrays that share memory share a member.
        """

        def order(key: tuple[str, str]) -> tuple[int, int, bool, tuple[str, str]]:
            array = self.arrays[key]
            return (
                array.ctypes.data,
                -array.nbytes,
                key[1].removeprefix("state_") not in LEARNT,
                key,
            )

        found: dict[tuple[str, str], tuple[str, int]] = {}
        member, first, end = "", 0, 0
        for key in sorted(self.arrays, key=order):
            array = self.arrays[key]
            start = array.ctypes.data
            if not array.size:  # it may lie inside of another one
                found[key] = self.member(*key), 0
                continue
            if not start < end:
                member, first, end = self.member(*key), start, start + array.nbytes
            found[key] = member, (start - first) // array.itemsize
        return {key: found[key] for key in self.arrays}

    def member(self, block: str, word: str) -> str:
        """The struct's member for an array of its own."""
        return self.names[block, word, "state"]


def _is_short(value: Any, owned: bool) -> bool:
    """Whether an array of a block is one that may be changed, and not a table."""
    is_array = isinstance(value, np.ndarray) and not owned and value.dtype.kind == "f"
    return is_array and 0 < value.size <= SHORT


def _bound(open_: float | None, closed: float | None, sign: int) -> tuple[float, bool]:
    """A bound, and whether it is itself out of bounds."""
    if open_ is not None:
        return open_, True
    return (sign * math.inf if closed is None else closed), False


def comment(text: str) -> str:
    """A text inside of a C comment, on one line."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")
