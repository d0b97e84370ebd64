"""Loops of the source.

In go a ``for`` or ``while`` of the source, out comes a loop of the form, or its rounds one by one:

    for i in range(n):          For("i", 0, n, 1, [...])
    for x, y in zip(a, b):      For("i_1_", 0, int_least(a_n0, b_n0), 1, [x = a[i_1_]; ...])
    for x in (1.0, 2.0):        Block([x = 1.0; ...]), Block([x = 2.0; ...])
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence

from runtime.codegen import arrays, scalars
from runtime.codegen.assigning import assign_to
from runtime.codegen.body import Body
from runtime.codegen.builtins import chosen
from runtime.codegen.calls import combined, items_in, items_of
from runtime.codegen.deciding import is_strict
from runtime.codegen.expressions import each, truth, value_of
from runtime.codegen.form import (
    Block,
    Call,
    Declare,
    Expr,
    For,
    If,
    Jump,
    Literal,
    Name,
    Prefix,
    While,
)
from runtime.codegen.source import ANY_ORDER
from runtime.codegen.types import INT, Array, NotTypedError, Tuple, join, leaves
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    converted,
    group,
    number,
    parts_of,
    size_expr,
)

Rounds = Callable[[Sequence[ast.stmt]], object]


def while_loop(body: Body, node: ast.While, rounds: Rounds) -> None:
    """``while``; ``rounds`` builds the statements inside."""
    if node.orelse:
        raise NotTypedError("uses 'else' after a loop")
    with body.branch() as statements:
        test = truth(body, value_of(body, node.test))
        if test.const is not UNKNOWN and not test.const:
            return
        before = list(statements)
        if before:
            body.add(If(Prefix("!", test.expr), [Jump("break")]))
        rounds(node.body)
    body.add(While(None if before else test.expr, statements))


def for_loop(body: Body, node: ast.For, rounds: Rounds) -> None:
    """``for``; ``rounds`` builds the statements inside."""
    if node.orelse:
        raise NotTypedError("uses 'else' after a loop")
    source = node.iter
    if isinstance(source, ast.Call) and isinstance(source.func, ast.Name):
        name = source.func.id if source.func.id not in body.function.counts else ""
        if name == "range" and not source.keywords:
            _count(body, node, each(body, source.args), rounds)
            return
        nested = any(isinstance(a, ast.Call) and isinstance(a.func, ast.Name) for a in source.args)
        if name in ("enumerate", "zip", "reversed") and not nested:
            _along(body, node, name, source, rounds)
            return
        _over(body, node, items_of(body, source), rounds)
        return
    value = value_of(body, source)
    if isinstance(value.type, Array):
        _walk(body, node, [value], lambda items, i: items[0], rounds)
        return
    _over(body, node, parts_of(value), rounds)


def _along(body: Body, node: ast.For, name: str, call: ast.Call, rounds: Rounds) -> None:
    """``for`` over ``enumerate``, ``zip`` or ``reversed`` of arrays or tuples."""
    values = [body.stored(value) for value in each(body, call.args)]
    arrays_ = [isinstance(value.type, Array) for value in values]
    if name == "enumerate" and arrays_[:1] == [True]:
        if call.keywords or len(values) > 2:
            raise NotTypedError("calls enumerate with a keyword; write enumerate(x, start)")
        start = body.kept(values[1]) if len(values) > 1 else number(0)

        def numbered(items: list[Value], i: Value) -> Value:
            count = i if start.const == 0 else scalars.binary(body, ast.Add(), i, start)
            return group([count, items[0]])

        _walk(body, node, values[:1], numbered, rounds)
    elif name == "zip" and values and all(arrays_):
        if is_strict(call):
            sizes = [size_expr(value, 0) for value in values]
            for other in dict.fromkeys(sizes[1:]):
                message = "zip() arguments are of different lengths"
                body.same_size(sizes[0], other, "ValueError", message)
        _walk(body, node, values, lambda items, i: group(items), rounds)
    elif name == "zip" and any(arrays_) and any(_length(v) is None for v in values):
        raise NotTypedError("walks along arrays and tuples at once; write the loop")
    elif name == "reversed" and any(arrays_):
        raise NotTypedError("walks along an array from its end; write the loop over its index")
    else:
        # The arguments are not evaluated again: one of them may draw a random number.
        columns = [items_in(body, value) for value in values]
        _over(body, node, combined(name, call, columns), rounds)


def _walk(
    body: Body,
    node: ast.For,
    arrays_: Sequence[Value],
    make: Callable[[list[Value], Value], Value],
    rounds: Rounds,
) -> None:
    """A loop along the first axis of arrays."""
    values = [body.kept(body.stored(v)) for v in arrays_]
    sizes = list(dict.fromkeys(size_expr(v, 0) for v in values))
    size = sizes[0]
    for other in sizes[1:]:
        size = Call("int_least", (size, other))
    index = body.fresh("i")
    with body.branch() as statements:
        high = int(size.value) if isinstance(size, Literal) else size
        at = Value(INT, (Name(index),), low=0, high=high)
        items = [arrays.subscript(body, v, [at]) for v in values]
        assign_to(body, node.target, make(items, at))
        rounds(node.body)
    body.add(For(index, Literal(0), size, 1, statements))


def _count(body: Body, node: ast.For, bounds: Sequence[Value], rounds: Rounds) -> None:
    """``for i in range(...)``."""
    if any(b.type != INT for b in bounds):
        raise NotTypedError("counts with numbers that are no integers; use int(...)")
    start = bounds[0] if len(bounds) > 1 else number(0)
    stop = bounds[1] if len(bounds) > 1 else bounds[0]
    step = bounds[2] if len(bounds) > 2 else number(1)
    if step.const is UNKNOWN or step.const == 0:
        raise NotTypedError("counts with a step that is not a literal number")
    changed = _assigned(node.body)
    if not _is_fixed(body, stop, changed):
        stop = body.kept(stop, "stop")
    target = node.target
    own = isinstance(target, ast.Name) and target.id not in changed
    name = _loop_name(body, target.id) if own and isinstance(target, ast.Name) else ""
    index = name or body.fresh("k")
    low, high = _range_bounds(start, stop, step.const > 0)
    with body.branch() as statements:
        value = Value(INT, (Name(index),), low=low, high=high)
        if name and isinstance(target, ast.Name):
            _with_index(body, target.id, value, node, rounds)
        else:
            assign_to(body, target, value)
            rounds(node.body)
    free = node.type_comment == ANY_ORDER
    body.add(For(index, start.expr, stop.expr, int(step.const), statements, free))


def _range_bounds(start: Value, stop: Value, up: bool) -> tuple[int | None, int | Expr | None]:
    """The bounds of the index of a ``range``."""
    limit = stop if up else start
    low = start.low if up else (stop.low + 1 if stop.low is not None else None)
    if isinstance(limit.high, int):
        return low, limit.high - (1 if up else 0)
    return low, limit.expr if up and limit.expr.is_stable else None


def _loop_name(body: Body, name: str) -> str:
    """A C variable for a loop's index, if the source does not use it after the loop."""
    if name in body.function.loops_read_later:
        return ""
    plain = body.c_name(name)
    around = name in body.values and body.values[name].leaves == (Name(plain),)
    hides = around or name not in body.function.indices
    return body.fresh(plain) if hides else plain


def _with_index(body: Body, name: str, value: Value, node: ast.For, rounds: Rounds) -> None:
    """A loop's body with its index as a C variable of the loop."""
    before = body.values.get(name)
    key = f"{name}@{body.versions.get(name, 0)}"
    known = body.types.get(key)
    body.types[key] = INT
    body.values[name] = value
    rounds(node.body)
    if before is None:
        body.values.pop(name, None)
    else:
        body.values[name] = before
    if known is None:
        body.types.pop(key, None)
    else:
        body.types[key] = known


def _over(body: Body, node: ast.For, items: Sequence[Value], rounds: Rounds) -> None:
    """``for`` over a tuple: written out, or a loop that selects the item."""
    leaves_loop = any(
        isinstance(n, (ast.Break, ast.Continue)) for s in node.body for n in ast.walk(s)
    )
    small = len(node.body) <= 3 and not leaves_loop
    if not items:
        return
    if small or (len({item.type for item in items}) > 1 and not leaves_loop):
        for item in [body.kept(item) for item in items]:
            with body.branch() as statements:
                assign_to(body, node.target, item)
                rounds(node.body)
            body.add(Block(statements))
        return
    kind = items[0].type
    for item in items[1:]:
        kind = join(kind, item.type)
    ready = [body.kept(converted(item, kind)) for item in items]
    index, name = Name(body.fresh("k")), body.fresh("item")
    with body.branch() as statements:
        found: list[Expr] = []
        for at, (suffix, c_type) in enumerate(leaves(kind)):
            choice = chosen(index, [item.leaves[at] for item in ready])
            body.add(Declare(c_type, f"{name}{suffix}", choice, const=False))
            found.append(Name(f"{name}{suffix}"))
        assign_to(body, node.target, Value(kind, tuple(found)))
        rounds(node.body)
    body.add(For(index.name, Literal(0), Literal(len(items)), 1, statements))


def _length(value: Value) -> int | None:
    if isinstance(value.type, Tuple):
        return len(value.type.parts)
    return value.type.dims[0] if isinstance(value.type, Array) else None


def _assigned(statements: Sequence[ast.stmt]) -> set[str]:
    return {
        node.id
        for statement in statements
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }


def _is_fixed(body: Body, value: Value, changed: set[str]) -> bool:
    """Whether a loop's bound is a number or a variable that the loop does not change."""
    if value.const is not UNKNOWN or value.expr.is_stable:
        return True
    return isinstance(value.expr, Name) and value.expr.name not in {body.c_name(n) for n in changed}
