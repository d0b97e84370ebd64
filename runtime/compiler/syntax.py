"""Small syntax trees: what translation makes of values, and asks of those that it reads.

In go values or trees, out come trees, names and answers::

constant(-math.inf)                     -math.inf
entries_of(a, 3)                        (a[0], a[1], a[2])
assigned_names(for i in x: y = i)       {"i", "y"}
"""

from __future__ import annotations

import ast
import math
from typing import Any


def constant(value: Any) -> ast.expr:
    """A number or a text; infinity and NaN have no literal."""
    if not isinstance(value, float) or math.isfinite(value):
        return ast.Constant(value)
    name = ast.Attribute(ast.Name("math", ast.Load()), repr(abs(float(value))), ast.Load())
    return ast.UnaryOp(ast.USub(), name) if value < 0.0 else name


def entries_of(array: ast.expr, length: int) -> ast.Tuple:
    return ast.Tuple(
        [ast.Subscript(array, ast.Constant(i), ast.Load()) for i in range(length)], ast.Load()
    )


def without_list(node: ast.expr) -> ast.expr:
    """``a`` in place of ``a.tolist()`` where its elements are read one by one at once."""
    return node.func.value if is_call(node, "tolist") else node  # type: ignore[attr-defined]


def copied_list(node: ast.expr) -> ast.expr:
    """``a.copy()`` in place of ``a.tolist()`` where its elements are read one by one later."""
    if not is_call(node, "tolist"):
        return node
    method = ast.Attribute(node.func.value, "copy", ast.Load())  # type: ignore[attr-defined]
    return ast.copy_location(ast.Call(method, [], []), node)


def is_call(node: ast.expr, attribute: str) -> bool:
    return (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == attribute
        and not node.args
    )


def reads_name(node: ast.FunctionDef, name: str) -> bool:
    return any(isinstance(inner, ast.Name) and inner.id == name for inner in ast.walk(node))


def assigned_names(node: ast.AST) -> set[str]:
    return {
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }
