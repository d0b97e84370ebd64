"""What the nodes of an expression become: arrays of scalar Python, and statements before them.

In: syntax trees of numbers. Out: :class:`Value`, a number, a vector or a matrix with one tree per
component, and in a :class:`Writer` the statements that have to be executed first::

    2*x[0:2]         Value((2,), (2 * x[0], 2 * x[1]))
    (a + b)*x[0:2]   Value((2,), (v0 * x[0], v0 * x[1]))       and the statement v0 = a + b

All is written out for the components, so that both engines execute one text of scalar arithmetic.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import TypeAlias

from blocks.core.expression_text import parsed
from blocks.limits import EXPRESSION_WRITTEN

# Of an expression as written out, with all that its indices run over.
MAX_WRITTEN = EXPRESSION_WRITTEN
# A longer sum is continued in a further statement, and so is a higher tree: it is printed,
# compiled and translated by recursion.
MAX_TERMS = 8
MAX_HEIGHT = 40
# What a name stands for: one text for a number, several for a vector, rows of them for a matrix.
Written: TypeAlias = "str | Sequence[str] | Sequence[Sequence[str]]"


@dataclass(frozen=True)
class Value:
    """A number (), a vector (n,) or a matrix (m, n); ``parts`` are its components, row by row."""

    shape: tuple[int, ...]
    parts: tuple[ast.expr, ...]

    def __str__(self) -> str:
        if not self.shape:
            return "a number"
        if len(self.shape) == 2:
            return f"a {self.shape[0]} x {self.shape[1]} matrix"
        return "1 component" if len(self.parts) == 1 else f"{len(self.parts)} components"

    def row(self, i: int) -> tuple[ast.expr, ...]:
        """The components of a matrix's row, or one of a vector as a row."""
        width = self.shape[1] if len(self.shape) == 2 else 1
        return self.parts[i * width : (i + 1) * width]


def number(part: ast.expr) -> Value:
    """A value of one component."""
    return Value((), (part,))


def vector(parts: Sequence[ast.expr]) -> Value:
    """A vector of components."""
    return Value((len(parts),), tuple(parts))


def named_value(written: Written) -> Value:
    """What a name stands for."""
    if isinstance(written, str):
        return number(_tree(written))
    if written and not isinstance(written[0], str):
        rows = [[_tree(text) for text in row] for row in written]
        return Value((len(rows), len(rows[0])), tuple(chain.from_iterable(rows)))
    return vector([_tree(str(text)) for text in written])


@lru_cache(maxsize=10_000)
def _tree(python: str) -> ast.expr:
    """The tree of a text that the caller gave for a name."""
    value: ast.expr = parsed(python).body[0].value  # type: ignore[attr-defined]
    return value


def literal(value: float) -> ast.expr:
    return ast.Constant(value)


def called(name: str, *arguments: ast.expr) -> ast.expr:
    """A call of a function of ``SCOPE``, such as ``math.sqrt``."""
    owner, _, function = name.rpartition(".")
    target: ast.expr = ast.Name(function, ast.Load())
    if owner:
        target = ast.Attribute(ast.Name(owner, ast.Load()), function, ast.Load())
    return ast.Call(target, list(arguments), [])


def _height(node: ast.AST) -> int:
    """The levels of a tree; those of its inner trees are remembered in them."""
    height: int | None = getattr(node, "height", None)
    if height is None:
        height = 1 + max(map(_height, ast.iter_child_nodes(node)), default=0)
        node.height = height  # type: ignore[attr-defined]
    return height


def one_or_zero(truth: ast.expr) -> ast.expr:
    """A truth value as a number: Python's `a and b` is one of the two, here it is 1.0 or 0.0."""
    return ast.IfExp(truth, literal(1.0), literal(0.0))


def not_zero(part: ast.expr) -> ast.expr:
    return ast.Compare(part, [ast.NotEq()], [literal(0.0)])


class TooLongError(Exception):
    """More was written than :data:`MAX_WRITTEN`."""


class Writer:
    """The statements of one function; ``lines`` are those of the innermost block."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.written = 0
        self.locals = 0

    def charge(self, amount: int) -> None:
        """Count what is written out, before it is.

        Raises
        ------
        TooLongError : it is too much.
        """
        self.written += amount
        if self.written > MAX_WRITTEN:
            raise TooLongError

    def name(self, letter: str = "v") -> str:
        """The name of a further local variable."""
        self.locals += 1
        return f"{letter}{self.locals - 1}"

    def bind(self, part: ast.expr) -> ast.expr:
        """A component that is written several times: a name for it, unless it is one already."""
        if isinstance(part, (ast.Name, ast.Constant, ast.Subscript)):
            return part
        name = self.name()
        self.lines.append(f"{name} = {ast.unparse(part)}")
        return ast.Name(name, ast.Load())

    def bound(self, value: Value) -> Value:
        """A value of which each component may be written several times."""
        return Value(value.shape, tuple(map(self.bind, value.parts)))

    def low(self, value: Value) -> Value:
        """A value whose components are no higher trees than :data:`MAX_HEIGHT`."""
        if all(_height(part) <= MAX_HEIGHT for part in value.parts):
            return value
        return self.bound(value)

    @contextmanager
    def block(self) -> Iterator[list[str]]:
        """Statements that are written meanwhile go to a list of their own, for :meth:`branch`."""
        outside, self.lines = self.lines, []
        try:
            yield self.lines
        finally:
            self.lines = outside

    def branch(self, head: str, lines: Sequence[str]) -> None:
        """A compound statement: its head, and the statements in it."""
        self.lines += [f"{head}:", *(f"    {line}" for line in lines)]

    def each(self, f: Callable[..., ast.expr], *values: Value) -> Value | None:
        """A function of the components of values, of which a number counts for all components.

        Returns
        -------
        Value : None if their shapes do not agree.
        """
        shapes = {value.shape for value in values} - {()}
        if len(shapes) > 1:
            return None
        shape = shapes.pop() if shapes else ()
        size = max(len(value.parts) for value in values)
        self.charge(size)
        columns = [
            value.parts if value.shape == shape else (self.bind(value.parts[0]),) * size
            for value in values
        ]
        return Value(shape, tuple(f(*parts) for parts in zip(*columns, strict=True)))

    def total(self, terms: Sequence[ast.expr]) -> ast.expr:
        """A sum from left to right."""
        if len(terms) > MAX_TERMS // 2:
            terms = [self.bind(term) for term in terms]
        return self.folded(lambda total, term: ast.BinOp(total, ast.Add(), term), terms)

    def folded(
        self, f: Callable[[ast.expr, ast.expr], ast.expr], terms: Sequence[ast.expr]
    ) -> ast.expr:
        """A function of two numbers, applied from left to right."""
        total = terms[0]
        for place, term in enumerate(terms[1:], 2):
            total = f(total, term)
            if place % MAX_TERMS == 0 and place < len(terms):
                total = self.bind(total)
        return total

    def array(self, value: Value, rows: int, columns: int) -> ast.expr:
        """A value as a NumPy array of two dimensions, in a statement per component."""
        name = self.name("m")
        self.lines.append(f"{name} = np.empty(({rows}, {columns}))")
        self.charge(len(value.parts))
        for place, part in enumerate(value.parts):
            i, j = divmod(place, columns)
            self.lines.append(f"{name}[{i}, {j}] = {ast.unparse(part)}")
        return ast.Name(name, ast.Load())

    def components(self, array: ast.expr, shape: tuple[int, ...]) -> Value:
        """The value of a call that returns an array of two dimensions."""
        name = self.name("m")
        self.lines.append(f"{name} = {ast.unparse(array)}")
        rows, columns = shape if len(shape) == 2 else (shape[0], 1)
        self.charge(rows * columns)
        texts = [f"{name}[{i}, {j}]" for i in range(rows) for j in range(columns)]
        return Value(shape, tuple(_tree(text) for text in texts))


def reached(
    lines: Sequence[str], values: Sequence[str], place: Mapping[str, int]
) -> list[set[int]]:
    """Of which of the texts in ``place`` each value depends, through the statements before it.

    ``place`` maps texts such as ``x[3]`` to their numbers. What is assigned under a condition
    depends on the condition, too.
    """
    known: dict[str, set[int]] = {}

    def uses(text: str) -> set[int]:
        found: set[int] = set()
        for node in ast.walk(parsed(text)):
            if isinstance(node, ast.Subscript) and (at := place.get(ast.unparse(node))) is not None:
                found.add(at)
            if isinstance(node, ast.Name):
                found |= known.get(node.id, set())
        return found

    conditions: list[tuple[int, set[int]]] = []
    for line in lines:
        depth = len(line) - len(line.lstrip())
        last = depth + (line.strip() == "else:")  # which belongs to the condition at its depth
        conditions = [each for each in conditions if each[0] < last]
        outer: set[int] = set().union(*(found for _, found in conditions))
        if line.endswith(":"):
            if line.strip() != "else:":
                conditions.append((depth, uses(line.strip()[3:-1]) | outer))
            continue
        name, _, text = line.strip().partition(" = ")
        owner = name.partition("[")[0]
        before = known.get(owner, set()) if "[" in name or outer else set()
        known[owner] = before | uses(text) | outer
    return [uses(value) for value in values]
