"""The struct of a compiled plan: words of eight bytes, declared in the order of their first use.

In go signals, states and arrays as a printer meets them; out come their C expressions and, for the
runner, where each member is and what fills it. ``signal(plant.pose)`` returns
``plan->out_plant_pose`` and declares ``double out_plant_pose[3];``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from runtime.engine.naming import Names
from runtime.plan import Argument, Port, Signal, StateArray, numbers_in


@dataclass
class Struct:
    """The members so far.

    members : the first word and the number of words of each member, by name.
    pointers : members that are addresses, with what they point to: ``fields`` of a block, a
        ``state``, its ``initial`` copy, or an ``array`` that the engine names.
    signals : the member of each output.
    fills : members that are filled once, with a number.
    inside : members that are the struct of a block.
    """

    names: Names
    members: dict[str, tuple[int, int]] = field(default_factory=dict)
    pointers: dict[str, tuple[str, str, str]] = field(default_factory=dict)
    signals: dict[Port, str] = field(default_factory=dict)
    fills: dict[str, float] = field(default_factory=dict)
    inside: dict[str, str] = field(default_factory=dict)
    declared: list[str] = field(default_factory=list)
    words: int = 0

    def member(self, name: str, size: int, declaration: str) -> None:
        """A member of this many words."""
        if name not in self.members:
            self.members[name] = (self.words, size)
            self.words += size
            self.declared.append(f"    {declaration};")

    def pointer(self, name: str, kind: str, owner: str, state: str = "") -> str:
        """A member that is an address."""
        to = "const void *" if kind == "fields" else "double *"
        self.member(name, 1, f"{to}{name}")
        self.pointers[name] = kind, owner, state
        return f"plan->{name}"

    def signal(self, signal: Signal) -> str:
        """The member of an output: a number, or an array."""
        name = f"out_{self.names.of(signal)}"
        if signal.key not in self.signals:
            self.signals[signal.key] = name
            size = max(1, numbers_in(signal.kind))
            dimension = "" if signal.kind.form == "scalar" else f"[{size}]"
            self.member(name, size, f"double {name}{dimension}")
        return f"plan->{name}"

    def open_input(self, argument: Argument) -> str:
        """An array that is what an open input reads."""
        name = f"open_{self.names.blocks[argument.block]}_{argument.port}"
        size = max(2, numbers_in(argument.kind))
        self.member(name, size, f"double {name}[{size}]")
        self.fills[name] = argument.default
        return f"plan->{name}"

    def fields(self, block: str) -> str:
        """The struct of a block."""
        return self.pointer(f"fields_{self.names.blocks[block]}", "fields", block)

    def inner(self, block: str, declared: str, words: int) -> str:
        """The address of the struct of a block as a member, which saves reading an address."""
        name = f"fields_{self.names.blocks[block]}"
        self.member(name, max(1, words), f"{declared} {name}")
        self.inside[name] = block
        return f"&plan->{name}"

    def state(self, state: StateArray, kind: str = "state") -> str:
        """The address of a state, or of its ``initial`` copy."""
        name = f"{kind}_{self.names.blocks[state.block]}_{state.name}"
        return self.pointer(name, kind, state.block, state.name)

    def array(self, name: str, member: str = "") -> str:
        """The address of an array that the engine names."""
        return self.pointer(member or name, "array", name)

    def text(self) -> str:
        """The declaration."""
        return "\n".join(["struct plan {", *(self.declared or ["    int64_t none;"]), "};", ""])
