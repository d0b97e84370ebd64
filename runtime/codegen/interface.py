"""How other units call a method: numbers by value, everything else by pointers to numbers.

In go the arguments and results of an entry, out come its C parameters and copies of its outputs:

    [("pose", Tuple((FLOAT, FLOAT)))], [FLOAT]     (..., const double *pose, double *out0)
                                                   out0[0] = output(pose[0], pose[1]);
"""

from __future__ import annotations

from runtime.codegen.body import Body
from runtime.codegen.form import Call, Do, Expr, Item, Literal, Name, Set, product
from runtime.codegen.names import local_name
from runtime.codegen.source import Entry
from runtime.codegen.types import C_NAMES, FLOAT, Array, NotTypedError, Number, Tuple, Type
from runtime.codegen.values import (
    Value,
    array_type,
    converted,
    group,
    parts_of,
    size_expr,
    sizes_of,
)

Parameter = tuple[str, str]  # the C type, and the name


def given(name: str, kind: Type, parameters: list[Parameter]) -> Value:
    """An argument from another unit; adds its C parameters."""
    plain = local_name(name)
    if isinstance(kind, Number):
        parameters.append((C_NAMES[kind.kind], plain))
        return Value(kind, (Name(plain),))
    if isinstance(kind, Array):
        parameters.append((f"{'const ' if kind.frozen else ''}double *", plain))
        return Value(kind, (Name(plain), *_sizes(plain, kind, parameters)))
    if isinstance(kind, Tuple):
        if kind.parts and all(part == FLOAT for part in kind.parts) and not name.endswith("..."):
            parameters.append(("const double *", plain))
            return Value(kind, tuple(Item(Name(plain), Literal(i)) for i in range(len(kind.parts))))
        stem = name.removesuffix("...")
        made = [given(f"{stem}_{i}", part, parameters) for i, part in enumerate(kind.parts)]
        return group(made)
    raise NotTypedError(f"takes a {kind} as an argument")


def _sizes(name: str, kind: Array, parameters: list[Parameter]) -> list[Expr]:
    """The parameters with the sizes of an array that are known only while running."""
    names = [f"{name}_n{axis}" for axis, size in enumerate(kind.dims) if size is None]
    parameters += [("int64_t", each) for each in names]
    return [Name(each) for each in names]


def results(body: Body, entry: Entry, found: Value, parameters: list[Parameter]) -> None:
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
        out = Name(f"out{i}")
        parameters.append(("double *", out.name))
        if isinstance(kind, Array):
            sizes = _sizes(out.name, kind, parameters)
            _array_result(body, part, Value(kind, (out, *sizes)))
            continue
        try:
            numbers = converted(part, kind)
        except NotTypedError:
            raise NotTypedError(f"returns a {part.type}, expected a {kind}") from None
        for at, leaf in enumerate(numbers.leaves):
            body.add(Set(Item(out, Literal(at)), leaf))


def _array_result(body: Body, part: Value, target: Value) -> None:
    """Copy an array, or a tuple of numbers, of the right shape to an output."""
    kind = array_type(target)
    if isinstance(part.type, Tuple) and kind.dims == (len(part.type.parts),):
        for at, entry in enumerate(parts_of(part)):
            body.add(Set(Item(target.expr, Literal(at)), converted(entry, FLOAT).expr))
        return
    if not isinstance(part.type, Array) or len(part.type.dims) != len(kind.dims):
        raise NotTypedError(f"returns a {part.type}, expected an array of shape {kind.dims}")
    for axis, size in enumerate(kind.dims):
        have = part.type.dims[axis]
        if have is not None and size is not None and have != size:
            raise NotTypedError(f"returns an array of shape {part.type.dims}, expected {kind.dims}")
        message = "an output has {index} elements along an axis, expected {size}"
        body.same_size(size_expr(part, axis), size_expr(target, axis), "ValueError", message)
    if part.type.packed and part.type.kind == "float":
        count = product(sizes_of(target))
        body.add(Do(Call("copy_numbers", (target.expr, part.expr, count))))
        return
    body.fill(target, part)
