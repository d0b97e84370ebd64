"""Source text with its lines: offsets, the positions of editors, and those of messages.

In: an offset, which counts characters from 0, or a place. Out: the other. Editors send a line and a
number of UTF-16 code units in it; messages have lines and columns from 1, in lines as YAML breaks
them, which knows more line breaks than editors do. In "é😀x", "x" has offset 2, the editor's
character 3 and the message's column 3.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

from runtime.errors import Where

_EDITOR_BREAK = re.compile("\r\n|[\n\r]")
# YAML also breaks lines at NEL, LS and PS, which editors show as characters: the numbers of lines
# in messages and in editors differ after one of these, so the two kinds are converted separately.
_YAML_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")


def _starts(source: str, line_break: re.Pattern[str]) -> list[int]:
    """The offset of each line's first character."""
    if not any(each in source for each in "\r\x85\u2028\u2029"):
        # Many times as fast as the pattern, and nearly all texts.
        return [0, *accumulate(len(line) + 1 for line in source.split("\n")[:-1])]
    return [0, *(match.end() for match in line_break.finditer(source))]


def _width(character: str, encoding: str) -> int:
    """How many units a character takes."""
    if encoding == "utf-32":
        return 1
    if encoding == "utf-8":
        return len(character.encode("utf-8", "surrogatepass"))
    return 2 if character > "\uffff" else 1


class Span(NamedTuple):
    """A part of a source: offsets of its first character and of the one after its last."""

    start: int
    end: int


class SourceText:
    """A text whose places can be converted; immutable."""

    def __init__(self, source: str) -> None:
        self.source = source

    @cached_property
    def starts(self) -> list[int]:
        """The offset of each line's first character, in an editor's lines."""
        return _starts(self.source, _EDITOR_BREAK)

    @cached_property
    def _yaml_starts(self) -> list[int]:
        return _starts(self.source, _YAML_BREAK)

    def line(self, number: int) -> str:
        """A line, from 0, without its break."""
        start, end = self.line_span(number)
        return self.source[start:end]

    def line_span(self, number: int) -> Span:
        """A line, from 0, without its break."""
        start = self.starts[number]
        last = number + 1 == len(self.starts)
        end = len(self.source) if last else self.starts[number + 1]
        while end > start and self.source[end - 1] in "\r\n":
            end -= 1
        return Span(start, end)

    def line_of(self, offset: int) -> int:
        """The number, from 0, of the line that an offset is in."""
        return bisect_right(self.starts, max(0, offset)) - 1

    def offset(self, line: int, units: int, encoding: str = "utf-16") -> int:
        """The offset of an editor's position, moved into the source where it is outside.

        ``encoding`` says what the editor counts: utf-8, utf-16 or utf-32 units.
        """
        if line < 0:
            return 0
        if line >= len(self.starts):
            return len(self.source)
        start, end = self.line_span(line)
        line_text = self.source[start:end]
        # Nearly all lines: units are characters, and nothing has to be counted.
        if line_text.isascii():
            return start + min(max(0, units), end - start)
        count = 0
        for i, character in enumerate(line_text):
            if count >= units:
                return start + i
            count += _width(character, encoding)
        return end

    def position(self, offset: int, encoding: str = "utf-16") -> tuple[int, int]:
        """Line and units of an offset, as editors count."""
        offset = min(max(0, offset), len(self.source))
        line = self.line_of(offset)
        before = self.source[self.starts[line] : offset]
        if before.isascii():
            return line, len(before)
        return line, sum(_width(character, encoding) for character in before)

    def at(self, where: Where) -> int:
        """The offset of a message's position."""
        starts = self._yaml_starts
        if not 1 <= where.line <= len(starts):
            return len(self.source) if where.line else 0
        return min(starts[where.line - 1] + max(0, where.column - 1), len(self.source))

    def where(self, offset: int, file: str) -> Where:
        """The position of an offset as messages write it."""
        line = bisect_right(self._yaml_starts, offset) - 1
        return Where(file, line + 1, offset - self._yaml_starts[line] + 1)
