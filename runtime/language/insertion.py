"""Edits of the file that add and remove entries where and as a person would write them.

In: a model, the path of a mapping, a key and a value. Out: edits. Adding "pid: {error: sum.out}" to
("wires",) writes a line in the style of the section: a new line in a section of lines, ", pid: ..."
before the closing brace of one in braces, and "wires:" first where there is none. The file is not
printed again from the tree, which would lose comments and the author's layout.
"""

from __future__ import annotations

from typing import NamedTuple

from runtime.language.items import YamlItem
from runtime.language.model import Model
from runtime.language.text import Span


class Edit(NamedTuple):
    """A part of the file, and what takes its place."""

    span: Span
    new: str


def add_entry(model: Model, path: tuple[str, ...], key: str, value: str) -> list[Edit] | None:
    """The edits that add an entry to a mapping, which is made if it is not there.

    None if the entry exists, or something else stands in the mapping's place.
    """
    holder = model.root
    for i, name in enumerate(path):
        inner = holder.get(name)
        if inner is None or (inner.kind == "empty" and not inner.flow):
            return _new_mappings(model, holder, inner, path[i:], f"{key}: {value}")
        holder = inner
    if holder.kind != "map" or holder.get(key) is not None:
        return None
    return [_into(model, holder, f"{key}: {value}")]


def _into(model: Model, holder: YamlItem, text: str) -> Edit:
    """A new last entry of a mapping that has a place for it."""
    if holder.flow:
        end = holder.end - 1 if holder.closed else holder.end
        # Behind the last entry, and before the space and the comma that may end the list.
        while end > holder.start + 1 and model.text.source[end - 1] in " \t\r\n,":
            end -= 1
        lead = ", " if holder.items else ""
        return Edit(Span(end, end), lead + text)
    return _below(model, holder, " " * holder.column + text)


def _below(model: Model, item: YamlItem, line: str) -> Edit:
    """A new line after the last one of an item."""
    last = max((max(i.end, i.key_end, i.colon) for i in item.walk()), default=0)
    end = model.text.line_span(model.text.line_of(last)).end
    return Edit(Span(end, end), f"\n{line}")


def _new_mappings(
    model: Model, holder: YamlItem, empty: YamlItem | None, path: tuple[str, ...], text: str
) -> list[Edit] | None:
    """An entry in mappings of which the outermost is not there yet, or is empty."""
    is_section = holder is model.root
    inner = text
    for name in reversed(path[1:]):
        inner = f"{name}: {{{inner}}}"
    if empty is not None:
        if is_section:
            return [_below(model, empty, f"  {inner}")]
        return [Edit(Span(empty.start, empty.start), f" {{{inner}}}")]
    if not is_section:
        return [_into(model, holder, f"{path[0]}: {{{inner}}}")] if holder.kind == "map" else None
    return [_section(model, f"{path[0]}:\n  {inner}\n")]


def _section(model: Model, text: str) -> Edit:
    """A new section at the end of the file."""
    source = model.text.source
    lead = "" if not source or source.endswith("\n") else "\n"
    return Edit(Span(len(source), len(source)), lead + text)


def add_name(model: Model, section: str, name: str) -> list[Edit]:
    """The edits that add a name to ``without`` or ``bypass``."""
    item = model.root.get(section)
    if item is None:
        # Beside the sections that say what is run, above those that say what is recorded.
        before = model.root.get("probes") or model.root.get("plots") or model.root.get("metrics")
        if before is None:
            return [_section(model, f"{section}: [{name}]\n")]
        return [Edit(Span(before.key_start, before.key_start), f"{section}: [{name}]\n")]
    if item.kind == "list" and item.flow:
        end = item.end - 1 if item.closed else item.end
        return [Edit(Span(end, end), f"{', ' if item.items else ''}{name}")]
    if item.kind == "list":
        return [_below(model, item, f"{' ' * item.column}- {name}")]
    if item.kind == "scalar":
        return [Edit(item.span, f"[{item.value}, {name}]")]
    return [Edit(Span(item.start, item.end), f" [{name}]")]


def remove_entry(model: Model, item: YamlItem) -> Edit:
    """The edit that removes an entry: with its lines, or with its comma."""
    source, text = model.text.source, model.text
    begin, end = item.begin, max(item.end, item.key_end, item.colon)
    if item.parent is not None and item.parent.flow:
        siblings = item.parent.items
        place = siblings.index(item)
        if place + 1 < len(siblings):
            return Edit(Span(begin, siblings[place + 1].begin), "")
        if place:
            before = siblings[place - 1]
            return Edit(Span(max(before.end, before.key_end, before.colon), end), "")
        return Edit(Span(begin, end), "")
    # An item of a list over several lines: its dash goes, too.
    if item.key_start < 0 and item.parent is not None and item.parent.parent is not None:
        begin = source.rfind("-", 0, begin) if "-" in source[:begin] else begin
    start = text.starts[text.line_of(begin)]
    last = text.line_of(max(begin, end - 1))
    after = text.starts[last + 1] if last + 1 < len(text.starts) else len(source)
    return Edit(Span(start, after), "")
