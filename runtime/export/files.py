"""The files of an exported controller: header, source, and the test that replays a recording."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray, IntArray
from runtime.codegen import MATH, draws_text, support
from runtime.engine.compiled import Ending
from runtime.export.interface import C_TYPES, InterfaceText, literal, renamed, table
from runtime.export.layout import Layout, comment
from runtime.export.pruning import prune
from runtime.export.templates import HEADER, LEARNT_FUNCTIONS, SOURCE, TEST, WEIGHTS
from runtime.plan import Port

HELPERS = {
    f"{verb}_{kind}": text.format(kind=kind, type=c_type)
    for kind, c_type in (
        ("numbers", "double"),
        ("integers", "int64_t"),
        ("flags", "bool"),
        ("words", "uint64_t"),
    )
    for verb, text in (
        (
            "set",
            "static void set_{kind}({type} *to, const {type} *from, int64_t n)\n{{\n"
            "    for (int64_t i = 0; i < n; i++) to[i] = from[i];\n}}\n",
        ),
        (
            "clear",
            "static void clear_{kind}({type} *to, int64_t n)\n{{\n"
            "    for (int64_t i = 0; i < n; i++) to[i] = 0;\n}}\n",
        ),
    )
}
FIRST = 100  # ticks on which the generated test compares, before it takes some
VERSION = 1  # of saved bytes
HEAD = 12  # bytes that tell of which controller saved bytes are, and their check
HELPERS["pick"] = """static double pick(bool condition, double one, double other)
{
    return condition ? one : other;
}
"""
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?![\w.])")
LENGTH = re.compile(r"INLINE double length_of\(.*?\n\}\n", re.DOTALL)


@dataclass(frozen=True)
class Replay:
    """A recorded run: the values of inputs and outputs on the ticks on which each is new.

    ticks : length of the recording. values : (rows, numbers) for each signal.
    run : ticks of the whole run. every : on each so many ticks, and the first and last ones, the
        generated test compares.
    """

    ticks: int
    values: Mapping[Port, FloatArray]
    run: int
    every: int

    @property
    def compared(self) -> IntArray:
        """The ticks that the generated test has recorded outputs of."""
        last = self.ticks - 1
        chosen = [k for k in range(self.ticks) if k < FIRST or k % self.every == 0 or k == last]
        return np.array(chosen, dtype=np.int64)

    def range_of(self, port: Port) -> float:
        """The largest range of a signal's numbers; of constant ones their size, or 1 of zeros."""
        values = self.values[port]
        finite = np.where(np.isfinite(values), values, np.nan)
        finite = finite[:, ~np.isnan(finite).all(axis=0)]
        widest = float(np.max(np.nanmax(finite, 0) - np.nanmin(finite, 0), initial=0.0))
        return widest or float(np.nanmax(np.abs(finite), initial=0.0)) or 1.0

    @property
    def covered(self) -> str:
        """What part of the run this is."""
        if self.ticks == self.run:
            return f"all {self.ticks} ticks of the run"
        return f"the first {self.ticks} of {self.run} ticks"


def header(layout: Layout, about: Sequence[str], float32: bool) -> str:
    """The header."""
    name, selection = layout.name, layout.selection
    guard = f"{name.upper()}_H"
    declared: list[str] = []
    if layout.hold:
        names = {port: layout.names[(*port, "held")] for port in selection.inputs}
        declared += [layout.declared(port, name) for port, name in names.items()]
    members = [
        f"    double {member}__before[{size}]; /* while learning is off */"
        for member, size in layout.learnt.items()
    ]
    members += [
        f"    {C_TYPES[v.dtype.kind]} {member}[{v.size}];"
        for _, member, v in layout.states()
        if v.size
    ]
    text = HEADER.substitute(
        about="\n * ".join(map(comment, about)),
        guard=guard,
        upper=name.upper(),
        dt=repr(selection.network.dt),
        name=name,
        inputs=_members(layout, selection.inputs),
        outputs=_members(layout, selection.outputs),
        signals=renamed(layout.plan.struct.text("plan"), name),
        parameters="\n".join(_parameters(layout)) or "    int none;",
        held="\n".join(declared),
        states="\n".join(members),
        arena=layout.arena_words,
        most="    int64_t arena_most; /* bytes of it that were ever used */\n"
        if layout.units.open
        else "",
        wrong=_wrong(layout),
        learnt=comment(_learnt(layout)),
        learning=_learning(layout),
        head=HEAD,
        end="arena_most" if layout.units.open else "arena",
        example=next((one.path for one in layout.parameters.values()), "gain.gain"),
        weights=WEIGHTS.substitute(
            _saved(layout), learnt=comment(_learnt(layout)), upper=name.upper()
        )
        if layout.learnt
        else "",
    )
    return single(text) if float32 else text


def _learning(layout: Layout) -> str:
    if not layout.learnt:
        return ""
    return "    bool learning; /* false: what was learnt stays as it is; init sets true */\n"


def _saved(layout: Layout) -> dict[str, Any]:
    """What the functions for what was learnt are written with."""
    sizes = [f"sizeof ((struct {layout.name} *)0)->{member}" for member in layout.learnt]
    return {
        **{"name": layout.name, "head": HEAD, "count": len(layout.learnt)},
        "size": " + ".join(sizes),
    }


def _learnt_parts(layout: Layout) -> str:
    parts = [
        f"    {{offsetof(struct {layout.name}, {m}), sizeof ((struct {layout.name} *)0)->{m}}},"
        for m in layout.learnt
    ]
    return "\n".join(["static const struct part learnt[] = {", *parts, "};"]) if parts else ""


def _digest(layout: Layout, float32: bool) -> str:
    """What the layout of the memory and the constants are known by: saved bytes carry it.

    Values that states and parameters begin with are left out: weights that an earlier export has
    learnt are right in one that begins with others.
    """
    found = hashlib.sha256(repr((VERSION, layout.name, float32, layout.hold)).encode())
    found.update(layout.plan.struct.text("plan").encode())
    for one in layout.parameters.values():
        found.update(repr((one.name, one.size)).encode())
    for block, member, values in layout.states():
        found.update(repr((block, member, values.dtype.kind, values.size)).encode())
    arrays = {
        (block, word): value
        for block, text in layout.units.blocks.items()
        for (word, _), value in zip(text.words, text.values, strict=True)
        if (block, word) in layout.fixed and (block, word) not in layout.parameters
    }
    for (block, word), value in arrays.items():
        if (block, word) not in layout.tuned:
            found.update(repr((block, word)).encode() + value.tobytes())
    return f"0x{found.hexdigest()[:16]}"


def _parameters(layout: Layout) -> list[str]:
    found = layout.parameters.values()
    return [f"    double {p.name}{p.dimension}; /* {comment(p.doc)} */" for p in found]


def _wrong(layout: Layout) -> str:
    """What happens to inputs that are not finite."""
    if layout.hold:
        return "Inputs that are not finite keep their last value that was."
    return "Inputs that are not finite are a failure."


def _learnt(layout: Layout) -> str:
    names = [f"{b}.{layout.state_names[m]}" for b, m, _ in layout.states() if layout.is_learnt(m)]
    return ", ".join(names) or "nothing here learns"


def _members(layout: Layout, ports: Sequence[Port]) -> str:
    return "\n".join(map(layout.declared, ports)) or "    int none;"


def source(layout: Layout, about: Sequence[str], float32: bool) -> str:
    """The source."""
    name, writer = layout.name, InterfaceText(layout)
    plan = renamed("\n".join([*layout.plan.inner, layout.plan.text]), name)
    begun = [writer.begun(each) for each in layout.parameters.values()]
    begun += ["    c->learning = true;"] if layout.learnt else []
    parts = {
        "learnt": [*begun, *writer.initial(kept=True)],
        "reset": writer.initial(kept=False),
        "inputs": writer.received(),
        "places": writer.places(),
        "checks": writer.checks(),
        "first": writer.failed(),
        "tunables": writer.tunables(),
        "before": writer.learning(kept=True),
        "after": writer.learning(kept=False),
    }
    texts = {key: "\n".join(lines) for key, lines in parts.items()}
    texts |= {key: f"{texts[key]}\n" if texts[key] else "" for key in ("before", "after")}
    statements = "\n".join(texts.values())
    helpers = [text for call, text in HELPERS.items() if f"{call}(" in statements]
    text = SOURCE.substitute(
        texts,
        stopped=Ending.STOPPED.value,
        about="\n * ".join(map(comment, about)),
        name=name,
        support=support(),
        helpers="".join(f"{text}\n" for text in helpers),
        tables="".join(f"{text}\n" for text in writer.tables.values()),
        blocks=layout.units.text,
        declared=layout.plan.struct.text("places"),
        plan=plan,
        measured="\n    c->arena_most = ctx.arena_most;" if layout.units.open else "",
        measuring="\n    ctx.arena_most = c->arena_most;" if layout.units.open else "",
        unmeasured="    c->arena_most = 0;\n" if layout.units.open else "",
        messages="\n".join(f"        {_quoted(t)}," for _, t in layout.failures.values()),
        head=HEAD,
        end="arena_most" if layout.units.open else "arena",
        digest=_digest(layout, float32),
        learnt_parts=_learnt_parts(layout),
        learnt_functions=LEARNT_FUNCTIONS.substitute(_saved(layout)) if layout.learnt else "",
    )
    text = re.sub(r"\n{3,}", "\n\n", _without_jumps(text))
    text = single(text) if float32 else text
    return prune(text.replace("@draws@\n", draws_text() if "draw_" in text else ""))


def _without_jumps(text: str) -> str:
    """The support's text as a compiler reads it that knows WITHOUT_JUMPS."""
    text = re.sub(r"#ifndef WITHOUT_JUMPS\n.*?#endif\n", "", text, flags=re.DOTALL)
    either = re.compile(r"#ifdef WITHOUT_JUMPS\n(.*?)#else\n.*?#endif\n", re.DOTALL)
    return either.sub(r"\1", text)


def _quoted(text: str) -> str:
    plain = comment(text).encode("ascii", "replace").decode()
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"').replace("?", "\\?") + '"'


def test(layout: Layout, replay: Replay, tolerance: float, reason: str, float32: bool) -> str:
    """A program that replays a recording and compares every output."""
    name, selection = layout.name, layout.selection
    compared = replay.compared
    rows = {port: replay.values[port] for port in selection.inputs}
    for port in selection.outputs:
        rows[port] = replay.values[port][compared // selection.every(port)]
    tables = [table(f"table_{layout.names[port]}", values) for port, values in rows.items()]
    form = f"in.{{0}} = ({'float' if float32 else 'double'}){{1}};"
    gives = [
        " " * 8 + _row(layout, port, form, "tick", selection.every(port))
        for port in selection.inputs
    ]
    compares = [
        " " * 8 + _row(layout, port, f"compare({i}, (double)out.{{0}}, {{1}});", "row")
        for i, port in enumerate(selection.outputs)
    ]
    labels = ", ".join(_quoted(".".join(port)) for port in selection.outputs)
    count = len(selection.outputs)
    unused = [] if selection.inputs else ["        in.none = 0;"]
    return TEST.substitute(
        ticks=replay.ticks,
        covered=replay.covered,
        scale="ranges[output]" if float32 else "(1.0 + fabs(recorded))",
        measure="its range" if float32 else "1 + |recorded value|",
        ranges=_ranges(replay, selection.outputs) if float32 else "",
        first=FIRST,
        every=replay.every,
        compared=len(compared),
        stopped=layout.failures[("stopped",)][0],
        name=name,
        reason=comment(reason),
        tolerance=literal(tolerance),
        tables="\n".join(tables),
        count=count,
        labels=labels,
        gives="\n".join([*unused, *gives]),
        compares="\n".join(compares),
    )


def _ranges(replay: Replay, ports: Sequence[Port]) -> str:
    numbers = ", ".join(literal(replay.range_of(port)) for port in ports)
    return f"static const double ranges[] = {{{numbers}}};\n"


def _row(layout: Layout, port: Port, form: str, row: str, every: int = 1) -> str:
    """A statement about a signal of the present tick and its row in the table."""
    name, count = layout.names[port], layout.count(port)
    row = row if every == 1 else f"({row} / {every})"
    if layout.kind(port).form == "scalar":
        return form.format(name, f"table_{name}[{row}]")
    statement = form.format(f"{name}[i]", f"table_{name}[{row} * {count} + i]")
    return f"for (int i = 0; i < {count}; i++) {statement}"


def single(text: str) -> str:
    """A text in float32."""
    text = LENGTH.sub(
        "INLINE double length_of(double a, double b)\n{\n    return hypot(a, b);\n}\n", text
    )
    text = re.sub(r"\bresult = name\(", "result = name##f(", text)  # of the macros REAL
    text = re.sub(r"\bdouble\b", "float", text)
    text = re.sub(rf"\b({'|'.join(MATH)})\(", r"\1f(", text)
    text = re.sub(r"\bOF_ARGUMENTS\((\w+)\);", r"OF_ARGUMENTS(\1f);", text)
    return NUMBER.sub(lambda match: _single(match.group(1)), text)


def _single(number: str) -> str:
    with np.errstate(over="ignore"):
        value = np.float32(number)
    return "INFINITY" if math.isinf(value) else f"{value!s}f"
