"""Assignments to names, tuples and elements.

In go a target of the source and a value, out come statements:

    x, a[0] = a[0], x       const double value_1_ = a[0];
                            const double value_2_ = x;
                            x = value_1_;
                            a[0] = value_2_;
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from functools import partial

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.body import Body
from runtime.codegen.deciding import calls
from runtime.codegen.expressions import indices_of, operated, value_of
from runtime.codegen.form import Literal, Set, names
from runtime.codegen.types import FLOAT, INT, Array, NotTypedError, Number, Tuple
from runtime.codegen.values import Value, array_type, converted, given, number, parts_of, size_expr

# Signs of operators that C has as one statement, for numbers of one type.
SIGNS: dict[type[ast.operator], str] = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}


def pairwise(body: Body, targets: Sequence[ast.expr], values: Sequence[Value]) -> None:
    """Assign values to targets, as if all at once."""
    ready = list(values)
    for i, target in enumerate(targets):
        if any(_uses(body, value, target) for value in ready[i + 1 :]):
            ready = [body.kept(value) for value in ready]
            break
    for target, value in zip(targets, ready, strict=True):
        assign_to(body, target, value)


def _uses(body: Body, value: Value, target: ast.expr) -> bool:
    """Whether a value depends on a target that is assigned before it."""
    if isinstance(target, ast.Subscript):
        return value.reads or isinstance(value.type, Array)
    if isinstance(target, (ast.Tuple, ast.List)):
        return any(_uses(body, value, part) for part in target.elts)
    if not isinstance(target, ast.Name):
        return True
    own = body.names_of(target.id)
    return any(name in own for leaf in value.leaves for name in names(leaf))


def assign_to(body: Body, target: ast.expr, value: Value) -> None:
    """Assign a value to a target."""
    if isinstance(target, ast.Name):
        if target.id in body.function.loaded or value.each is not None:
            body.assign(target.id, value)
        else:
            body.reached(value)
    elif isinstance(target, (ast.Tuple, ast.List)):
        pairwise(body, target.elts, _unpack(body, value, len(target.elts)))
    elif isinstance(target, ast.Subscript):
        _write_to(body, target, value)
    else:
        raise NotTypedError(f"assigns to '{ast.unparse(target)}'")


def _unpack(body: Body, value: Value, wanted: int) -> list[Value]:
    """The parts of a tuple, or the rows of an array, that are assigned to so many targets."""
    value = given(value)
    if isinstance(value.type, Array):
        value = body.stored(value)
        message = f"expected {wanted} values to unpack, got {{index}}"
        body.same_size(size_expr(value, 0), Literal(wanted), "ValueError", message)
        return [arrays.subscript(body, value, [number(i)]) for i in range(wanted)]
    parts = parts_of(value)
    if len(parts) != wanted:
        raise NotTypedError(f"unpacks {len(parts)} values into {wanted}")
    return parts


def _write_to(body: Body, target: ast.Subscript, value: Value) -> None:
    """``a[...] = value``."""
    array = value_of(body, target.value)
    if not isinstance(array.type, Array) or array.each is not None:
        raise NotTypedError(f"assigns to a part of a {array.type}")
    value = body.stored(value)
    if calls(target.slice):
        value = body.kept(value)
    indices = indices_of(body, target.slice, array, stored=True)
    chosen = _selection(indices)
    if chosen is not None:
        builtins.select_and_write(body, array, chosen, value)
        return
    place = arrays.subscript(body, array, indices)
    if isinstance(place.type, Array):
        if isinstance(value.type, Tuple):
            value = creation.as_array(body, value)
        arrays.write(body, place, value)
        return
    if array_type(array).frozen:
        raise NotTypedError(arrays.FROZEN)
    if isinstance(value.type, Array):
        value = library.item(body, value)
    body.change()
    kind = arrays.elements(array)
    if kind == INT and value.type == FLOAT:
        value = scalars.whole(body, value)
    body.act(Set(place.expr, converted(scalars.as_number(value), kind).expr))


def _selection(indices: Sequence[arrays.Index]) -> Value | None:
    """The array that selects elements, if the first index is one."""
    first = indices[0] if indices else None
    return first if isinstance(first, Value) and isinstance(first.type, Array) else None


def augment(body: Body, node: ast.AugAssign) -> None:
    """``x += value`` and ``a[i] += value``."""
    target = node.target
    if isinstance(target, ast.Name):
        name = ast.Name(target.id, ast.Load(), lineno=node.lineno)
        before, value = body.in_order(partial(value_of, body, n) for n in (name, node.value))
        _augment(body, target, before, value, node.op)
    elif isinstance(target, ast.Subscript):
        _augmented_part(body, target, node)
    else:
        raise NotTypedError(f"assigns to '{ast.unparse(target)}'")


def _augment(body: Body, target: ast.Name, before: Value, value: Value, op: ast.operator) -> None:
    """``x += value`` of a variable; arrays change in place."""
    if isinstance(before.type, Array):
        arrays.write(body, before, operated(body, op, before, value))
        return
    if isinstance(before.type, Tuple):
        raise NotTypedError("extends a list or tuple in place; write x = x + y")
    made = operated(body, op, before, value)
    sign = SIGNS.get(type(op))
    folded = isinstance(before.type, Number) and made.type == before.type and made.is_known
    if sign and not folded and made.type == FLOAT and before.type == FLOAT:
        own = [place for place in before.leaves if place in body.places_of(target.id)]
        if own:
            body.add(Set(own[0], converted(value, made.type).expr, sign))
            return
    body.assign(target.id, made)


def _augmented_part(body: Body, target: ast.Subscript, node: ast.AugAssign) -> None:
    """``a[i] += value``; the index is evaluated once."""
    array = value_of(body, target.value)
    indices = [
        body.kept(i) if isinstance(i, Value) else i
        for i in indices_of(body, target.slice, array, stored=True)
    ]
    chosen = _selection(indices)
    if chosen is not None:
        selected = partial(builtins.selected, body, array, chosen)
        before, value = body.in_order([selected, partial(value_of, body, node.value)])
        made = operated(body, node.op, before, value)
        builtins.select_and_write(body, array, chosen, made)
        return
    # An element is read before the value is evaluated; of a part, Python takes a view.
    place = arrays.subscript(body, array, indices)
    before, value = body.in_order([lambda: place, partial(value_of, body, node.value)])
    if array_type(array).frozen:
        raise NotTypedError(arrays.FROZEN)
    made = operated(body, node.op, before, value)
    if isinstance(place.type, Array):
        arrays.write(body, place, made)
        return
    body.change()
    kind = arrays.elements(array)
    sign = SIGNS.get(type(node.op))
    if sign and kind == FLOAT and made.type == FLOAT and before is place:
        body.act(Set(place.expr, converted(value, kind).expr, sign))
        return
    made = scalars.whole(body, made) if kind == INT and made.type == FLOAT else made
    body.act(Set(place.expr, converted(made, kind).expr))
