"""Code actions: the suggestions that messages make, as edits, and changes to a block.

In: a model and a part of the file. Out: :class:`Action` objects with edits, such as "Replace by
'q'" for "unknown parameter 'Q', did you mean 'q'?".

A message is the one place that says what to do about a problem; its wording is read here, and
``tests/runtime/language/test_actions.py`` makes each of these messages and applies the action.
Fixes as data beside each message would have been a second text to keep in step with the first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from blocks.registry import BUILTIN
from runtime.language.cursor import steps
from runtime.language.diagnostics import Diagnostic, diagnose
from runtime.language.insertion import Edit, added_entry, added_name, removed_entry
from runtime.language.items import YamlItem, deepest
from runtime.language.model import Model
from runtime.language.scopes import class_of, scope_at
from runtime.language.text import Span

DELAY = "UnitDelay"
_DID_YOU_MEAN = re.compile(r", did you mean ('[^']*'(?: or '[^']*')*)\?")
_OPEN = re.compile(r"input '([\w.]+)\.(\w+)'(?: \([^)]*\)+)? is not connected")
_FITTING = re.compile(r"outputs of that type: ([\w., ]+)")
_QUOTES = re.compile(r"needs quotes: (\S+): (\".*\")")
_SPACE = re.compile(r"a space is missing after the colon: (\w+): (.*)")
_INSTEAD = (
    re.compile(r"a decimal point is a dot: ([-+\d.]+)"),
    re.compile(r"; the nearest is ([-+\d.e]+)"),
)
_DEGREES = re.compile(r"if degrees are intended, write ([-+\d.e]+)deg")
_BYPASS = re.compile(r"'bypass: \[([\w.]+)\]' would connect through it")


@dataclass(frozen=True)
class Action:
    """A change that an editor offers; ``fixes`` is the diagnostic that it answers."""

    title: str
    edits: tuple[Edit, ...]
    fixes: Diagnostic | None = None
    preferred: bool = False


def actions(model: Model, span: Span) -> list[Action]:
    """The actions for a part of the file: fixes first, then changes to the block there."""
    fixes: list[Action] = []
    for diagnostic in diagnose(model):
        if diagnostic.span.start <= span.end and span.start <= diagnostic.span.end:
            for make in _FIXES:
                fixes += make(model, diagnostic)
    return [*fixes, *_changes(model, span.start)]


def _replacements(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``did you mean 'q'?``"""
    match = _DID_YOU_MEAN.search(diagnostic.message)
    if match is None or diagnostic.related:
        return
    text = model.text.source[diagnostic.span.start : diagnostic.span.end]
    for new in re.findall("'([^']*)'", match[1]):
        span = _wrong_part(text, diagnostic, diagnostic.message[: match.start()])
        yield Action(f"Replace by '{new}'", (Edit(span, new),), diagnostic, True)


def _wrong_part(text: str, diagnostic: Diagnostic, before: str) -> Span:
    """The part of the underlined text that a message calls wrong."""
    # The last name before "did you mean" is the wrong one: "block 'a' has no output 'pos', did you
    # ...".
    for name in reversed(re.findall("'([^']*)'", before)):
        place = re.search(rf"(?<![\w]){re.escape(name)}(?!\w)", text) if name else None
        if place is not None:
            return Span(diagnostic.span.start + place.start(), diagnostic.span.start + place.end())
    has_quotes = text[:1] in "\"'" and len(text) > 2
    return Span(diagnostic.span.start + has_quotes, diagnostic.span.end - has_quotes)


def _wirings(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``outputs of that type: error.state, ...``"""
    names, outputs = _OPEN.search(diagnostic.message), _FITTING.search(diagnostic.message)
    if names is None or outputs is None or "." in names[1]:
        return
    for i, output in enumerate(o.strip(" .") for o in outputs[1].split(",")):
        edits = added_entry(model, ("wires", names[1]), names[2], output) if output else None
        if edits is not None:
            title = f"Wire '{names[1]}.{names[2]}' to {output}"
            yield Action(title, tuple(edits), diagnostic, preferred=i == 0)


def _loops(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``a UnitDelay on one of these wires breaks it``"""
    if not diagnostic.message.startswith("algebraic loop: ") or model.network is None:
        return
    through = BUILTIN[DELAY].spec.through
    names = diagnostic.message.split(";")[0].removeprefix("algebraic loop: ").split(" ▸ ")
    wires = {wire.target: wire for wire in model.network.wires}
    for name in names[1::2] if through is not None else ():
        wire = wires.get(name)
        if wire is None or wire.where.file != model.file:
            continue
        item = deepest(model.root, model.text.at(wire.where))
        if item.kind != "scalar" or steps(item)[:1] != ("wires",) or through is None:
            continue
        block = _unused_name(model, f"{name.split('.')[0]}_delay")
        # The wire a ─▶ b becomes a ─▶ b_delay ─▶ b; only one whose text is in this file can be
        # changed.
        edits = [Edit(item.span, f"{block}.{through[1]}")]
        block_edits = added_entry(model, ("blocks",), block, f"{{type: {DELAY}}}")
        wire_edits = added_entry(model, ("wires",), block, f"{{{through[0]}: {item.value}}}")
        if block_edits is not None and wire_edits is not None:
            title = f"Put a {DELAY} between {item.value} and {name}"
            yield Action(title, (*edits, *block_edits, *wire_edits), diagnostic)


def _unused_name(model: Model, name: str) -> str:
    blocks, number, free = model.root.get("blocks") or YamlItem(), 2, name
    while blocks.get(free) is not None:
        free, number = f"{name}_{number}", number + 1
    return free


def _quotes(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``a string that contains ': ' needs quotes``"""
    match, source = _QUOTES.search(diagnostic.message), model.text.source
    if match is not None:
        entry = f"{match[1]}: {match[2][1:-1]}"
        start, end = model.text.line_span(model.text.line_of(diagnostic.span.start))
        place = source.find(entry, start, end)
        if place >= 0:
            span = Span(place, place + len(entry))
            yield Action("Put quotes around it", (Edit(span, match[0][14:]),), diagnostic, True)
    match = _SPACE.search(diagnostic.message)
    if match is not None:
        span = Span(diagnostic.span.start, diagnostic.span.start + len(match[1]) + 1)
        if source[span.start : span.end] == f"{match[1]}:":
            yield Action("Insert the space", (Edit(span, f"{match[1]}: "),), diagnostic, True)


def _values(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``the nearest is 0.05``, ``a decimal point is a dot: 1.5``, ``write 90deg``."""
    for pattern in _INSTEAD:
        match = pattern.search(diagnostic.message)
        if match is not None:
            new = match[1].rstrip(".")
            yield Action(f"Replace by {new}", (Edit(diagnostic.span, new),), diagnostic, True)
    match = _DEGREES.search(diagnostic.message)
    if match is not None:
        item = deepest(model.root, diagnostic.span.start)
        # The message quotes the number, and the item may be a list: the scalar of that value is
        # meant.
        for scalar in [item, *item.walk()]:
            if scalar.kind == "scalar" and _is_number(scalar.value, float(match[1])):
                edit = Edit(scalar.span, f"{scalar.value}deg")
                yield Action(f"Write {scalar.value}deg", (edit,), diagnostic)
                return


def _is_number(text: str, value: float) -> bool:
    try:
        return float(text) == value
    except ValueError:
        return False


def _removals(model: Model, diagnostic: Diagnostic) -> Iterator[Action]:
    """``delete these wires``, ``is not used; remove it``, ``would connect through it``."""
    item = deepest(model.root, diagnostic.span.start)
    if "; delete these wires" in diagnostic.message and item.key:
        yield Action(f"Delete the wires of '{item.key}'", (removed_entry(model, item),), diagnostic)
    if " is not used" in diagnostic.message and item.key:
        yield Action(f"Remove '{item.key}'", (removed_entry(model, item),), diagnostic)
    match = _BYPASS.search(diagnostic.message)
    if match is not None:
        edits = [*added_name(model, "bypass", match[1])]
        without = model.root.get("without")
        names = without.scalars() if without is not None else []
        # A block stands in one of the two lists only.
        edits += [removed_entry(model, each) for each in names if each.value == match[1]]
        yield Action(f"Bypass '{match[1]}' instead", tuple(edits), diagnostic, True)


_FIXES: tuple[Callable[[Model, Diagnostic], Iterator[Action]], ...] = (
    *(_replacements, _wirings, _loops),
    *(_quotes, _values, _removals),
)


def _changes(model: Model, offset: int) -> Iterator[Action]:
    """What can be done to the block whose name is at an offset."""
    item = deepest(model.root, offset)
    path = steps(item)
    if len(path) != 2 or path[0] != "blocks" or not item.key_start <= offset <= item.key_end:
        return
    if model.kind != "graph" or not item.key:
        return
    scope, _ = scope_at(model, path)
    cls = class_of(model, scope, item.key)
    yield Action(f"Leave out '{item.key}' (without)", tuple(added_name(model, "without", item.key)))
    if cls is not None and cls.spec.through is not None:
        yield Action(f"Bypass '{item.key}'", tuple(added_name(model, "bypass", item.key)))
