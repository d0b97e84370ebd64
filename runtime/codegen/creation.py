"""New arrays: zeros, copies, and arrays of numbers.

In go the arguments of a call of NumPy, by NumPy's names; out comes a new array in the arena:

    np.full(n, 2.0)     double *const array_1_ = take(ctx, 8 * n, failure);
                        for (...) array_1_[i] = 2.0;
"""

from __future__ import annotations

from collections.abc import Sequence

from runtime.codegen import arrays
from runtime.codegen.body import Body
from runtime.codegen.form import CTX, Call, Choice, Item, Literal, Operator, Set
from runtime.codegen.types import (
    BOOL,
    FLOAT,
    INT,
    NONE,
    Array,
    Known,
    NotTypedError,
    Number,
    Tuple,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    number,
    parts_of,
    size_of,
    sizes_of,
)

KINDS = {"float64": FLOAT, "float": FLOAT, "int64": INT, "int": INT, "bool_": BOOL, "bool": BOOL}


def shape_of(value: Value) -> list[Value]:
    """The sizes in a shape argument."""
    sizes = parts_of(value) if isinstance(value.type, Tuple) else [value]
    if any(size.type != INT for size in sizes):
        raise NotTypedError("makes an array with a size that is no integer; use int(...)")
    return sizes


def kind_of(dtype: Value | None, default: Number) -> Number:
    """The type that a ``dtype`` names."""
    if dtype is None or dtype.type == NONE:
        return default
    found = KINDS.get(dtype.type.value) if isinstance(dtype.type, Known) else None
    if found is None:
        raise NotTypedError("uses a dtype other than float64, int64 and bool")
    return found


def new_array(body: Body, sizes: Sequence[Value], kind: Number) -> Value:
    found = []
    for size in sizes:
        expr = size.expr
        if size.const is UNKNOWN and (size.low is None or size.low < 0):
            failure = body.fail("ValueError", "negative dimensions are not allowed")
            expr = Call("array_size", (CTX, expr, failure))
        found.append(expr)
    dims = tuple(int(s.const) if s.const is not UNKNOWN else None for s in sizes)
    return body.new(kind.kind, found, dims)


def filled(fill: float | None, body: Body, shape: Value, dtype: Value | None = None) -> Value:
    """``np.zeros``, ``np.ones`` and ``np.empty``."""
    kind = kind_of(dtype, FLOAT)
    made = new_array(body, shape_of(shape), kind)
    if fill is not None:
        body.fill(made, number({BOOL: bool, INT: int}.get(kind, float)(fill)))
    return made


def full(body: Body, shape: Value, fill_value: Value, dtype: Value | None = None) -> Value:
    """``np.full``."""
    value = body.kept(fill_value)
    kind = kind_of(dtype, arrays.common([value]))
    made = new_array(body, shape_of(shape), kind)
    body.fill(made, converted(value, kind))
    return made


def like(fill: float | None, body: Body, a: Value, dtype: Value | None = None) -> Value:
    """``np.zeros_like``, ``np.ones_like`` and ``np.empty_like``."""
    kind = kind_of(dtype, arrays.elements(a))
    made = new_array(body, [size_of(a, k) for k in range(len(array_type(a).dims))], kind)
    if fill is not None:
        body.fill(made, number({BOOL: bool, INT: int}.get(kind, float)(fill)))
    return made


def eye(body: Body, N: Value, M: Value | None = None, k: Value | None = None) -> Value:
    """``np.eye``; the arguments have NumPy's names."""
    columns = N if M is None or M.type == NONE else M
    (offset,) = shape_of(number(0) if k is None else body.kept(k))
    made = new_array(body, [*shape_of(N), *shape_of(columns)], FLOAT)
    with body.loops(sizes_of(made)) as (i, j):
        shifted = i if offset.const == 0 else Operator("+", i, offset.expr)
        one = Choice(Operator("==", j, shifted), Literal(1.0), Literal(0.0))
        body.act(Set(body.place(made, [i, j]), one))
    return made


def identity(body: Body, n: Value) -> Value:
    """``np.identity``."""
    return eye(body, n)


def arange(body: Body, stop: Value, /) -> Value:
    """``np.arange`` of a length."""
    if stop.type != INT:
        raise NotTypedError("calls np.arange with a number that is no integer; write the loop")
    made = new_array(body, [stop], INT)
    with body.loops(sizes_of(made)) as (i,):
        body.act(Set(body.place(made, [i]), i))
    return made


def as_kind(body: Body, value: Value, kind: Number) -> Value:
    """A new array with elements of another type, which holds all of theirs."""
    have = arrays.elements(value)
    if have == kind:
        return arrays.copied(body, value)
    if (have, kind) not in ((INT, FLOAT), (BOOL, FLOAT), (BOOL, INT)):
        raise NotTypedError(f"makes {kind}s of {have}s, which may lose something; write the loop")
    return body.stored(arrays.elementwise(body, [value], lambda v: v, kind))


def as_array(body: Body, object: Value, dtype: Value | None = None) -> Value:
    """``np.array`` of an array, a number, or tuples of numbers."""
    value = object
    if isinstance(value.type, Array):
        return as_kind(body, value, kind_of(dtype, arrays.elements(value)))
    if not isinstance(value.type, Tuple):
        kind = kind_of(dtype, arrays.common([value]))
        made = body.new(kind.kind, [], ())
        body.fill(made, converted(value, kind))
        return made
    rows = parts_of(value)
    numbers = [n for r in rows for n in (parts_of(r) if isinstance(r.type, Tuple) else [r])]
    kind = kind_of(dtype, arrays.common(numbers) if numbers else FLOAT)
    dims: tuple[int, ...] = (len(rows),)
    lengths = {len(r.type.parts) if isinstance(r.type, Tuple) else None for r in rows}
    if lengths not in ({None}, set()):
        width = lengths.pop()
        if lengths or width is None:
            raise NotTypedError("makes an array of rows of different lengths")
        dims = (len(rows), width)
    made = body.new(kind.kind, [Literal(d) for d in dims], dims)
    for at, entry in enumerate(numbers):
        body.act(Set(Item(made.expr, Literal(at)), converted(entry, kind).expr))
    return made


def copy(body: Body, a: Value) -> Value:
    """``np.copy``."""
    return as_array(body, a)


def unchanged(body: Body, a: Value, dtype: Value | None = None) -> Value:
    """``np.asarray``: the very array, if it has the type."""
    if not isinstance(a.type, Array) or kind_of(dtype, arrays.elements(a)) != arrays.elements(a):
        return as_array(body, a, dtype)
    return body.stored(a)


def contiguous(body: Body, a: Value) -> Value:
    """``np.ascontiguousarray``, which is the very array if it is contiguous."""
    if not array_type(a).packed or not array_type(a).dims:
        raise NotTypedError("makes a view contiguous, which copies it or not; use .copy()")
    return body.stored(a)
