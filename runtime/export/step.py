"""The C text of a controller: its struct, its initial values, and the straight-line step."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import Evaluation, SignalType
from runtime.engine import drivers
from runtime.export.selection import Port, Selection
from runtime.export.units import BlockText, Units
from runtime.network import Endpoint, first_column

C_TYPES = {"f": "double", "i": "int64_t", "b": "bool"}
LEARNT = ("weights",)  # states that a reset keeps
WIDTH = 96
KEYWORDS = frozenset(
    (
        *("auto", "bool", "break", "case", "char", "const", "continue", "default", "do", "double"),
        *("else", "enum", "extern", "false", "float", "for", "goto", "if", "inline", "int", "long"),
        *("register", "restrict", "return", "short", "signed", "sizeof", "static", "struct"),
        *("switch", "true", "typedef", "union", "unsigned", "void", "volatile", "while", "main"),
    )
)
# Names that the generated files use themselves.
RESERVED = KEYWORDS | frozenset(
    (
        *("tick", "failure", "arena", "context", "draws", "in", "out", "c", "t", "ctx"),
        *("labels", "largest", "compare", "controller", "resume", "i", "wrong", "bad"),
    )
)


@dataclass(frozen=True)
class Layout:
    """Everything that the C text is written from.

    Parameters
    ----------
    name : of the controller's struct and functions.
    units : the blocks' functions.
    constants : the values of constant outputs.
    arena : bytes for local arrays of blocks.
    """

    name: str
    selection: Selection
    units: Units
    constants: Mapping[Port, Any]
    arena: int

    @cached_property
    def names(self) -> dict[Any, str]:
        """C names of signals by (block, port), and of blocks by name."""
        taken = set(RESERVED)
        found: dict[Any, str] = {}
        selection = self.selection
        ports = [*selection.inputs, *selection.constants]
        ports += [(s.block, port) for s in selection.steps for port in s.evaluation.outputs]
        for key in (*ports, *selection.blocks):
            text = key if isinstance(key, str) else "_".join(key)
            plain = re.sub(r"\W", "_", text, flags=re.ASCII)
            plain = f"_{plain}" if plain[:1].isdigit() else plain
            while plain in taken:
                plain += "_"
            taken.add(plain)
            found[key] = plain
        return found

    @property
    def arena_words(self) -> int:
        """The arena's length, in words of eight bytes."""
        return max(1, -(-self.arena // 8))

    def kind(self, port: Port) -> SignalType:
        return self.selection.network.types[port]

    def count(self, port: Port) -> int:
        """How many numbers an output has."""
        kind = self.kind(port)
        return math.prod(kind.shape) if kind.form == "array" else len(kind.components) or 1

    def declared(self, port: Port) -> str:
        """The declaration of a signal's member, with what it is."""
        kind = self.kind(port)
        size = "" if kind.form == "scalar" else f"[{self.count(port)}]"
        return f"    double {self.names[port]}{size}; /* {comment('.'.join(port))}: {kind} */"

    def is_learnt(self, member: str) -> bool:
        """Whether a reset keeps a state."""
        return member.rpartition("__")[2] in LEARNT

    def messages(self) -> list[str]:
        """What failures mean, from number 1."""
        names = [".".join(port) for port in self.selection.outputs]
        return [*self.units.failures, *(f"output {name} is not finite" for name in names)]

    def states(self) -> Iterator[tuple[str, str, np.ndarray[Any, Any]]]:
        """The state arrays: block, member of the struct, initial values."""
        for (block, word), (member, start) in self.places.items():
            if not start and member == self.member(block, word):
                yield block, member, self.arrays[block, word]

    @cached_property
    def arrays(self) -> dict[tuple[str, str], np.ndarray[Any, Any]]:
        """The arrays of the blocks' states, by block and word."""
        return {
            (block, word): value
            for block, text in self.units.blocks.items()
            for (word, _), value, owned in zip(text.words, text.values, text.owned, strict=True)
            if owned
        }

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
            if not start < end or not array.size:
                member, first, end = self.member(*key), start, start + array.nbytes
            found[key] = member, (start - first) // array.itemsize
        return {key: found[key] for key in self.arrays}

    def member(self, block: str, word: str) -> str:
        """The struct's member for an array of its own."""
        return f"{self.names[block]}__{word.removeprefix('state_')}"


def comment(text: str) -> str:
    """A text inside of a C comment, on one line."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")


def literal(value: Any) -> str:
    """A number in C."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        if int(value) == -(2**63):
            return "INT64_MIN"  # C reads a minus and a number that is too large
        return f"INT64_C({int(value)})" if abs(int(value)) >= 2**31 else str(int(value))
    number = float(value)
    if math.isnan(number):
        return "NAN"
    if math.isinf(number):
        return "INFINITY" if number > 0.0 else "-INFINITY"
    return repr(number)


def table(name: str, values: np.ndarray[Any, Any]) -> str:
    """A constant array."""
    kind = C_TYPES[values.dtype.kind]
    lines, line = [], "   "
    for item in values.ravel():
        text = f" {literal(item)},"
        if len(line) + len(text) > WIDTH:
            lines.append(line)
            line = "   "
        line += text
    body = "\n".join([*lines, line])
    return f"static const {kind} {name}[{values.size}] = {{\n{body}\n}};\n"


class StepText:
    """Writes the functions of a controller."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.selection = layout.selection
        self.network = layout.selection.network
        self.wires = drivers(self.network)
        self.tables: dict[str, str] = {}
        self.lines: list[str] = []
        self.rate = 0

    # Initial values

    def initial(self, kept: bool) -> Iterator[str]:
        """The statements that set the states; ``kept`` are those that a reset leaves alone."""
        for _, member, values in self.layout.states():
            if values.size == 0 or self.layout.is_learnt(member) != kept:
                continue
            kind = {"f": "numbers", "i": "integers", "b": "flags"}[values.dtype.kind]
            if not np.any(values) and not np.signbit(values.astype(float)).any():
                yield f"    clear_{kind}(c->{member}, {values.size});"
                continue
            name = f"{member}_0"
            self.tables[name] = table(name, values)
            yield f"    set_{kind}(c->{member}, {name}, {values.size});"

    # The step

    def put(self, text: str) -> None:
        self.lines.append("    " * (1 + (self.rate > 1)) + text)

    def at(self, every: int) -> None:
        """What follows runs on every ``every``-th tick."""
        if every != self.rate and self.rate > 1:
            self.lines.append("    }")
        if every != self.rate and every > 1:
            self.lines.append(f"    if (c->tick % {every} == 0) {{")
        self.rate = every

    def step(self) -> str:
        """The statements of a step."""
        self.lines, self.rate = [], 1
        for step in self.selection.steps:
            self.at(step.every)
            self.call(step.block, step.evaluation)
        for block, every, update in self.selection.updates:
            self.at(every)
            self.call(block, update)
        self.at(1)
        entries = [self.entries(name, text) for name, text in self.layout.units.blocks.items()]
        return "\n".join([*entries, *self.lines])

    def entries(self, name: str, text: BlockText) -> str:
        """The struct that a block's functions take."""
        place = self.layout.names[name]
        members = []
        for (word, c_type), value, owned in zip(text.words, text.values, text.owned, strict=True):
            if owned:
                member, start = self.layout.places[name, word]
                given = f"c->{member}" + (f" + {start}" if start else "")
            elif isinstance(value, np.ndarray):
                given = f"{place}__{word}"
                self.tables[given] = table(given, value)
                # The functions take pointers to what they could change; they do not change these.
                given = f"({c_type}){given}"
            else:
                given = literal(float(value) if c_type == "double" else value)
            members.append(f"        .{word} = {given},")
        head = f"    const struct {text.prefix}_entries {place} = {{"
        return "\n".join([head, *(members or ["        .none = 0,"]), "    };"])

    def call(self, block: str, evaluation: Evaluation) -> None:
        """The call of a method, and the way out if it fails."""
        text, place = self.layout.units.blocks[block], self.layout.names[block]
        arguments = ["&ctx", f"&{place}", "t", *self.arguments(block, evaluation)]
        for port in evaluation.outputs:
            scalar = self.layout.kind((block, port)).form == "scalar"
            arguments.append(f"{'&' if scalar else ''}c->{self.layout.names[block, port]}")
        self.put(f"{text.prefix}__{evaluation.method}({', '.join(arguments)});")
        failed = f"c->failure = {text.first + 1} + (int)ctx.failure"
        self.put(f"if (ctx.failure >= 0) return {failed};")

    def arguments(self, block: str, evaluation: Evaluation) -> Iterator[str]:
        """The arguments of a method after t."""
        inputs = self.network.entries[block].cls.spec.inputs
        for port in evaluation.needs:
            kind = self.network.types[block, port]
            if port not in inputs:
                yield self.value(Endpoint(block, port), kind)
                continue
            wires = self.wires.get((block, port), [])
            if inputs[port].variadic:
                yield from (self.value(wire.source, kind) for wire in wires)
            elif wires:
                yield self.value(wires[0].source, kind)
            else:
                yield self.absent(kind, float(inputs[port].default or 0.0))

    def absent(self, kind: SignalType, number: float) -> str:
        """An open input."""
        if kind.form == "scalar":
            return literal(number)
        size = math.prod(kind.shape) if kind.form == "array" else len(kind.components)
        name = re.sub(r"\W", "_", f"open_{size}_{number}", flags=re.ASCII)
        self.tables[name] = table(name, np.full(size, number))
        return name

    def value(self, end: Endpoint, target: SignalType) -> str:
        """A signal, or a component of it: a number for a scalar, otherwise a pointer."""
        port = (end.block, end.port)
        kind = self.layout.kind(port)
        text = self.signal(port)
        if end.component:
            column = first_column(kind, end.component)
            return f"{text}[{column}]" if target.form == "scalar" else f"&{text}[{column}]"
        if kind.form == "scalar":
            return text if target.form == "scalar" else f"&{text}"
        return f"{text}[0]" if target.form == "scalar" else text

    def signal(self, port: Port) -> str:
        """The C name of a signal."""
        name = self.layout.names[port]
        if port in self.layout.constants:
            values = np.atleast_1d(np.asarray(self.layout.constants[port], dtype=np.float64))
            self.tables[name] = table(name, values)
            return f"{name}[0]" if self.layout.kind(port).form == "scalar" else name
        return f"{'in' if port in self.selection.inputs else 'c'}->{name}"
