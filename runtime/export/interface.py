"""The C around a plan: what its places point to, initial values, inputs and outputs.

In go the plan's C of the compiled engine and the layout of the controller's struct, out come the
statements of ``_reset`` and ``_step`` that stand around it. The engine's ``struct places`` has
addresses in Python's memory; a controller fills it at each step, since its own memory may move::

    const struct places places = {
        .fields_gain = {.self_gain = c->parameters.gain_gain},
        .state_delay_stored = c->delay__stored,
        .out_clock_time = &in->clock_time,
    };
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from runtime.engine.compiled import Ending
from runtime.export.layout import ENGINE, Layout, Parameter
from runtime.export.units import BlockText
from runtime.plan import Port

C_TYPES = {"f": "double", "i": "int64_t", "b": "bool", "u": "uint64_t"}
KINDS = {"f": "numbers", "i": "integers", "b": "flags", "u": "words"}
WIDTH = 96


def literal(value: Any) -> str:
    """A number in C."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, np.unsignedinteger):
        return f"UINT64_C({int(value)})"
    if isinstance(value, (int, np.integer)):
        if int(value) == -(2**63):
            return "INT64_MIN"  # C reads a minus and a number that is too large
        return f"INT64_C({int(value)})" if abs(int(value)) >= 2**31 else str(int(value))
    number = float(value)
    if math.isnan(number):
        return "(double)NAN"
    if math.isinf(number):
        return "(double)INFINITY" if number > 0.0 else "-(double)INFINITY"
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


class InterfaceText:
    """Writes the statements around a plan; ``tables`` are the constant arrays that they name."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.selection = layout.selection
        self.tables: dict[str, str] = {}

    # Initial values

    def initial(self, kept: bool) -> Iterator[str]:
        """The statements that set the states; ``kept`` are those that a reset leaves alone."""
        tests = {member: test for _, member, _, test in self.layout.checked_states()}
        for _, member, values in self.layout.states():
            begun = self.initialised(member, values)
            learnt = self.layout.is_learnt(member)
            if learnt == kept:
                yield f"    {begun}"
            elif learnt and member in tests:  # what is not finite was not learnt
                yield f"    if (!{tests[member]}(c->{member}, {values.size})) {begun}"
        for port in self.selection.inputs if self.layout.hold and not kept else ():
            place, count = self.given(port), self.layout.count(port)  # nothing is held yet
            yield f"    for (int i = 0; i < {count}; i++) {place}[i] = (double)NAN;"

    def begun(self, parameter: Parameter) -> str:
        """The statement that sets a parameter to what it begins with."""
        place, value = f"c->parameters.{parameter.name}", parameter.value
        if isinstance(value, float):
            return f"    {place} = {literal(value)};"
        name = self.table(f"table_{parameter.name}", value)
        return f"    set_numbers({place}, {name}, {value.size});"

    def initialised(self, member: str, values: np.ndarray[Any, Any]) -> str:
        """The statement that sets a state to what it begins with."""
        kind = KINDS[values.dtype.kind]
        if not np.any(values) and not np.signbit(values.astype(float)).any():
            return f"clear_{kind}(c->{member}, {values.size});"
        return f"set_{kind}(c->{member}, {self.table(f'table_{member}', values)}, {values.size});"

    def table(self, name: str, values: np.ndarray[Any, Any]) -> str:
        """A constant array of this name."""
        self.tables[name] = table(name, values)
        return name

    # Where everything is

    def places(self) -> Iterator[str]:
        """The members of the plan's ``struct places``."""
        struct = self.layout.plan.struct
        for name in struct.places:
            if name in struct.inside:
                block = struct.inside[name]
                yield f"        .{name} = {{"
                yield from self.entries(block, self.layout.units.blocks[block])
                yield "        },"
            else:
                yield f"        .{name} = {self.address(name, *struct.pointers[name])},"
        if not struct.places:
            yield "        .none = 0.0,"

    def entries(self, block: str, text: BlockText) -> Iterator[str]:
        """The members of the struct that a block's functions take."""
        for (word, c_type), value, owned in zip(text.words, text.values, text.owned, strict=True):
            if isinstance(value, np.ndarray) and not value.size:
                given = "NULL"
            elif (block, word) in self.layout.tuned:
                given = self.followed(self.layout.tuned[block, word], c_type == "double")
            elif (block, word) in self.layout.parameters:
                given = f"c->parameters.{self.layout.parameters[block, word].name}"
            elif owned and (block, word) not in self.layout.fixed:
                given = self.owned(block, word, c_type if value.dtype.kind == "u" else "")
            elif isinstance(value, np.ndarray):
                name = self.table(f"table_{self.layout.names[block]}__{word}", value)
                # The functions take pointers to what they could change; they do not change these.
                given = f"({c_type}){name}"
            else:
                given = literal(float(value) if c_type == "double" else value)
            yield f"            .{word} = {given},"
        if not text.words:
            yield "            .none = 0,"

    @staticmethod
    def followed(texts: tuple[str, ...], is_number: bool) -> str:
        """What follows from parameters: a number, or the address of an array."""
        if is_number:
            return texts[0]
        whole = texts[0].removesuffix("[0]")
        if texts == tuple(f"{whole}[{i}]" for i in range(len(texts))):
            return whole
        return f"(double[]){{{', '.join(texts)}}}"

    def owned(self, block: str, word: str, c_type: str = "") -> str:
        """The address of an array in the controller's struct."""
        member, start = self.layout.places[block, word]
        found = f"c->{member}" + (f" + {start}" if start else "")
        return f"({c_type}){found}" if c_type else found

    def address(self, name: str, kind: str, owner: str, item: str) -> str:
        """What a member of the places points to."""
        layout = self.layout
        if kind == "state":
            key = owner, f"state_{item}"
            return self.owned(*key) if key in layout.places and layout.arrays[key].size else "NULL"
        if kind == "initial":
            values = layout.initial(owner, item)
            return self.table(f"table_{name}", values) if values.size else "NULL"
        if kind == "open":
            return self.table(name, np.full(*layout.plan.struct.defaults[name]))
        if owner.startswith("probe_"):
            port = layout.selection.outputs[int(owner.removeprefix("probe_"))]
            return f"{'&' * (layout.kind(port).form == 'scalar')}made.{layout.names[port]}"
        if kind == "array":
            values = layout.engine[owner]
            if not values.size:  # of guards, in a graph whose steps end at edges alone
                return "NULL"
            if (ENGINE, owner) in layout.places:
                return self.owned(ENGINE, owner)
            return f"(double *){self.table(f'table_{name}', values)}"
        port = owner, item
        if port in layout.constants:
            if texts := layout.constant_output(owner):
                return self.followed(texts, is_number=False)
            values = np.atleast_1d(np.asarray(layout.constants[port], dtype=np.float64))
            return self.table(f"table_{name}", values)
        return self.given(port)

    # Inputs, outputs and states

    def given(self, port: Port) -> str:
        """The address of an input."""
        if self.layout.hold:
            return f"c->{self.layout.names[(*port, 'held')]}"
        is_scalar = self.layout.kind(port).form == "scalar"
        return f"{'&' * is_scalar}in->{self.layout.names[port]}"

    def received(self) -> Iterator[str]:
        """Check the inputs, or hold the last ones that were finite."""
        if not self.selection.inputs:
            yield "    (void)in;"
        for port in self.selection.inputs:
            count, kind = self.layout.count(port), self.layout.kind(port)
            test = "all_finite" if kind.finite else "no_nan"
            number, _ = self.layout.failures["input", *port]
            if self.layout.hold:
                at = "&" * (kind.form == "scalar")
                new = f"{at}in->{self.layout.names[port]}"
                held = f"set_numbers({self.given(port)}, {new}, {count});"
                yield f"    if ({test}({new}, {count})) {held}"
            yield f"    if (!{test}({self.given(port)}, {count})) return c->failure = {number};"

    def checks(self) -> Iterator[str]:
        """Fail if a state is not finite, on the ticks of its block."""
        for block, member, _, test in self.layout.checked_states():
            entry = self.selection.network.entries[block]
            due = f"c->tick % {entry.every} == {entry.offset} && " * (entry.every > 1)
            number, _ = self.layout.failures["state", member]
            wrong = f"{due}!{test}(c->{member}, {self.layout.sizes[member]})"
            yield f"    if ({wrong}) return c->failure = {number};"

    def tunables(self) -> Iterator[str]:
        """The rows of the table of parameters: name, place, count, bounds."""
        at = 0
        for one in self.layout.parameters.values():
            bounds = f"{literal(one.low)}, {literal(one.high)}, "
            bounds += ", ".join(map(literal, (one.is_above, one.is_below)))
            yield f'        {{"{one.path}", {at}, {one.size}, {bounds}}},'
            at += one.size
        if not at:
            yield '        {"", 0, 0, 0.0, 0.0, false, false},'

    def learning(self, kept: bool) -> Iterator[str]:
        """Keep what is learnt while learning is off, or put it back."""
        pairs = [(f"c->{m}", f"c->{m}__before", n) for m, n in self.layout.learnt.items()]
        for member, before, count in pairs:
            to, source = (before, member) if kept else (member, before)
            yield f"    if (!c->learning) set_numbers({to}, {source}, {count});"

    def failed(self) -> Iterator[str]:
        """The numbers of what may go wrong in a call of the plan."""
        failures = self.layout.failures
        firsts = []
        for call in self.layout.plan.calls:
            own = failures.get(("block", call.block), (0, ""))[0]
            output = failures["output", *call.outputs[0].key][0] if call.outputs else 0
            firsts.append(f"{{{own}, {output}}}")
        yield f"    static const int16_t first[{max(1, len(firsts))}][2] = {{"
        yield from (
            f"        {', '.join(firsts[i : i + 8])}," for i in range(0, max(1, len(firsts)), 8)
        )
        yield "    };"
        kinds = {Ending.FAILED: "first[ctx->at][0] + (int)ctx->failure"}
        kinds[Ending.NOT_FINITE] = "first[ctx->at][1] + (int)ctx->index"
        for ending, what in kinds.items():
            yield f"    if (ended == {ending.value}) return {what};"
        yield f"    if (ended == {Ending.STOPPED.value}) return {failures['stopped',][0]};"
        unsolved = failures["unsolved",][0]
        yield f"    return ended == {Ending.UNSOLVED.value} ? {unsolved} : {unsolved + 1};"


def renamed(text: str, name: str) -> str:
    """The text of a plan whose numbers are part of the controller's struct."""
    return re.sub(r"\bstruct plan\b", f"struct {name}_signals", text)
