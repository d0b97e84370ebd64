"""New arrays: zeros, copies, and arrays of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from runtime.codegen import arrays, scalars
from runtime.codegen.body import Body
from runtime.codegen.types import BOOL, FLOAT, INT, Array, NotTypedError, Number, Tuple
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    number,
    parts_of,
    size_of,
    size_text,
)

Given = Sequence[Value]
KINDS = {"float64": FLOAT, "float": FLOAT, "int64": INT, "int": INT, "bool_": BOOL, "bool": BOOL}


def shape_of(value: Value) -> list[Value]:
    """The sizes in a shape argument."""
    sizes = parts_of(value) if isinstance(value.type, Tuple) else [value]
    if any(size.type != INT for size in sizes):
        raise NotTypedError("makes an array with a size that is no integer; use int(...)")
    return sizes


def kind_of(given: Given, options: Mapping[str, Value], at: int, default: Number) -> Number:
    value = given[at] if len(given) > at else options.get("dtype")
    if value is None:
        return default
    found = KINDS.get(value.type.value) if value.is_known and not value.texts else None  # type: ignore[union-attr]
    if found is None:
        raise NotTypedError("uses a dtype other than float64, int64 and bool")
    return found


def new_array(body: Body, sizes: Sequence[Value], kind: Number) -> Value:
    texts = []
    for size in sizes:
        text = size.text
        if size.const is UNKNOWN and (size.low is None or size.low < 0):
            text = f"not_negative({text})"
        texts.append(text)
    dims = tuple(int(s.const) if s.const is not UNKNOWN else None for s in sizes)
    return body.new(kind.kind, texts, dims)


def filled(fill: float | None, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    kind = kind_of(given, options, 1, FLOAT)
    made = new_array(body, shape_of(given[0]), kind)
    if fill is not None:
        body.fill(made, number({BOOL: bool, INT: int}.get(kind, float)(fill)))
    return made


def full(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    value = body.kept(given[1])
    kind = kind_of(given, options, 2, arrays.elements(value))
    made = new_array(body, shape_of(given[0]), kind)
    body.fill(made, converted(value, kind))
    return made


def like(fill: float | None, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    kind = kind_of(given, options, 1, arrays.elements(given[0]))
    axes = range(len(array_type(given[0]).dims))
    made = new_array(body, [size_of(given[0], k) for k in axes], kind)
    if fill is not None:
        body.fill(made, number({BOOL: bool, INT: int}.get(kind, float)(fill)))
    return made


def eye(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    n = given[0]
    made = new_array(body, [n, n], FLOAT)
    i, j = arrays.loops(body, [size_text(made, 0), size_text(made, 1)])
    body.act(f"{body.place(made, [i, j])} = {i} == {j} ? 1.0 : 0.0;")
    arrays.close(body, 2)
    return made


def arange(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    if len(given) != 1 or options or given[0].type != INT:
        raise NotTypedError("calls np.arange with more than a length; write the loop")
    made = new_array(body, given, INT)
    (i,) = arrays.loops(body, [size_text(made, 0)])
    body.act(f"{body.place(made, [i])} = {i};")
    arrays.close(body, 1)
    return made


def as_array(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    """``np.array`` of an array, a number, or tuples of numbers."""
    value = given[0]
    if isinstance(value.type, Array):
        return arrays.copied(body, value)
    if not isinstance(value.type, Tuple):
        made = body.new(scalars.as_number(value).type.kind, [], ())  # type: ignore[union-attr]
        body.fill(made, value)
        return made
    rows = parts_of(value)
    numbers = [n for r in rows for n in (parts_of(r) if isinstance(r.type, Tuple) else [r])]
    kind = kind_of(given, options, 1, arrays.common(numbers) if numbers else FLOAT)
    dims: tuple[int, ...] = (len(rows),)
    lengths = {len(r.type.parts) if isinstance(r.type, Tuple) else None for r in rows}
    if lengths not in ({None}, set()):
        width = lengths.pop()
        if lengths or width is None:
            raise NotTypedError("makes an array of rows of different lengths")
        dims = (len(rows), width)
    made = body.new(kind.kind, [str(d) for d in dims], dims)
    for at, entry in enumerate(numbers):
        body.act(f"{made.text}[{at}] = {converted(entry, kind).text};")
    return made


def unchanged(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    value = given[0]
    if not isinstance(value.type, Array):
        return as_array(body, given, options)
    value = body.stored(value)
    return value if array_type(value).packed else arrays.copied(body, value)
