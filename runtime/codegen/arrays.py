"""Elements, views and elementwise expressions of arrays.

In go arrays and indices, out come elements, views or array expressions that are not stored yet:

    a[i]            Item(a, i), the index checked where it may be outside
    a[1:, 2]        a view: pointer, sizes and strides; nothing is copied
    a * b + 1.0     a value with ``each``: the element at some indices, stored by ``body.fill``
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from runtime.codegen.body import Body
from runtime.codegen.form import (
    CTX,
    Call,
    Declare,
    Expr,
    Literal,
    Name,
    Operator,
    Set,
    product,
)
from runtime.codegen.types import (
    BOOL,
    C_NAMES,
    EITHER,
    FLOAT,
    INT,
    NUMBERS,
    Array,
    NotTypedError,
    Number,
    leaves,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    number,
    offset,
    size_expr,
    sizes_of,
    stride_expr,
)

FROZEN = "writes into an input or a stored output; write to a copy"


@dataclass(frozen=True)
class Cut:
    """One slice of an axis: its bounds, None where it is open, and its step."""

    start: Value | None = None
    stop: Value | None = None
    step: int = 1


Index = Value | Cut


def elements(value: Value) -> Number:
    """The type of an array's elements, or of a number."""
    return NUMBERS[value.type.kind] if isinstance(value.type, Array) else _number(value)


def common(values: Sequence[Value]) -> Number:
    """The type of a result of numbers and arrays together."""
    kinds = [elements(value) for value in values]
    if EITHER in kinds and FLOAT not in kinds:
        raise NotTypedError("computes with arrays and an int or float; write 0.0 instead of 0")
    return FLOAT if FLOAT in kinds else INT if INT in kinds else BOOL


def _number(value: Value) -> Number:
    if not isinstance(value.type, Number):
        raise NotTypedError(f"computes with a {value.type} and arrays")
    return value.type


def index_expr(body: Body, array: Value, axis: int, index: Value) -> Expr:
    """An index: negative ones count from the end, checked if asked for."""
    if index.type != INT:
        # A bool is a mask to NumPy.
        raise NotTypedError(f"uses a {index.type} as an index; use int(...)")
    size = size_expr(array, axis)
    known = array_type(array).dims[axis]
    if index.const is not UNKNOWN:
        inside = known is not None and -known <= index.const < known
        if inside or not body.check:
            at = int(index.const)
            if at >= 0:
                return Literal(at)
            return Literal(known + at) if known is not None else Operator("-", size, Literal(-at))
    elif index.low is not None and index.low >= 0:
        if _below(index.high, known, size) or not body.check:
            return index.expr
    elif not body.check:
        return Call("wrapped", (index.expr, size))
    message = "index {index} is out of bounds for axis {axis} with size {size}"
    if isinstance(array.expr, Name) and not array.expr.is_temporary:
        message += f" of '{array.expr.name}'"
    failure = body.fail("IndexError", message)
    # In a statement of its own: without jumps, nothing is read or written after a failure.
    checked = Call("checked", (CTX, index.expr, size, Literal(axis), failure))
    return body.held("at", "int64_t", checked)


def _below(high: int | Expr | None, known: int | None, size: Expr) -> bool:
    if isinstance(high, int):
        return known is not None and high <= known
    return high is not None and high == size


def subscript(body: Body, array: Value, indices: Sequence[Index]) -> Value:
    """An element, or a view of a part of an array.

    Raises
    ------
    NotTypedError : there are more indices than axes.
    """
    kind = array_type(array)
    if len(indices) > len(kind.dims):
        raise NotTypedError(f"uses {len(indices)} indices on an {kind}")
    if array.each is not None:
        array = body.stored(array)
    full = [*indices, *[Cut()] * (len(kind.dims) - len(indices))]
    if all(isinstance(part, Value) for part in full):
        at = [index_expr(body, array, k, v) for k, v in enumerate(full) if isinstance(v, Value)]
        return Value(NUMBERS[kind.kind], (body.place(array, at),))
    return _view(body, array, full)


def _view(body: Body, array: Value, indices: Sequence[Index]) -> Value:
    kind = array_type(array)
    starts: list[Expr] = []
    dims: list[int | None] = []
    sizes: list[Expr] = []
    strides: list[Expr] = []
    for axis, part in enumerate(indices):
        if isinstance(part, Value):
            starts.append(_simple(body, index_expr(body, array, axis, part)))
            continue
        start, size, known = _cut(body, array, axis, part)
        starts.append(start)
        dims.append(known)
        sizes.append(size)
        step = stride_expr(array, axis)
        strides.append(step if part.step == 1 else product([Literal(part.step), step]))
    packed = kind.packed and _is_packed(indices)
    place = offset(array, starts)
    made = Array(kind.kind, tuple(dims), packed, kind.frozen)
    dynamic = [size for size, known in zip(sizes, dims, strict=True) if known is None]
    pointer = array.expr
    if place != Literal(0):
        pointer = body.held("part", next(leaves(kind))[1], Operator("+", pointer, place))
    return Value(made, (pointer, *dynamic, *([] if packed else strides)))


def _simple(body: Body, expr: Expr) -> Expr:
    """A number or a variable."""
    return expr if isinstance(expr, (Name, Literal)) else body.held("at", "int64_t", expr)


def _cut(body: Body, array: Value, axis: int, cut: Cut) -> tuple[Expr, Expr, int | None]:
    """The first index, the size, and the size where it is known, of one axis of a view."""
    size, known = size_expr(array, axis), array_type(array).dims[axis]
    if cut.step < 1:
        raise NotTypedError("uses a slice with a step below one; write the loop")
    if cut.start is None and cut.stop is None:
        if cut.step == 1:
            return Literal(0), size, known
        if known is not None:
            return Literal(0), Literal(-(-known // cut.step)), -(-known // cut.step)
    bounds = [cut.start or number(0), cut.stop]
    if known is not None and all(b is None or b.const is not UNKNOWN for b in bounds):
        first, last = (None if b is None else int(b.const) for b in bounds)
        taken = range(known)[first : last : cut.step]
        return Literal(taken.start if len(taken) else 0), Literal(len(taken)), len(taken)
    low = _bound(body, bounds[0], size)
    length = size if bounds[1] is None else _bound(body, bounds[1], size)
    if low != Literal(0):
        length = Call("not_negative", (Operator("-", length, low),))
    if cut.step != 1:
        length = Operator("/", Operator("+", length, Literal(cut.step - 1)), Literal(cut.step))
    return low, _simple(body, length), None


def _bound(body: Body, bound: Value | None, size: Expr) -> Expr:
    if bound is None or bound.const == 0:
        return Literal(0)
    if bound.type != INT:
        raise NotTypedError(f"uses a {bound.type} as the bound of a slice; use int(...)")
    return body.held("at", "int64_t", Call("clamped", (bound.expr, size)))


def _is_packed(indices: Sequence[Index]) -> bool:
    """Whether a view is contiguous: single indices first, then one slice, then whole axes."""
    first = next(k for k, part in enumerate(indices) if isinstance(part, Cut))
    cut = indices[first]
    rest = indices[first + 1 :]
    if not isinstance(cut, Cut) or cut.step != 1:
        return False
    return all(isinstance(p, Cut) and p == Cut() for p in rest)


def transposed(array: Value) -> Value:
    """A view with the axes in reverse order."""
    kind = array_type(array)
    axes = range(len(kind.dims) - 1, -1, -1)
    if len(kind.dims) < 2:
        return array
    sizes = [size_expr(array, k) for k in axes if kind.dims[k] is None]
    strides = [stride_expr(array, k) for k in axes]
    made = replace(kind, dims=tuple(kind.dims[k] for k in axes), packed=False)
    return Value(made, (array.expr, *sizes, *strides))


def flat(body: Body, array: Value) -> Value:
    """All elements in one axis: a view of a packed array, else a copy."""
    array = body.stored(array)
    if not array_type(array).packed:
        array = copied(body, array)
    size = product(sizes_of(array))
    known = int(size.value) if isinstance(size, Literal) else None
    dynamic = [] if known is not None else [_simple(body, size)]
    return Value(replace(array_type(array), dims=(known,)), (array.expr, *dynamic))


def copied(body: Body, array: Value) -> Value:
    """A new array with the same elements."""
    kind = array_type(array)
    made = body.new(kind.kind, sizes_of(array), kind.dims)
    body.fill(made, array)
    return made


def stored_again(body: Body, value: Value) -> Value:
    """A value that may be copied element by element into a view that shares memory with it."""
    if value.each is None and not isinstance(value.type, Array):
        return value
    return copied(body, value) if value.each is None else body.stored(value)


def write(body: Body, target: Value, value: Value) -> None:
    """Copy a number or an array into a view.

    Raises
    ------
    NotTypedError : the target is read-only, or the shapes differ.
    """
    kind = array_type(target)
    if kind.frozen:
        raise NotTypedError(FROZEN)
    if isinstance(value.type, Array):
        if len(value.type.dims) > len(kind.dims):
            raise NotTypedError(f"copies an {value.type} into an {kind}")
        value = stored_again(body, value)
        _shared(body, [target, value], exact=True)
    else:
        value = body.kept(value)
    body.change()
    body.fill(target, value)


def elementwise(
    body: Body, values: Sequence[Value], function: Callable[..., Value], kind: Number
) -> Value:
    """A function of numbers, applied to the elements of arrays of one shape, and numbers.

    Parameters
    ----------
    kind : of the results.
    """
    ready = [v if isinstance(v.type, Array) else body.kept(v) for v in values]
    dims, sizes = _shared(body, ready)
    axes = len(dims)
    if not axes:
        # NumPy gives a number, not an array without axes.
        return converted(function(*[body.at(value, []) for value in ready]), kind)

    def each(indices: Sequence[Expr]) -> Value:
        return converted(function(*[body.at(value, indices) for value in ready]), kind)

    made = Array(kind.kind, tuple(dims))
    return Value(made, each=each, sizes=tuple(sizes[:axes]))


def _shared(
    body: Body, values: Sequence[Value], exact: bool = False
) -> tuple[list[int | None], list[Expr]]:
    """The shape that arrays have together; sizes known only while running are checked.

    ``exact`` : the result has the first one's shape.
    """
    arrays = [v for v in values if isinstance(v.type, Array)]
    axes = max(len(array_type(v).dims) for v in arrays)
    dims: list[int | None] = []
    sizes: list[Expr] = []
    for axis in range(axes):
        found: list[tuple[int | None, Expr]] = []
        for value in arrays:
            own = axis - axes + len(array_type(value).dims)
            if own >= 0 and (array_type(value).dims[own] != 1 or (exact and value is arrays[0])):
                found.append((array_type(value).dims[own], size_expr(value, own)))
        dim, size = _one_size(body, found)
        dims.append(dim)
        sizes.append(size)
    return dims, sizes


def _one_size(body: Body, found: list[tuple[int | None, Expr]]) -> tuple[int | None, Expr]:
    if not found:
        return 1, Literal(1)
    fixed = sorted({dim for dim, _ in found if dim is not None})
    if len(fixed) > 1:
        raise NotTypedError(f"combines arrays with {fixed[0]} and {fixed[1]} elements on one axis")
    sizes = list(dict.fromkeys(size for _, size in found))
    for other in sizes[1:]:
        message = "operands could not be broadcast together: sizes {index} and {size}"
        body.same_size(sizes[0], other, "ValueError", message)
    return (fixed[0], Literal(fixed[0])) if fixed else (None, sizes[0])


def reduced(body: Body, value: Value, start: Value, step: Callable[[Value, Value], Value]) -> Value:
    """A loop over all elements that changes one number."""
    if not isinstance(start.type, Number):
        raise NotTypedError(f"reduces to a {start.type}")
    name = body.fresh("result")
    body.add(Declare(C_NAMES[start.type.kind], name, start.expr, const=False))
    so_far = Value(start.type, (Name(name),))
    with body.loops(sizes_of(value)) as indices:
        found = converted(step(so_far, body.at(value, indices)), start.type)
        body.add(Set(so_far.expr, found.expr))
    return so_far


def nonzero(body: Body, a: Value) -> Value:
    """``np.flatnonzero``: without branches, which a processor would guess wrongly."""
    value = flat(body, body.stored(a))
    size = size_expr(value, 0)
    count, marked = Name(body.fresh("count")), Name(body.fresh("marked"))
    body.add(Declare("int64_t", count.name, Literal(0), const=False))
    made = body.new("int", [size], (None,))
    with body.loops([size]) as (index,):
        element = body.at(value, [index])
        body.add(Declare("bool", marked.name, Operator("!=", element.expr, Literal(0))))
        body.act(Set(body.place(made, [count]), index))
        body.add(Set(count, marked, "+="))
    return Value(made.type, (made.expr, body.kept(Value(INT, (count,)), "found").expr))


__all__ = ["FROZEN", "Cut", "Index", "copied", "elementwise", "flat", "subscript", "write"]
