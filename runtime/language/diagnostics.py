"""Diagnostics: all that ``runtime validate`` says, each with its part of the file.

In: a model. Out: :class:`Diagnostic` objects, problems first. A message has a line and a column; an
editor underlines a range, which is the key or value that begins there::

    g.yaml:3:8: blocks.u.value: expected a number     underlines the value in line 3
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from blocks.messages import Fix, InsertBlock
from runtime.errors import Problem, Where
from runtime.language.items import YamlItem, deepest
from runtime.language.model import Model
from runtime.language.text import Span

Severity = Literal["error", "warning", "information"]
_WORD = re.compile(r"[^\s,\[\]{}]+")


@dataclass(frozen=True)
class Related:
    """Another place that a diagnostic is about."""

    where: Where
    message: str


@dataclass(frozen=True)
class Diagnostic:
    """Something wrong or noteworthy in a file.

    ``address`` is the entry's in the graph; ``kind`` and ``fixes`` are those of the message.
    """

    span: Span
    severity: Severity
    message: str
    address: str = ""
    related: tuple[Related, ...] = ()
    kind: str = ""
    fixes: tuple[Fix, ...] = ()


def diagnose(model: Model) -> list[Diagnostic]:
    """Everything to report about a file, problems first."""
    diagnostics = [_of_problem(model, problem) for problem in model.problems]
    return diagnostics if diagnostics else _notes(model)


def _of_problem(model: Model, problem: Problem) -> Diagnostic:
    where, text = problem.where, problem.text
    related: tuple[Related, ...] = ()
    # A problem of another file is shown where this text brings that file in, with a link to the
    # problem itself: an editor shows no diagnostics of files that are not open.
    if where.file and Path(where.file) != model.path:
        span = _span_of_file_name(model, problem)
        related = (Related(where, text),)
        text = f"{Where(Path(where.file).name, where.line, where.column)}: {text}"
    elif problem.kind == "algebraic-loop":
        span, related = _loop(model, problem)
    elif not where.line:
        span = _first_line(model)
    else:
        span = span_at(model, model.text.at(where))
    # A file that is too large to be checked may be right.
    severity: Severity = "warning" if model.refusal else "error"
    severity = "information" if problem.is_pending else severity
    # What another file's text has to be is not written here.
    fixes = () if where.file and Path(where.file) != model.path else problem.fixes
    return Diagnostic(span, severity, text, problem.address, related, problem.kind, fixes)


def span_at(model: Model, offset: int) -> Span:
    """The key or value that begins at an offset, or else the word there."""
    item = deepest(model.root, offset)
    source = model.text.source
    if item.key_start >= 0 and offset <= item.key_start:
        return item.key_span
    if item.start == offset and item.end > item.start:
        return _one_line(model, item.span)
    if item.kind == "empty" and item.colon >= 0 and offset >= item.colon:
        return item.key_span
    word = _WORD.match(source, offset)
    if word is not None:
        return Span(word.start(), word.end())
    return Span(max(0, offset - 1), offset) if offset >= len(source) else Span(offset, offset + 1)


def _one_line(model: Model, span: Span) -> Span:
    """A span as far as it is on its first line."""
    end = model.text.line_span(model.text.line_of(span.start)).end
    return Span(span.start, min(span.end, max(end, span.start + 1)))


def _first_line(model: Model) -> Span:
    title = model.root.get("graph")
    if title is not None and title.kind == "scalar":
        return title.span
    first = next(iter(model.root.items), None)
    return first.key_span if first is not None and first.key_start >= 0 else Span(0, 0)


def item_at_address(model: Model, address: str) -> YamlItem | None:
    """The innermost entry of the file on the way to an address, if there is one."""
    item, innermost = model.root, None
    for name in re.findall(r"[^.\[\]]+", address):
        inner = item.get(name)
        if inner is None and item.kind == "list" and name.isdigit() and int(name) < len(item.items):
            inner = item.items[int(name)]
        if inner is None:
            break
        item = innermost = inner
    return innermost


def _span_of_file_name(model: Model, problem: Problem) -> Span:
    """What makes another file part of this graph: a part's or a world's name, or ``extends``."""
    entry = item_at_address(model, problem.address)
    part = entry.get("graph") if entry is not None and entry.kind == "map" else None
    for item in (part, entry):
        if item is not None and item.kind == "scalar":
            return item.span
    for name in ("extends", "graph"):
        item = model.root.get(name)
        if item is not None and item.key_start >= 0:
            return _one_line(model, item.span) if item.end > item.start else item.key_span
    return _first_line(model)


def _loop(model: Model, problem: Problem) -> tuple[Span, tuple[Related, ...]]:
    """The first wire of an algebraic loop that this text has, and the others."""
    wires = {wire.target: wire for wire in (model.network.wires if model.network else ())}
    targets = [fix.target for fix in problem.fixes if isinstance(fix, InsertBlock)]
    places = [wires[name].where for name in targets if name in wires]
    own = [where for where in places if where.file == model.file and where.line]
    others = tuple(Related(where, "a wire of the loop") for where in places if where not in own[:1])
    # A loop has no place of its own: its first wire in this file is underlined, the others are
    # linked.
    span = span_at(model, model.text.at(own[0])) if own else _first_line(model)
    return span, others


def _notes(model: Model) -> list[Diagnostic]:
    """Notes of a graph without problems, and a package that it needs."""
    diagnostics = []
    missing = model.checked_graph.missing
    if missing is not None:
        diagnostics.append(Diagnostic(_first_line(model), "information", str(missing)))
    notes = model.observation.notes if model.observation is not None else []
    for note in dict.fromkeys(notes):
        item = item_at_address(model, note.address) if note.address else None
        severity: Severity = "information" if item is None else "warning"
        text, address = (str(note), "") if item is None else (note.text, note.address)
        if item is None and note.name:
            span = _mention(model, note.name)
        elif item is None:
            span = _block(model, note.block)
        else:
            span = item.span if item.kind == "scalar" or item.flow else item.key_span
        diagnostics.append(Diagnostic(span, severity, text, address, (), note.kind, note.fixes))
    return diagnostics


def _block(model: Model, name: str) -> Span:
    """Where the file writes a block, or the part that it is in."""
    item = item_at_address(model, f"blocks.{name.replace('.', '.blocks.')}") if name else None
    return (
        item.key_span if item is not None and item.parent is not model.root else _first_line(model)
    )


def _mention(model: Model, name: str) -> Span:
    """Where the file names an address among what is recorded, drawn and measured."""
    for section in ("probes", "plots", "metrics"):
        for item in (model.root.get(section) or YamlItem()).walk():
            if item.kind == "scalar" and item.value == name:
                return item.span
    return _first_line(model)
