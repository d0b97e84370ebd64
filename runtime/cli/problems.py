"""Errors on the terminal: each problem of a graph with its source line and a caret below it."""

from __future__ import annotations

import sys
import unicodedata

from blocks.files import read_text
from blocks.limits import GRAPH_FILE
from runtime.errors import GraphError, Problem, SpikeblocksError, Where
from runtime.terminal import draw, in_colour, printable

QUOTED = (
    20  # problems that are shown with their line; further ones would only scroll the first away
)
WIDTH = 96  # characters of a source line


def report(error: SpikeblocksError) -> None:
    """Print an error on stderr; the problems of a graph with the lines that they are in."""
    if not isinstance(error, GraphError):
        draw(f"{printable(str(error))}\n")
        return
    texts: dict[str, list[str]] = {}
    colour = in_colour(sys.stderr)
    for i, problem in enumerate(error.problems):
        draw(f"{_message(problem, colour)}\n")
        if i < QUOTED:
            draw(_excerpt(problem.where, texts, colour))


def _message(problem: Problem, colour: bool) -> str:
    text = printable(str(problem))
    place = printable(str(problem.where))
    if colour and place and text.startswith(place):
        return f"\033[1m{place}\033[0m{text[len(place) :]}"
    return text


def _excerpt(where: Where, texts: dict[str, list[str]], colour: bool) -> str:
    """The source line of a position and a caret below its column; '' if it cannot be shown."""
    if not where.line or where.file.startswith("--"):
        return ""
    if where.file not in texts:
        texts[where.file] = _lines(where.file)
    lines = texts[where.file]
    if where.line > len(lines):
        return ""
    line, column = lines[where.line - 1], where.column - 1
    if not 0 <= column <= len(line):
        return ""
    start = max(0, column - WIDTH // 2) if len(line) > WIDTH else 0
    shown = _clean(line[start : start + WIDTH])
    before = _clean(line[start:column])
    caret = " " * _columns(before) + ("\033[31;1m^\033[0m" if colour else "^")
    margin = f"{where.line:>6} | "
    return f"{margin}{shown}\n{' ' * (len(margin) - 2)}| {caret}\n"


def _lines(name: str) -> list[str]:
    """The lines of a graph's file; none if it cannot be read."""
    try:
        return read_text(name, GRAPH_FILE, "utf-8-sig", "replace").split("\n")
    except (OSError, ValueError):
        return []


def _clean(text: str) -> str:
    """A part of a line in which every character that cannot be printed is one space."""
    return "".join(c if c.isprintable() else " " for c in text)


def _columns(text: str) -> int:
    """The columns of a terminal that a text takes: two for wide characters, none for accents."""
    return sum(
        0 if unicodedata.combining(c) else 1 + (unicodedata.east_asian_width(c) in "WF")
        for c in text
    )
