"""Typed values: a type, and the expressions that compute its leaves.

In go values, out come values of another type or parts of them; nothing here writes a statement.

    number(2)                                        Value(INT, (Literal(2),), const=2)
    converted(number(2), FLOAT)                      Value(FLOAT, (Literal(2.0),), const=2.0)
    group([x, y]), of floats                         Value(Tuple((FLOAT, FLOAT)), (x, y))
    a row of ``a``, 3 by n                           Value(Array("float", (None,)), (pointer, n))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.codegen.form import NULL, Expr, Literal, Prefix, product, sum_of
from runtime.codegen.types import (
    BOOL,
    EITHER,
    FLOAT,
    INT,
    NONE,
    Array,
    Known,
    Maybe,
    NotTypedError,
    Number,
    Tuple,
    Type,
    count,
    leaves,
)

UNKNOWN: Any = object()


@dataclass(frozen=True, eq=False)
class Value:
    """A value: its type, and the expression of each leaf.

    const : the Python number, where it is known while compiling.
    low, high : bounds of an integer, ``low <= value < high``; ``high`` a number or an expression.
    each : of an array expression that is not stored yet: the element at some indices.
    sizes : of such an expression: each axis.
    """

    type: Type
    leaves: tuple[Expr, ...] = ()
    const: Any = UNKNOWN
    low: int | None = None
    high: int | Expr | None = None
    each: Callable[[Sequence[Expr]], Value] | None = None
    sizes: tuple[Expr, ...] = ()

    @property
    def expr(self) -> Expr:
        """The expression of a value with one leaf, or of an array's pointer."""
        return self.leaves[0]

    @property
    def is_known(self) -> bool:
        """Whether the value is known while compiling."""
        return self.const is not UNKNOWN or isinstance(self.type, Known)

    @property
    def fails(self) -> bool:
        """Whether computing it may fail."""
        return any(leaf.fails for leaf in self.leaves)

    @property
    def reads(self) -> bool:
        """Whether a value that is not computed yet depends on what memory holds."""
        return self.each is not None or any(leaf.reads for leaf in self.leaves)


def number(value: float) -> Value:
    """A literal."""
    if isinstance(value, bool):
        return Value(BOOL, (Literal(value),), value)
    if isinstance(value, int):
        if not -(2**63) < value < 2**63:
            raise NotTypedError(f"uses the integer {value}, which has more than 64 bits")
        return Value(INT, (Literal(value),), value, value, value + 1)
    value = float(value)
    return Value(FLOAT, (Literal(value),), value)


def none() -> Value:
    """None."""
    return Value(NONE)


def known(value: Any) -> Value:
    """A string, which only decides branches."""
    return Value(Known(value))


def group(parts: Sequence[Value]) -> Value:
    """A tuple of values."""
    found = tuple(leaf for part in parts for leaf in part.leaves)
    return Value(Tuple(tuple(part.type for part in parts)), found)


def parts_of(value: Value) -> list[Value]:
    """The parts of a tuple."""
    if not isinstance(value.type, Tuple):
        raise NotTypedError(f"unpacks a {value.type}")
    found, at = [], 0
    for kind in value.type.parts:
        size = count(kind)
        own = value.leaves[at : at + size]
        known = kind in (BOOL, INT, FLOAT) and isinstance(own[0], Literal)
        found.append(number(own[0].value) if known else Value(kind, own))  # type: ignore[attr-defined]
        at += size
    return found


def given(value: Value) -> Value:
    """A value that may be None, where it is used as one that is not."""
    return Value(value.type.part, value.leaves[1:]) if isinstance(value.type, Maybe) else value


def size_expr(value: Value, axis: int) -> Expr:
    """An array's size along an axis."""
    size = array_type(value).dims[axis]
    if size is not None:
        return Literal(size)
    if value.each is not None:
        return value.sizes[axis]
    at = 1 + sum(n is None for n in array_type(value).dims[:axis])
    return value.leaves[at]


def sizes_of(value: Value) -> list[Expr]:
    """An array's size along each axis."""
    return [size_expr(value, axis) for axis in range(axes_of(value))]


def axes_of(value: Value) -> int:
    """How many axes an array has."""
    return len(array_type(value).dims)


def size_of(value: Value, axis: int) -> Value:
    """An array's size along an axis, as a number."""
    size = array_type(value).dims[axis]
    if size is not None:
        return number(size)
    return Value(INT, (size_expr(value, axis),), low=0, high=None)


def stride_expr(value: Value, axis: int) -> Expr:
    """An array's stride along an axis, in elements."""
    kind = array_type(value)
    if not kind.packed:
        return value.leaves[1 + sum(n is None for n in kind.dims) + axis]
    return product(sizes_of(value)[axis + 1 :])


def offset(array: Value, indices: Sequence[Expr]) -> Expr:
    """An element's distance from an array's start."""
    zero = Literal(0)
    if array_type(array).packed:
        found: Expr = indices[0] if indices else zero
        for axis in range(1, len(indices)):
            scaled = product([found, size_expr(array, axis)])
            found = sum_of([scaled, indices[axis]])
        return found
    return sum_of([product([i, stride_expr(array, k)]) for k, i in enumerate(indices)])


def array_type(value: Value) -> Array:
    """The type of an array.

    Raises
    ------
    NotTypedError : it is something else.
    """
    if not isinstance(value.type, Array):
        raise NotTypedError(f"uses a {value.type} as an array")
    return value.type


def zero(kind: Type) -> tuple[Expr, ...]:
    """Leaves of a value that is never used."""
    zeros = {"double": Literal(0.0), "bool": Literal(False)}
    return tuple(
        NULL if name.endswith("*") else zeros.get(name, Literal(0)) for _, name in leaves(kind)
    )


def converted(value: Value, kind: Type) -> Value:
    """A value in the form of another type, which holds all values of its own.

    Raises
    ------
    NotTypedError : the type cannot hold it.
    """
    have = value.type
    if have == kind:
        return value
    found = None
    if isinstance(have, Number) and isinstance(kind, Number):
        found = _number_as(value, kind)
    elif isinstance(have, Array) and isinstance(kind, Array):
        found = _array_as(value, have, kind)
    elif isinstance(have, Tuple) and isinstance(kind, Tuple):
        if len(have.parts) == len(kind.parts):
            pairs = zip(parts_of(value), kind.parts, strict=True)
            found = Value(kind, tuple(t for part, of in pairs for t in converted(part, of).leaves))
    elif isinstance(kind, Maybe):
        found = _maybe(value, kind)
    if found is None:
        raise NotTypedError(f"uses a {have} where a {kind} is needed")
    return found


def _number_as(value: Value, kind: Number) -> Value | None:
    if kind == FLOAT:
        if value.const is not UNKNOWN:
            return number(float(value.const))
        if value.type == EITHER:
            return replace(value, type=FLOAT)
        return Value(kind, (Prefix("(double)", value.expr),))
    if kind == EITHER and value.type != BOOL:
        if value.const is not UNKNOWN:
            return Value(EITHER, number(float(value.const)).leaves)
        return replace(_number_as(value, FLOAT) or value, type=EITHER)
    if kind == INT and value.type == BOOL:
        if value.const is not UNKNOWN:
            return number(int(value.const))
        # Not C's own conversion, which is to an int of 32 bits: 1103515245 * (x + 1) would be one.
        return Value(INT, (Prefix("(int64_t)", value.expr),), low=0, high=2)
    return None


def _array_as(value: Value, have: Array, kind: Array) -> Value | None:
    if have.kind != kind.kind or len(have.dims) != len(kind.dims) or value.each is not None:
        return None
    if kind.packed > have.packed or (have.frozen and not kind.frozen):
        return None
    axes = range(len(kind.dims))
    sizes = [size_expr(value, k) for k in axes if kind.dims[k] is None]
    strides = [] if kind.packed else [stride_expr(value, k) for k in axes]
    return Value(kind, (value.expr, *sizes, *strides))


def _maybe(value: Value, kind: Maybe) -> Value:
    if value.type == NONE:
        return Value(kind, (Literal(False), *zero(kind.part)))
    if isinstance(value.type, Maybe):
        inner = converted(Value(value.type.part, value.leaves[1:]), kind.part)
        return Value(kind, (value.leaves[0], *inner.leaves))
    return Value(kind, (Literal(True), *converted(value, kind.part).leaves))
