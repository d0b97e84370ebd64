"""The struct of a compiled plan: its members, and how signals are passed from them in C."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from blocks.core import Evaluation, SignalType
from runtime.compiler import Kernel
from runtime.engine.compiled.plan_text import count, literal, sizes
from runtime.engine.schedule import Emitter, Plan, RecordSlot
from runtime.network import Endpoint, first_column, state_shape
from runtime.observation import StopTest
from runtime.toolchain import TranslationUnit

Call = tuple[str, Evaluation]


@dataclass
class PlanText:
    """The text of a plan, and how to call it.

    text : in C, without the support that every unit begins with.
    members : the first word and the number of words of each member of the struct, by name.
    pointers : members that are addresses, with what they point to: ``fields`` of a block,
        a state, or an array that the engine names.
    solver : the solver's own unit, of a graph with continuous states.
    signals : the member of each output, by block and port.
    fills : members that are filled once, with a number.
    calls : the evaluations by their number in ``at``.
    driver : the Python loop around it, empty if nothing is called between its ``parts``.
    """

    text: str = ""
    members: dict[str, tuple[int, int]] = field(default_factory=dict)
    pointers: dict[str, tuple[str, str, str]] = field(default_factory=dict)
    signals: dict[tuple[str, str], str] = field(default_factory=dict)
    fills: dict[str, float] = field(default_factory=dict)
    calls: list[Call] = field(default_factory=list)
    solver: TranslationUnit | None = None
    driver: str = ""
    parts: int = 1
    lines: dict[int, str] = field(default_factory=dict)

    @property
    def words(self) -> int:
        """The size of the struct."""
        start, size = next(reversed(self.members.values()), (0, 0))
        return start + size


class StructEmitter(Emitter):
    """Adds members to the struct of a plan as they are needed.

    Parameters
    ----------
    kernels : the blocks that are compiled, by name; the others are called from Python.
    widths : the numbers in a row of each probe's array, by its name.
    """

    def __init__(
        self,
        plan: Plan,
        recordings: list[RecordSlot],
        kernels: dict[str, Kernel],
        widths: Mapping[str, int],
        stop: StopTest | None = None,
    ) -> None:
        super().__init__(plan, recordings, stop)
        self.kernels, self.widths = kernels, widths
        self.made = PlanText()
        self.declared: list[str] = []
        self.own: set[str] = set()

    def member(self, name: str, size: int, c_type: str = "double") -> str:
        """A member of the struct of this many words; returns its name."""
        if name not in self.made.members:
            self.made.members[name] = (self.made.words, size)
            space = "" if c_type.endswith("*") else " "
            self.declared.append(f"    {c_type}{space}{name}{f'[{size}]' if size != 1 else ''};")
        return name

    def pointer(self, name: str, target: tuple[str, str, str]) -> str:
        """A member that is an address."""
        self.member(name, 1, "const void *" if target[0] == "fields" else "double *")
        self.made.pointers[name] = target
        return f"plan->{name}"

    def signal(self, block: str, port: str) -> tuple[str, SignalType]:
        """The member of an output, and its type."""
        kind = self.network.types[block, port]
        name = f"out_{self.variable(block, port)}"
        if (block, port) not in self.made.signals:
            size = max(1, count(kind))
            self.member(name, size)
            if size == 1 and kind.form != "scalar":
                self.declared[-1] = f"    double {name}[1];"
            self.made.signals[block, port] = name
        return name, kind

    def inputs(self, block: str, evaluation: Evaluation) -> list[str]:
        """The arguments of an evaluation: inputs, and outputs of the block itself."""
        declared = self.network.entries[block].cls.spec.inputs
        found: list[str] = []
        for port in evaluation.needs:
            kind = self.network.types[block, port]
            if port not in declared:
                found += self.passed(Endpoint(block, port), kind)
                continue
            wires = self.wires.get((block, port), [])
            if wires or declared[port].variadic:
                found += [text for wire in wires for text in self.passed(wire.source, kind)]
            else:
                found += self.absent(block, port, kind, declared[port].default)
        return found

    def passed(self, end: Endpoint, target: SignalType) -> list[str]:
        """A signal, or a component of it, as arguments of the target's form."""
        name, kind = self.signal(end.block, end.port)
        place = f"plan->{name}"
        if kind.form != "scalar":
            place += f"[{first_column(kind, end.component)}]"
        return [place] if target.form == "scalar" else [f"&{place}", *sizes(target)]

    def state_size(self, block: str, state: str) -> int:
        """How many numbers a state has."""
        entry, spec = self.network.entries[block], self.network.entries[block].cls.spec
        context = self.network.context(block)
        return math.prod(state_shape(entry.block, spec.states[state], context, spec))

    def absent(self, block: str, port: str, kind: SignalType, default: float | None) -> list[str]:
        """The arguments of an open input."""
        value = float(default or 0.0)
        if kind.form == "scalar":
            return [literal(value)]
        name = self.member(f"open_{self.plan.names[block]}_{port}", max(2, count(kind)))
        self.made.fills[name] = value
        return [f"plan->{name}", *sizes(kind)]

    def address(self, end: Endpoint, is_state: bool) -> str:
        """The address of a signal or a state, or of the first number of a component."""
        if is_state:
            name = f"state_{self.plan.names[end.block]}_{end.port}"
            place = self.pointer(name, ("state", end.block, end.port))
            first = int(end.component.partition(":")[0] or 0)
            return f"{place} + {first}" if first else place
        name, kind = self.signal(end.block, end.port)
        if kind.form == "scalar":
            return f"&plan->{name}"
        first = first_column(kind, end.component)
        return f"plan->{name} + {first}" if first else f"plan->{name}"
