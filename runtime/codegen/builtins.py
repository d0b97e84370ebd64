"""Python's own functions on numbers, tuples and arrays; indexing by an array."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence

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

Given = Sequence[Value]


def _length(body: Body, given: Given) -> Value:
    (value,) = given
    if isinstance(value.type, Tuple):
        return number(len(value.type.parts))
    if isinstance(value.type, Array) and value.type.dims:
        found = size_of(value, 0)
        high = found.text if found.text in body.stable else None
        return found if found.const is not UNKNOWN else _with_high(found, high)
    raise NotTypedError(f"takes the length of a {value.type}")


def _with_high(value: Value, high: str | None) -> Value:
    return Value(value.type, value.texts, low=0, high=None if high is None else value.high)


def _single(body: Body, value: Value) -> Value:
    """A number, or an array's only element."""
    return library.method(body, value, "item", [], {}) if isinstance(value.type, Array) else value


def _float(body: Body, given: Given) -> Value:
    return converted(scalars.as_number(_single(body, given[0])), FLOAT) if given else number(0.0)


def _int(body: Body, given: Given) -> Value:
    return scalars.whole(body, _single(body, given[0])) if given else number(0)


def _bool(body: Body, given: Given) -> Value:
    return scalars.truth(_single(body, given[0]))


def _abs(body: Body, given: Given) -> Value:
    return library.numpy(body, "abs", given, {})


def _round(body: Body, given: Given) -> Value:
    if len(given) > 1:
        raise NotTypedError("rounds to digits; compute with round(x * 10**n) / 10**n")
    return scalars.whole(body, _single(body, given[0]), "rint")


def _extreme(name: str) -> Callable[[Body, Given], Value]:
    def of(body: Body, given: Given) -> Value:
        if len(given) > 1:
            return scalars.extreme(body, name, list(given))
        if isinstance(given[0].type, Tuple):
            return scalars.extreme(body, name, parts_of(given[0]))
        return library.numpy(body, name, given, {})

    return of


def _sum(body: Body, given: Given) -> Value:
    """Python's sum, in order from the left."""
    start = given[1] if len(given) > 1 else number(0)
    add = ast.Add()
    if isinstance(given[0].type, Tuple):
        total = start
        for part in parts_of(given[0]):
            total = scalars.binary(body, add, total, part)
        return total
    value = body.stored(given[0])
    start = converted(start, arrays.common([start, value]))
    return arrays.reduced(body, value, start, lambda a, b: scalars.binary(body, add, a, b))


def _pow(body: Body, given: Given) -> Value:
    return library.operator(body, ast.Pow(), list(given))


def _divmod(body: Body, given: Given) -> Value:
    a, b = (body.kept(value) for value in given)
    return group([scalars.binary(body, op, a, b) for op in (ast.FloorDiv(), ast.Mod())])


def _tests(sign: str) -> Callable[[Body, Given], Value]:
    def of(body: Body, given: Given) -> Value:
        (value,) = given
        if isinstance(value.type, Array):
            return library.numpy(body, "all" if sign == "&&" else "any", given, {})
        tests = [scalars.truth(part) for part in parts_of(value)]
        text = f" {sign} ".join(f"({t.text})" for t in tests)
        return Value(BOOL, (f"({text})",)) if tests else number(sign == "&&")

    return of


BUILTINS: dict[str, Callable[[Body, Given], Value]] = {
    **{"len": _length, "float": _float, "int": _int, "bool": _bool, "abs": _abs},
    **{"round": _round, "min": _extreme("min"), "max": _extreme("max"), "sum": _sum},
    **{"pow": _pow, "divmod": _divmod, "all": _tests("&&"), "any": _tests("||")},
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
    mask = arrays.elements(chosen) == BOOL
    if mask:
        _same_length(body, array, chosen)
    at = body.fresh("at")
    if mask:
        body.put(f"int64_t {at} = 0;")
    (i,) = arrays.loops(body, [size_text(chosen, 0)])
    source = value
    if isinstance(value.type, Array):
        index = Value(INT, (f"{at}++" if mask else i,), low=0)
        source = arrays.subscript(body, value, [index])
    text = converted(source, arrays.elements(array)).text
    if mask:
        body.act(f"if ({body.at(chosen, [i]).text}) {body.place(array, [i])} = {text};")
    else:
        place = arrays.subscript(body, array, [body.at(chosen, [i])])
        body.act(f"{place.text} = {text};")
    arrays.close(body, 1)


def _same_length(body: Body, array: Value, chosen: Value) -> None:
    sizes = size_text(array, 0), size_text(chosen, 0)
    if sizes[0] != sizes[1]:
        message = "boolean index did not match: sizes {index} and {size}"
        failure = body.fail("IndexError", message)
        body.act(f"same_size(ctx, {sizes[0]}, {sizes[1]}, {failure});")
