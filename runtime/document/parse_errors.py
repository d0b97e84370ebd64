"""Errors of the YAML parser, each with a message that suggests a fix.

In: libyaml's exception and the text. Out: a problem at the character that needs to change::

    title: robot: line    libyaml: mapping values are not allowed in this context
                          here:    a string that contains ': ' needs quotes: title: "robot: line"
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from blocks.limits import GRAPH_DEPTH
from blocks.messages import Message, Replace, as_message
from runtime.errors import Problem, Where

# Of lists and mappings within each other: far below Python's limit of recursion, which every walk
# through a tree would reach otherwise.
MAX_DEPTH = GRAPH_DEPTH
# The complement of what YAML 1.2 allows (c-printable).
_ILLEGAL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# What libyaml counts as a line: str.splitlines also breaks at form feeds.
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
# plant.scan[0:2] inside of {}, where the bracket would begin a list.
_SLICED = re.compile(r"[^\s:,{}[\]\"'][^:,{}[\]\"']*(?:\[[0-9: ]*\][^,{}[\]\"']*)+")
_SUGGESTIONS = {
    "mapping values are not allowed in this context": (
        "an unexpected ':'; quote a string that contains ': ', or check the indentation"
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
        "a list starts on a new line, or is written [a, b]"
    ),
    "did not find expected node content": "expected a value here",
    "found a tab character that violates indentation": "a tab; indent with spaces",
}


def explain(error: yaml.YAMLError | UnicodeError, text: str, file: str) -> Problem:
    """The problem that a parser's error stands for, at the position that needs to change."""
    illegal = _ILLEGAL.search(text)
    problem: Any = getattr(error, "problem_mark", None)
    context: Any = getattr(error, "context_mark", None)
    message = str(getattr(error, "problem", None) or str(error).splitlines()[0])
    # The reader fails before there are tokens, so the exception has no mark.
    if illegal and problem is None:
        message = f"character U+{ord(illegal[0]):04X} is not allowed; remove it"
        return Problem(position(text, illegal.start(), file), "", message, "invalid-yaml")
    mark = problem or context
    # From the most specific: libyaml says "did not find expected ','" for an unquoted ': ', for
    # brackets in an address and for a missing brace alike, and only the text tells which.
    if "cannot start any token" in message:
        message = _stray(text, mark.line, mark.column) or message
    elif "unexpected end of stream" in message and context is not None:
        mark, message = context, "the quote that opens here is never closed"
    elif mark is not None and (
        advice := _colon_advice(text, mark, message) or _bracket_advice(text, mark, message)
    ):
        message = advice
    elif message.startswith("did not find expected ','") and context is not None:
        opening = message[-2:].strip("'").translate(str.maketrans("]}", "[{"))
        closing = _character(text, problem)
        if closing in "]}" and closing != message[-2]:
            message = f"this '{closing}' has no '{'[' if closing == ']' else '{'}' before it"
        elif problem.line > context.line:
            mark, message = context, f"this '{opening}' is not closed"
        else:
            message = message.replace("did not find expected", "expected")
    elif "could not find expected ':'" in message and context is not None:
        mark = context
    elif "maximum nesting depth" in message:
        # libyaml 0.2.6 scans so far ahead that its own limit comes before ours.
        message = f"nested more than {MAX_DEPTH} deep"
        return Problem(_where(text, mark, file), "", message, "too-large")
    message = as_message(_SUGGESTIONS.get(message, message)).within("not valid YAML: ")
    return Problem(_where(text, mark, file), "", message, "invalid-yaml")


def _character(text: str, mark: Any) -> str:
    """The character at a parser's mark; a space at the end of the text."""
    lines = _BREAK.split(text)
    line = lines[mark.line] if mark.line < len(lines) else ""
    return line[mark.column : mark.column + 1] or " "


def _where(text: str, mark: Any, file: str) -> Where:
    """The position of a parser's mark, moved into the text."""
    if mark is None:
        return Where(file)
    # Where the last line has no line break, the parser places the end of the text below it.
    last = len(_BREAK.findall(text))
    if mark.line > last:
        return Where(file, last + 1, len(_BREAK.split(text)[-1]) + 1)
    return Where(file, mark.line + 1, mark.column + 1)


def position(text: str, index: int, file: str) -> Where:
    """Line and column of a character."""
    breaks = list(_BREAK.finditer(text, 0, index))
    begin = breaks[-1].end() if breaks else 0
    return Where(file, len(breaks) + 1, index - begin + 1)


def _colon_advice(text: str, mark: Any, message: str) -> str:
    """What to write where a string without quotes holds ': '; '' if that is not what is wrong."""
    lines = _BREAK.split(text)
    line = lines[mark.line] if mark.line < len(lines) else ""
    before, rest = line[: mark.column], line[mark.column :]
    if not rest.startswith(":") or ("','" not in message and "mapping values" not in message):
        return ""
    key, colon, start = before.rpartition(": ")
    stop = re.split(r"[,}\]]", rest)[0] if set("{[") & set(key) else rest.partition(" #")[0]
    value = f"{start}{stop}".strip()
    if not (colon and start.strip()) or set("\"'[]{}") & set(value) or len(value) > 80:
        return ""
    name = re.split(r"[{,\s]", key)[-1]
    quoted = f'{name}: "{value}"'
    advice = f"a string that contains ': ' needs quotes: {quoted}"
    if "','" in message:
        advice = f"expected ',' or '}}'; {advice}"
    fix = Replace(quoted, f"{name}: {value}", "Put quotes around it")
    return Message(advice, "invalid-yaml", [fix])


def _bracket_advice(text: str, mark: Any, message: str) -> str:
    """What to write where an address inside of braces has brackets; '' if that is not wrong."""
    line = [*_BREAK.split(text), ""][mark.line]
    match = _SLICED.search(line, 0, len(line))
    while match is not None and not match.start() < mark.column <= match.end():
        match = _SLICED.search(line, match.end())
    if match is None or "','" not in message:
        return ""
    advice = f'inside of braces, a string with brackets needs quotes: "{match[0]}"'
    fix = Replace(f'"{match[0]}"', match[0], "Put quotes around it")
    return Message(advice, "invalid-yaml", [fix])


def _stray(text: str, line: int, column: int) -> str:
    lines = text.splitlines()
    character = lines[line][column : column + 1] if line < len(lines) else ""
    if character == "\t":
        return "a tab; indent with spaces"
    return f"a string cannot begin with {character}; put it in quotes" if character else ""
