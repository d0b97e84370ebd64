"""Elements, views and elementwise expressions of arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from runtime.codegen.body import Body, offset
from runtime.codegen.types import BOOL, EITHER, FLOAT, INT, Array, NotTypedError, Number
from runtime.codegen.values import (
    ATOM,
    LOOSE,
    SUM,
    UNKNOWN,
    Value,
    array_type,
    converted,
    number,
    product_text,
    size_text,
    stride_text,
)

NUMBERS = {"bool": BOOL, "int": INT, "float": FLOAT}


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


def index_text(body: Body, array: Value, axis: int, index: Value) -> str:
    """An index as C text: negative ones count from the end, checked if asked for."""
    if index.type != INT:
        # A bool is a mask to NumPy.
        raise NotTypedError(f"uses a {index.type} as an index; use int(...)")
    size = size_text(array, axis)
    known = array_type(array).dims[axis]
    if index.const is not UNKNOWN:
        inside = known is not None and -known <= index.const < known
        if inside or not body.check:
            at = int(index.const)
            if at >= 0:
                return str(at)
            return str(known + at) if known is not None else f"{size} - {-at}"
    elif index.low is not None and index.low >= 0:
        if _below(index.high, known, size) or not body.check:
            return index.texts[0]
    elif not body.check:
        return f"wrapped({index.text}, {size})"
    message = "index {index} is out of bounds for axis {axis} with size {size}"
    if not array.text.startswith("array_") and array.text.isidentifier():
        message += f" of '{array.text}'"
    failure = body.fail("IndexError", message)
    # In a statement of its own: without jumps, nothing is read or written after a failure.
    return _held(body, f"checked(ctx, {index.text}, {size}, {axis}, {failure})")


def _below(high: int | str | None, known: int | None, size: str) -> bool:
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
        texts = [index_text(body, array, k, v) for k, v in enumerate(full) if isinstance(v, Value)]
        return Value(NUMBERS[kind.kind], (body.place(array, texts),))
    return _view(body, array, full)


def _view(body: Body, array: Value, indices: Sequence[Index]) -> Value:
    kind = array_type(array)
    starts: list[str] = []
    dims: list[int | None] = []
    sizes: list[str] = []
    strides: list[str] = []
    for axis, part in enumerate(indices):
        if isinstance(part, Value):
            text = index_text(body, array, axis, part)
            starts.append(text if _simple(text) else _held(body, text))
            continue
        start, size, known = _cut(body, array, axis, part)
        starts.append(start)
        dims.append(known)
        sizes.append(size)
        step = stride_text(array, axis)
        strides.append(step if part.step == 1 else product_text([str(part.step), step]))
    packed = kind.packed and _is_packed(array, indices)
    place = offset(array, starts)
    pointer = array.text if place == "0" else f"{array.text} + {place}"
    made = Array(kind.kind, tuple(dims), packed, kind.frozen)
    dynamic = [size for size, known in zip(sizes, dims, strict=True) if known is None]
    texts = (pointer, *dynamic, *([] if packed else strides))
    if pointer != array.text:
        name = body.fresh("part")
        const = "const " if kind.frozen else ""
        c_type = {"bool": "bool", "int": "int64_t", "float": "double"}[kind.kind]
        body.put(f"{const}{c_type} *const {name} = {pointer};")
        body.stable.add(name)
        texts = (name, *texts[1:])
    return Value(made, texts)


def _held(body: Body, text: str) -> str:
    name = body.fresh("at")
    body.put(f"const int64_t {name} = {text};")
    body.stable.add(name)
    return name


def _simple(text: str) -> bool:
    return text.isidentifier() or text.isdigit()


def _cut(body: Body, array: Value, axis: int, cut: Cut) -> tuple[str, str, int | None]:
    """The first index, the size, and the size where it is known, of one axis of a view."""
    size, known = size_text(array, axis), array_type(array).dims[axis]
    if cut.step < 1:
        raise NotTypedError("uses a slice with a step below one; write the loop")
    if cut.start is None and cut.stop is None:
        if cut.step == 1:
            return "0", size, known
        if known is not None:
            return "0", str(-(-known // cut.step)), -(-known // cut.step)
    bounds = [cut.start or number(0), cut.stop]
    if known is not None and all(b is None or b.const is not UNKNOWN for b in bounds):
        first, last = (None if b is None else int(b.const) for b in bounds)
        taken = range(known)[first : last : cut.step]
        return str(taken.start if len(taken) else 0), str(len(taken)), len(taken)
    low = _bound(body, bounds[0], size)
    high = size if bounds[1] is None else _bound(body, bounds[1], size)
    text = high if low == "0" else f"{high} - {low}"
    if low != "0":
        text = f"not_negative({text})"
    if cut.step != 1:
        text = f"({text} + {cut.step - 1}) / {cut.step}"
    return low, text if _simple(text) else _held(body, text), None


def _bound(body: Body, bound: Value | None, size: str) -> str:
    if bound is None or bound.const == 0:
        return "0"
    if bound.type != INT:
        raise NotTypedError(f"uses a {bound.type} as the bound of a slice; use int(...)")
    text = f"clamped({bound.text}, {size})"
    return _held(body, text)


def _is_packed(array: Value, indices: Sequence[Index]) -> bool:
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
    sizes = [size_text(array, k) for k in axes if kind.dims[k] is None]
    strides = [stride_text(array, k) for k in axes]
    made = replace(kind, dims=tuple(kind.dims[k] for k in axes), packed=False)
    return Value(made, (array.text, *sizes, *strides))


def flat(body: Body, array: Value) -> Value:
    """All elements in one axis: a view of a packed array, else a copy."""
    array = body.stored(array)
    if not array_type(array).packed:
        array = copied(body, array)
    kind = array_type(array)
    size = product_text([size_text(array, k) for k in range(len(kind.dims))])
    known = int(size) if size.isdigit() else None
    dynamic = [] if known is not None else [size if _simple(size) else _held(body, size)]
    return Value(replace(kind, dims=(known,)), (array.text, *dynamic))


def copied(body: Body, array: Value) -> Value:
    """A new array with the same elements."""
    kind = array_type(array)
    axes = range(len(kind.dims))
    made = body.new(kind.kind, [size_text(array, k) for k in axes], kind.dims)
    body.fill(made, array)
    return made


def stored_again(body: Body, target: Value, value: Value) -> Value:
    """A value that may be copied into ``target`` element by element although they share memory."""
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
        raise NotTypedError("writes into an input or a stored output; write to a copy")
    if isinstance(value.type, Array):
        if len(value.type.dims) > len(kind.dims):
            raise NotTypedError(f"copies an {value.type} into an {kind}")
        value = stored_again(body, target, value)
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

    def each(indices: Sequence[str]) -> Value:
        return converted(function(*[body.at(value, indices) for value in ready]), kind)

    made = Array(kind.kind, tuple(dims))
    return Value(made, (), LOOSE, each=each, sizes=tuple(sizes[:axes]))


def _shared(
    body: Body, values: Sequence[Value], exact: bool = False
) -> tuple[list[int | None], list[str]]:
    """The shape that arrays have together; sizes known only while running are checked.

    ``exact`` : the result has the first one's shape.
    """
    arrays = [v for v in values if isinstance(v.type, Array)]
    axes = max(len(array_type(v).dims) for v in arrays)
    dims: list[int | None] = []
    sizes: list[str] = []
    for axis in range(axes):
        found: list[tuple[int | None, str]] = []
        for value in arrays:
            own = axis - axes + len(array_type(value).dims)
            if own >= 0 and (array_type(value).dims[own] != 1 or (exact and value is arrays[0])):
                found.append((array_type(value).dims[own], size_text(value, own)))
        dim, size = _one_size(body, found)
        dims.append(dim)
        sizes.append(size)
    return dims, sizes


def _one_size(body: Body, found: list[tuple[int | None, str]]) -> tuple[int | None, str]:
    if not found:
        return 1, "1"
    fixed = sorted({dim for dim, _ in found if dim is not None})
    if len(fixed) > 1:
        raise NotTypedError(f"combines arrays with {fixed[0]} and {fixed[1]} elements on one axis")
    texts = list(dict.fromkeys(text for _, text in found))
    for other in texts[1:]:
        message = "operands could not be broadcast together: sizes {index} and {size}"
        failure = body.fail("ValueError", message)
        body.act(f"same_size(ctx, {texts[0]}, {other}, {failure});")
    return (fixed[0], str(fixed[0])) if fixed else (None, texts[0])


def reduced(body: Body, value: Value, start: Value, step: Callable[[Value, Value], Value]) -> Value:
    """A loop over all elements that changes one number."""
    kind = array_type(value)
    if not isinstance(start.type, Number):
        raise NotTypedError(f"reduces to a {start.type}")
    name = body.fresh("result")
    c_type = {"bool": "bool", "int": "int64_t", "float": "double"}[start.type.kind]
    body.put(f"{c_type} {name} = {start.text};")
    indices = loops(body, [size_text(value, k) for k in range(len(kind.dims))])
    so_far = Value(start.type, (name,))
    found = converted(step(so_far, body.at(value, indices)), start.type)
    body.put(f"{name} = {found.text};")
    close(body, len(indices))
    return so_far


def loops(body: Body, sizes: Sequence[str]) -> list[str]:
    """Open one loop per axis; returns the names of the indices."""
    indices = []
    for size in sizes:
        index = body.fresh("i")
        body.put(f"for (int64_t {index} = 0; {index} < {size}; {index}++) {{")
        body.depth += 1
        indices.append(index)
    return indices


def close(body: Body, count: int) -> None:
    """Close loops."""
    for _ in range(count):
        body.depth -= 1
        body.put("}")


__all__ = ["ATOM", "SUM", "Cut", "Index", "copied", "elementwise", "flat", "subscript", "write"]
