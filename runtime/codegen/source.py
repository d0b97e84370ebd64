"""The source of a unit: functions of the compiled subset as syntax trees, and which are called.

In go syntax trees, out come facts that need no types: which names are assigned once, which are read
after their loop, which may be read before they are assigned.

    for i in range(n):      counts {"i": 2, "total": 3}, since a loop may assign more than once
        total += a[i]       indices {"i"}: it is a C variable of the loop, unless it is read later
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

from runtime.codegen.scopes import separated, stored_names, uncertain
from runtime.codegen.types import Type
from runtime.codegen.ziggurat import draws_text

# The comment at a ``for`` whose rounds may be done in any order, or at once.
# Without it, graphs with populations take 1.3 to 1.4 times as long.
ANY_ORDER = "any order"


class RefusedError(Exception):
    """Text that cannot be compiled: the reason with file and line."""


@dataclass(frozen=True)
class Entry:
    """A method that other units call.

    Parameters
    ----------
    symbol : the C name.
    function : the source's function.
    arguments : names and types: numbers are passed as they are, tuples of floats and arrays of
        floats as pointers, other tuples part by part.
    results : types of the outputs, which are written through pointers: floats, tuples of floats
        and arrays of floats.

    Sizes of arrays that the types do not tell follow the pointer.
    """

    symbol: str
    function: str
    arguments: Sequence[tuple[str, Type]]
    results: Sequence[Type] = ()


@dataclass(frozen=True)
class Function:
    """One function.

    Parameters
    ----------
    name : as in calls.
    parameters : their names.
    defaults : of the last ones.
    statements : the body.
    file : of the source.
    line : the line before that of a node with line 1.
    bound : whether it reads the unit's entries; calls then give ``b`` first.
    """

    name: str
    parameters: tuple[str, ...]
    statements: Sequence[ast.stmt]
    defaults: Mapping[str, ast.expr] = field(default_factory=dict)
    file: str = ""
    line: int = 0
    bound: bool = False
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "statements", separated(self.statements))

    @cached_property
    def uncertain(self) -> frozenset[str]:
        """Variables that are read where they may not be assigned yet."""
        return uncertain(self.parameters, self.statements)

    @cached_property
    def counts(self) -> Counter[str]:
        """How often each name is assigned to in the text; parameters count once more."""
        found = Counter(self.parameters)
        for statement in self.statements:
            for node in ast.walk(statement):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    found[node.id] += 1
                if isinstance(node, (ast.For, ast.While, ast.AugAssign, ast.comprehension)):
                    for inner in stored_names(node):
                        found[inner] += 1
        return found

    @cached_property
    def loaded(self) -> frozenset[str]:
        """Names that are read anywhere, by ``x += 1`` too."""
        augmented = {
            node.target.id
            for statement in self.statements
            for node in ast.walk(statement)
            if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name)
        }
        return frozenset(name for s in self.statements for name in _loaded(s)) | augmented

    @cached_property
    def loops_read_later(self) -> frozenset[str]:
        """Indices of loops that are also read outside of these loops."""
        inside: Counter[str] = Counter()
        total: Counter[str] = Counter()
        for statement in self.statements:
            total.update(_loaded(statement))
            waiting: list[ast.AST] = [statement]
            while waiting:
                node = waiting.pop()
                if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
                    name = node.target.id
                    inside[name] += sum(_loaded(s)[name] for s in node.body)
                    waiting += [s for s in node.body if not _rebinds(s, name)]
                    continue
                waiting += ast.iter_child_nodes(node)
        return frozenset(name for name, times in total.items() if times > inside[name])

    @cached_property
    def indices(self) -> frozenset[str]:
        """Names that are only assigned to by ``for ... in range(...)``."""
        found = Counter(
            node.target.id
            for statement in self.statements
            for node in ast.walk(statement)
            if isinstance(node, ast.For)
            and isinstance(node.target, ast.Name)
            and isinstance(node.iter, ast.Call)
            and ast.unparse(node.iter.func) == "range"
        )
        stored = Counter(self.parameters)
        for statement in self.statements:
            stored.update(stored_names(statement))
        return frozenset(name for name, times in found.items() if times == stored[name])

    @cached_property
    def once(self) -> frozenset[str]:
        """Names that keep the value that they are given first."""
        return frozenset(name for name, times in self.counts.items() if times == 1)


def _loaded(node: ast.AST) -> Counter[str]:
    return Counter(
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
    )


def _rebinds(node: ast.AST, name: str) -> bool:
    return any(
        isinstance(n, ast.For) and isinstance(n.target, ast.Name) and n.target.id == name
        for n in ast.walk(node)
    )


class Failures:
    """The failures of a unit, by number: exception, message, file and line."""

    def __init__(self) -> None:
        self.listed: list[tuple[str, str, str, int]] = []
        self.numbers: dict[tuple[str, str, str, int], int] = {}

    def number(self, kind: str, message: str, file: str, line: int) -> int:
        """The number of a failure."""
        entry = (kind, message, file, line)
        if entry not in self.numbers:
            self.numbers[entry] = len(self.listed)
            self.listed.append(entry)
        return self.numbers[entry]


@dataclass(frozen=True)
class Source:
    """All functions of a unit by name, and the types of the entries that bound ones read."""

    functions: Mapping[str, Function]
    entries: Mapping[str, Type] = field(default_factory=dict)


@cache
def _support() -> str:
    return (Path(__file__).parent / "support.h").read_text(encoding="utf-8")


def support(text: str = "") -> str:
    """What a unit with this text begins with."""
    return _support() + (draws_text() if "draw_" in text else "")


def apart(text: str) -> str:
    """The text of a unit without what it begins with."""
    own = text.replace(_support(), "")
    return own.replace(draws_text(), "") if "draw_" in own else own
