"""The printer of a plan as C for a controller: its initial values, and the straight-line step.

In go the operations of the exported blocks and the layout of the controller's struct, out come the
statements of ``_reset`` and ``_step``. ``call gain.out: Scalar = gain.output(t, clock.time)`` with
its test becomes::

    block_gain__output(&ctx, &entries_gain, t, in->clock_time, &c->gain_out);
    if (!isfinite(c->gain_out)) return c->failure = 2;
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from blocks.core import SignalType
from runtime.export.layout import Layout
from runtime.export.units import BlockText
from runtime.plan import (
    Argument,
    Call,
    CText,
    Gate,
    Port,
    Restore,
    Signal,
    Test,
    Zero,
    numbers_in,
)

C_TYPES = {"f": "double", "i": "int64_t", "b": "bool"}
WIDTH = 96


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


class StepText(CText):
    """Writes the functions of a controller."""

    def __init__(self, layout: Layout) -> None:
        super().__init__("c->tick", depth=1)
        self.layout = layout
        self.selection = layout.selection
        self.network = layout.selection.network
        self.tables: dict[str, str] = {}

    # Initial values

    def initial(self, kept: bool) -> Iterator[str]:
        """The statements that set the states; ``kept`` are those that a reset leaves alone."""
        tests = {member: test for _, member, _, test in self.layout.checked_states()}
        for _, member, values in self.layout.states():
            if not values.size:
                continue
            begun = self.initialised(member, values)
            learnt = self.layout.is_learnt(member)
            if learnt == kept:
                yield f"    {begun}"
            elif learnt and member in tests:  # what is not finite was not learnt
                yield f"    if (!{tests[member]}(c->{member}, {values.size})) {begun}"
        for port in self.selection.inputs if self.layout.hold and not kept else ():
            place = self.place(port)  # nothing is held yet
            if self.layout.kind(port).form == "scalar":
                yield f"    {place} = (double)NAN;"
            else:
                count = self.layout.count(port)
                yield f"    for (int i = 0; i < {count}; i++) {place}[i] = (double)NAN;"

    def initialised(self, member: str, values: np.ndarray[Any, Any]) -> str:
        """The statement that sets a state to what it begins with."""
        kind = {"f": "numbers", "i": "integers", "b": "flags"}[values.dtype.kind]
        if not np.any(values) and not np.signbit(values.astype(float)).any():
            return f"clear_{kind}(c->{member}, {values.size});"
        name = f"table_{member}"
        self.tables[name] = table(name, values)
        return f"set_{kind}(c->{member}, {name}, {values.size});"

    # The step

    def step(self) -> str:
        """The statements of a step."""
        for block, text in self.layout.units.blocks.items():
            self.entries(block, text)
        for port in self.selection.inputs:
            self.received(port)
        self.operations(self.selection.operations)
        for block, member, _, test in self.layout.checked_states():
            entry = self.network.entries[block]
            self.within(Gate(entry.every, offset=entry.offset))
            size = self.layout.sizes[member]
            self.check(f"!{test}(c->{member}, {size})", "state", member)
        self.within(Gate())
        return "\n".join(self.lines)

    def check(self, wrong: str, *key: str) -> None:
        """Leave with a failure if something is wrong."""
        number, _ = self.layout.failures[key]
        self.put(f"if ({wrong}) return c->failure = {number};")

    def entries(self, name: str, text: BlockText) -> None:
        """The struct that a block's functions take."""
        place = self.layout.names[name]
        self.put(f"const struct {text.prefix}_entries entries_{place} = {{")
        for (word, c_type), value, owned in zip(text.words, text.values, text.owned, strict=True):
            if isinstance(value, np.ndarray) and not value.size:
                given = "NULL"
            elif owned:
                member, start = self.layout.places[name, word]
                given = f"c->{member}" + (f" + {start}" if start else "")
            elif isinstance(value, np.ndarray):
                given = f"table_{place}__{word}"
                self.tables[given] = table(given, value)
                # The functions take pointers to what they could change; they do not change these.
                given = f"({c_type}){given}"
            else:
                given = literal(float(value) if c_type == "double" else value)
            self.put(f"    .{word} = {given},")
        if not text.words:
            self.put("    .none = 0,")
        self.put("};")

    def received(self, port: Port) -> None:
        """Check an input, or hold the last one that was finite."""
        given, used = f"in->{self.layout.names[port]}", self.place(port)
        if self.layout.hold:
            count = self.layout.count(port)
            begin = "" if self.layout.kind(port).form != "scalar" else "&"
            with self.block(f"if ({self.valid(port, given)})"):
                self.put(f"set_numbers({begin}{used}, {begin}{given}, {count});")
        self.check(f"!{self.valid(port, used)}", "input", *port)

    def valid(self, port: Port, text: str) -> str:
        """A test whether a signal is finite; where misses are infinite, whether it has no NaN."""
        kind = self.layout.kind(port)
        if kind.form == "scalar":
            return f"isfinite({text})" if kind.finite else f"(!isnan({text}))"
        test = "all_finite" if kind.finite else "no_nan"
        return f"{test}({text}, {self.layout.count(port)})"

    def test(self, test: Test) -> None:
        for signal in test.outputs:
            wrong = f"!{self.valid(signal.key, self.signal(signal))}"
            self.check(wrong, "output", *signal.key)

    def zero(self, zero: Zero) -> None:
        for target in zero.targets:
            if isinstance(target, Signal):
                place, scalar = self.signal(target), target.kind.form == "scalar"
                clear = f"clear_numbers({place}, {self.layout.count(target.key)});"
                self.put(f"{place} = 0.0;" if scalar else clear)
            elif (state := self.layout.state(target.block, target.name)) is not None:
                member, start, size = state
                first = f"c->{member}" + (f" + {start}" if start else "")
                self.put(f"clear_numbers({first}, {size});")

    def restore(self, restore: Restore) -> None:
        """Set the states of a part back; of all its arrays, those that nothing declares, too."""
        switched = {state.block for state in restore.states}
        for block, member, values in self.layout.states():
            if block in switched and values.size:
                self.put(self.initialised(member, values))

    def call(self, call: Call) -> None:
        """The call of a method, and the way out if it fails."""
        super().call(call)
        if self.layout.units.blocks[call.block].failures:
            first, _ = self.layout.failures["block", call.block]
            self.put(f"if (ctx.failure >= 0) return c->failure = {first} + (int)ctx.failure;")

    def function(self, call: Call) -> tuple[str, list[str]]:
        prefix = self.layout.units.blocks[call.block].prefix
        entries = f"&entries_{self.layout.names[call.block]}"
        return f"{prefix}__{call.method}", ["&ctx", entries]

    def absent(self, argument: Argument) -> list[str]:
        number, count = argument.default, numbers_in(argument.kind)
        if argument.kind.form == "scalar":
            return [literal(number)]
        name = re.sub(r"\W", "_", f"open_{count}_{number}", flags=re.ASCII)
        self.tables[name] = table(name, np.full(count, number))
        return [name]

    def sizes(self, kind: SignalType) -> list[str]:
        return []  # the functions are written for them

    def signal(self, signal: Signal) -> str:
        return self.place(signal.key)

    def place(self, port: Port) -> str:
        """The C name of a signal."""
        name = self.layout.names[port]
        if port in self.layout.constants:
            values = np.atleast_1d(np.asarray(self.layout.constants[port], dtype=np.float64))
            self.tables[f"table_{name}"] = table(f"table_{name}", values)
            scalar = self.layout.kind(port).form == "scalar"
            return f"table_{name}[0]" if scalar else f"table_{name}"
        if port not in self.selection.inputs:
            return f"c->{name}"
        return f"c->{self.layout.names[(*port, 'held')]}" if self.layout.hold else f"in->{name}"
