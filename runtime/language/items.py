"""The tree that :mod:`runtime.language.scan` makes: values with their keys, and where both stand.

In: "a: [1, 2]". Out: a root with one item: key "a" at 0..1, its colon ends at 2, a value of kind
"list" at 3..9 in flow style with two scalars. Offsets count characters from 0. Nothing here is
checked: an item says what is written and not what it means.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from runtime.language.text import Span

_ESCAPE = re.compile(r"\\(?:x([\da-fA-F]{2})|u([\da-fA-F]{4})|U([\da-fA-F]{8})|(.))", re.DOTALL)
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "a": "\a", "b": "\b", "e": "\x1b"}
Kind = Literal["map", "list", "scalar", "empty"]


# Mutable and compared by identity: the scanner extends items while it reads, and equal values at
# different places are different items.
@dataclass(eq=False, slots=True)
class YamlItem:
    """A value with its key: what is written, and where.

    key : its name in a mapping, '' in a list; written at ``key_start`` to ``key_end``.
    colon : the offset after the key's colon, -1 if there is none.
    start, end : of the value; equal where nothing is written.
    kind : ``empty`` where nothing is written; flow : in braces or brackets.
    value : a scalar without its quotes; quoted : whether it has some.
    column : of the entries of a mapping or list over several lines.
    closed : whether braces or brackets are closed.
    """

    parent: YamlItem | None = None
    key: str = ""
    key_start: int = -1
    key_end: int = -1
    colon: int = -1
    start: int = 0
    end: int = 0
    kind: Kind = "empty"
    flow: bool = False
    value: str = ""
    quoted: bool = False
    column: int = 0
    closed: bool = True
    items: list[YamlItem] = field(default_factory=list)

    @property
    def begin(self) -> int:
        """Where the entry begins: at its key, if it has one."""
        return self.key_start if self.key_start >= 0 else self.start

    @property
    def key_span(self) -> Span:
        return Span(self.key_start, self.key_end)

    @property
    def span(self) -> Span:
        return Span(self.start, self.end)

    @property
    def path(self) -> tuple[str, ...]:
        """Keys from the root, and numbers of list items, as texts."""
        names: list[str] = []
        item = self
        while item.parent is not None:
            is_item = item.parent.kind == "list"
            names.append(str(item.parent.items.index(item)) if is_item else item.key)
            item = item.parent
        return tuple(reversed(names))

    def get(self, key: str) -> YamlItem | None:
        """The entry of that name."""
        return next((item for item in self.items if item.key == key), None)

    def at(self, *path: str) -> YamlItem | None:
        """The entry at a path below this one."""
        entry: YamlItem | None = self
        for key in path:
            entry = entry.get(key) if entry is not None else None
        return entry

    def walk(self) -> Iterator[YamlItem]:
        """This item and all below it, in the order of the file."""
        stack = [self]
        while stack:
            item = stack.pop()
            yield item
            stack += reversed(item.items)

    def scalars(self) -> list[YamlItem]:
        """The item itself, or the items of its list, as far as they are scalars."""
        items = self.items if self.kind == "list" else [self]
        return [item for item in items if item.kind == "scalar"]


def deepest(root: YamlItem, offset: int) -> YamlItem:
    """The innermost item whose key or value is at an offset."""
    item = root
    while True:
        # Items begin in the order of the file, so the one at an offset is the last that begins by
        # it.
        i = bisect_right(item.items, offset, key=lambda child: child.begin) - 1
        if i < 0 or offset > max(item.items[i].end, item.items[i].key_end):
            return item
        item = item.items[i]


def closing_quote(source: str, start: int) -> int:
    """The offset after the quote that closes the one at ``start``; -1 if there is none."""
    quote, position = source[start], start + 1
    while True:
        position = source.find(quote, position)
        if position < 0:
            return -1
        # In single quotes, two of them mean one: 'it''s'.
        if quote == "'" and source[position + 1 : position + 2] == "'":
            position += 2
            continue
        if quote == '"':
            # An odd number of backslashes escapes the quote; of an even number each escapes the
            # next.
            slashes = len(source[start + 1 : position]) - len(
                source[start + 1 : position].rstrip("\\")
            )
            if slashes % 2:
                position += 1
                continue
        return position + 1


def unquote(literal: str) -> str:
    """A quoted text without its quotes and with its escapes replaced."""
    inner = literal[1:-1] if len(literal) > 1 and literal[-1] == literal[0] else literal[1:]
    if literal[0] == "'":
        return inner.replace("''", "'")
    return _ESCAPE.sub(_unescape, inner) if "\\" in inner else inner


def _unescape(match: re.Match[str]) -> str:
    code = match[1] or match[2] or match[3]
    if code:
        number = int(code, 16)
        return chr(number) if number < 0x110000 else "?"
    return _ESCAPES.get(match[4], match[4])
