"""How many operations a step takes at most, counted in the C text of the blocks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

HEAD = re.compile(r"^static (?:const )?(?:struct )?\w+ \**(\w+)\((.*)\)$")
LOOP = re.compile(r"for \((?:int64_t )?\w+ = ([^;]+); \w+ < ([^;]+); \w+(?:\+\+| \+= (\d+))\)")
FIXED = re.compile(r"const int64_t (\w+) = (?:clamped\(.*, )?(\d+)\)?;")
CALL = re.compile(r"\b([A-Za-z_]\w*)\(")
ARITHMETIC = re.compile(r" (?:[-+*]=?) |-=|\+=|\*=")
TAKEN = re.compile(r"\btake\(ctx, (.*), \d+\);")
ALIGNED = 32  # bytes that local arrays are multiples of, see take in support.h
MATH = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh"),
    *("cosh", "tanh", "asinh", "acosh", "atanh", "exp", "expm1", "exp2"),
    *("log", "log1p", "log2", "log10", "sqrt", "cbrt", "floor", "ceil"),
    *("trunc", "rint", "round", "fabs", "hypot", "copysign", "fmod", "pow"),
    *("remainder", "frexp", "ldexp", "fmin", "fmax", "nearbyint"),
)
ONES = ("least", "greatest", "np_least", "np_greatest", "sign_of")


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
    """Counts the operations of functions in a C text."""

    bodies: dict[str, list[str]]
    counted: dict[str, Operations] = field(default_factory=dict)

    def of(self, name: str) -> Operations:
        """The operations of one call of a function."""
        if name not in self.counted:
            self.counted[name] = Operations()  # no recursion
            self.counted[name] = self.body(self.bodies[name])
        return self.counted[name]

    def body(self, lines: list[str]) -> Operations:
        total, times, known = Operations(), [1], dict[str, int]()
        opened = [False]  # of the blocks around a line, which are in a loop of unknown length
        for line in lines:
            found = FIXED.search(line)
            if found:
                known[found.group(1)] = int(found.group(2))
            loop = LOOP.search(line)
            factor, is_open = 1, "while (" in line
            if loop:
                factor, is_open = _passes(loop, known)
            total.open_loops += is_open
            inside = LOOP.sub("", line)
            closed = line.lstrip().startswith("}")
            if closed and len(times) > 1:
                times.pop()
                opened.pop()
            done = self.line(inside)
            done.is_open |= bool(done.reserved) and (opened[-1] or is_open)
            total.add(done, times[-1] * factor)
            if line.rstrip().endswith("{"):
                times.append(times[-1] * factor)
                opened.append(opened[-1] or is_open)
        return total

    def line(self, line: str) -> Operations:
        """The operations of a line."""
        found = Operations()
        taken = TAKEN.search(line)
        if taken and taken[1].isdigit():
            found.reserved = -(-int(taken[1]) // ALIGNED) * ALIGNED
        found.is_open = taken is not None and not taken[1].isdigit()
        integer = re.match(r"\s*(?:const )?(?:int64_t|bool) ", line) is not None
        plain = _outside_brackets(line)
        if not integer:
            found.arithmetic += len(ARITHMETIC.findall(plain))
            found.divisions += plain.count(" / ")
        for name in CALL.findall(line):
            if name in self.bodies:
                found.add(self.of(name))
            elif name in MATH or name in ("power", "length_of"):
                found.functions += 1
            elif name in ONES:
                found.arithmetic += 1
            elif name.startswith(("divide", "modulo", "floor_divide")):
                found.divisions += 1
        return found


def _passes(loop: re.Match[str], known: dict[str, int]) -> tuple[int, bool]:
    """How often a loop's body runs, and whether that is unknown."""
    ends = [text.strip() for text in loop.groups()[:2]]
    numbers = [int(e) if e.isdigit() else known.get(e) for e in ends]
    if numbers[1] is None:
        return 1, True
    step = int(loop.group(3) or 1)
    return max(0, -(-(numbers[1] - (numbers[0] or 0)) // step)), False


def _outside_brackets(line: str) -> str:
    """A line without what is inside of square brackets."""
    kept, depth = [], 0
    for character in line:
        depth += character == "["
        if not depth:
            kept.append(character)
        depth -= character == "]"
    return "".join(kept)


def functions(text: str) -> Iterator[tuple[str, list[str]]]:
    """The functions of a C text: name and lines of the body."""
    name, lines = "", list[str]()
    for line in text.split("\n"):
        head = HEAD.match(line)
        if head:
            name, lines = head.group(1), []
        elif line == "}" and name:
            yield name, lines
            name = ""
        elif name and line != "{":
            lines.append(line)


def counter(text: str) -> Counter:
    """A counter of a text's functions."""
    return Counter(dict(functions(text)))
