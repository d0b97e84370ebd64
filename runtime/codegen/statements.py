"""Statements of the source.

In go nodes of Python's syntax tree, out come statements of the form, added to the body.
``BUILDERS`` has a function for each type of node, which returns False if what follows is never
reached:

    if x is None:          nothing, where x is a number: the branch is never taken
        return 0.0
    return x               Return((x,))
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from runtime.codegen.assigning import assign_to, augment, pairwise
from runtime.codegen.body import Body
from runtime.codegen.expressions import each, truth, value_of
from runtime.codegen.form import Fail, If, Jump, Return
from runtime.codegen.loops import for_loop, while_loop
from runtime.codegen.types import NotTypedError
from runtime.codegen.values import UNKNOWN, none


def build(body: Body, statements: Sequence[ast.stmt]) -> bool:
    """Build statements; returns whether what follows them can be reached."""
    return all(_statement(body, statement) for statement in statements)


def _statement(body: Body, node: ast.stmt) -> bool:
    body.line = body.function.line + node.lineno if hasattr(node, "lineno") else body.line
    builder = BUILDERS.get(type(node))
    if builder is None:
        raise NotTypedError(f"holds a {type(node).__name__}, which is not compiled")
    return builder(body, node) is not False


def _pass(body: Body, node: ast.Pass) -> None:
    pass


def _expression(body: Body, node: ast.Expr) -> None:
    if not isinstance(node.value, ast.Constant):
        body.reached(body.stored(value_of(body, node.value)))


def _assign(body: Body, node: ast.Assign) -> None:
    if len(node.targets) == 1:
        _assign_one(body, node.targets[0], node.value)
        return
    value = body.kept(body.stored(value_of(body, node.value)))
    for target in node.targets:
        assign_to(body, target, value)


def _annotate(body: Body, node: ast.AnnAssign) -> None:
    if node.value is not None:
        _assign_one(body, node.target, node.value)


def _assign_one(body: Body, target: ast.expr, node: ast.expr) -> None:
    """``target = value``; tuples of equal length pair by pair."""
    if isinstance(target, ast.Tuple) and isinstance(node, ast.Tuple):
        starred = any(isinstance(e, ast.Starred) for e in (*target.elts, *node.elts))
        if len(target.elts) == len(node.elts) and not starred:
            pairwise(body, target.elts, [body.stored(value) for value in each(body, node.elts)])
            return
    assign_to(body, target, value_of(body, node))


def _if(body: Body, node: ast.If) -> bool:
    test = truth(body, value_of(body, node.test))
    if test.const is not UNKNOWN:
        return build(body, node.body if test.const else node.orelse)
    with body.branch() as first:
        first_falls = build(body, node.body)
    with body.branch() as second:
        second_falls = build(body, node.orelse)
    body.add(If(test.expr, first, second))
    return first_falls or second_falls


def _while(body: Body, node: ast.While) -> None:
    while_loop(body, node, partial(build, body))


def _for(body: Body, node: ast.For) -> None:
    for_loop(body, node, partial(build, body))


def _jump(body: Body, node: ast.Break | ast.Continue) -> bool:
    body.add(Jump(type(node).__name__.lower()))
    return False


def _return(body: Body, node: ast.Return) -> bool:
    value = none() if node.value is None else body.stored(value_of(body, node.value))
    body.add(Return(body.returns(value).leaves))
    return False


def _raise(body: Body, node: ast.Raise) -> bool:
    body.act(Fail(body.fail(*_raised(node))))
    return False


def _assert(body: Body, node: ast.Assert) -> None:
    raise NotTypedError("asserts; raise an exception")


BUILDERS: dict[type[ast.stmt], Callable[[Body, Any], bool | None]] = {
    **{ast.Pass: _pass, ast.Expr: _expression, ast.Assert: _assert, ast.Raise: _raise},
    **{ast.Assign: _assign, ast.AnnAssign: _annotate, ast.AugAssign: augment},
    **{ast.If: _if, ast.While: _while, ast.For: _for, ast.Return: _return},
    **{ast.Break: _jump, ast.Continue: _jump},
}


def _raised(node: ast.Raise) -> tuple[str, str]:
    """The exception and the message of a ``raise``; one that is computed as it is in the source."""
    call = node.exc
    if call is None:
        raise NotTypedError("raises an exception again")
    if not isinstance(call, ast.Call):
        return ast.unparse(call), ""
    message = call.args[0] if call.args else ast.Constant("")
    constant = isinstance(message, ast.Constant) and isinstance(message.value, str)
    text = message.value if constant else ast.unparse(message)  # type: ignore[attr-defined]
    return ast.unparse(call.func), str(text)
