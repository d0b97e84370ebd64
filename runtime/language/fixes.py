"""Code actions: the fixes of problems and notes, as edits of the text, and changes to a block.

In: a model and a part of the file. Out: :class:`Action` objects with edits, such as "Replace by
'q'" for "unknown parameter 'Q', did you mean 'q'?".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from blocks.library.registry import BUILTIN
from blocks.messages import AddEntry, BypassBlock, Fix, InsertBlock, RemoveEntry, Replace
from runtime.language.cursor import steps
from runtime.language.diagnostics import Diagnostic, diagnose
from runtime.language.insertion import Edit, add_entry, add_name, remove_entry
from runtime.language.items import YamlItem, deepest
from runtime.language.model import Model
from runtime.language.scopes import class_of, scope_at
from runtime.language.text import Span


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
            for fix in diagnostic.fixes:
                title, edits = _edits(model, diagnostic, fix)
                # Of several ways the first is the likely one; but a loop can be cut anywhere.
                is_likely = not isinstance(fix, InsertBlock | RemoveEntry)
                is_first = fix is diagnostic.fixes[0] and diagnostic.severity == "error"
                preferred = is_first and is_likely
                if edits:
                    fixes.append(Action(title, tuple(edits), diagnostic, preferred))
    return [*fixes, *_changes(model, span.start)]


def _edits(model: Model, diagnostic: Diagnostic, fix: Fix) -> tuple[str, list[Edit]]:
    """What a fix is called, and its edits; none where the text is another than the fix is for."""
    if isinstance(fix, Replace):
        span = _part(model, diagnostic.span, fix.old)
        edits = [] if span is None else [Edit(span, fix.new)]
        return fix.title or f"Replace by '{fix.new}'", edits
    if isinstance(fix, AddEntry):
        return fix.title, add_entry(model, fix.path, fix.key, fix.value) or []
    if isinstance(fix, RemoveEntry):
        item = deepest(model.root, diagnostic.span.start)
        return fix.title, [remove_entry(model, item)] if item.key else []
    if isinstance(fix, BypassBlock):
        return f"Bypass '{fix.block}' instead", _bypass(model, fix.block)
    return _insertion(model, fix)


def _part(model: Model, span: Span, old: str) -> Span | None:
    """Where ``old`` is written: in the underlined text, or else in its line."""
    source = model.text.source
    text = source[span.start : span.end]
    if not old:
        has_quotes = text[:1] in "\"'" and len(text) > 2
        return Span(span.start + has_quotes, span.end - has_quotes)
    line = model.text.line_span(model.text.line_of(span.start))
    for part in (span, line):
        pattern = rf"(?<!\w){re.escape(old)}(?!\w)" if old[-1:].isalnum() else re.escape(old)
        place = re.search(pattern, source[part.start : part.end])
        if place is not None:
            return Span(part.start + place.start(), part.start + place.end())
    # A number may be written in another way, and be one of a list over several lines.
    item = deepest(model.root, span.start)
    numbers = (each for each in [item, *item.walk()] if each.kind == "scalar")
    return next((each.span for each in numbers if _is_equal(each.value, old)), None)


def _is_equal(text: str, number: str) -> bool:
    try:
        return float(text) == float(number)
    except ValueError:
        return False


def _bypass(model: Model, name: str) -> list[Edit]:
    without = model.root.get("without")
    names = without.scalars() if without is not None else []
    # A block is in one of the two lists only.
    removed = [remove_entry(model, each) for each in names if each.value == name]
    return [*add_name(model, "bypass", name), *removed]


def _insertion(model: Model, fix: InsertBlock) -> tuple[str, list[Edit]]:
    """A block on a wire: a ─▶ b becomes a ─▶ b_delay ─▶ b, if the wire is written in this file."""
    through = BUILTIN[fix.type].spec.through
    wires = model.network.wires if model.network is not None else ()
    wire = next((each for each in wires if each.target == fix.target), None)
    if wire is None or wire.where.file != model.file or through is None:
        return "", []
    item = deepest(model.root, model.text.at(wire.where))
    if item.kind != "scalar" or steps(item)[:1] != ("wires",):
        return "", []
    block = _unused_name(model, f"{fix.target.split('.')[0]}_delay")
    block_edits = add_entry(model, ("blocks",), block, f"{{type: {fix.type}}}")
    wire_edits = add_entry(model, ("wires",), block, f"{{{through[0]}: {item.value}}}")
    if block_edits is None or wire_edits is None:
        return "", []
    edits = [Edit(item.span, f"{block}.{through[1]}"), *block_edits, *wire_edits]
    return f"Put a {fix.type} between {item.value} and {fix.target}", edits


def _unused_name(model: Model, name: str) -> str:
    blocks, number, free = model.root.get("blocks") or YamlItem(), 2, name
    while blocks.get(free) is not None:
        free, number = f"{name}_{number}", number + 1
    return free


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
    yield Action(f"Leave out '{item.key}' (without)", tuple(add_name(model, "without", item.key)))
    if cls is not None and cls.spec.through is not None:
        yield Action(f"Bypass '{item.key}'", tuple(add_name(model, "bypass", item.key)))
