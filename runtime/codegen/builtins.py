"""Python's own functions on numbers, tuples and arrays; indexing by an array."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import partial

from runtime.codegen import arrays, library, scalars
from runtime.codegen.body import Body
from runtime.codegen.types import BOOL, FLOAT, INT, NONE, Array, NotTypedError, Tuple, join
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    group,
    number,
    parts_of,
    size_of,
    size_text,
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
    tests = [scalars.truth(part) for part in parts_of(iterable)]
    text = f" {sign} ".join(f"({t.text})" for t in tests)
    return Value(BOOL, (f"({text})",)) if tests else number(sign == "&&")


# The parameters have Python's names, or are by position as there.
BUILTINS: dict[str, Callable[..., Value]] = {
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
    at = body.fresh("at")
    body.act(f"const int64_t {at} = checked(ctx, {index.text}, {len(parts)}, 0, {failure});")
    texts = []
    for leaf in range(len(ready[0].texts)):
        choice = ready[-1].texts[leaf]
        for k in range(len(ready) - 2, -1, -1):
            choice = f"({at} == {k} ? {ready[k].texts[leaf]} : {choice})"
        texts.append(choice)
    return body.kept(Value(kind, tuple(texts)), "part")


def selected(body: Body, array: Value, chosen: Value) -> Value:
    """``a[mask]`` and ``a[indices]`` of an array with one axis, a new array."""
    array, chosen = body.stored(array), body.stored(chosen)
    if len(array_type(array).dims) != 1 or len(array_type(chosen).dims) != 1:
        raise NotTypedError("selects by an array in more than one axis; write the loop")
    size = size_text(chosen, 0)
    if arrays.elements(chosen) == BOOL:
        _same_length(body, array, chosen)
        count = library.numpy(body, "count_nonzero", [chosen], {})
        made = body.new(array_type(array).kind, [count.text], (None,))
        at = body.fresh("at")
        body.put(f"int64_t {at} = 0;")
        (i,) = arrays.loops(body, [size])
        test = body.at(chosen, [i]).text
        body.act(f"if ({test}) {made.text}[{at}++] = {body.at(array, [i]).text};")
        arrays.close(body, 1)
        return made
    made = body.new(array_type(array).kind, [size], array_type(chosen).dims)
    (i,) = arrays.loops(body, [size])
    found = arrays.subscript(body, array, [body.at(chosen, [i])])
    body.act(f"{body.place(made, [i])} = {found.text};")
    arrays.close(body, 1)
    return made


def select_and_write(body: Body, array: Value, chosen: Value, value: Value) -> None:
    """``a[mask] = value`` and ``a[indices] = value`` of an array with one axis."""
    if array_type(array).frozen:
        raise NotTypedError("writes into an input or a stored output; write to a copy")
    chosen = body.stored(chosen)
    value = arrays.copied(body, value) if isinstance(value.type, Array) else body.kept(value)
    if len(array_type(array).dims) != 1 or len(array_type(chosen).dims) != 1:
        raise NotTypedError("selects by an array in more than one axis; write the loop")
    body.change()
    mask = arrays.elements(chosen) == BOOL
    if mask:
        _same_length(body, array, chosen)
    repeated = _fits(body, chosen, value, mask)
    at = body.fresh("at")
    if mask:
        body.put(f"int64_t {at} = 0;")
    (i,) = arrays.loops(body, [size_text(chosen, 0)])
    source = value
    if isinstance(value.type, Array):
        index = "0" if repeated else f"{at}++" if mask else i
        source = Value(arrays.elements(value), (body.place(value, [index]),))
    text = converted(scalars.as_number(source), arrays.elements(array)).text
    if mask:
        body.act(f"if ({body.at(chosen, [i]).text}) {body.place(array, [i])} = {text};")
    else:
        place = arrays.subscript(body, array, [body.at(chosen, [i])])
        body.act(f"{place.text} = {text};")
    arrays.close(body, 1)


def _fits(body: Body, chosen: Value, value: Value, mask: bool) -> bool:
    """Check that there is a value for each selected element; returns whether one is for all."""
    if not isinstance(value.type, Array) or not value.type.dims:
        return isinstance(value.type, Array)
    if len(value.type.dims) > 1:
        raise NotTypedError("assigns more than one axis to selected elements; write the loop")
    if value.type.dims[0] == 1:
        return True
    wanted = size_text(chosen, 0)
    if mask:
        wanted = body.kept(library.numpy(body, "count_nonzero", [chosen], {})).text
    message = "cannot assign {size} values to {index} selected elements"
    failure = body.fail("ValueError", message)
    body.act(f"same_size(ctx, {wanted}, {size_text(value, 0)}, {failure});")
    return False


def _same_length(body: Body, array: Value, chosen: Value) -> None:
    sizes = size_text(array, 0), size_text(chosen, 0)
    if sizes[0] != sizes[1]:
        message = "boolean index did not match: sizes {index} and {size}"
        failure = body.fail("IndexError", message)
        body.act(f"same_size(ctx, {sizes[0]}, {sizes[1]}, {failure});")
