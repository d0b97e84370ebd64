"""A tolerant reading of YAML: a tree of what is written, with the place of each key and value.

In: any text. Out: the root :class:`YamlItem`; there are no errors. Completion is asked for while a
line is half typed, when a strict parser has no tree at all::

    wires:
      sum: {terms: [a.out,          # an open bracket ends where the indentation goes back
      gain                          # a key without a colon: an entry without a value
    probes: {y: gain.out}           # is read as if nothing had happened

Texts that parse get the same tree as the strict reader's (``tests/runtime/language/test_scan.py``
compares them), apart from rare forms: complex keys, tags, plain scalars over several lines.
"""

from __future__ import annotations

import re

from runtime.language.items import YamlItem, closing_quote, unquote
from runtime.language.text import Span

# What is nested deeper is skipped: "[[[[..." must not overflow the stack of those who walk the
# tree.
MAX_DEPTH = 60

_LINE = re.compile(r"([^\n\r]*)(\r\n|\n|\r|$)")
# A key ends at a colon that a space or the end of the line follows: "a:b" is a scalar and "a: b" an
# entry. A "#" is part of a key unless a space is before it. Quoted keys may contain colons.
_KEY = re.compile(
    r"""("(?:[^"\\]|\\.)*"\s*|'(?:[^']|'')*'\s*
        |[^\s\#"'{}\[\],&*!|>%@`:][^:\#]*(?:(?::(?!\s|$)|(?<!\s)\#)[^:\#]*)*)
        :(?=\s|$)""",
    re.VERBOSE,
)
_PLAIN = re.compile(r"(?:[^#\s]|(?<!\s)#|[^\S\r\n]+(?=[^#\s]))+")
# In braces, commas and brackets end a scalar as well: {a: x,y} has two entries, a: x,y has one.
_FLOW_PLAIN = re.compile(
    r"""(?:[^\s,\[\]{}:\#]|:(?![\s,\[\]{}]|$)|(?<!\s)\#)
        (?:[^,\[\]{}:\#\r\n]|:(?![\s,\[\]{}]|$)|(?<!\s)\#)*""",
    re.VERBOSE,
)
_PROPERTY = re.compile(r"[&!]\S*[^\S\r\n]*")


def scan(source: str) -> YamlItem:
    """The tree of a file; its root is a mapping."""
    return _Scanner(source).root


class _Scanner:
    """Reads lines; ``open`` holds the mappings and lists that a line may continue."""

    def __init__(self, source: str) -> None:
        self.source = source
        # Files with "\r" are rare: str.find ends the lines of all others, without a pattern.
        self.has_returns = "\r" in source
        self.root = YamlItem(kind="map", end=len(source), column=0)
        self.open: list[YamlItem] = [self.root]
        self.pending: YamlItem | None = None  # a key whose value may be in the lines below
        self.pending_column = 0
        self.last: YamlItem | None = None  # the scalar that a further line may continue
        position, first = 0, True
        while position < len(source) or first:
            first = False
            position = self.read_line(position)

    def line_end(self, offset: int) -> int:
        """The offset of the break that ends a line."""
        if self.has_returns:
            match = _LINE.match(self.source, offset)
            return match.end(1) if match else len(self.source)
        end = self.source.find("\n", offset)
        return end if end >= 0 else len(self.source)

    def next_line(self, offset: int) -> int:
        """The offset after the break that ends a line."""
        if self.has_returns:
            match = _LINE.match(self.source, offset)
            return match.end() if match else len(self.source)
        return min(self.line_end(offset) + 1, len(self.source))

    def read_line(self, begin: int) -> int:
        """Read a line that begins at an offset; returns where the next one begins."""
        end = self.line_end(begin)
        start = begin
        while start < end and self.source[start] in " \t\ufeff":
            start += 1
        # At least one character further, whatever the line holds: reading always ends.
        following = max(self.next_line(begin), begin + 1)
        if start == end or self.source[start] == "#" or self.is_marker(start, end):
            return following
        stop = self.read_entry(start, start - begin, end)
        # A value in quotes or brackets can reach beyond this line; reading goes on after its last
        # line.
        return following if stop <= end else max(self.next_line(stop), following)

    def is_marker(self, start: int, end: int) -> bool:
        """Whether a line is a directive or the mark of a document."""
        text = self.source[start:end]
        return text.startswith("%") or text.rstrip() in ("---", "...")

    def read_entry(self, start: int, column: int, end: int) -> int:
        """Read what a line holds from an offset on; returns where reading ended."""
        text = self.source[start:end]
        if text == "-" or text.startswith(("- ", "-\t")):
            return self.read_list_item(start, column, end)
        match = _KEY.match(self.source, start, end)
        if match is None:
            return self.read_without_colon(start, column, end)
        self.close_deeper(column, is_list=False)
        holder = self.open[-1]
        # A key below the dashes of a list: no mapping could take it.
        if holder.kind != "map":
            return end
        key = Span(match.start(1), match.start(1) + len(match[1].rstrip()))
        item = self.entry(holder, key, match.end())
        return self.read_value(item, column, match.end(), end)

    def entry(self, holder: YamlItem, key: Span, colon: int) -> YamlItem:
        """A new entry of a mapping, without a value."""
        name = self.source[key.start : key.end]
        if len(name) > 1 and name[0] in "\"'" and name[-1] == name[0]:
            name = unquote(name)
        after = colon if colon >= 0 else key.end
        item = YamlItem(holder, name, key.start, key.end, colon, after, after)
        holder.items.append(item)
        return item

    def close_deeper(self, column: int, is_list: bool) -> None:
        """Find the mapping or list that an entry in a column belongs to."""
        # The entry above that has no value yet gets one if this line is further indented:
        #     wires:        pending, column 0
        #       sum: ...    column 2: "wires" becomes a mapping whose entries are in column 2
        # A list may stand in the column of its key, as YAML allows; a mapping may not.
        pending, self.pending, self.last = self.pending, None, None
        if pending is not None and pending.kind == "empty":
            least = self.pending_column + (0 if is_list else 1)
            if column >= least and len(self.open) < MAX_DEPTH:
                pending.kind = "list" if is_list else "map"
                pending.column = column
                self.open.append(pending)
        while len(self.open) > 1:
            top = self.open[-1]
            # Whatever is further indented than this line is complete, and so is a list in whose
            # column a key begins.
            if column > top.column or (column == top.column and (top.kind == "list") == is_list):
                break
            self.open.pop()

    def read_list_item(self, start: int, column: int, end: int) -> int:
        """An item of a list over several lines."""
        self.close_deeper(column, is_list=True)
        holder = self.open[-1]
        if holder.kind != "list":
            return end
        after = start + 1
        while after < end and self.source[after] in " \t":
            after += 1
        item = YamlItem(holder, start=after, end=after)
        holder.items.append(item)
        holder.end = after
        # In "- a: 1", the mapping's column is that of "a", where the next line's keys have to be.
        inner = column + after - start
        if after < end and _KEY.match(self.source, after, end) and len(self.open) < MAX_DEPTH:
            item.kind, item.column = "map", inner
            self.open.append(item)
            return self.read_entry(after, inner, end)
        return self.read_value(item, column, after, end)

    def read_without_colon(self, start: int, column: int, end: int) -> int:
        """A line without a colon: a key that is being typed, or more of a scalar above."""
        # The line goes on with the plain scalar above, as YAML folds lines.
        if self.last is not None and column > self.pending_column:
            match = _PLAIN.match(self.source, start, end)
            self.last.end = match.end() if match else self.last.end
            self.grow(self.last)
            return end
        # A value in the line below its key.
        if self.source[start] in "{[\"'|>" and self.pending is not None:
            item, self.pending = self.pending, None
            return self.read_value(item, self.pending_column, start, end)
        if self.source[start] in "{[" and not self.root.items:
            self.root.kind = "empty"
            return self.read_flow(self.root, start, -1)
        match = _PLAIN.match(self.source, start, end)
        self.close_deeper(column, is_list=False)
        holder = self.open[-1]
        if match is not None and holder.kind == "map":
            self.grow(self.entry(holder, Span(start, match.end()), -1))
        return end

    def read_value(self, item: YamlItem, column: int, start: int, end: int) -> int:
        """Read an entry's value, as far as it is on its line; returns where reading ended."""
        while start < end and self.source[start] in " \t":
            start += 1
        # Anchors and tags (&a, !t) are not part of a value.
        while start < end and (match := _PROPERTY.match(self.source, start, end)):
            start = match.end()
        self.pending_column, self.last = column, None
        if start >= end or self.source[start] == "#":
            self.pending = item
            self.grow(item)
            return end
        self.pending = None
        first = self.source[start]
        if first in "{[":
            stop = self.read_flow(item, start, column)
        elif first in "|>":
            stop = self.read_block_scalar(item, start, column)
        elif first in "\"'":
            stop = self.read_quoted(item, start, column)
        else:
            match = _PLAIN.match(self.source, start, end)
            stop = match.end() if match else end
            item.kind, item.start, item.end = "scalar", start, stop
            item.value = self.source[start:stop]
            self.last = item
        self.grow(item)
        return stop

    def grow(self, item: YamlItem) -> None:
        """Make all that contain an item reach to its end."""
        end, holder = max(item.end, item.key_end), item.parent
        while holder is not None and holder is not self.root:
            holder.end = max(holder.end, end)
            holder = holder.parent

    def read_block_scalar(self, item: YamlItem, start: int, column: int) -> int:
        """A literal or folded text: all lines that are further indented."""
        end = self.line_end(start)
        position = self.next_line(start)
        while position < len(self.source):
            stop = self.line_end(position)
            line = self.source[position:stop]
            if line.strip() and len(line) - len(line.lstrip(" ")) <= column:
                break
            end, position = stop, max(self.next_line(position), position + 1)
        item.kind, item.start, item.end, item.quoted = "scalar", start, end, True
        item.value = self.source[self.line_end(start) : end].strip()
        return end

    def read_quoted(self, item: YamlItem, start: int, column: int) -> int:
        """A scalar in quotes; one that is never closed ends with its line."""
        quote = self.source[start]
        end = closing_quote(self.source, start)
        # The closing quote may be that of a later string: "a: 'x" above "b: 'y'" pairs the wrong
        # ones. A line that is no further indented than the key proves it, since YAML forbids such
        # lines in a scalar.
        if end < 0 or self.dedents(start, end, column):
            end, item.closed = self.line_end(start), False
        item.kind, item.start, item.end, item.quoted = "scalar", start, end, True
        literal = self.source[start:end]
        item.value = unquote(literal) if item.closed else literal.lstrip(quote)
        return end

    def dedents(self, start: int, end: int, column: int) -> bool:
        """Whether a line between two offsets is no further indented than a column."""
        position = self.next_line(start)
        while position < end:
            line = self.source[position : self.line_end(position)]
            if line.strip() and len(line) - len(line.lstrip(" ")) <= column:
                return True
            position = max(self.next_line(position), position + 1)
        return False

    def read_flow(self, item: YamlItem, start: int, column: int) -> int:
        """A value in braces or brackets; returns the offset after it."""
        return _FlowScanner(self, item, column).read(start)


# Brackets are read by a stack of its own, since they ignore indentation except for one rule: a line
# that is no further indented than the key of the whole value ends all of it. So an unclosed bracket
# spoils its own entry and not the rest of the file:
#     a: {x: [1, 2
#     b: 3             "a" ends above this line
class _FlowScanner:
    """Reads a value in braces or brackets, over several lines if need be."""

    def __init__(self, scanner: _Scanner, item: YamlItem, column: int) -> None:
        self.scanner, self.source, self.column = scanner, scanner.source, column
        self.open: list[YamlItem] = []
        self.slot: YamlItem | None = item  # the entry that takes the next value
        self.outer = item

    def read(self, start: int) -> int:
        position = start
        while position < len(self.source):
            character = self.source[position]
            if character in "\r\n":
                position = self.scanner.next_line(position)
                if self.is_outside(position):
                    break
            elif character in " \t":
                position += 1
            elif character == "#" and self.source[position - 1] in " \t\r\n":
                position = self.scanner.line_end(position)
            elif character in "{[":
                position = self.begin(position)
            elif character in "}]":
                position += 1
                if self.end(character, position):
                    return position
            else:
                position = self.token(position, character)
        return self.stop(min(position, len(self.source)))

    def is_outside(self, position: int) -> bool:
        """Whether a line is no further indented than the key of the whole value."""
        line = self.source[position : self.scanner.line_end(position)]
        text = line.lstrip(" ")
        # A closing bracket may stand in the key's own column, as formatters write it.
        return bool(text) and text[0] not in "#}]" and len(line) - len(text) <= self.column

    def stop(self, position: int) -> int:
        """End all that is open where the source goes on with something else."""
        end = len(self.source[:position].rstrip())
        for item in self.open:
            item.end, item.closed = max(item.start + 1, end), False
        return max(end, self.outer.start + 1)

    def token(self, position: int, character: str) -> int:
        holder = self.open[-1]
        if character == ",":
            self.slot = None
            return position + 1
        if character == ":":
            if self.slot is not None and self.slot.colon < 0 and holder.kind == "map":
                self.slot.colon = self.slot.start = self.slot.end = position + 1
            return position + 1
        is_quoted = character in "\"'"
        if is_quoted:
            end = closing_quote(self.source, position)
            if end < 0 or self.scanner.dedents(position, end, self.column):
                end = self.scanner.line_end(position)
        else:
            match = _FLOW_PLAIN.match(self.source, position)
            if match is None:
                return position + 1
            end = position + len(match[0].rstrip())
        self.scalar(Span(position, end), is_quoted)
        return end

    def scalar(self, span: Span, is_quoted: bool) -> None:
        holder, slot = self.open[-1], self.slot
        if holder.kind == "map" and slot is None:
            self.slot = self.scanner.entry(holder, span, -1)
            return
        if slot is None:
            self.slot = slot = YamlItem(holder)
            holder.items.append(slot)
        elif holder.kind == "map" and slot.kind != "empty":
            self.slot = self.scanner.entry(holder, span, -1)  # a comma is missing
            return
        elif slot.kind != "empty" or (holder.kind == "map" and slot.colon < 0):
            return  # two values beside each other
        literal = self.source[span.start : span.end]
        slot.kind, slot.start, slot.end, slot.quoted = "scalar", *span, is_quoted
        slot.value = unquote(literal) if is_quoted else literal

    def begin(self, position: int) -> int:
        item = self.slot
        if item is None or item.kind != "empty" or (self.open and self.misses_colon(item)):
            item = YamlItem(self.open[-1])
            self.open[-1].items.append(item)
        if len(self.open) >= MAX_DEPTH:
            return position + 1
        item.kind = "map" if self.source[position] == "{" else "list"
        item.flow, item.start, item.end = True, position, position + 1
        self.open.append(item)
        self.slot = None
        return position + 1

    def misses_colon(self, item: YamlItem) -> bool:
        return self.open[-1].kind == "map" and item.colon < 0

    def end(self, character: str, position: int) -> bool:
        """A closing bracket; returns whether the whole value ends with it."""
        kind = "map" if character == "}" else "list"
        # A bracket that closes nothing is skipped; one that fits an outer bracket closes the inner
        # ones, too.
        if all(item.kind != kind for item in self.open):
            return False
        while self.open:
            item = self.open.pop()
            item.end, item.closed = position, item.kind == kind
            if item.kind == kind:
                break
        self.slot = item
        return not self.open
