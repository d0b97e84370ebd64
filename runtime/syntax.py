"""What the YAML parser says of a broken text, in words that tell how to mend it."""

from __future__ import annotations

import re
from typing import Any

import yaml

from runtime.errors import Problem, Where

_ILLEGAL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
_MENDS = {
    "mapping values are not allowed in this context": (
        "a ':' too many; quote a text that holds ': ', or check the indentation"
    ),
    "did not find expected key": (
        "this does not fit the lines above; check its indentation, and the quotes before it"
    ),
    "could not find expected ':'": (
        "this line has no ': '; write 'key: value', or '- ' before an item of a list"
    ),
    "did not find expected '-' indicator": (
        "expected '- ' as in the items above; check the indentation"
    ),
    "block sequence entries are not allowed in this context": (
        "a list begins on a line of its own, or is written [a, b]"
    ),
    "did not find expected node content": "expected a value here",
    "found a tab character that violates indentation": "a tab; indent with spaces",
}


def explain(error: yaml.YAMLError | UnicodeError, text: str, file: str) -> Problem:
    """The problem that a parser's error stands for, at the place that is to be mended."""
    illegal = _ILLEGAL.search(text)
    problem: Any = getattr(error, "problem_mark", None)
    context: Any = getattr(error, "context_mark", None)
    said = str(getattr(error, "problem", None) or str(error).splitlines()[0])
    if illegal and problem is None:
        said = f"character U+{ord(illegal[0]):04X} is not allowed; take it out"
        return Problem(place(text, illegal.start(), file), "", said)
    mark = problem or context
    if "cannot start any token" in said:
        said = _stray(text, mark.line, mark.column) or said
    elif "unexpected end of stream" in said and context is not None:
        mark, said = context, "the quote that opens here is never closed"
    elif said.startswith("did not find expected ','") and context is not None:
        opened = said[-2:].strip("'").translate(str.maketrans("]}", "[{"))
        if problem.line > context.line:
            mark, said = context, f"this '{opened}' is not closed"
        else:
            said = said.replace("did not find expected", "expected")
    elif "could not find expected ':'" in said and context is not None:
        mark = context
    said = _MENDS.get(said, said)
    return Problem(_where(text, mark, file), "", f"not valid YAML: {said}")


def _where(text: str, mark: Any, file: str) -> Where:
    """The place of a parser's mark, which lies inside the text."""
    if mark is None:
        return Where(file)
    # Where the last line has no line break, the parser places the end of the text below it.
    last = len(_BREAK.findall(text))
    if mark.line > last:
        return Where(file, last + 1, len(_BREAK.split(text)[-1]) + 1)
    return Where(file, mark.line + 1, mark.column + 1)


def place(text: str, index: int, file: str) -> Where:
    """Line and column of a character."""
    breaks = list(_BREAK.finditer(text, 0, index))
    begin = breaks[-1].end() if breaks else 0
    return Where(file, len(breaks) + 1, index - begin + 1)


def _stray(text: str, line: int, column: int) -> str:
    lines = text.splitlines()
    found = lines[line][column : column + 1] if line < len(lines) else ""
    if found == "\t":
        return "a tab; indent with spaces"
    return f"a text cannot begin with {found}; put it in quotes" if found else ""
