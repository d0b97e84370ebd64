"""Where a function ends after a failure, in C text that is compiled without jumps.

See ``LEAVE`` in support.h: every function that may fail takes ``ctx``, and after each statement
with such a call, its caller returns if it failed. Conditions and bounds of loops that may fail are
computed in a statement before them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

MAY_FAIL = "(ctx"
HEAD = re.compile(r"^( *)(if|while) \(")
LOOP = re.compile(r"^( *)for \(int64_t (\w+) = (.*?); \2 (<|>) (.*); (\2\S*|\2 \+= \S+)\) \{$")


def leaving(lines: Sequence[str], value: str) -> list[str]:
    """Lines that leave the function after a failure.

    Parameters
    ----------
    lines : of a function, each with at most one statement.
    value : what the function then returns, without meaning; empty if it returns nothing.
    """
    names = _unused_names("\n".join(lines))
    found: list[str] = []
    for line in lines:
        if MAY_FAIL not in line:
            found.append(line)
            continue
        loop, head = LOOP.match(line), HEAD.match(line)
        if loop:
            found += _loop(loop, value, names)
        elif head:
            found += _branch(line, head, value, names)
        else:
            found += _statement(line, value)
    return found


def _statement(line: str, value: str) -> list[str]:
    """A statement, and the way out; after ``fail`` and ``return`` there is one already."""
    text = line.lstrip(" ")
    if MAY_FAIL not in text or text.startswith(("fail(", "return ")):
        return [line]
    return [line, f"{line[: len(line) - len(text)]}LEAVE({value});"]


def _branch(line: str, head: re.Match[str], value: str, names: Iterator[str]) -> list[str]:
    """``if (condition) rest`` and ``while (condition) {``."""
    start = head.end()
    end = _closing(line, start)
    indent, condition, rest = head[1], line[start:end], line[end + 1 :]
    if MAY_FAIL not in condition:
        return _statement(line, value)
    name = next(names)
    if head[2] == "if":
        held = _statement(f"{indent}const bool {name} = {condition};", value)
        return [*held, *_statement(f"{indent}if ({name}){rest}", value)]
    held = _statement(f"{indent}    const bool {name} = {condition};", value)
    return [f"{indent}while (true) {{", *held, f"{indent}    if (!{name}) break;"]


def _loop(loop: re.Match[str], value: str, names: Iterator[str]) -> list[str]:
    """``for`` whose bounds may fail: Python computes them once, before the loop."""
    indent, index, first, sign, last, change = loop.groups()
    found, bounds = [], []
    for bound in (first, last):
        if MAY_FAIL in bound:
            name = next(names)
            found += _statement(f"{indent}const int64_t {name} = {bound};", value)
            bounds.append(name)
        else:
            bounds.append(bound)
    head = f"for (int64_t {index} = {bounds[0]}; {index} {sign} {bounds[1]}; {change}) {{"
    return [*found, f"{indent}{head}"]


def _closing(line: str, start: int) -> int:
    """The place of the parenthesis that closes the one before ``start``."""
    depth = 1
    for at in range(start, len(line)):
        depth += (line[at] == "(") - (line[at] == ")")
        if depth == 0:
            return at
    raise ValueError(f"a parenthesis is not closed: {line}")


def _unused_names(text: str) -> Iterator[str]:
    number = 0
    while True:
        number += 1
        if f"held_{number}_" not in text:
            yield f"held_{number}_"
