"""The two structs of a compiled plan: numbers that move, and addresses of what is elsewhere.

In go signals, states and arrays as a printer meets them; out come their C expressions and, for
what fills them, where each member is. ``signal(plant.pose)`` returns ``plan->out_plant_pose`` and
declares ``double out_plant_pose[3];`` in ``struct plan``, which has nothing but numbers: a copy of
it is what a plan remembers. Addresses are in ``struct places``, which nothing writes to after it is
filled: of states, of arrays that the engine names, of signals that the plan does not compute, and
the structs of blocks.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from runtime.engine.naming import Names
from runtime.plan import Argument, Port, Signal, StateArray, numbers_in


@dataclass
class Struct:
    """The members so far.

    outside : signals that the plan does not compute: constants, inputs of what is exported.
    members : the first number and the count of numbers of each signal that it computes, by name.
    signals : the member of each of these.
    places : the first word and the number of words of each member of ``struct places``, by name.
    pointers : those that are addresses, with what they point to: ``fields`` of a block, a
        ``state``, its ``initial`` copy, a ``signal`` outside, what an ``open`` input reads, or an
        ``array`` that the engine names.
    defaults : of open inputs, how many numbers an array has that is filled with which.
    inside : those that are the struct of a block.
    """

    names: Names
    outside: Collection[Port] = ()
    members: dict[str, tuple[int, int]] = field(default_factory=dict)
    signals: dict[Port, str] = field(default_factory=dict)
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    pointers: dict[str, tuple[str, str, str]] = field(default_factory=dict)
    defaults: dict[str, tuple[int, float]] = field(default_factory=dict)
    inside: dict[str, str] = field(default_factory=dict)
    declared: dict[str, list[str]] = field(default_factory=lambda: {"plan": [], "places": []})
    size: int = 0
    words: int = 0

    def place(self, name: str, words: int, declaration: str) -> str:
        """A member of ``struct places``."""
        if name not in self.places:
            self.places[name] = (self.words, words)
            self.words += words
            self.declared["places"].append(f"    {declaration};")
        return f"places->{name}"

    def pointer(self, name: str, kind: str, owner: str, state: str = "") -> str:
        """A member that is an address."""
        to = dict.fromkeys(("signal", "open", "initial"), "const double *")
        to["fields"] = "const void *"
        self.pointers[name] = kind, owner, state
        return self.place(name, 1, f"{to.get(kind, 'double *')}{name}")

    def signal(self, signal: Signal) -> str:
        """An output: a number, or an array."""
        name = f"out_{self.names.of(signal)}"
        is_scalar = signal.kind.form == "scalar"
        if signal.key in self.outside:
            return self.pointer(name, "signal", *signal.key) + "[0]" * is_scalar
        if signal.key not in self.signals:
            self.signals[signal.key] = name
            size = max(1, numbers_in(signal.kind))
            self.members[name] = self.size, size
            self.size += size
            self.declared["plan"].append(f"    double {name}{'' if is_scalar else f'[{size}]'};")
        return f"plan->{name}"

    def open_input(self, argument: Argument) -> str:
        """An array that is what an open input reads."""
        name = f"open_{self.names.blocks[argument.block]}_{argument.port}"
        self.defaults[name] = max(2, numbers_in(argument.kind)), argument.default
        return self.pointer(name, "open", argument.block, argument.port)

    def fields(self, block: str) -> str:
        """The struct of a block."""
        return self.pointer(f"fields_{self.names.blocks[block]}", "fields", block)

    def inner(self, block: str, declared: str, words: int) -> str:
        """The address of the struct of a block as a member, which saves reading an address."""
        name = f"fields_{self.names.blocks[block]}"
        self.inside[name] = block
        return f"&{self.place(name, max(1, words), f'{declared} {name}')}"

    def state(self, state: StateArray, kind: str = "state") -> str:
        """The address of a state, or of its ``initial`` copy."""
        name = f"{kind}_{self.names.blocks[state.block]}_{state.name}"
        return self.pointer(name, kind, state.block, state.name)

    def array(self, name: str, member: str = "") -> str:
        """The address of an array that the engine names."""
        return self.pointer(member or name, "array", name)

    def text(self, *structs: str) -> str:
        """The declarations."""
        lines = []
        for name in structs:
            members = self.declared[name] or ["    double none;"]
            lines += [f"struct {name} {{", *members, "};", ""]
        return "\n".join(lines)
