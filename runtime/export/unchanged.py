"""Which arrays the C text of blocks never writes to: these are constants of a controller.

In goes the text, out come for each function the pointers that something may be stored through: its
parameters, and the members of its block's struct. Whatever is not plainly a read counts as a store.

    static void flush(double *x) { x[0] = 0.0; }                        x
    static double first(double *x, double *y) { return x[0] + y[0]; }   none
    double *const cells = self->state_cells; flush(cells);              self->state_cells
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from runtime.export.operations import functions

ALIAS = re.compile(
    r"^\s*(?:(?:struct )?\w+ \*(?:const )?)?(\w+) = ((?:self->)?\w+)(?: \+ [^;]+)?;$"
)
COPIED = re.compile(r"const (?:double|int64_t|bool) \w+ = self->\w+;")  # a number, no pointer
NAME = re.compile(r"(?<![\w.>])[A-Za-z_]\w*")
STORE = re.compile(r"\s*(?:[-+*/]?=(?!=)|\+\+|--)")
FUNCTION = re.compile(r"(\w+)$")


@dataclass
class Unchanged:
    """Finds stores in the functions of a text: their parameters and lines, by name."""

    bodies: dict[str, tuple[list[str], list[str]]]
    known: dict[str, frozenset[str]] = field(default_factory=dict)

    def written(self, function: str) -> frozenset[str]:
        """The parameters and ``self->...`` that a function may store through."""
        if function not in self.known:
            self.known[function] = frozenset()  # there is no recursion
            self.known[function] = frozenset(self._written(*self.bodies[function]))
        return self.known[function]

    def _written(self, parameters: list[str], lines: list[str]) -> Iterator[str]:
        roots, others = _aliases(parameters, lines)
        for line in others:
            for found in NAME.finditer(line):
                if found[0] == "self":
                    yield from self._of_inner(line, found)
                elif found[0] in roots and not self._is_read(line, found):
                    yield from roots[found[0]]

    def _of_inner(self, line: str, found: re.Match[str]) -> Iterator[str]:
        """What a function that gets the block's struct stores through."""
        called = _argument(line, found)
        if called is None or called[0] not in self.bodies:
            raise ValueError(f"unknown use of a block's struct: {line.strip()}")
        yield from (each for each in self.written(called[0]) if each.startswith("self->"))

    def _is_read(self, line: str, found: re.Match[str]) -> bool:
        """Whether what is at a place of a line is read only."""
        end = found.end()
        if line[end : end + 1] == "[":
            return line[found.start() - 1] != "&" and not STORE.match(line, _closing(line, end))
        called = _argument(line, found)
        if called is None or called[0] not in self.bodies:
            return False
        name, place = called
        return self.bodies[name][0][place] not in self.written(name)


def stored(text: str, prefix: str) -> frozenset[str]:
    """The members of a block's struct that its functions, of this prefix, may store through."""
    found = Unchanged(dict(functions(text)))
    names = [name for name in found.bodies if name.startswith(f"{prefix}__")]
    every = frozenset[str]().union(*map(found.written, names))
    return frozenset(each.removeprefix("self->") for each in every if each.startswith("self->"))


def _aliases(parameters: list[str], lines: list[str]) -> tuple[dict[str, set[str]], list[str]]:
    """What each pointer of a function may stand for, and the lines that use them."""
    roots = {name: {name} for name in parameters}
    for line in (*lines, *lines):  # in a loop, a pointer is used before the line that sets it
        found = ALIAS.search(line)
        if found and found[2].startswith("self->") and "*" in line.split("=")[0]:
            roots.setdefault(found[1], set()).add(found[2])
        elif found and found[2] in roots:
            roots.setdefault(found[1], set()).update(roots[found[2]])
    said = (ALIAS, COPIED, re.compile(r"^\s*\(void\)"))
    others = [line for line in lines if not any(each.search(line) for each in said)]
    return roots, others


def _closing(line: str, opening: int) -> int:
    """The place behind the bracket that closes the one at a place."""
    depth = 0
    for at in range(opening, len(line)):
        depth += {"[": 1, "]": -1}.get(line[at], 0)
        if not depth:
            return at + 1
    return len(line)


def _argument(line: str, found: re.Match[str]) -> tuple[str, int] | None:
    """The function that takes what is at a place as it is, and which of its arguments that is."""
    before, after = line[: found.start()].rstrip(), line[found.end() :].lstrip()
    if not before.endswith(("(", ",")) or not after.startswith((",", ")", "+")):
        return None
    depth, place = 0, 0
    for at in range(found.start() - 1, -1, -1):
        depth += {")": 1, "]": 1, "(": -1, "[": -1}.get(line[at], 0)
        place += line[at] == "," and not depth
        if depth < 0:
            name = FUNCTION.search(line[:at])
            return (name[1], place) if name and line[at] == "(" else None
    return None
