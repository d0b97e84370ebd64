"""Descriptions of blocks and options, from their own declarations: as text, Markdown and data.

In: a block's class. Out: its ports, parameters and states for a terminal, for docs/blocks or as
plain data; nothing is written down twice::

    param_row("dt", LQR.spec.params["dt"])    # name, what is expected, default, documentation
"""

from __future__ import annotations

import inspect
import math
import re
import sys
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import Block, Input, Output, Param, Setting, Variant
from blocks.files import opened
from blocks.library.registry import BLOCKS, blocks_of_module, is_built_in
from blocks.limits import MODULE
from runtime.errors import UsageError, raised_text
from runtime.terminal import table

TableRow = tuple[str, str, str, str]


def library(module: str | None = None) -> dict[str, type[Block]]:
    """All block types: built in, of installed packages that work, and those of a file."""
    own = {} if module is None else own_blocks(module)
    return {**BLOCKS.usable(), **own}


def own_blocks(file: str) -> dict[str, type[Block]]:
    """The block types that a Python file defines.

    Raises
    ------
    UsageError : it cannot be loaded.
    """
    try:
        opened(file, MODULE).close()
    except OSError as error:
        raise UsageError(f"cannot read '{file}': {error.strerror or error}") from None
    try:
        return blocks_of_module(Path(file))
    except BaseException as error:  # noqa: BLE001 -- a user's file may raise anything
        raise UsageError(f"cannot load '{file}': {raised_text(error)}") from None


def families(known: Mapping[str, type[Block]]) -> dict[str, list[str]]:
    """The names of block types by what they are for: the rooms of the library, then others."""
    families_by_room: dict[str, list[str]] = {}
    for name, cls in known.items():
        top, *rest = cls.__module__.split(".")
        # The first sentence of a room's docstring is its title. A class exists, so its room is
        # imported.
        room = sys.modules.get(f"{top}.{rest[0]}") if rest and is_built_in(cls) else None
        about = _first_line(room.__doc__).rstrip(".") if room is not None else ""
        family = f"{rest[0]}: {about}" if about else top
        # Modules of a user's files get hidden names (blocks.library.registry).
        families_by_room.setdefault("your own" if family.startswith("_") else family, []).append(
            name
        )
    return families_by_room


def summary(cls: type[Block]) -> str:
    """The first line of a block's documentation, without the marks of code."""
    return _first_line(cls.__doc__)


def _first_line(text: str | None) -> str:
    return (text or "").strip().split("\n")[0].replace("``", "")


def settings(known: Mapping[str, type[Block]]) -> dict[type[Setting], list[str]]:
    """Settings that parameters choose from, as neuron models and solvers, and which these are.

    ``Decoder.synapse, Weights.synapse`` for the synapses: only what has forms that can be listed.
    """
    users: dict[type[Setting], list[str]] = {}
    for name, cls in known.items():
        for parameter, declared in cls.spec.params.items():
            if declared.setting is not None and declared.setting.forms():
                users.setdefault(declared.setting, []).append(f"{name}.{parameter}")
    return users


def forms(setting: type[Setting]) -> list[TableRow]:
    """What may be written for a setting: each form with its parameters and a line about it."""
    rows = []
    members = setting.members if issubclass(setting, Variant) else {}
    # The forms of a family of classes are in the order of its classes.
    labels = [*members, *[""] * len(setting.forms())]
    for label, (form, doc) in zip(labels, setting.forms().items(), strict=False):
        declared = members[label].declared if label else {}
        given = [f"{name}: {param_row(name, d)[2]}" for name, d in declared.items()]
        rows.append((form, ", ".join(given), "", doc))
    return rows


def matches(setting: type[Setting], word: str) -> list[tuple[str, str]]:
    """The forms of a setting, with a line about each, that have a word in them or their choices."""
    members = setting.members if issubclass(setting, Variant) else {}
    declared = [member.declared.values() for member in members.values()]
    choices = [
        " ".join(c for each in params for c in (*each.choices, each.doc)) for params in declared
    ]
    choices += [""] * len(setting.forms())
    return [
        (form, doc)
        for (form, given, _, doc), more in zip(forms(setting), choices, strict=False)
        if word in f"{form} {given} {doc} {more}".lower()
    ]


def variants(known: Mapping[str, type[Block]]) -> dict[str, type[Variant]]:
    """The classes that settings of these blocks are chosen from, as ``LIF``, by name."""
    families = [each for each in settings(known) if issubclass(each, Variant)]
    return {label: member for family in families for label, member in family.members.items()}


def describe_variant(cls: type[Variant], used: str) -> str:
    """The description of a neuron model, solver and so on for a terminal."""
    rows = [param_row(name, declared) for name, declared in cls.declared.items()]
    parameters = ["parameters", table(rows), ""] if rows else []
    lines = [cls.label, "", inspect.getdoc(cls) or "", "", *parameters]
    written = f"{{{cls.key}: {cls.label}, {rows[0][0]}: ...}}" if rows else cls.label
    name = used.partition(", ")[0].partition(".")[2]
    return "\n".join([*lines, f"for {used}, as in {name}: {written}"])


def describe_text(cls: type[Block]) -> str:
    """The description of a block for a terminal."""
    lines = [cls.__name__, "", inspect.getdoc(cls) or "", ""]
    tables = _tables(cls)
    for setting, users in settings({cls.__name__: cls}).items():
        names = [user.partition(".")[2] for user in users]
        tables.append((f"for {', '.join(names)}: {setting.expected}", forms(setting)))
    for title, rows in tables:
        # Without columns that are empty throughout, as the defaults of ports are.
        columns = [i for i in range(len(rows[0])) if any(row[i] for row in rows)]
        lines += [title, table([[row[i] for i in columns] for row in rows]), ""]
    through = cls.spec.through
    if through:
        lines.append(f"bypass wires {through[0]} straight to {through[1]}")
    return "\n".join(lines).rstrip()


def describe_markdown(cls: type[Block]) -> str:
    """The description of a block for its page in docs/blocks."""
    paragraphs = (inspect.getdoc(cls) or "").split("\n\n")
    lines = [f"## {cls.__name__}", ""]
    for is_code, together in groupby(paragraphs, key=_is_code):
        if is_code:
            text = "\n\n".join(together).strip("\n").replace("``", "")
            lines += ["```text", text, "```", ""]
        else:
            lines += [line for text in together for line in (_prose(text), "")]
    for title, rows in _tables(cls):
        heads = "expected | default" if title == "parameters" else "type | unit"
        lines += [f"| {title} | {heads} | meaning |", "|---|---|---|---|"]
        for name, kind, default, text in rows:
            cells = (f"`{name}`", kind, f"`{default}`" if default else "", text)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    through = cls.spec.through
    if through:
        lines += [f"`bypass` wires `{through[0]}` straight to `{through[1]}`.", ""]
    return "\n".join(lines)


# What Markdown would read as a mark in "K [along, lateral]", "s_i * x" or "<path>".
MARKS = re.compile(r"([\\*_\[\]<>#~|$])")


def _is_code(text: str) -> bool:
    """Whether a paragraph of a docstring is a drawing, or equations below each other."""
    rows = text.strip("\n").split("\n")
    return rows[0].startswith("    ") or "─▶ [" in text or any("  " in row.strip() for row in rows)


def _prose(text: str) -> str:
    """A paragraph of a docstring in Markdown."""
    parts = text.split("``")  # every second one is code
    return "`".join(part if i % 2 else MARKS.sub(r"\\\1", part) for i, part in enumerate(parts))


def describe_json(cls: type[Block]) -> dict[str, Any]:
    """The description of a block as plain data."""
    spec = cls.spec
    return {
        "doc": inspect.getdoc(cls),
        "inputs": {
            n: {"type": str(p.type), "unit": p.unit, "required": not p.optional, "doc": p.doc}
            for n, p in spec.inputs.items()
        },
        "outputs": {
            n: {"type": str(p.type), "unit": p.unit, "doc": p.doc, "through": p.through or None}
            for n, p in spec.outputs.items()
        },
        "states": {n: {"unit": s.unit, "doc": s.doc} for n, s in spec.states.items()},
        "parameters": parameters_json(spec.params),
    }


def parameters_json(params: Mapping[str, Param]) -> dict[str, Any]:
    """The parameters of a block, or of a setting, as plain data."""
    return {
        n: {
            "expected": p.describe(),
            "required": p.required,
            "default": None if p.required else _plain(p.default),
            "doc": p.doc,
            "tunable": p.tunable,
            **({"forms": dict(p.setting.forms())} if p.setting and p.setting.forms() else {}),
        }
        for n, p in params.items()
    }


def _tables(cls: type[Block]) -> list[tuple[str, list[TableRow]]]:
    spec = cls.spec
    tables: list[tuple[str, list[TableRow]]] = [
        ("inputs", [_input(name, port) for name, port in spec.inputs.items()]),
        ("outputs", [_output(name, port) for name, port in spec.outputs.items()]),
        ("parameters", [param_row(name, declared) for name, declared in spec.params.items()]),
        ("states (for probes)", [(n, "", s.unit, s.doc) for n, s in spec.states.items()]),
    ]
    return [(title, rows) for title, rows in tables if rows]


def _input(name: str, port: Input) -> TableRow:
    doc = port.doc
    if port.default is not None:
        doc += f"; default: {port.default:g}"
    kind = f"{port.type}, any number" if port.variadic else str(port.type)
    return name, kind, port.unit, doc


def _output(name: str, port: Output) -> TableRow:
    return name, str(port.type), port.unit, port.doc


def param_row(name: str, declared: Param) -> TableRow:
    """Name, what is expected, default and documentation of a parameter or option."""
    default = "required" if declared.required else _default_text(declared.default)
    doc = f"{declared.doc}; may change during a run" if declared.tunable else declared.doc
    return name, declared.describe(), default, doc


def _plain(value: Any) -> Any:
    value = list(value) if isinstance(value, (tuple, np.ndarray)) else value
    # JSON has no infinity; this is how a graph writes it.
    if isinstance(value, float) and math.isinf(value):
        return ".inf" if value > 0.0 else "-.inf"
    return value


def _default_text(value: Any) -> str:
    value = _plain(value)
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def option_text(name: str, declared: Param) -> str:
    """An option in one line of Markdown."""
    _, expectation, default, doc = param_row(name, declared)
    default_text = default if default in ("", "required") else f"default {default}"
    return f"`{name}` ({', '.join(filter(None, (expectation, default_text)))}): {doc}"
