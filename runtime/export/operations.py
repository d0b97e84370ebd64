"""How many operations a step takes at most, counted in the C text of the blocks.

In: the text, and the integers among a block's parameters. Out: :class:`Operations` of one call of a
function. Lengths are followed through arguments and results, so that loops over them are counted::

    product(ctx, a, 4, 4, b, 4)   ->   for (i < a_n0) for (j < b_n1) for (k < a_n1): 64 passes

A length that depends on data is bounded by what it is a part of: at most as many neurons spike as
there are, whatever happened in a recorded run::

    flatnonzero(ctx, marks, 60)   ->   for (i < 60) found += marked;   found_n0: at most 60
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from runtime.toolchain import INEXACT as ROUNDED

HEAD = re.compile(r"^static (?:const )?(?:struct )?\w+ \**(\w+)\((.*)\)$")
LOOP = re.compile(
    r"for \((?:int64_t )?\w+ = ([^;]+); \w+ ([<>]) ([^;]+); \w+(?:\+\+|--| [+-]= (\d+))\)"
)
FIXED = re.compile(r"const int64_t (\w+) = (?:(\w+)\()?([^()]+)\)?;$")
COUNTED = re.compile(r"^\s*(\w+) \+= marked_\w+;$")  # what is found in an array
SUM = re.compile(r"const int64_t (\w+) = int_(add|subtract|multiply)\(ctx, (\w+), (\w+), \d+\);")
RESULT = re.compile(r"const struct \w+ (\w+) = (\w+)\((.*)\);$")
RETURN = re.compile(r"return \(struct \w+\)\{(?!NULL)(.*)\};$")  # NULL: after a failure
CALL = re.compile(r"\b([A-Za-z_]\w*)\(")
ARITHMETIC = re.compile(r" (?:[-+*]=?) |-=|\+=|\*=")
TAKEN = re.compile(r"\btake\(ctx, (.*), \d+\);")
ALIGNED = 8  # bytes that local arrays are multiples of: ARENA_STEP of support.h
MATH = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh"),
    *("cosh", "tanh", "asinh", "acosh", "atanh", "exp", "expm1", "exp2"),
    *("log", "log1p", "log2", "log10", "sqrt", "cbrt", "floor", "ceil"),
    *("trunc", "rint", "round", "fabs", "hypot", "copysign", "fmod", "pow"),
    *("remainder", "frexp", "ldexp", "fmin", "fmax", "nearbyint", "erf", "erfc"),
)
INEXACT = tuple(
    name for name in ROUNDED if name in MATH
)  # libraries round these each in its own way
ONES = ("least", "greatest", "np_least", "np_greatest", "sign_of")


def inexact(text: str) -> list[str]:
    """The functions that a C text calls of which libraries differ in the last bits."""
    return [name for name in INEXACT if re.search(rf"\b(?:real_)?{name}\(", text)]


class AtMost(int):
    """The largest value of a length that depends on data; the smallest is 0."""


@dataclass
class Operations:
    """Operations of one call: of every branch as if it were taken, loops with their bounds.

    arithmetic : additions, subtractions, multiplications, minima and maxima. divisions : also
    remainders. functions : calls of math.h. open_loops : loops whose length depends on data, each
    counted as one pass. reserved : bytes of local arrays whose size is known. is_open : whether
    there are others, or some in a loop whose length depends on data.
    """

    arithmetic: int = 0
    divisions: int = 0
    functions: int = 0
    open_loops: int = 0
    reserved: int = 0
    is_open: bool = False

    def add(self, other: Operations, times: int = 1) -> None:
        """Add what is done a number of times."""
        self.arithmetic += times * other.arithmetic
        self.divisions += times * other.divisions
        self.functions += times * other.functions
        self.open_loops += other.open_loops
        self.reserved += times * other.reserved
        self.is_open |= other.is_open


@dataclass
class Counter:
    """Counts the operations of functions in a C text.

    functions : parameters and lines of each function, by name.
    """

    functions: dict[str, tuple[list[str], list[str]]]
    counted: dict[Any, tuple[Operations, tuple[int | None, ...]]] = field(default_factory=dict)

    def of(self, name: str, entries: Mapping[str, int] = MappingProxyType({})) -> Operations:
        """The operations of one call of a function; ``entries`` are integers of its block."""
        own = {f"self->{word}": value for word, value in entries.items()}
        return self.call(name, [], own)[0]

    def call(
        self, name: str, arguments: list[int | None], entries: Mapping[str, int]
    ) -> tuple[Operations, tuple[int | None, ...]]:
        """The operations of one call, and the integers among what it returns."""
        exact = tuple(type(argument) for argument in arguments)
        key = (name, tuple(arguments), exact, tuple(entries.items()))
        if key not in self.counted:
            self.counted[key] = Operations(), ()  # no recursion
            parameters, lines = self.functions[name]
            known = dict(zip(parameters, arguments, strict=False))
            given = {each: value for each, value in known.items() if value is not None}
            self.counted[key] = self.body(lines, {**entries, **given}, entries)
        return self.counted[key]

    def body(
        self, lines: list[str], known: dict[str, int], entries: Mapping[str, int]
    ) -> tuple[Operations, tuple[int | None, ...]]:
        total, times = Operations(), [1]
        opened = [False]  # of the blocks around a line, which are in a loop of unknown length
        returned: tuple[int | None, ...] | None = None
        for line in lines:
            line = SUM.sub(_plain, line)
            found = FIXED.search(line)
            if found and (value := _length(found[2], found[3], known)) is not None:
                known[found[1]] = value
            loop = LOOP.search(line)
            factor, is_open = 1, "while (" in line
            if loop:
                factor, is_open = _passes(loop, known)
            total.open_loops += is_open
            closed = line.lstrip().startswith("}")
            if closed and len(times) > 1:
                times.pop()
                opened.pop()
            done = self.line(LOOP.sub("", line), known, entries)
            done.is_open |= bool(done.reserved) and (opened[-1] or is_open)
            total.add(done, times[-1] * factor)
            if (counted := COUNTED.search(line)) and not opened[-1]:
                known[counted[1]] = AtMost(times[-1])
            if line.rstrip().endswith("{"):
                times.append(times[-1] * factor)
                opened.append(opened[-1] or is_open)
            if result := RETURN.search(line):
                parts = () if "(" in result[1] else result[1].split(", ")
                values = tuple(_value(text, known) for text in parts)
                pairs = zip(values, values if returned is None else returned, strict=False)
                returned = tuple(_either(one, other) for one, other in pairs)
        return total, returned or ()

    def line(self, line: str, known: dict[str, int], entries: Mapping[str, int]) -> Operations:
        """The operations of a line; integers that a call in it returns are then known."""
        found = Operations()
        if taken := TAKEN.search(line):
            size = _value(taken[1], known)
            found.is_open, found.reserved = size is None, -(-(size or 0) // ALIGNED) * ALIGNED
        integer = re.match(r"\s*(?:const )?(?:int64_t|bool) ", line) is not None
        plain = _outside_brackets(line)
        if not integer:
            found.arithmetic += len(ARITHMETIC.findall(plain))
            found.divisions += plain.count(" / ")
        result = RESULT.search(line)
        for name in CALL.findall(line):
            if name in self.functions:
                inside = re.search(rf"\b{name}\((.*)\)", line)
                texts = inside[1].split(", ") if inside and "(" not in inside[1] else []
                done, values = self.call(name, [_value(text, known) for text in texts], entries)
                found.add(done)
                if result and result[2] == name:
                    names = [f"{result[1]}.v{i}" for i in range(len(values))]
                    pairs = zip(names, values, strict=True)
                    known |= {each: value for each, value in pairs if value is not None}
            elif name in MATH or name in ("power", "length_of"):
                found.functions += 1
            elif name in ONES:
                found.arithmetic += 1
            elif name.startswith(("divide", "modulo", "floor_divide")):
                found.divisions += 1
        return found


def _plain(sum_of_two: re.Match[str]) -> str:
    """A sum, difference or product that is tested for its size, without the test."""
    name, kind, one, other = sum_of_two.groups()
    sign = {"add": "+", "subtract": "-", "multiply": "*"}[kind]
    return f"const int64_t {name} = {one} {sign} {other};"


def _value(text: str, known: Mapping[str, int]) -> int | None:
    """What a C expression of integers is, read from left to right; None if that is not known."""
    words = text.split()
    numbers = [int(word) if word.isdigit() else known.get(word) for word in words[::2]]
    total = numbers[0] if numbers else None
    for sign, number in zip(words[1::2], numbers[1:], strict=False):
        if total is None or number is None or sign not in ("+", "-", "*"):
            return None
        # From at most 5, at most 5 is left.
        less = 0 if isinstance(number, AtMost) else number
        found = {"+": total + number, "-": total - less, "*": total * number}[sign]
        is_exact = type(total) is type(number) is int
        total = found if is_exact else AtMost(found)
    return total


def _length(function: str | None, text: str, known: Mapping[str, int]) -> int | None:
    """What a constant of a function is: an expression, or one in a function of support.h."""
    if function is None:
        return _value(text, known)
    words = text.removeprefix("ctx, ").split(", ")
    first, last = _value(words[0], known), _value(words[-1], known)
    if function in ("array_size", "same_size"):
        return first
    if function == "not_negative" and first is not None:
        return first if isinstance(first, AtMost) else max(0, first)
    if function == "clamped" and last is not None:  # a bound of a slice
        if first is None or isinstance(first, AtMost) or isinstance(last, AtMost):
            return AtMost(last if first is None or first < 0 else min(first, last))
        return min(max(0, first + last if first < 0 else first), last)
    return None


def _either(one: int | None, other: int | None) -> int | None:
    """What is known of a value that is one of two."""
    if one is None or other is None or (one == other and type(one) is type(other)):
        return one if one == other else None
    return AtMost(max(one, other))


def _passes(loop: re.Match[str], known: Mapping[str, int]) -> tuple[int, bool]:
    """How often a loop's body runs at most, and whether that is unknown."""
    first, last = (_value(text.removeprefix("-"), known) for text in (loop[1], loop[3]))
    first, last = (
        -value if value is not None and text.startswith("-") else value
        for value, text in ((first, loop[1]), (last, loop[3]))
    )
    if loop[2] == ">":
        first, last = last, first  # counts down
    # A loop that begins at a variable has at most the passes of one that begins at 0.
    if last is None:
        return 1, True
    first = None if isinstance(first, AtMost) else first
    return max(0, -(-(last - (first or 0)) // int(loop[4] or 1))), False


def _outside_brackets(line: str) -> str:
    """A line without what is inside of square brackets."""
    kept, depth = [], 0
    for character in line:
        depth += character == "["
        if not depth:
            kept.append(character)
        depth -= character == "]"
    return "".join(kept)


def functions(text: str) -> Iterator[tuple[str, tuple[list[str], list[str]]]]:
    """The functions of a C text: name, parameters and lines of the body."""
    name, parameters, lines = "", list[str](), list[str]()
    for line in text.split("\n"):
        head = HEAD.match(line)
        if head:
            name, lines = head[1], []
            parameters = [re.split(r"[ *]", each)[-1] for each in head[2].split(", ")]
        elif line == "}" and name:
            yield name, (parameters, lines)
            name = ""
        elif name and line != "{":
            lines.append(line)


def counter(text: str) -> Counter:
    """A counter of a text's functions."""
    return Counter(dict(functions(text)))
