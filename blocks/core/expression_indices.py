"""What is known of an expression while it is read: whole numbers, indices and what they run over.

In: nodes of a syntax tree and the indices of the loops around them. Out: integers, as Python
computes them::

    x[3*i:3*i + 3]  with i = 1      range(3, 6)
    3**40 % 1000                    801, which floats would not give
"""

from __future__ import annotations

import ast
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import NoReturn

from blocks.core.expression_text import ExpressionError
from blocks.core.expression_values import Value, Writer, literal
from blocks.limits import EXPRESSION_DEPTH

MAX_DEPTH = EXPRESSION_DEPTH
_COMPARISONS: dict[type[ast.cmpop], Callable[[int, int], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_INTEGERS: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Mod: operator.mod,
    ast.FloorDiv: operator.floordiv,
    ast.Pow: operator.pow,
}
MAX_BITS = 4096  # of an integer on the way; floats end at 1024


class Indices(ABC):
    """Integers in one expression.

    names : what each name stands for. writer : of the function that the expression belongs to.
    """

    def __init__(self, text: str, names: Mapping[str, Value], writer: Writer) -> None:
        self.text, self.names, self.writer = text, names, writer
        self.indices: dict[str, int] = {}
        self._whole: dict[ast.expr, int | None] = {}

    @abstractmethod
    def value(self, node: ast.expr, depth: int) -> Value:
        """What a node computes."""

    def fail(self, node: ast.expr, message: str) -> NoReturn:
        blanks = len(self.text) - len(self.text.lstrip())
        raise ExpressionError(self.text, node.col_offset + 1 + blanks, message)

    def whole(self, node: ast.expr, depth: int) -> int | None:
        """The value of integers alone, which Python computes exactly: 3**40 % 1000 is 801."""
        # Remembered: asked of every node on the way down, it would take quadratic time. A chain
        # such as a + b + c is as deep as it is long: its inner nodes first.
        chain = [node]
        while isinstance(inner := chain[-1], ast.BinOp) and inner.left not in self._whole:
            chain.append(inner.left)
        for each in reversed(chain):
            if each not in self._whole:
                self._whole[each] = None if depth > MAX_DEPTH else self._integer(each, depth + 1)
        return self._whole[node]

    def _integer(self, node: ast.expr, depth: int) -> int | None:
        match node:
            case ast.Name(id=name) if name in self.indices:
                return self.indices[name]
            case ast.Call(func=ast.Name(id="len"), args=[of], keywords=[]):
                return self.length(of)
            case ast.Constant(value=int() as value) if not isinstance(value, bool):
                return value
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                inner = self.whole(operand, depth)
                return -inner if inner is not None and isinstance(op, ast.USub) else inner
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _INTEGERS:
                a, b = self.whole(left, depth), self.whole(right, depth)
                if a is None or b is None or (b == 0 and isinstance(op, (ast.Mod, ast.FloorDiv))):
                    return None
                if isinstance(op, ast.Pow) and b < 0:
                    return None
                # Before it is computed: 9**9**9 would fill the memory.
                if isinstance(op, ast.Pow) and abs(a) > 1 and a.bit_length() * b > MAX_BITS:
                    self.fail(node, "the number is too large")
                return int(_INTEGERS[type(op)](a, b))
        return None

    def length(self, node: ast.expr) -> int:
        """The number of components of a vector, or of rows of a matrix, computing nothing."""
        with self.writer.block():
            value = self.value(node, 1)
        if not value.shape:
            self.fail(node, "a number has no length")
        return value.shape[0]

    def exact(self, node: ast.expr, whole: int) -> ast.expr:
        """An integer as the float of the same value."""
        try:
            value = float(whole)
        except OverflowError:
            self.fail(node, "the number is too large")
        if int(value) != whole:
            message = "no float has exactly this value, and all numbers here are floats; write a "
            self.fail(node, message + "float, as in '3.0**40', to have it rounded")
        return literal(value)

    def constant(self, node: ast.Constant) -> float:
        written = node.value
        if not isinstance(written, (bool, int, float)):
            self.fail(node, f"expected a number, got {ast.unparse(node)[:40]}")
        try:
            value = float(written)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            self.fail(node, "the number is too large")
        return value

    def index(self, node: ast.expr) -> int:
        value = self.whole(node, 0)
        if value is None:
            self.fail(node, "an index is an integer, as in 'u[0]' or 'u[3*i + 1]'")
        return value

    def places(self, key: ast.expr, size: int, whole: Value, name: str) -> int | range:
        """One index, or a range of them, along a side of this size."""
        if isinstance(key, ast.Slice):
            if key.step is not None:
                self.fail(key.step, f"a range has no step, as in '{name}[0:2]'")
            bounds = [None if p is None else self.index(p) for p in (key.lower, key.upper)]
            places = range(size)[bounds[0] : bounds[1]]
            if not places:
                self.fail(
                    key.lower or key.upper or key, f"the range is empty; '{name}' has {whole}"
                )
            return places
        index = self.index(key)
        if not -size <= index < size:
            what = f"'{name}' has {whole}, '{name}[0]' to '{name}[{size - 1}]'"
            if len(whole.shape) > 1:
                what = f"'{name}' is {whole}; this index is 0 to {size - 1}"
            self.fail(key, what)
        return index % size

    def range_of(self, node: ast.expr) -> range:
        match node:
            case ast.Call(func=ast.Name(id="range"), args=[_, *more] as bounds, keywords=[]) if (
                len(more) < 3
            ):
                numbers = [self.index(bound) for bound in bounds]
                if len(numbers) < 3 or numbers[2] != 0:
                    return range(*numbers)
        self.fail(node, "an index runs over 'range(n)', 'range(first, end)' or 'range(len(x))'")

    def static(self, node: ast.expr) -> bool:
        """A condition on indices, which is decided while the expression is read."""
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rest):
                numbers = [self.index(part) for part in (left, *rest)]
                pairs = zip(ops, numbers, numbers[1:], strict=False)
                if all(type(op) in _COMPARISONS for op in ops):
                    return all(_COMPARISONS[type(op)](a, b) for op, a, b in pairs)
            case ast.BoolOp(op=op, values=parts):
                truths = [self.static(part) for part in parts]
                return all(truths) if isinstance(op, ast.And) else any(truths)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not self.static(operand)
        self.fail(node, "expected a comparison of indices, as in 'if i != j'")
