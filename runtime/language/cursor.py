"""What is being written at an offset: a key or a value, of which mapping, with which beginning.

In: the scanned tree and an offset. Out: a :class:`Cursor`, from which completion and signatures
start. With "|" for the offset::

    wires: {sum: {te|     key,   path (wires, sum),         prefix "te"
    wires: {sum: {terms: [a.|   value, path (wires, sum, terms, []), prefix "a."
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from typing import Literal

from runtime.language.items import YamlItem, deepest
from runtime.language.text import SourceText, Span

ITEM = "[]"  # stands in a path for any item of a list


@dataclass(frozen=True)
class Cursor:
    """A place in the file, for completion.

    role : whether a key of ``holder`` is written here, or a value.
    path : of the mapping whose key it is, or of the entry whose value it is.
    item : the entry that is written already, if any.
    prefix : what is written of it before the offset. span : what a completion replaces.
    lead : what has to stand before the completion, a space after a colon.
    """

    role: Literal["key", "value"]
    path: tuple[str, ...]
    holder: YamlItem
    item: YamlItem | None
    prefix: str
    span: Span
    lead: str = ""


def steps(item: YamlItem) -> tuple[str, ...]:
    """The keys from the root to an item, with :data:`ITEM` for those in lists."""
    names: list[str] = []
    while item.parent is not None:
        names.append(ITEM if item.parent.kind == "list" else item.key)
        item = item.parent
    return tuple(reversed(names))


def cursor_at(text: SourceText, root: YamlItem, offset: int) -> Cursor | None:
    """What is being written at an offset; None in a comment, and where nothing can be written."""
    if _in_comment(text, root, offset):
        return None
    holder = _flow_at(text.source, root, offset)
    return _in_flow(text.source, holder, offset) if holder else _in_block(text, root, offset)


# Quotes have to be looked at: the "#" in 'a #b' begins no comment.
def _in_comment(text: SourceText, root: YamlItem, offset: int) -> bool:
    start = text.starts[text.line_of(offset)]
    position = text.source.find("#", start, offset)
    while position >= 0:
        item = deepest(root, position)
        inside = item.kind == "scalar" and item.start < position < item.end
        if not inside and (position == start or text.source[position - 1] in " \t"):
            return True
        position = text.source.find("#", position + 1, offset)
    return False


def _last(items: list[YamlItem], offset: int, *, inclusive: bool) -> YamlItem | None:
    """The last of the items that begins before an offset, or at it where ``included``."""
    begins = [item.begin for item in items]
    i = bisect_right(begins, offset) if inclusive else bisect_left(begins, offset)
    return items[i - 1] if i else None


def _flow_at(source: str, root: YamlItem, offset: int) -> YamlItem | None:
    """The innermost braces or brackets around an offset."""
    flow, item = None, root
    if root.flow and root.start < offset and (not root.closed or offset < root.end):
        flow = root
    while (child := _last(item.items, offset, inclusive=False)) is not None:
        if child.flow and child.start < offset:
            rest = source[child.end : offset]
            # An unclosed bracket still holds what is typed behind it, as long as that is in the
            # same line.
            is_open = not child.closed and not rest.strip() and "\n" not in rest
            if not (is_open or offset < child.end):
                break
            flow = child
        elif not child.items:
            break
        item = child
    return flow


def _in_flow(source: str, holder: YamlItem, offset: int) -> Cursor:
    child = _last(holder.items, offset, inclusive=True)
    if child is None or "," in source[max(child.end, child.key_end, child.colon) : offset]:
        role: Literal["key", "value"] = "key" if holder.kind == "map" else "value"
        path = steps(holder) if role == "key" else (*steps(holder), ITEM)
        return Cursor(role, path, holder, None, "", Span(offset, offset))
    if holder.kind == "map" and (child.colon < 0 or offset < child.colon):
        return _key(source, holder, child, offset)
    return _value(source, holder, child, offset)


def _key(source: str, holder: YamlItem, child: YamlItem, offset: int) -> Cursor:
    span = child.key_span if child.key_start >= 0 else Span(offset, offset)
    prefix = source[span.start : max(offset, span.start)]
    return Cursor("key", steps(holder), holder, child, prefix, span)


def _value(source: str, holder: YamlItem, child: YamlItem, offset: int) -> Cursor:
    # Behind "dt:" a completion has to insert the space that makes it an entry.
    lead = " " if child.colon >= 0 and source[offset - 1 : offset] == ":" else ""
    span = Span(offset, offset)
    if child.kind == "scalar" and child.start <= offset <= child.end:
        span = child.span
    elif child.kind == "scalar" and child.colon >= 0 and offset < child.start:
        span = Span(offset, child.end)
    prefix = source[span.start : offset]
    return Cursor("value", steps(child), holder, child, prefix, span, lead)


def _in_block(text: SourceText, root: YamlItem, offset: int) -> Cursor | None:
    line = text.line_of(offset)
    start, end = text.line_span(line)
    chain = _chain(root, end)
    here = [item for item in chain if start <= item.begin and item.parent is not None]
    entry = _last(here, offset, inclusive=True) if here else None
    if entry is not None and entry.parent is not None:
        if entry.parent.kind == "map" and (entry.colon < 0 or offset < entry.colon):
            return _key(text.source, entry.parent, entry, offset)
        # Behind a key whose value is in the lines below: nothing fits between the two.
        if entry.kind in ("map", "list") and entry.begin >= start and entry.items:
            return None
        return _value(text.source, entry.parent, entry, offset)
    if text.source[start:offset].strip():
        return None
    # An empty line: its indentation alone says which mapping a new key would belong to.
    holder = _holder(text, root, _chain(root, start - 1), offset - start)
    return Cursor("key", steps(holder), holder, None, "", Span(offset, offset))


def _chain(root: YamlItem, offset: int) -> list[YamlItem]:
    """The last item that begins by an offset, with all that contain it, outermost first."""
    chain, item = [root], root
    while (child := _last(item.items, offset, inclusive=True)) is not None:
        chain.append(child)
        item = child
    return chain


def _holder(text: SourceText, root: YamlItem, chain: list[YamlItem], column: int) -> YamlItem:
    """The mapping that a new key in a column of an empty line belongs to."""
    for item in reversed(chain):
        if item.flow or item.parent is None:
            continue
        own = item.begin - text.starts[text.line_of(item.begin)]
        # "blocks:" above an indented empty line is about to get its first entry.
        if item.kind == "empty" and item.colon >= 0 and own < column:
            return item
        if item.kind in ("map", "list") and item.items and item.column <= column:
            return item
    return root
