"""Formatting: one way to space what stands in braces and brackets; comments keep their columns.

In: a model. Out: edits, line by line, from ``{type: Gain,  gain : 2}`` to ``{type: Gain, gain:
2}``. Entries whose values are written in one column stay so when a key gets longer; all others
have one space after the colon. A file that does not parse, or that would not mean the same, is
left alone.
"""

from __future__ import annotations

import re

from runtime.document import parse_yaml
from runtime.errors import GraphError
from runtime.language.items import YamlItem
from runtime.language.model import Model
from runtime.language.text import Span

_SPECIAL = re.compile(r"(?:^|[\s\[{,:])[&*!]")


def format_edits(model: Model) -> list[tuple[Span, str]]:
    """The edits that format a file, line by line."""
    if model.syntax:
        return []
    text, edits = model.text, []
    lines = _Formatter(model).lines()
    for number in range(len(text.starts)):
        span = text.line_span(number)
        if number in lines and lines[number] != text.source[span.start : span.end]:
            edits.append((span, lines[number]))
    whole = text.source
    if whole and not whole.endswith(("\n", "\r")):
        edits.append((Span(len(whole), len(whole)), "\n"))
    return edits if _is_same(model, edits) else []


def apply_edits(source: str, edits: list[tuple[Span, str]]) -> str:
    """The source with edits made; they do not overlap."""
    for span, new in sorted(edits, reverse=True):
        source = source[: span.start] + new + source[span.end :]
    return source


# The edits are made from the tolerant tree. Whether they keep the meaning is left to the loader's
# own parser, and to no argument about this module.
def _is_same(model: Model, edits: list[tuple[Span, str]]) -> bool:
    try:
        after = parse_yaml(apply_edits(model.text.source, edits), model.file)
    except GraphError:
        return False
    return bool(after.plain() == model.tree.plain())


class _Formatter:
    def __init__(self, model: Model) -> None:
        self.model, self.text, self.source = model, model.text, model.text.source
        self.new: dict[int, str] = {}

    def lines(self) -> dict[int, str]:
        """The new form of each line, by number; those of scalars over several lines are missing."""
        multi_line = set()
        for item in self.model.root.walk():
            first, last = self.text.line_of(item.start), self.text.line_of(max(0, item.end - 1))
            if item.kind == "scalar" and last > first:
                multi_line |= set(range(first, last + 1))
        for number in range(len(self.text.starts)):
            if number not in multi_line:
                self.new[number] = self.text.line(number).rstrip()
        for item in self.model.root.walk():
            if item.kind == "map" and not item.flow:
                self.mapping(item)
        return {number: line for number, line in self.new.items() if number not in multi_line}

    def mapping(self, holder: YamlItem) -> None:
        """Space the entries of a mapping over several lines; those in braces may be aligned."""
        short = [item for item in holder.items if self.is_short(item)]
        # Entries in braces are aligned among themselves: beside long mappings, scalars have no
        # common column.
        for is_flow in (True, False):
            self.entries([item for item in short if item.flow == is_flow])

    def is_short(self, item: YamlItem) -> bool:
        """Whether an entry stands on one line, with its value."""
        first = self.text.line_of(item.begin)
        has_value = item.kind == "scalar" or item.flow
        between = self.source[item.colon : item.start]
        is_plain = not between.strip() and item.colon >= 0
        return has_value and is_plain and first == self.text.line_of(max(item.begin, item.end - 1))

    def entries(self, run: list[YamlItem]) -> None:
        # Values in one column are meant so by the author, if most are; "until:  20.0" alone is an
        # accident, and gets one space.
        #     dt:    0.01
        #     until: 20.0
        is_aligned = any(item.start - item.colon > 1 for item in run) and self.is_mostly(run)
        width = max((item.colon - item.key_start for item in run), default=0)
        for item in run:
            gap = width - (item.colon - item.key_start) + 1 if is_aligned else 1
            self.entry(item, gap)

    def is_mostly(self, run: list[YamlItem]) -> bool:
        """Whether most of some entries have their values in one column."""
        columns = [item.start - self.text.starts[self.text.line_of(item.start)] for item in run]
        most = max(columns.count(column) for column in columns)
        return most > 1 and 2 * most > len(columns)

    def entry(self, item: YamlItem, gap: int) -> None:
        number = self.text.line_of(item.key_start)
        if number not in self.new or self.text.line_of(item.end) != number:
            return
        start, end = self.text.line_span(number)
        rest = self.source[item.end : end]
        code = self.source[start : item.colon] + " " * gap + self.value(item)
        comment = rest.lstrip()
        if comment.startswith("#"):
            column = item.end - start + len(rest) - len(comment)
            # A comment keeps its column, which others above and below share, unless the code has
            # become longer.
            least = min(2, len(rest) - len(comment))
            code = code + " " * max(least, column - len(code)) + comment
        elif comment:
            return
        self.new[number] = code.rstrip()

    def value(self, item: YamlItem) -> str:
        """A value with one way of spacing; as it is where it has anchors, holes or comments."""
        raw = self.source[item.start : item.end]
        # Anchors, aliases and tags are not in the tolerant tree, and would be lost.
        if not item.flow or not item.closed or _SPECIAL.search(raw):
            return raw
        inner = []
        for each in item.items:
            if each.kind == "empty":
                return raw
            key = self.source[each.key_start : each.key_end] + ": " if each.key_start >= 0 else ""
            inner.append(key + self.value(each))
        opening, closing = ("{", "}") if item.kind == "map" else ("[", "]")
        return opening + ", ".join(inner) + closing
