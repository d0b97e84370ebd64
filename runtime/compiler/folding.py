"""Constant folding: branches that a block never takes are dropped before it is compiled.

In go statements in which attributes are constants already, out come those that can be reached:

    if "euler" == "rk4":        return x + dt * rate
        return rk4(x)
    return x + dt * rate

A test is visited before its branches: what the block never runs may hold what does not compile.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

COMPARE: dict[type, Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
}


class Folding(ast.NodeTransformer):
    """Visits tests before branches: a branch that is never taken is not visited."""

    def visit_If(self, node: ast.If) -> Any:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            return self.block(node.body if node.test.value else node.orelse)
        node.body = self.block(node.body) or [ast.Pass()]
        node.orelse = self.block(node.orelse)
        return node

    def block(self, body: list[ast.stmt]) -> list[ast.stmt]:
        """Visit statements in order, up to the first return or raise."""
        done: list[ast.stmt] = []
        for statement in body:
            result = self.visit(statement)
            done += result if isinstance(result, list) else [result] if result is not None else []
            if done and isinstance(done[-1], (ast.Return, ast.Raise)):
                break
        return done

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            return self.visit(node.body if node.test.value else node.orelse)
        node.body, node.orelse = self.visit(node.body), self.visit(node.orelse)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        decides = isinstance(node.op, ast.Or)
        left: list[ast.expr] = []
        for at, value in enumerate(node.values):
            value = self.visit(value)
            if isinstance(value, ast.Constant) and isinstance(value.value, bool):
                if value.value is decides:
                    # What a call before it changes, or draws, stays.
                    called = any(isinstance(n, ast.Call) for term in left for n in ast.walk(term))
                    left = [*left, value] if called else [value]
                    break
                if at < len(node.values) - 1:
                    continue
            left.append(value)
        return left[0] if len(left) == 1 else ast.BoolOp(node.op, left)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        self.generic_visit(node)
        if isinstance(node.op, ast.Not) and isinstance(node.operand, ast.Constant):
            return ast.Constant(not node.operand.value)
        return node

    def visit_Compare(self, node: ast.Compare) -> Any:
        self.generic_visit(node)
        if len(node.ops) == 1 and type(node.ops[0]) in COMPARE:
            left, right = node.left, node.comparators[0]
            if isinstance(left, ast.Constant) and isinstance(right, ast.Constant):
                return ast.Constant(COMPARE[type(node.ops[0])](left.value, right.value))
        return node


def holds_one(node: ast.expr, state: object) -> bool:
    """Whether an expression is a state without axes, ``state.x`` of ``x = State()``."""
    if not isinstance(node, ast.Attribute) or ast.unparse(node.value) != "state":
        return False
    value = getattr(state, node.attr, None)
    return isinstance(value, np.ndarray) and value.ndim == 0
