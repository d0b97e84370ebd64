"""What is decided while compiling: constants, types, and conditions that depend on them.

In go values or nodes, out come answers that drop a branch before anything is built for it:

    identical(none(), x), x a float    number(False): ``if x is None`` is never taken
    both([test, number(True)], "&&")   test
"""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from runtime.codegen import scalars
from runtime.codegen.creation import KINDS
from runtime.codegen.form import Logic
from runtime.codegen.types import (
    BOOL,
    INT,
    NONE,
    Array,
    Draws,
    Known,
    Maybe,
    NotTypedError,
    Number,
    Tuple,
)
from runtime.codegen.values import UNKNOWN, Value, known, none, number


def both(values: Sequence[Value], sign: str) -> Value:
    """``&&`` or ``||`` of conditions."""
    left: list[Value] = []
    for value in values:
        if value.const is UNKNOWN:
            left.append(value)
        elif bool(value.const) == (sign == "||") and not any(v.fails for v in left):
            return number(bool(value.const))
        elif bool(value.const) == (sign == "||"):
            left.append(value)
    if not left:
        return number(sign == "&&")
    if len(left) == 1:
        return left[0]
    if any(isinstance(v.type, Array) for v in left):
        raise NotTypedError("uses 'and' or a chained comparison on arrays")
    return Value(BOOL, (Logic(sign, tuple(value.expr for value in left)),))


def lowest(a: Value, b: Value) -> int | None:
    if a.type != INT or a.low is None or b.low is None:
        return None
    return min(a.low, b.low)


def identical(a: Value, b: Value) -> Value | None:
    """Whether values that are partly known while compiling are the same; None for others."""
    if isinstance(a.type, Known) and isinstance(b.type, Known):
        return number(a.type.value == b.type.value)
    for x, y in ((a, b), (b, a)):
        if x.type == NONE:
            if isinstance(y.type, Maybe):
                return scalars.inverted(Value(BOOL, y.leaves[:1]))
            return number(False)
        if isinstance(x.type, Known) and isinstance(y.type, (Number, Tuple, Array)):
            return number(False)
    return None


def is_module(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id in ("math", "np")


def calls(node: ast.expr) -> bool:
    """Whether an expression calls something."""
    return any(isinstance(part, ast.Call) for part in ast.walk(node))


def is_strict(node: ast.Call) -> bool:
    """Whether ``zip`` is called with ``strict=True``.

    Raises
    ------
    NotTypedError : it has another keyword, or the keyword is no literal.
    """
    for keyword in node.keywords:
        if keyword.arg != "strict" or not isinstance(keyword.value, ast.Constant):
            raise NotTypedError(f"calls '{ast.unparse(node)}' with a keyword; write the loop")
    return any(keyword.value.value for keyword in node.keywords)  # type: ignore[attr-defined]


def constant(module: str, name: str) -> Value:
    found: Any = getattr(math if module == "math" else np, name, None)
    if isinstance(found, (bool, int, float)):
        return number(found)
    if module == "np" and name in KINDS:
        return known(name)
    if found is None and name == "newaxis":
        return none()
    raise NotTypedError(f"uses '{module}.{name}', which is not compiled")


def is_instance(value: Value, kinds: ast.expr) -> bool:
    names = [ast.unparse(n) for n in (kinds.elts if isinstance(kinds, ast.Tuple) else [kinds])]
    kind = value.type
    if isinstance(kind, Draws) or (isinstance(kind, Number) and kind.kind != "float"):
        # NumPy's integers and bools are no int and no bool.
        raise NotTypedError(f"tests the type of a {kind}")
    of = {
        "tuple": isinstance(kind, Tuple),
        "np.ndarray": isinstance(kind, Array),
        "float": isinstance(kind, Number) and kind.kind == "float",
        "int": False,
        "bool": False,
        "str": isinstance(kind, Known) and isinstance(kind.value, str),
    }
    if any(name not in of for name in names):
        raise NotTypedError(f"tests for {ast.unparse(kinds)}")
    return any(of[name] for name in names)
