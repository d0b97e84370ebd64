"""The functions of an expression that take or give vectors and matrices, each declared once.

In: the values of the arguments. Out: that of the call, written out or computed by a statement::

    dot(a, b)      v = a[0]*b[0] + a[1]*b[1]
    inv(a)         m0[0, 0] = a[0][0]; ...; m1 = solution(m0, eye)      blocks.core.matrices

The table :data:`ARRAYS` is also what the documentation lists.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product

from blocks.core.expression_values import Value, Writer, called, literal, number, vector
from blocks.limits import INVERTED_SIDE

MAX_SIDE = INVERTED_SIDE
MAX_PRODUCTS = 256  # of a matrix product that is written out; larger ones are loops


class ShapeError(Exception):
    """Values whose shapes do not fit."""


@dataclass(frozen=True)
class ArrayFunction:
    """A function of arrays.

    signature, doc : as the documentation shows them.
    least, most : how many arguments it takes; None for any number.
    compute : its value from those of the arguments.
    """

    signature: str
    doc: str
    least: int
    most: int | None
    compute: Callable[[Writer, list[Value]], Value]


def map_pairs(writer: Writer, op: ast.operator, a: Value, b: Value) -> Value:
    """``a op b`` for each pair of components.

    Raises
    ------
    ShapeError : neither is a number, and their shapes differ.
    """
    value = writer.each(lambda x, y: ast.BinOp(x, op, y), a, b)
    if value is None:
        raise ShapeError(f"expected equal shapes, or a number and an array, got {a} and {b}")
    return value


def matrix_product(writer: Writer, a: Value, b: Value) -> Value:
    """``a @ b`` of matrices and vectors, each entry summed from left to right.

    Raises
    ------
    ShapeError : one is a number, or their sides differ.
    """
    if not a.shape or not b.shape:
        raise ShapeError(f"'@' takes vectors and matrices, got {a} and {b}; a product is '*'")
    rows = a.shape[0] if len(a.shape) == 2 else 1
    columns = b.shape[1] if len(b.shape) == 2 else 1
    inner = a.shape[-1]
    if inner != b.shape[0]:
        raise ShapeError(f"expected sides that agree, got {a} @ {b}")
    shape = (*a.shape[:-1], *b.shape[1:])
    if rows * columns * inner > MAX_PRODUCTS and shape:
        left, right = writer.array(a, rows, inner), writer.array(b, inner, columns)
        value = writer.components(called("small_product", left, right), (rows, columns))
        return Value(shape, value.parts)
    writer.charge(rows * columns * inner)
    a = writer.bound(a) if columns > 1 else a
    b = writer.bound(b) if rows > 1 else b
    parts = []
    for i, j in product(range(rows), range(columns)):
        pairs = zip(a.parts[i * inner : (i + 1) * inner], b.parts[j::columns], strict=True)
        parts.append(writer.total([ast.BinOp(x, ast.Mult(), y) for x, y in pairs]))
    return Value(shape, tuple(parts))


def transposed(value: Value) -> Value:
    if len(value.shape) < 2:
        return value
    rows, columns = value.shape
    return Value((columns, rows), tuple(chain(*(value.parts[j::columns] for j in range(columns)))))


def stacked(values: Sequence[Value]) -> Value:
    """A vector of numbers, or a matrix whose rows are vectors.

    Raises
    ------
    ShapeError : the shapes differ, or are those of matrices.
    """
    first = values[0].shape
    for value in values:
        if value.shape != first:
            raise ShapeError(f"expected items of equal shape, got {values[0]} and {value}")
    if len(first) > 1:
        raise ShapeError("a list holds numbers or vectors; a matrix has two dimensions")
    return Value((len(values), *first), tuple(chain.from_iterable(v.parts for v in values)))


def _square(value: Value, name: str) -> int:
    if len(value.shape) != 2 or value.shape[0] != value.shape[1]:
        raise ShapeError(f"'{name}' takes a square matrix, got {value}")
    if value.shape[0] > MAX_SIDE:
        raise ShapeError(f"'{name}' takes at most {MAX_SIDE} rows, got {value.shape[0]}")
    return value.shape[0]


def _solve(writer: Writer, arguments: list[Value]) -> Value:
    a, b = arguments
    n = _square(a, "solve")
    if not b.shape or b.shape[0] != n:
        raise ShapeError(f"expected {n} components or rows beside {a}, got {b}")
    columns = b.shape[1] if len(b.shape) == 2 else 1
    matrix, sides = writer.array(a, n, n), writer.array(b, n, columns)
    return writer.components(called("solution", matrix, sides), b.shape)


def _inv(writer: Writer, arguments: list[Value]) -> Value:
    return _solve(writer, [arguments[0], eye(_square(arguments[0], "inv"))])


def _det(writer: Writer, arguments: list[Value]) -> Value:
    n = _square(arguments[0], "det")
    return number(writer.bind(called("determinant", writer.array(arguments[0], n, n))))


def eye(n: int) -> Value:
    """The unit matrix (n, n)."""
    parts = tuple(literal(float(i == j)) for i in range(n) for j in range(n))
    return Value((n, n), parts)


def _diag(writer: Writer, arguments: list[Value]) -> Value:
    value = arguments[0]
    if len(arguments) > 1 or not value.shape:
        value = stacked(arguments)
    if len(value.shape) == 2 and len(arguments) == 1:
        return vector([value.row(i)[i] for i in range(min(value.shape))])
    if len(value.shape) != 1:
        raise ShapeError("'diag' takes numbers, a vector or a matrix")
    n = value.shape[0]
    writer.charge(n * n)
    zero = literal(0.0)
    return Value(
        (n, n), tuple(value.parts[i] if i == j else zero for i in range(n) for j in range(n))
    )


def _vectors(name: str, arguments: list[Value], length: int | None = None) -> None:
    for value in arguments:
        if len(value.shape) != 1 or (length is not None and value.shape[0] != length):
            what = f"vectors of {length} components" if length else "vectors"
            raise ShapeError(f"'{name}' takes {what}, got {value}")


def _cross(writer: Writer, arguments: list[Value]) -> Value:
    _vectors("cross", arguments, 3)
    a, b = (writer.bound(value).parts for value in arguments)

    def difference(i: int, j: int) -> ast.expr:
        left, right = ast.BinOp(a[i], ast.Mult(), b[j]), ast.BinOp(a[j], ast.Mult(), b[i])
        return ast.BinOp(left, ast.Sub(), right)

    return vector([difference(1, 2), difference(2, 0), difference(0, 1)])


def _dot(writer: Writer, arguments: list[Value]) -> Value:
    _vectors("dot", arguments)
    return matrix_product(writer, *arguments)


def _outer(writer: Writer, arguments: list[Value]) -> Value:
    _vectors("outer", arguments)
    a, b = (writer.bound(value) for value in arguments)
    writer.charge(len(a.parts) * len(b.parts))
    parts = [ast.BinOp(x, ast.Mult(), y) for x, y in product(a.parts, b.parts)]
    return Value((len(a.parts), len(b.parts)), tuple(parts))


def _concat(writer: Writer, arguments: list[Value]) -> Value:
    if any(len(value.shape) > 1 for value in arguments):
        raise ShapeError("'concat' takes numbers and vectors")
    return vector(list(chain.from_iterable(value.parts for value in arguments)))


def _all(writer: Writer, arguments: list[Value], name: str) -> Value:
    """A function of all components, such as a sum."""
    parts = tuple(chain.from_iterable(value.parts for value in arguments))
    if not parts:
        raise ShapeError(f"'{name}' of nothing")
    if name in ("min", "max"):
        function = "lesser" if name == "min" else "greater"
        return number(writer.folded(lambda a, b: called(function, a, b), parts))
    if name == "norm":
        total = writer.total([called("square", part) for part in parts])
        return number(called("math.sqrt", total))
    if name == "prod":
        result = parts[0]
        for part in parts[1:]:
            result = writer.bind(ast.BinOp(result, ast.Mult(), part))
        return number(result)
    total = writer.total(parts)
    return number(
        total if name == "sum" else ast.BinOp(total, ast.Div(), literal(float(len(parts))))
    )


def _transpose(writer: Writer, arguments: list[Value]) -> Value:
    return transposed(arguments[0])


def _trace(writer: Writer, arguments: list[Value]) -> Value:
    n = _square(arguments[0], "trace")
    return number(writer.total([arguments[0].row(i)[i] for i in range(n)]))


def _over(name: str) -> Callable[[Writer, list[Value]], Value]:
    return lambda writer, arguments: _all(writer, arguments, name)


_TABLE = (
    ("sum", "x", "sum of the components; of `... for i in range(n)`, of the values", 1, 1),
    ("mean", "x", "mean of the components", 1, 1),
    ("prod", "x", "product of the components", 1, 1),
    ("norm", "x, ...", "square root of the sum of the squares of all components", 1, None),
    ("min", "x, ...", "least component; of several arguments, one by one", 1, 1),
    ("max", "x, ...", "largest component; of several arguments, one by one", 1, 1),
)
ARRAYS: Mapping[str, ArrayFunction] = {
    **{
        name: ArrayFunction(f"{name}({of})", doc, least, most, _over(name))
        for name, of, doc, least, most in _TABLE
    },
    "dot": ArrayFunction("dot(a, b)", "scalar product of two vectors", 2, 2, _dot),
    "cross": ArrayFunction("cross(a, b)", "cross product of vectors of three", 2, 2, _cross),
    "outer": ArrayFunction("outer(a, b)", "the matrix of a[i]*b[j]", 2, 2, _outer),
    "concat": ArrayFunction("concat(a, b, ...)", "numbers and vectors in a row", 1, None, _concat),
    "transpose": ArrayFunction("transpose(a)", "rows for columns, also `a.T`", 1, 1, _transpose),
    "trace": ArrayFunction("trace(a)", "sum of the diagonal", 1, 1, _trace),
    "det": ArrayFunction("det(a)", "determinant", 1, 1, _det),
    "inv": ArrayFunction("inv(a)", "inverse; an error if a is singular", 1, 1, _inv),
    "solve": ArrayFunction(
        "solve(a, b)", "x with a @ x = b; an error if a is singular", 2, 2, _solve
    ),
    "diag": ArrayFunction(
        "diag(x, ...)", "diagonal matrix; of a matrix, its diagonal", 1, None, _diag
    ),
}
# Functions whose arguments are whole numbers, and how many each takes.
CREATION: Mapping[str, tuple[str, str]] = {
    "eye": ("eye(n)", "unit matrix"),
    "zeros": ("zeros(n), zeros(m, n)", "a vector or a matrix of zeros"),
    "ones": ("ones(n), ones(m, n)", "a vector or a matrix of ones"),
    "full": ("full(n, x), full(m, n, x)", "a vector or a matrix of a number"),
}
