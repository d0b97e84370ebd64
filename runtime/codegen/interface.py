"""How other units call a method: numbers by value, everything else by pointers to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from runtime.codegen.body import Body
from runtime.codegen.names import local_name
from runtime.codegen.types import FLOAT, INT, Array, NotTypedError, Tuple, Type
from runtime.codegen.values import Value, converted, group, parts_of, size_text


@dataclass(frozen=True)
class Entry:
    """A method that other units call.

    Parameters
    ----------
    symbol : the C name.
    function : the source's function.
    arguments : names and types: numbers are passed as they are, tuples of floats and arrays of
        floats as pointers, other tuples part by part.
    results : types of the outputs, which are written through pointers: floats, tuples of floats
        and arrays of floats of known shape.
    """

    symbol: str
    function: str
    arguments: Sequence[tuple[str, Type]]
    results: Sequence[Type] = ()


def given(name: str, kind: Type, parameters: list[str]) -> Value:
    """An argument from another unit; adds its C parameters."""
    plain = local_name(name)
    if kind == FLOAT:
        parameters.append(f"double {plain}")
        return Value(kind, (plain,))
    if kind == INT:
        parameters.append(f"int64_t {plain}")
        return Value(kind, (plain,))
    if isinstance(kind, Array):
        parameters.append(f"{'const ' if kind.frozen else ''}double *{plain}")
        return Value(kind, (plain,))
    if isinstance(kind, Tuple):
        if kind.parts and all(part == FLOAT for part in kind.parts) and not name.endswith("..."):
            parameters.append(f"const double *{plain}")
            return Value(kind, tuple(f"{plain}[{i}]" for i in range(len(kind.parts))))
        stem = name.removesuffix("...")
        made = [given(f"{stem}_{i}", part, parameters) for i, part in enumerate(kind.parts)]
        return group(made)
    raise NotTypedError(f"takes a {kind} as an argument")


def results(body: Body, entry: Entry, found: Value, parameters: list[str]) -> None:
    """Copy what a method returns to its outputs."""
    if not entry.results:
        return
    parts = [found]
    if len(entry.results) > 1:
        if not isinstance(found.type, Tuple) or len(found.type.parts) != len(entry.results):
            message = f"returns a {found.type}, expected {len(entry.results)} outputs"
            raise NotTypedError(message)
        parts = parts_of(found)
    for i, (part, kind) in enumerate(zip(parts, entry.results, strict=True)):
        parameters.append(f"double *out{i}")
        if isinstance(kind, Array):
            _array_result(body, part, kind, f"out{i}")
            continue
        try:
            numbers = converted(part, kind)
        except NotTypedError:
            raise NotTypedError(f"returns a {part.type}, expected a {kind}") from None
        for at, text in enumerate(numbers.texts):
            body.put(f"out{i}[{at}] = {text};")


def _array_result(body: Body, part: Value, kind: Array, name: str) -> None:
    """Copy an array, or a tuple of numbers, of the right shape to an output."""
    if isinstance(part.type, Tuple) and kind.dims == (len(part.type.parts),):
        for at, entry in enumerate(parts_of(part)):
            body.put(f"{name}[{at}] = {converted(entry, FLOAT).text};")
        return
    if not isinstance(part.type, Array) or len(part.type.dims) != len(kind.dims):
        raise NotTypedError(f"returns a {part.type}, expected an array of shape {kind.dims}")
    for axis, size in enumerate(kind.dims):
        if part.type.dims[axis] is None:
            message = "an output has {index} elements along an axis, expected {size}"
            failure = body.fail("ValueError", message)
            body.put(f"same_size(ctx, {size_text(part, axis)}, {size}, {failure});")
        elif part.type.dims[axis] != size:
            shape = f"returns an array of shape {part.type.dims}, expected {kind.dims}"
            raise NotTypedError(shape)
    if part.type.packed and part.type.kind == "float":
        count = 1
        for size in kind.dims:
            count *= size or 1
        body.put(f"copy_numbers({name}, {part.text}, {count});")
        return
    body.fill(Value(kind, (name,)), part)
