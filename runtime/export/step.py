"""The C text of a controller: its initial values, and the straight-line step."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from blocks.core import Evaluation, SignalType
from runtime.engine import Step, drivers
from runtime.export.layout import Layout
from runtime.export.selection import Port
from runtime.export.units import BlockText
from runtime.network import Endpoint, first_column, resets

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


class StepText:
    """Writes the functions of a controller."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.selection = layout.selection
        self.network = layout.selection.network
        self.wires = drivers(self.network)
        self.tables: dict[str, str] = {}
        self.lines: list[str] = []
        self.rate = 1
        self.depth = 1

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
            place = self.signal(port)  # nothing is held yet
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

    def put(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Lines in braces; none without a head."""
        if head:
            self.put(f"{head} {{")
        self.depth += bool(head)
        yield
        self.depth -= bool(head)
        if head:
            self.put("}")

    def at(self, every: int) -> None:
        """What follows runs on every ``every``-th tick."""
        if every == self.rate:
            return
        if self.rate > 1:
            self.depth -= 1
            self.put("}")
        if every > 1:
            self.put(f"if (c->tick % {every} == 0) {{")
            self.depth += 1
        self.rate = every

    def step(self) -> str:
        """The statements of a step."""
        self.lines, self.rate, self.depth = [], 1, 1
        for block, text in self.layout.units.blocks.items():
            self.entries(block, text)
        for port in self.selection.inputs:
            self.received(port)
        for step in self.selection.steps:
            self.at(step.every)
            self.evaluated(step)
        for block, every, update in self.selection.updates:
            self.at(every)
            self.updated(block, update)
        for enable in self.selection.resetting:
            self.at(self.network.entries[enable].every)
            self.reset(enable)
        for block, member, _, test in self.layout.checked_states():
            self.at(self.network.entries[block].every)
            size = self.layout.sizes[member]
            self.check(f"!{test}(c->{member}, {size})", "state", member)
        self.at(1)
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
        given, used = f"in->{self.layout.names[port]}", self.signal(port)
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

    def all_on(self, enables: Sequence[str]) -> str:
        """The condition under which the parts that these blocks switch run."""
        return " && ".join(f"{self.signal((name, 'on'))} != 0.0" for name in enables)

    def evaluated(self, step: Step) -> None:
        """Call an evaluation; outputs of a part that is reset while it is off are zero then."""
        ports = [(step.block, port) for port in step.evaluation.outputs]
        with self.block(f"if ({self.all_on(step.enables)})" if step.enables else ""):
            self.call(step.block, step.evaluation)
            for port in ports:
                self.check(f"!{self.valid(port, self.signal(port))}", "output", *port)
        resetting = [name for name in step.enables if resets(self.network, name)]
        if resetting:
            with self.block(f"if (!({self.all_on(resetting)}))"):
                for port in ports:
                    name, scalar = self.signal(port), self.layout.kind(port).form == "scalar"
                    zero = f"clear_numbers({name}, {self.layout.count(port)});"
                    self.put(f"{name} = 0.0;" if scalar else zero)

    def updated(self, block: str, update: Evaluation) -> None:
        """Call an update; no event happens in a part that is off."""
        enables = self.selection.plan.enables.get(block, ())
        with self.block(f"if ({self.all_on(enables)})" if enables else ""):
            self.call(block, update)
        spec = self.network.entries[block].cls.spec
        events = [name for name, declared in spec.states.items() if declared.event]
        held = [place for name in events if (place := self.layout.state(block, name))]
        if enables and held:
            with self.block(f"if (!({self.all_on(enables)}))"):
                for place in held:
                    member, start, size = place
                    first = f"c->{member}" + (f" + {start}" if start else "")
                    self.put(f"clear_numbers({first}, {size});")

    def reset(self, enable: str) -> None:
        """Bring the states of a part that is off back to what they were in the beginning."""
        switched = {n for n, above in self.selection.plan.enables.items() if enable in above}
        states = [s for s in self.layout.states() if s[0] in switched and s[2].size]
        if states:
            with self.block(f"if (!({self.all_on([enable])}))"):
                for _, member, values in states:
                    self.put(self.initialised(member, values))

    def call(self, block: str, evaluation: Evaluation) -> None:
        """The call of a method, and the way out if it fails."""
        text, place = self.layout.units.blocks[block], self.layout.names[block]
        arguments = ["&ctx", f"&entries_{place}", "t", *self.arguments(block, evaluation)]
        for port in evaluation.outputs:
            scalar = self.layout.kind((block, port)).form == "scalar"
            arguments.append(f"{'&' if scalar else ''}c->{self.layout.names[block, port]}")
        self.put(f"{text.prefix}__{evaluation.method}({', '.join(arguments)});")
        if text.failures:
            first, _ = self.layout.failures["block", block]
            self.put(f"if (ctx.failure >= 0) return c->failure = {first} + (int)ctx.failure;")

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
            self.tables[f"table_{name}"] = table(f"table_{name}", values)
            scalar = self.layout.kind(port).form == "scalar"
            return f"table_{name}[0]" if scalar else f"table_{name}"
        if port not in self.selection.inputs:
            return f"c->{name}"
        return f"c->{self.layout.names[(*port, 'held')]}" if self.layout.hold else f"in->{name}"
