"""Values in C text, and their conversion from one type to another."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

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

# How tightly a text binds: an operand of lower rank is put in parentheses.
LOOSE, SUM, PRODUCT, SIGN, ATOM = range(5)
UNKNOWN: Any = object()


@dataclass(frozen=True)
class Value:
    """A value: its type, and the C text of each leaf.

    const : the Python number, where it is known while compiling.
    low, high : bounds of an integer, ``low <= value < high``; ``high`` a number or C text.
    each : of an array expression that is not stored yet: the element at some indices.
    sizes : of such an expression: the C text of each axis.
    names : the variables that an array expression reads with other indices than its own.
    """

    type: Type
    texts: tuple[str, ...] = ()
    rank: int = ATOM
    const: Any = UNKNOWN
    low: int | None = None
    high: int | str | None = None
    each: Callable[[Sequence[str]], Value] | None = None
    sizes: tuple[str, ...] = ()
    shifted: bool = field(default=False, compare=False)

    @property
    def text(self) -> str:
        """The text of a value with one leaf, or of an array's pointer."""
        return self.texts[0]

    def within(self, rank: int) -> str:
        """The text as an operand of an operator of this rank."""
        return self.texts[0] if self.rank >= rank else f"({self.texts[0]})"

    @property
    def is_known(self) -> bool:
        """Whether the value is known while compiling."""
        return self.const is not UNKNOWN or isinstance(self.type, Known)


def number(value: float) -> Value:
    """A literal."""
    if isinstance(value, bool):
        return Value(BOOL, ("true" if value else "false",), const=value)
    if isinstance(value, int):
        if not -(2**63) < value < 2**63:
            raise NotTypedError(f"uses the integer {value}, which has more than 64 bits")
        text = f"INT64_C({value})" if abs(value) >= 2**31 else str(value)
        return Value(INT, (text,), SIGN if value < 0 else ATOM, value, value, value + 1)
    value = float(value)
    if math.isnan(value):
        return Value(FLOAT, ("(double)NAN",), SIGN, value)
    if math.isinf(value):
        return Value(FLOAT, (f"{'-' * (value < 0.0)}(double)INFINITY",), SIGN, value)
    sign = math.copysign(1.0, value) < 0.0
    return Value(FLOAT, (repr(value),), SIGN if sign else ATOM, value)


def none() -> Value:
    """None."""
    return Value(NONE)


def known(value: Any) -> Value:
    """A string, which only decides branches."""
    return Value(Known(value))


def group(parts: Sequence[Value]) -> Value:
    """A tuple of values."""
    texts = tuple(text for part in parts for text in part.texts)
    return Value(Tuple(tuple(part.type for part in parts)), texts)


def parts_of(value: Value) -> list[Value]:
    """The parts of a tuple."""
    if not isinstance(value.type, Tuple):
        raise NotTypedError(f"unpacks a {value.type}")
    found, at = [], 0
    for kind in value.type.parts:
        size = count(kind)
        texts = value.texts[at : at + size]
        literal = _literal(kind, texts)
        found.append(literal or Value(kind, texts, rank=_rank(value, kind, at)))
        at += size
    return found


def _literal(kind: Type, texts: tuple[str, ...]) -> Value | None:
    """The number that a text spells."""
    if kind == INT and texts[0].lstrip("-").isdigit():
        return number(int(texts[0]))
    if kind == FLOAT and texts[0].lstrip("-")[:1].isdigit():
        try:
            return number(float(texts[0]))
        except ValueError:
            return None
    return number(texts[0] == "true") if kind == BOOL and texts[0] in ("true", "false") else None


def _rank(value: Value, kind: Type, at: int) -> int:
    """Parts keep no rank of their own: only plain texts are certain not to need parentheses."""
    text = value.texts[at] if count(kind) == 1 else ""
    return ATOM if all(c.isalnum() or c in "_.>-" for c in text.lstrip("-")) else LOOSE


def size_text(value: Value, axis: int) -> str:
    """The C text of an array's size along an axis."""
    size = array_type(value).dims[axis]
    if size is not None:
        return str(size)
    if value.each is not None:
        return value.sizes[axis]
    at = 1 + sum(n is None for n in array_type(value).dims[:axis])
    return value.texts[at]


def size_of(value: Value, axis: int) -> Value:
    """An array's size along an axis, as a number."""
    size = array_type(value).dims[axis]
    if size is not None:
        return number(size)
    return Value(INT, (size_text(value, axis),), low=0, high=None)


def stride_text(value: Value, axis: int) -> str:
    """The C text of an array's stride along an axis, in elements."""
    kind = array_type(value)
    if not kind.packed:
        return value.texts[1 + sum(n is None for n in kind.dims) + axis]
    return product_text([size_text(value, k) for k in range(axis + 1, len(kind.dims))])


def product_text(factors: Sequence[str]) -> str:
    """A product of texts; numbers are multiplied while compiling."""
    constant = math.prod(int(f) for f in factors if f.isdigit())
    rest = [f if _is_plain(f) else f"({f})" for f in factors if not f.isdigit()]
    if not rest or constant == 0:
        return str(constant)
    return " * ".join([*([str(constant)] if constant != 1 else []), *rest])


def _is_plain(text: str) -> bool:
    return all(c.isalnum() or c in "_." or c == "[" or c == "]" for c in text)


def array_type(value: Value) -> Array:
    """The type of an array.

    Raises
    ------
    NotTypedError : it is something else.
    """
    if not isinstance(value.type, Array):
        raise NotTypedError(f"uses a {value.type} as an array")
    return value.type


def zero(kind: Type) -> tuple[str, ...]:
    """Leaves of a value that is never used."""
    return tuple(
        "NULL" if name.endswith("*") else {"double": "0.0", "bool": "false"}.get(name, "0")
        for _, name in leaves(kind)
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
            found = Value(kind, tuple(t for part, of in pairs for t in converted(part, of).texts))
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
        return Value(kind, (f"(double){value.within(ATOM)}",), SIGN)
    if kind == EITHER and value.type != BOOL:
        if value.const is not UNKNOWN:
            return Value(EITHER, number(float(value.const)).texts, SIGN)
        return replace(_number_as(value, FLOAT) or value, type=EITHER)
    if kind == INT and value.type == BOOL:
        if value.const is not UNKNOWN:
            return number(int(value.const))
        return Value(INT, value.texts, value.rank, low=0, high=2)
    return None


def _array_as(value: Value, have: Array, kind: Array) -> Value | None:
    if have.kind != kind.kind or len(have.dims) != len(kind.dims) or value.each is not None:
        return None
    if kind.packed > have.packed or (have.frozen and not kind.frozen):
        return None
    axes = range(len(kind.dims))
    sizes = [size_text(value, k) for k in axes if kind.dims[k] is None]
    strides = [] if kind.packed else [stride_text(value, k) for k in axes]
    return Value(kind, (value.text, *sizes, *strides), value.rank)


def _maybe(value: Value, kind: Maybe) -> Value:
    if value.type == NONE:
        return Value(kind, ("false", *zero(kind.part)))
    if isinstance(value.type, Maybe):
        inner = converted(Value(value.type.part, value.texts[1:]), kind.part)
        return Value(kind, (value.texts[0], *inner.texts))
    return Value(kind, ("true", *converted(value, kind.part).texts))
