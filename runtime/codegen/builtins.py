"""Python's own functions on numbers, tuples and arrays; indexing by an array.

In go the arguments of a call, by Python's names; out comes the value of the result:

    max(x, 0.0)     greatest(x, 0.0)
    len(a)          the size of a's first axis
    a[mask]         a new array, filled in a loop
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Sequence
from functools import partial

from runtime.codegen import arrays, library, scalars
from runtime.codegen.body import Body
from runtime.codegen.form import (
    CTX,
    Append,
    Call,
    Choice,
    Declare,
    Expr,
    If,
    Literal,
    Logic,
    Name,
    Operator,
    Set,
    Statement,
)
from runtime.codegen.types import BOOL, FLOAT, INT, NONE, Array, NotTypedError, Tuple, count, join
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    group,
    number,
    parts_of,
    size_expr,
    size_of,
)

ZERO, NOTHING = number(0.0), number(0)


def _len(body: Body, obj: Value, /) -> Value:
    if isinstance(obj.type, Tuple):
        return number(len(obj.type.parts))
    if isinstance(obj.type, Array) and obj.type.dims:
        return size_of(obj, 0)
    raise NotTypedError(f"takes the length of a {obj.type}")


def _single(body: Body, value: Value) -> Value:
    """A number, or an array's only element."""
    return library.item(body, value) if isinstance(value.type, Array) else value


def _float(body: Body, x: Value = ZERO, /) -> Value:
    return converted(scalars.as_number(_single(body, x)), FLOAT)


def _int(body: Body, x: Value = ZERO, /) -> Value:
    return scalars.whole(body, _single(body, x))


def _bool(body: Body, x: Value = ZERO, /) -> Value:
    return scalars.truth(_single(body, x))


def _round(body: Body, x: Value, /) -> Value:
    return scalars.whole(body, _single(body, x), "rint")


def _extreme(name: str, body: Body, *values: Value) -> Value:
    """``min`` and ``max`` as Python compares them, which differs from NumPy's where NaN is."""
    if len(values) > 1:
        return scalars.extreme(body, name, list(values))
    if isinstance(values[0].type, Tuple):
        parts = parts_of(values[0])
        if not parts:
            raise NotTypedError(f"takes the {name} of nothing")
        return scalars.extreme(body, name, parts)
    value = _vector(body, values[0])
    first = library.first(body, value, f"{name}() arg is an empty sequence")
    return arrays.reduced(body, value, first, lambda a, b: scalars.extreme(body, name, [a, b]))


def _vector(body: Body, value: Value) -> Value:
    """An array with one axis, over which Python's own functions go."""
    value = body.stored(value)
    if len(array_type(value).dims) != 1:
        raise NotTypedError("goes over an array that has not one axis; write the loop")
    return value


def _sum(body: Body, iterable: Value, /, start: Value = NOTHING) -> Value:
    """Python's sum, in order from the left."""
    add = ast.Add()
    if isinstance(iterable.type, Tuple):
        total = start
        for part in parts_of(iterable):
            total = scalars.binary(body, add, total, part)
        return _plain_sum(total)
    value = _vector(body, iterable)
    if (size_of(value, 0).const is UNKNOWN) or size_of(value, 0).const == 0:
        # The sum of nothing is an int.
        library.first(body, value, "the sum of no floats is an int")
    start = converted(start, arrays.common([start, value]))
    return _plain_sum(
        arrays.reduced(body, value, start, lambda a, b: scalars.binary(body, add, a, b))
    )


def _plain_sum(total: Value) -> Value:
    if total.type != INT and sys.version_info >= (3, 12):
        # From Python 3.12 on, the rounding errors of floats are added up, too.
        raise NotTypedError("adds up floats with 'sum', which is compensated; write the loop")
    return total


def _pow(body: Body, base: Value, exp: Value) -> Value:
    return library.operator(body, ast.Pow(), [base, exp])


def _divmod(body: Body, x: Value, y: Value, /) -> Value:
    a, b = (body.kept(scalars.as_number(value)) for value in (x, y))
    return group([scalars.binary(body, op, a, b) for op in (ast.FloorDiv(), ast.Mod())])


def _tests(sign: str, body: Body, iterable: Value, /) -> Value:
    if isinstance(iterable.type, Array):
        return library.tests_all("all" if sign == "&&" else "any", body, _vector(body, iterable))
    tests = [scalars.truth(part).expr for part in parts_of(iterable)]
    return Value(BOOL, (Logic(sign, tuple(tests)),)) if tests else number(sign == "&&")


# The parameters have Python's names, or are by position as there.
def _bits(name: str, body: Body, x: Value, /) -> Value:
    return scalars.call(name, scalars.as_float(x).expr)


BUILTINS: dict[str, Callable[..., Value]] = {
    # Not Python's: the two functions of blocks.core that look at the bits of a number.
    **{name: partial(_bits, name) for name in ("power_of_two", "exponent_of")},
    **{"len": _len, "float": _float, "int": _int, "bool": _bool, "abs": library.absolute},
    **{"round": _round, "min": partial(_extreme, "min"), "max": partial(_extreme, "max")},
    **{"sum": _sum, "pow": _pow, "divmod": _divmod},
    **{"all": partial(_tests, "&&"), "any": partial(_tests, "||")},
}


def picked(body: Body, parts: list[Value], index: Value) -> Value:
    """A part of a tuple by a variable index: the parts must have one type."""
    kind = parts[0].type if parts else NONE
    for part in parts:
        kind = join(kind, part.type)
    if not parts or index.type != INT:
        raise NotTypedError("takes a part of a tuple by a variable; use a literal number")
    ready = [body.kept(converted(part, kind)) for part in parts]
    failure = body.fail("IndexError", "tuple index out of range")
    checked = Call("checked", (CTX, index.expr, Literal(len(parts)), Literal(0), failure))
    at = body.held("at", "int64_t", checked)
    found = [chosen(at, [part.leaves[leaf] for part in ready]) for leaf in range(count(kind))]
    return body.kept(Value(kind, tuple(found)), "part")


def chosen(index: Expr, values: Sequence[Expr]) -> Expr:
    """One of some expressions by its index."""
    made = values[-1]
    for k in range(len(values) - 2, -1, -1):
        made = Choice(Operator("==", index, Literal(k)), values[k], made)
    return made


def selected(body: Body, array: Value, chosen: Value) -> Value:
    """``a[mask]`` and ``a[indices]`` of an array with one axis, a new array."""
    array, chosen = body.stored(array), body.stored(chosen)
    if len(array_type(array).dims) != 1 or len(array_type(chosen).dims) != 1:
        raise NotTypedError("selects by an array in more than one axis; write the loop")
    size = size_expr(chosen, 0)
    if arrays.elements(chosen) == BOOL:
        _same_length(body, array, chosen)
        count = library.numpy(body, "count_nonzero", [chosen], {})
        made = body.new(array_type(array).kind, [count.expr], (None,))
        at = _from_zero(body)
        with body.loops([size]) as (i,):
            append = Append(made.expr, at, body.at(array, [i]).expr)
            body.act(If(body.at(chosen, [i]).expr, [append]))
        return made
    made = body.new(array_type(array).kind, [size], array_type(chosen).dims)
    with body.loops([size]) as (i,):
        found = arrays.subscript(body, array, [body.at(chosen, [i])])
        body.act(Set(body.place(made, [i]), found.expr))
    return made


def _from_zero(body: Body) -> Name:
    """A counter."""
    name = body.fresh("at")
    body.add(Declare("int64_t", name, Literal(0), const=False))
    return Name(name)


def select_and_write(body: Body, array: Value, chosen: Value, value: Value) -> None:
    """``a[mask] = value`` and ``a[indices] = value`` of an array with one axis."""
    if array_type(array).frozen:
        raise NotTypedError(arrays.FROZEN)
    chosen = body.stored(chosen)
    value = arrays.copied(body, value) if isinstance(value.type, Array) else body.kept(value)
    if len(array_type(array).dims) != 1 or len(array_type(chosen).dims) != 1:
        raise NotTypedError("selects by an array in more than one axis; write the loop")
    body.change()
    mask = arrays.elements(chosen) == BOOL
    if mask:
        _same_length(body, array, chosen)
    repeated = _fits(body, chosen, value, mask)
    # With a mask, the values are taken one after the other.
    in_turn = mask and isinstance(value.type, Array) and not repeated
    at = _from_zero(body) if in_turn else None
    with body.loops([size_expr(chosen, 0)]) as (i,):
        source = value
        if isinstance(value.type, Array):
            index = Literal(0) if repeated else at or i
            source = Value(arrays.elements(value), (body.place(value, [index]),))
        expr = converted(scalars.as_number(source), arrays.elements(array)).expr
        if mask:
            steps: list[Statement] = [Set(body.place(array, [i]), expr)]
            steps += [Set(at, Literal(1), "+=")] if at is not None else []
            body.act(If(body.at(chosen, [i]).expr, steps))
        else:
            place = arrays.subscript(body, array, [body.at(chosen, [i])])
            body.act(Set(place.expr, expr))


def _fits(body: Body, chosen: Value, value: Value, mask: bool) -> bool:
    """Check that there is a value for each selected element; returns whether one is for all."""
    if not isinstance(value.type, Array) or not value.type.dims:
        return isinstance(value.type, Array)
    if len(value.type.dims) > 1:
        raise NotTypedError("assigns more than one axis to selected elements; write the loop")
    if value.type.dims[0] == 1:
        return True
    wanted = size_expr(chosen, 0)
    if mask:
        wanted = body.kept(library.numpy(body, "count_nonzero", [chosen], {})).expr
    message = "cannot assign {size} values to {index} selected elements"
    body.same_size(wanted, size_expr(value, 0), "ValueError", message)
    return False


def _same_length(body: Body, array: Value, chosen: Value) -> None:
    message = "boolean index did not match: sizes {index} and {size}"
    body.same_size(size_expr(array, 0), size_expr(chosen, 0), "IndexError", message)
