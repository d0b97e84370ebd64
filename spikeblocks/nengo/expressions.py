"""Python functions as expressions of a graph, found in their source or by fitting, and tested.

In: a function, and points at which it is asked. Out: a text that has its values at all of them, to
rounding, or None::

    expression_of(lambda x: x[0] * x[1], points, {"x": 2})      # 'x[0] * x[1]'
"""

from __future__ import annotations

import ast
import inspect
import itertools
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from blocks.core import ExpressionError, FloatArray, expression_function

Text = str | list[str]
TOLERANCE = 1e-12  # of the largest value
FEW_NUMBERS = 16  # of an array that becomes part of a text
# Functions without source, as texts of all components.
KNOWN = ("x", "x**2", "sin(x)", "cos(x)", "tanh(x)", "exp(x)", "sqrt(x)", "abs(x)", "0*x")
RENAMED = {"absolute": "abs", "fabs": "abs", "power": "pow", "arcsin": "asin", "arccos": "acos"}
RENAMED |= {"arctan": "atan", "arctan2": "atan2", "maximum": "max", "minimum": "min"}


def expression_of(
    function: Callable[..., Any], points: Sequence[tuple[Any, ...]], names: Mapping[str, int | None]
) -> Text | None:
    """A text with the function's values at the points.

    Parameters
    ----------
    points : arguments to call it with.
    names : what the text calls them, with their lengths; None is a number.
    """
    try:
        wanted = [np.atleast_1d(np.asarray(function(*p), dtype=float)).ravel() for p in points]
    except Exception:  # noqa: BLE001 -- a user's function may raise anything
        return None
    return next((t for t in candidates(function, points, wanted, names)), None)


def candidates(
    function: Any,
    points: Sequence[tuple[Any, ...]],
    wanted: list[FloatArray],
    names: Mapping[str, int | None],
) -> Iterator[Text]:
    """The texts among those that are tried which have the values."""
    tried: list[Text] = [*_of_source(function, list(names))]
    if not tried and list(names) == ["x"]:
        tried += KNOWN
        d = names["x"] or 1
        tried += [[each.replace("x", f"x[{i}]") for i in range(d)] for each in KNOWN]
        places = np.array([p[0] for p in points]).reshape(len(points), -1)
        tried += [t for t in (_polynomials(places, wanted), _rectified(places, wanted)) if t]
    for text in tried:
        for written in (text, [text] if isinstance(text, str) else text):
            if _has_values(written, points, wanted, names):
                yield written
                break


def _has_values(
    text: Text,
    points: Sequence[tuple[Any, ...]],
    wanted: list[FloatArray],
    names: Mapping[str, int | None],
) -> bool:
    texts = text if isinstance(text, str) else tuple(text)
    scale = max((float(np.abs(w).max(initial=0.0)) for w in wanted), default=0.0) or 1.0
    for sizes in (names, {k: None if v == 1 else v for k, v in names.items()}):
        try:
            computed = expression_function(texts, dict(sizes))
            values = [
                np.atleast_1d(np.asarray(computed(*map(_argument, p, sizes.values())), float))
                for p in points
            ]
        except (ExpressionError, ArithmeticError, ValueError, TypeError):
            continue
        if all(v.shape == w.shape for v, w in zip(values, wanted, strict=True)) and all(
            np.abs(v - w).max(initial=0.0) <= TOLERANCE * scale
            for v, w in zip(values, wanted, strict=True)
        ):
            return True
    return False


def _argument(value: Any, size: int | None) -> Any:
    flat = np.atleast_1d(np.asarray(value, dtype=float)).ravel().tolist()
    return flat[0] if size is None else flat


def node_of(function: Any) -> list[ast.Lambda | ast.FunctionDef]:
    """The definitions that begin in the line where the function does; its file is not executed."""
    # Nengo's own functions are known by their values alone: its source is not ours to write out.
    if not isinstance(function, types.FunctionType) or function.__module__.startswith("nengo."):
        return []
    try:
        lines, _ = inspect.findsource(function)
        tree = ast.parse("".join(lines))
    except (OSError, SyntaxError, TypeError):
        return []
    first = function.__code__.co_firstlineno
    found = [
        node
        for node in ast.walk(tree)
        if isinstance(node, (ast.Lambda, ast.FunctionDef))
        and first in (node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ())))
    ]
    count = function.__code__.co_argcount
    return [node for node in found if len(node.args.args) == count]


def given_names(function: Any) -> dict[str, Any]:
    """What a function takes from around it, by name."""
    found = inspect.getclosurevars(function)
    return {**found.globals, **found.nonlocals}


def _of_source(function: Any, names: list[str]) -> list[Text]:
    found: list[Text] = []
    for node in node_of(function):
        try:
            arguments = [each.arg for each in node.args.args]
            known = {a: ast.Name(n) for a, n in zip(arguments, names, strict=True)}
            body = node.body if isinstance(node.body, list) else [ast.Return(node.body)]
            value = _Translation(given_names(function)).value(body, dict(known))
        except (_Unknown, ValueError, RecursionError):
            continue
        if isinstance(value, (ast.List, ast.Tuple)):
            found.append([ast.unparse(ast.fix_missing_locations(item)) for item in value.elts])
        else:
            found.append(ast.unparse(ast.fix_missing_locations(value)))
    return found


class _Unknown(Exception):  # noqa: N818 -- control flow of this module
    """A construct that expressions do not have."""


class _Translation:
    """Statements of Python as one expression: names are replaced by what they stand for."""

    def __init__(self, around: Mapping[str, Any]) -> None:
        self.around = around

    def value(self, body: list[Any], known: dict[str, Any]) -> Any:
        """What a list of statements returns."""
        for i, statement in enumerate(body):
            if isinstance(statement, ast.Return) and statement.value is not None:
                return self.expression(statement.value, known)
            if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
                self.assign(statement.targets[0], self.expression(statement.value, known), known)
            elif isinstance(statement, ast.If):
                rest = body[i + 1 :]
                chosen = self.value([*statement.body, *rest], dict(known))
                other = self.value([*statement.orelse, *rest], dict(known))
                return ast.IfExp(self.expression(statement.test, known), chosen, other)
            elif not (
                isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            ):
                raise _Unknown
        raise _Unknown

    def assign(self, target: Any, value: Any, known: dict[str, Any]) -> None:
        if isinstance(target, ast.Name):
            known[target.id] = value
        elif isinstance(target, (ast.Tuple, ast.List)):
            for i, item in enumerate(target.elts):
                self.assign(item, _item(value, i), known)
        else:
            raise _Unknown

    def expression(self, node: Any, known: Mapping[str, Any]) -> Any:
        if isinstance(node, ast.Name):
            return known[node.id] if node.id in known else self.constant(node.id)
        if isinstance(node, ast.Attribute):
            return self.attribute(node)
        if isinstance(node, ast.Call):
            return self.call(node, known)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            return _item(self.expression(node.value, known), node.slice.value)
        if isinstance(node, (ast.List, ast.Tuple)):
            return ast.List([self.expression(item, known) for item in node.elts], ast.Load())
        allowed = (ast.BinOp, ast.UnaryOp, ast.Compare, ast.BoolOp, ast.IfExp, ast.Subscript)
        if isinstance(node, ast.Constant):
            return node
        if not isinstance(node, allowed):
            raise _Unknown
        fields: dict[str, Any] = {}
        for name, field in ast.iter_fields(node):
            if isinstance(field, list):
                fields[name] = [
                    self.expression(each, known) if isinstance(each, ast.expr) else each
                    for each in field
                ]
            else:
                is_expression = isinstance(field, ast.expr) and not isinstance(field, ast.Slice)
                fields[name] = self.expression(field, known) if is_expression else field
        return type(node)(**fields)

    def constant(self, name: str) -> Any:
        if name not in self.around:
            raise _Unknown
        return _literal(self.around[name])

    def attribute(self, node: ast.Attribute) -> Any:
        module = self.around.get(node.value.id) if isinstance(node.value, ast.Name) else None
        if module is not None and node.attr in ("pi", "e"):
            return ast.Name(node.attr)
        if module is not None and not isinstance(module, types.ModuleType):
            return _literal(getattr(module, node.attr, None))
        raise _Unknown

    def call(self, node: ast.Call, known: Mapping[str, Any]) -> Any:
        function = node.func
        name = getattr(function, "attr", getattr(function, "id", ""))
        arguments = [self.expression(each, known) for each in node.args]
        if node.keywords or name in known:
            raise _Unknown
        if name in ("array", "asarray", "float", "list") and len(arguments) == 1:
            return arguments[0]
        if name == "square":
            return ast.BinOp(arguments[0], ast.Pow(), ast.Constant(2))
        if name in ("dot", "matmul") and len(arguments) == 2:
            return ast.BinOp(arguments[0], ast.MatMult(), arguments[1])
        return ast.Call(ast.Name(RENAMED.get(name, name)), arguments, [])


def _item(value: Any, index: Any) -> Any:
    if isinstance(value, ast.List) and isinstance(index, int) and -1 <= index < len(value.elts):
        return value.elts[index]
    if isinstance(index, int):
        return ast.Subscript(value, ast.Constant(index), ast.Load())
    raise _Unknown


def _literal(value: Any) -> Any:
    array = np.asarray(value) if isinstance(value, (bool, int, float, list, tuple, np.ndarray,
                                                    np.number)) else None  # fmt: skip
    if array is None or array.dtype.kind not in "biuf" or array.size > FEW_NUMBERS:
        raise _Unknown
    return ast.parse(repr(array.tolist()), mode="eval").body


def _rectified(points: FloatArray, wanted: list[FloatArray]) -> str | None:
    """A line that is 0 on one side of where it crosses 0."""
    x, values = points[:, 0], np.array([w[0] for w in wanted])
    there = values != 0.0
    if points.shape[1] > 1 or len(wanted[0]) > 1 or there.sum() < 3:
        return None
    slope, offset = np.polyfit(x[there], values[there], 1).tolist()
    kink = float(f"{-offset / slope:.9g}") if slope else 0.0
    factor = "" if f"{slope:.9g}" == "1" else f"{slope:.9g}*"
    inside = f"x {'-' if kink > 0.0 else '+'} {abs(kink):.9g}"
    inside = f"{factor}({inside})" if factor else inside
    return f"{'max' if values.sum() > 0.0 else 'min'}(0, {inside})"


def _polynomials(points: FloatArray, wanted: list[FloatArray]) -> list[str] | None:
    """Polynomials of the second degree through the values; those of each component are a text."""
    m, d = points.shape
    factors = [(), *((i,) for i in range(d)), *itertools.combinations_with_replacement(range(d), 2)]
    if m < 2 * len(factors) or len({w.shape for w in wanted}) > 1:
        return None
    columns = np.array([np.prod(points[:, list(f)], axis=1) for f in factors]).T
    coefficients = np.linalg.lstsq(columns, np.array(wanted), rcond=None)[0]
    texts = []
    for column in coefficients.T:
        terms = []
        for number, factor in zip(column.tolist(), factors, strict=True):
            rounded = float(f"{number:.9g}")
            if abs(rounded) > 1e-9:
                names = [f"x[{i}]" for i in factor]
                terms.append("*".join([f"{rounded:g}", *names] if rounded != 1.0 or not names
                                      else names))  # fmt: skip
        texts.append(" + ".join(terms).replace("+ -", "- ") or "0")
    return texts
