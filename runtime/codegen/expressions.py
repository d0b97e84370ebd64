"""Expressions of the source as values: names, operators, comparisons, subscripts.

In go nodes of Python's syntax tree, out come typed values; what they need done before them is added
to the body. ``READERS`` has a function for each type of node, calls and comprehensions included
(``calls``); a node without one is refused.

    x if x > 0.0 else self.gain     Value(FLOAT, (Choice(x > 0.0, x, gain),))
    a[i] + b                        Value(FLOAT, (Operator("+", Item(a, i), b),))
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.body import Body
from runtime.codegen.deciding import both, calls, constant, identical, lowest
from runtime.codegen.form import Choice, Declare, If, Name, Set, Statement, Table
from runtime.codegen.types import (
    BOOL,
    C_NAMES,
    INT,
    NONE,
    Array,
    Known,
    Maybe,
    NotTypedError,
    Number,
    Tuple,
    join,
    leaves,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    given,
    group,
    known,
    none,
    number,
    parts_of,
    size_of,
)

READERS: dict[type[ast.expr], Callable[[Body, Any], Value]] = {}


Reader = TypeVar("Reader", bound=Callable[[Body, Any], Value])


def reads(*kinds: type[ast.expr]) -> Callable[[Reader], Reader]:
    """The function below reads these nodes."""

    def register(function: Reader) -> Reader:
        READERS.update(dict.fromkeys(kinds, function))
        return function

    return register


def value_of(body: Body, node: ast.expr) -> Value:
    """The value of an expression.

    Raises
    ------
    NotTypedError : it is outside the compiled subset.
    """
    line = getattr(node, "lineno", None)
    body.line = body.function.line + line if line else body.line
    reader = READERS.get(type(node))
    if reader is None:
        raise NotTypedError(f"holds a {type(node).__name__}, which is not compiled")
    return reader(body, node)


def each(body: Body, nodes: Sequence[ast.expr]) -> list[Value]:
    """The values of expressions that are evaluated from left to right."""
    inner = [node.value if isinstance(node, ast.Starred) else node for node in nodes]
    values = body.in_order(partial(value_of, body, node) for node in inner)
    found: list[Value] = []
    for node, value in zip(nodes, values, strict=True):
        found += parts_of(value) if isinstance(node, ast.Starred) else [value]
    return found


# Names and constants


@reads(ast.Constant)
def _constant(body: Body, node: ast.Constant) -> Value:
    if node.value is None:
        return none()
    if isinstance(node.value, (bool, int, float)):
        return number(node.value)
    if isinstance(node.value, str):
        return known(node.value)
    raise NotTypedError(f"uses {node.value!r}")


@reads(ast.Name)
def _name(body: Body, node: ast.Name) -> Value:
    name = node.id
    if body.is_local(name):
        return body.read(name)
    if body.function.bound and name in body.caller.source.entries:
        return body.entry(name)
    if name in ("float", "int", "bool"):
        return known(name)
    raise NotTypedError(f"uses '{name}'")


@reads(ast.Attribute)
def _attribute(body: Body, node: ast.Attribute) -> Value:
    if isinstance(node.value, ast.Name) and node.value.id in ("math", "np"):
        return constant(node.value.id, node.attr)
    value = value_of(body, node.value)
    if isinstance(value.type, Array):
        axes = range(len(value.type.dims))
        if node.attr == "shape":
            return group([size_of(value, k) for k in axes])
        if node.attr == "ndim":
            return number(len(axes))
        if node.attr == "size":
            return library.size(value)
        if node.attr == "T":
            return arrays.transposed(body.stored(value))
        if node.attr == "flat":
            return library.ravel(body, value)
    raise NotTypedError(f"reads '{ast.unparse(node)}'")


@reads(ast.Tuple, ast.List)
def _tuple(body: Body, node: ast.Tuple | ast.List) -> Value:
    return group([body.reached(body.stored(v)) for v in each(body, node.elts)])


# Operators


@reads(ast.UnaryOp)
def _unary(body: Body, node: ast.UnaryOp) -> Value:
    value = value_of(body, node.operand)
    if isinstance(node.op, ast.Not):
        return scalars.inverted(truth(body, value))
    if isinstance(node.op, ast.USub):
        return library.negated(body, value)
    is_bool = arrays.elements(value) == BOOL
    if isinstance(node.op, ast.UAdd) and not is_bool:
        return value
    if isinstance(node.op, ast.Invert) and is_bool and isinstance(value.type, Array):
        return library.lifted(body, [value], scalars.inverted, BOOL)
    raise NotTypedError("inverts bits, or gives a bool a sign; use 'not' or int(...)")


@reads(ast.BinOp)
def _binary(body: Body, node: ast.BinOp) -> Value:
    a, b = each(body, [node.left, node.right])
    return operated(body, node.op, a, b)


def operated(body: Body, op: ast.operator, a: Value, b: Value) -> Value:
    """A binary operator."""
    if isinstance(a.type, Tuple) and isinstance(b.type, Tuple) and isinstance(op, ast.Add):
        return group([*parts_of(a), *parts_of(b)])
    if isinstance(a.type, Tuple) and isinstance(op, ast.Mult) and b.type == INT and b.is_known:
        return group(parts_of(a) * int(b.const))
    if isinstance(op, ast.MatMult):
        return library.matmul(body, a, b)
    if isinstance(a.type, Array) or isinstance(b.type, Array):
        # A tuple that is combined with an array is one.
        a, b = (creation.as_array(body, v) if isinstance(v.type, Tuple) else v for v in (a, b))
    return library.operator(body, op, [a, b])


@reads(ast.Compare)
def _compare(body: Body, node: ast.Compare) -> Value:
    a, b = each(body, [node.left, node.comparators[0]])
    return _compared_on(body, node.ops, a, b, node.comparators[1:])


def _compared_on(
    body: Body, ops: Sequence[ast.cmpop], a: Value, b: Value, nodes: Sequence[ast.expr]
) -> Value:
    """``a < b < ...``: what follows is evaluated only if the first comparison holds."""
    if not nodes:
        return compared(body, ops[0], a, b)
    b = body.kept(b)
    first = compared(body, ops[0], a, b)

    def rest() -> Value:
        return _compared_on(body, ops[1:], b, value_of(body, nodes[0]), nodes[1:])

    return _decided(body, first, rest, "&&")


def compared(body: Body, op: ast.cmpop, a: Value, b: Value) -> Value:
    """One comparison."""
    if isinstance(op, (ast.Is, ast.IsNot, ast.Eq, ast.NotEq)):
        same = identical(a, b)
        if same is not None:
            # Known while compiling, but an error of an operand comes all the same.
            a, b = body.reached(a), body.reached(b)
            return scalars.inverted(same) if isinstance(op, (ast.IsNot, ast.NotEq)) else same
    if isinstance(op, (ast.In, ast.NotIn)):
        a = body.kept(a)
        found = both([compared(body, ast.Eq(), a, part) for part in parts_of(b)], "||")
        return scalars.inverted(found) if isinstance(op, ast.NotIn) else found
    if isinstance(a.type, Tuple) and isinstance(b.type, Tuple):
        pairs = zip(parts_of(a), parts_of(b), strict=False)
        if isinstance(op, (ast.Eq, ast.NotEq)) and len(a.type.parts) == len(b.type.parts):
            found = both([compared(body, ast.Eq(), x, y) for x, y in pairs], "&&")
            return scalars.inverted(found) if isinstance(op, ast.NotEq) else found
    return library.compared(body, op, [a, b])


def truth(body: Body, value: Value) -> Value:
    """Whether a value counts as true."""
    if isinstance(value.type, Known):
        return number(bool(value.type.value))
    if isinstance(value.type, Tuple):
        return number(bool(value.type.parts))
    if isinstance(value.type, Maybe):
        return Value(BOOL, value.leaves[:1])
    if isinstance(value.type, Array):
        value = library.item(body, value)
    return scalars.truth(value)


@reads(ast.BoolOp)
def _bool_op(body: Body, node: ast.BoolOp) -> Value:
    return _chained(body, node.values, "&&" if isinstance(node.op, ast.And) else "||")


def _chained(body: Body, nodes: Sequence[ast.expr], sign: str) -> Value:
    """``and`` and ``or``: the right side is evaluated only if the left does not decide."""
    first = value_of(body, nodes[0])
    if len(nodes) == 1:
        return first
    tested = truth(body, first)
    if tested.const is not UNKNOWN:
        decides = bool(tested.const) == (sign == "||")
        return first if decides else _chained(body, nodes[1:], sign)
    first = first if first.type == BOOL else body.kept(first)
    return _decided(body, first, partial(_chained, body, nodes[1:], sign), sign)


def _decided(body: Body, first: Value, following: Callable[[], Value], sign: str) -> Value:
    """The first value if it decides, or else what follows, which is evaluated only then."""
    tested = truth(body, first)
    with body.branch() as statements:
        rest = following()
    if first.type == BOOL and rest.type == BOOL and not statements:
        return both([tested, rest], sign)
    branches = [(statements, rest), ([], first)]
    return _chosen(body, tested, *(branches if sign == "&&" else branches[::-1]))


@reads(ast.IfExp)
def _if_exp(body: Body, node: ast.IfExp) -> Value:
    test = truth(body, value_of(body, node.test))
    if test.const is not UNKNOWN:
        return value_of(body, node.body if test.const else node.orelse)
    branches = []
    for part in (node.body, node.orelse):
        with body.branch() as statements:
            value = body.stored(value_of(body, part))
        branches.append((statements, value))
    return _chosen(body, test, *branches)


Branch = tuple[list[Statement], Value]


def _chosen(body: Body, test: Value, yes: Branch, no: Branch) -> Value:
    """One of two values, each with the statements that compute it."""
    kind = join(yes[1].type, no[1].type)
    a, b = body.as_type(yes[1], kind), body.as_type(no[1], kind)
    if not yes[0] and not no[0] and isinstance(kind, Number):
        return Value(kind, (Choice(test.expr, a.expr, b.expr),), low=lowest(a, b))
    name = body.fresh("chosen")
    targets = [Name(f"{name}{suffix}") for suffix, _ in leaves(kind)]
    for target, (_, c_type) in zip(targets, leaves(kind), strict=True):
        body.add(Declare(c_type, target.name, const=False))
    first, second = (
        [*branch[0], *(Set(place, leaf) for place, leaf in zip(targets, value.leaves, strict=True))]
        for branch, value in ((yes, a), (no, b))
    )
    body.add(If(test.expr, first, second))
    return Value(kind, tuple(targets))


# Subscripts


@reads(ast.Subscript)
def _subscript(body: Body, node: ast.Subscript) -> Value:
    value = given(value_of(body, node.value))
    if isinstance(value.type, Tuple):
        return _part(body, body.kept(value) if calls(node.slice) else value, node.slice)
    if not isinstance(value.type, Array):
        raise NotTypedError(f"takes an element of a {value.type}")
    whole = isinstance(node.slice, ast.Constant) and node.slice.value is Ellipsis
    if whole and not value.type.dims:
        return value
    indices = indices_of(body, node.slice, value)
    if len(indices) == 1 and isinstance(indices[0], Value):
        chosen = indices[0]
        if isinstance(chosen.type, Array):
            return builtins.selected(body, value, chosen)
    return arrays.subscript(body, value, indices)


def _part(body: Body, value: Value, node: ast.expr) -> Value:
    """A part of a tuple, or some of them."""
    parts = parts_of(value)
    if isinstance(node, ast.Slice):
        bounds = [value_of(body, b) if b else None for b in (node.lower, node.upper, node.step)]
        if any(b is not None and b.const is UNKNOWN for b in bounds):
            raise NotTypedError("slices a tuple with bounds that are not literal numbers")
        first, last, step = (None if b is None else int(b.const) for b in bounds)
        return group(parts[first:last:step])
    index = value_of(body, node)
    if index.const is not UNKNOWN:
        if not -len(parts) <= int(index.const) < len(parts):
            raise NotTypedError(f"takes part {index.const} of {len(parts)}")
        return parts[int(index.const)]
    kind = parts[0].type if parts else NONE
    if not isinstance(kind, Number) or any(p.type != kind for p in parts):
        return builtins.picked(body, parts, index)
    name = body.fresh("array")
    body.add(Table(C_NAMES[kind.kind], name, tuple(part.expr for part in parts)))
    held = Value(Array(kind.kind, (len(parts),), frozen=True), (Name(name, True),))
    return arrays.subscript(body, held, [index])


def indices_of(
    body: Body, node: ast.expr, array: Value, stored: bool = False
) -> list[arrays.Index]:
    """The indices of a subscript, ``stored`` to or read; ``...`` stands for whole axes."""
    nodes = node.elts if isinstance(node, ast.Tuple) else [node]
    found: list[arrays.Index] = []
    before = body.changes
    axes = len(array.type.dims) if isinstance(array.type, Array) else 0
    for part in nodes:
        if isinstance(part, ast.Constant) and part.value is Ellipsis:
            found += [arrays.Cut()] * (axes - len(nodes) + 1)
            if axes < len(nodes) and axes and not stored:
                raise NotTypedError("takes an element with '...', which is an array of one")
        elif isinstance(part, ast.Slice):
            found.append(_cut(body, part))
        else:
            value = value_of(body, part)
            found += parts_of(value) if isinstance(value.type, Tuple) else [value]
    if body.changes > before and len(nodes) > 1:
        raise NotTypedError("changes something in one of several indices; assign it before")
    return found


def _cut(body: Body, node: ast.Slice) -> arrays.Cut:
    bounds = [value_of(body, b) if b else None for b in (node.lower, node.upper)]
    bounds = [None if b is None or b.type == NONE else b for b in bounds]
    step = value_of(body, node.step) if node.step else number(1)
    if step.const is UNKNOWN or not isinstance(step.const, int):
        raise NotTypedError("uses a slice with a step that is not a literal number")
    return arrays.Cut(bounds[0], bounds[1], step.const)


__all__ = ["each", "indices_of", "operated", "reads", "truth", "value_of"]
