"""Calls and comprehensions of the source.

In go a call, out comes its value: of a function of the unit by the unit, of one of Python, ``math``
or NumPy by its form in ``builtins``, ``scalars`` or ``library``.

    tuple(2.0 * x for x in pair)      two values, written out
    np.clip(a, 0.0, 1.0)              library.FUNCTIONS["clip"]
"""

from __future__ import annotations

import ast
from collections.abc import Sequence

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.assigning import assign_to
from runtime.codegen.body import Body
from runtime.codegen.deciding import is_instance, is_module, is_strict
from runtime.codegen.expressions import each, reads, value_of
from runtime.codegen.types import Array, NotTypedError, unknown_call
from runtime.codegen.values import UNKNOWN, Value, group, number, parts_of


@reads(ast.Call)
def _call(body: Body, node: ast.Call) -> Value:
    function = node.func
    if isinstance(function, ast.Name):
        return _named(body, node, function.id)
    if isinstance(function, ast.Attribute):
        owner = function.value
        if ast.unparse(owner).startswith(("np.", "math.")):
            name = ast.unparse(function)
            raise NotTypedError(f"calls {name}, which is not compiled; write the loop")
        whole = not is_module(owner)
        values, options = _arguments(body, [*([owner] if whole else []), *node.args], node)
        if whole:
            return library.method(body, values[0], function.attr, values[1:], options)
        if isinstance(owner, ast.Name) and owner.id == "math" and not options:
            return scalars.function(body, function.attr, values)
        if function.attr in creation.KINDS and not any(isinstance(v.type, Array) for v in values):
            convert = builtins.BUILTINS[function.attr.rstrip("_64")]
            return library.applied(f"np.{function.attr}", convert, body, values, options)
        return library.numpy(body, function.attr, values, options)
    raise NotTypedError(unknown_call(ast.unparse(function)))


def _arguments(
    body: Body, nodes: Sequence[ast.expr], call: ast.Call
) -> tuple[list[Value], dict[str, Value]]:
    """The values of a call's arguments, and of its keywords, in order."""
    names = [keyword.arg for keyword in call.keywords]
    if None in names:
        raise NotTypedError("calls with '**'; write the keywords")
    values = each(body, [*nodes, *(keyword.value for keyword in call.keywords)])
    first = len(values) - len(names)
    return values[:first], dict(zip(map(str, names), values[first:], strict=True))


def _named(body: Body, node: ast.Call, name: str) -> Value:
    """A call of a function of the unit, or of one that Python has."""
    if name in body.function.counts:
        raise NotTypedError(f"calls the variable '{name}'")
    target = body.caller.source.functions.get(name)
    if target is not None:
        own = node.args[1:] if target.bound else node.args
        values, options = _arguments(body, own, node)
        return body.caller.call(body, target, values, options)
    if name == "isinstance" and len(node.args) == 2:
        # Known while compiling, but an error of the operand comes all the same.
        value = body.reached(value_of(body, node.args[0]))
        return number(is_instance(value, node.args[1]))
    if name == "tuple" and len(node.args) == 1:
        return _as_tuple(body, node.args[0])
    function = builtins.BUILTINS.get(name)
    if function is None:
        raise NotTypedError(unknown_call(ast.unparse(node)))
    return library.applied(name, function, body, *_arguments(body, node.args, node))


def _as_tuple(body: Body, node: ast.expr) -> Value:
    """``tuple(...)`` of a tuple, a comprehension over tuples, or an array of known length."""
    if isinstance(node, (ast.ListComp, ast.GeneratorExp)):
        return _comprehension(body, node)
    value = value_of(body, node)
    if isinstance(value.type, Array) and len(value.type.dims) == 1:
        size = value.type.dims[0]
        if size is None:
            raise NotTypedError("makes a tuple of an array of unknown length")
        value = body.stored(value)
        parts = [arrays.subscript(body, value, [number(i)]) for i in range(size)]
        return group([body.kept(part) for part in parts])
    parts_of(value)
    return value


@reads(ast.ListComp)
def _comprehension(body: Body, node: ast.ListComp | ast.GeneratorExp) -> Value:
    """A comprehension over tuples, written out."""
    (loop,) = node.generators if len(node.generators) == 1 else (None,)
    if loop is None or loop.ifs:
        raise NotTypedError("uses a comprehension with a condition; write the loop")
    found = []
    for part in items_of(body, loop.iter):
        assign_to(body, loop.target, part)
        found.append(body.kept(value_of(body, node.elt)))
    return group(found)


@reads(ast.GeneratorExp)
def _generator(body: Body, node: ast.GeneratorExp) -> Value:
    before = body.changes
    made = _comprehension(body, node)
    if body.changes > before:
        # any(...) and all(...) would stop before some of them.
        raise NotTypedError("changes something in a generator expression; write the loop")
    return made


def items_of(body: Body, node: ast.expr) -> list[Value]:
    """The items of a tuple, of a zip of tuples, or of a range of known length."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        name = node.func.id if node.func.id not in body.function.counts else ""
        if name == "zip" or (name == "enumerate" and len(node.args) == 1 and not node.keywords):
            return combined(name, node, [items_of(body, part) for part in node.args])
        if name == "range":
            bounds = [value_of(body, part) for part in node.args]
            if all(b.const is not UNKNOWN for b in bounds):
                return [number(i) for i in range(*[int(b.const) for b in bounds])]
    return items_in(body, value_of(body, node))


def items_in(body: Body, value: Value) -> list[Value]:
    """The items of a tuple, or of an array of known length."""
    if isinstance(value.type, Array) and value.type.dims[0] is not None:
        value = body.stored(value)
        rows = range(value.type.dims[0])  # type: ignore[union-attr,arg-type]
        return [arrays.subscript(body, value, [number(i)]) for i in rows]
    return [body.kept(part) for part in parts_of(value)]


def combined(name: str, call: ast.Call, columns: Sequence[list[Value]]) -> list[Value]:
    """The items of ``zip`` or ``enumerate`` of these items."""
    if name == "zip":
        if is_strict(call) and len({len(column) for column in columns}) > 1:
            raise NotTypedError("zips tuples of different lengths with strict=True")
        return [group(list(row)) for row in zip(*columns, strict=False)]
    if name != "enumerate" or len(columns) != 1 or call.keywords:
        raise NotTypedError(unknown_call(ast.unparse(call)))
    return [group([number(i), item]) for i, item in enumerate(columns[0])]
