"""The outline of a file, and which of its lines fold.

In: a model. Out: a tree of names with spans: the section "blocks" holds "pid" with the detail
"PID".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from runtime.language.items import YamlItem
from runtime.language.model import Model
from runtime.language.text import Span

SymbolKind = Literal["section", "block", "part", "wires", "value"]


@dataclass(frozen=True)
class OutlineSymbol:
    """An entry of the outline: its name, one line about it, the whole of it, and its name alone."""

    name: str
    detail: str
    kind: SymbolKind
    span: Span
    name_span: Span
    inner: tuple[OutlineSymbol, ...] = ()


def outline(model: Model) -> list[OutlineSymbol]:
    """Sections with their entries, in the order of the file."""
    return [_symbol(model, item, 0) for item in model.root.items if item.key]


def _symbol(model: Model, item: YamlItem, depth: int) -> OutlineSymbol:
    section = item.parent.key if item.parent is not None and item.parent.parent else ""
    type_item, part = item.get("type"), item.get("graph") or item.get("blocks")
    detail = type_item.value if type_item is not None else _short(model, item)
    kind: SymbolKind = "section" if depth == 0 else "value"
    if section == "blocks":
        kind = "part" if part is not None else "block"
    elif section == "wires":
        kind = "wires"
    # Parameters of a block are not listed: an outline as long as the file would be no overview.
    inside = depth < 1 or (kind == "part" and depth < 20) or section in ("blocks", "variants")
    inner = [_symbol(model, each, depth + 1) for each in item.items if inside and each.key]
    if kind == "block":
        inner = []
    span = Span(item.key_start, max(item.end, item.key_end, item.colon))
    return OutlineSymbol(item.key, detail, kind, span, item.key_span, tuple(inner))


def _short(model: Model, item: YamlItem) -> str:
    if item.kind == "scalar":
        return item.value.split("\n")[0][:60]
    if item.flow:
        return model.text.source[item.start : item.end].split("\n")[0][:60]
    return ""


def folds(model: Model) -> list[tuple[int, int, bool]]:
    """(first line, last line, whether it is a comment), from 0."""
    ranges = []
    text = model.text
    for item in model.root.walk():
        if item.parent is None or item.kind == "empty":
            continue
        first, last = text.line_of(item.begin), text.line_of(max(item.begin, item.end - 1))
        if last > first:
            ranges.append((first, last, False))
    begin: int | None = None
    for number in range(len(text.starts) + 1):
        line = text.line(number).lstrip() if number < len(text.starts) else ""
        if line.startswith("#"):
            begin = number if begin is None else begin
        elif begin is not None:
            if number - begin > 1:
                ranges.append((begin, number - 1, True))
            begin = None
    return sorted(set(ranges))
