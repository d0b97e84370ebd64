"""Expressions of a graph, such as ``u[0]*u[1] - sin(t)``, as plain functions of numbers.

In: texts, and what their names stand for. Out: a function whose source is scalar arithmetic::

    read_expressions(["s*x", "norm(v)"], {"x": ["x[0]", "x[1]"]}, let={"s": "2*x[0]", "v": "x"})
    def expression(t, x, u, c):
        v0 = 2.0 * x[0]
        return (v0 * x[0], v0 * x[1], math.sqrt(square(x[0]) + square(x[1])))

A text is parsed into a syntax tree, and every node of it must be on a list of allowed ones. From
these nodes a new text is written, of scalar arithmetic, functions of ``math``, of
``blocks.core.scalar_functions`` and of ``blocks.core.matrices``; names in it come from the caller
alone. Only that text is executed. All arithmetic is in floats, so no number can grow without bound;
length and depth of a text, ranges of indices and sizes of matrices are limited.

The functions are plain Python with a readable source, which the compiled engine translates as it
translates a block's methods.
"""

from __future__ import annotations

import ast
import hashlib
import linecache
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from blocks.core.expression_reader import Reader
from blocks.core.expression_text import PARSING, ExpressionError, tree_of
from blocks.core.expression_values import Value, Writer, Written, named_value, reached
from blocks.core.scalar_functions import SCOPE
from blocks.core.signals import FloatArray, SignalForm

Names = Mapping[str, Written]


@dataclass(frozen=True)
class Expressions:
    """Valid expressions as Python.

    lines : statements that come first. values : a text for each component of all expressions.
    shapes : of each expression: (), (n,) or (m, n).
    """

    lines: tuple[str, ...]
    values: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]

    def couplings(self, name: str, count: int) -> list[set[int]]:
        """Of which of ``name[0]`` to ``name[count - 1]`` each value depends."""
        return reached(self.lines, self.values, {f"{name}[{i}]": i for i in range(count)})


def read_expressions(
    texts: Sequence[str], names: Names, let: Mapping[str, str] | None = None
) -> Expressions:
    """Check expressions and write them as Python.

    Parameters
    ----------
    names : what each name stands for, as Python text: one text for a number, several for the
        components of a vector (``u[0]``), rows of them for a matrix. ``pose.x`` is a name with a
        dot.
    let : further names and their expressions, which may use earlier ones; what a text uses is
        computed once, before it.

    Raises
    ------
    ExpressionError : with the column and a suggestion; its ``place`` is a number of ``texts`` or a
        name of ``let``.
    """
    fixed = tuple((name, _fixed(written)) for name, written in names.items())
    return _expressions(tuple(texts), fixed, tuple((let or {}).items()))


def _fixed(written: Written) -> Any:
    """What a name stands for, as tuples."""
    return written if isinstance(written, str) else tuple(map(_fixed, written))


@lru_cache(maxsize=500)  # each run of a graph, such as an episode, asks for the same ones again
def _expressions(
    texts: tuple[str, ...], names: tuple[tuple[str, Any], ...], lets: tuple[tuple[str, str], ...]
) -> Expressions:
    known: dict[str, Value] = {name: named_value(written) for name, written in names}
    let = dict(lets)
    used = used_words(texts, let)
    writer = Writer()
    for name, text in let.items():
        # What nothing uses is checked all the same.
        own = writer if name in used else Writer()
        known[name] = own.bound(_read(text, name, known, own))
    read = [_read(text, place, known, writer) for place, text in enumerate(texts)]
    values = tuple(ast.unparse(part) for value in read for part in value.parts)
    return Expressions(tuple(writer.lines), values, tuple(value.shape for value in read))


def _read(text: str, place: int | str, known: Mapping[str, Value], writer: Writer) -> Value:
    try:
        return Reader(text, known, writer).value(tree_of(text), 0)
    except ExpressionError as error:
        error.place = place
        raise


def used_words(texts: Iterable[str], let: Mapping[str, str]) -> set[str]:
    """All words in texts, and in those of ``let`` that they use, through others as well."""
    words: set[str] = set()
    waiting = list(texts)
    while waiting:
        more = set(re.findall(r"[A-Za-z_]\w*", waiting.pop())) - words
        waiting += [let[word] for word in more & let.keys()]
        words |= more
    return words


def signed_distance(text: str) -> str:
    """An expression that is above zero where a condition holds, and 0 or below where it does not.

    ``x < 0 and v < 0`` becomes ``min(0 - x, 0 - v)``, whose zero can be located. What is no
    comparison, as ``x`` or ``a == b``, becomes 1 or -1.

    Raises
    ------
    ExpressionError : it is no expression.
    """
    return ast.unparse(_distance(_as_written(text, tree_of(text)), False))


def _as_written(text: str, node: ast.expr) -> ast.expr:
    """A condition with its comparisons' sides as texts: they may be chains too long to print."""
    match node:
        case ast.BoolOp(op=op, values=parts):
            return ast.BoolOp(op, [_as_written(text, part) for part in parts])
        case ast.UnaryOp(op=ast.Not() as op, operand=operand):
            return ast.UnaryOp(op, _as_written(text, operand))
        case ast.IfExp(test=test, body=body, orelse=other):
            return ast.IfExp(*(_as_written(text, part) for part in (test, body, other)))
        case ast.Compare(left=left, ops=ops, comparators=rest):
            sides = [_as_written(text, part) for part in (left, *rest)]
            return ast.Compare(sides[0], ops, sides[1:])
    flat = re.sub(r"\s", " ", text).strip()  # what columns of the tree count in
    return ast.Name(f"({flat[node.col_offset : node.end_col_offset]})", ast.Load())


_OPPOSITE = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt}


def _distance(node: ast.expr, is_negated: bool) -> ast.expr:
    match node:
        case ast.BoolOp(op=op, values=parts):
            return _nearest([_distance(p, is_negated) for p in parts], op, is_negated)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return _distance(operand, not is_negated)
        case ast.IfExp(test=test, body=body, orelse=other):
            return ast.IfExp(test, _distance(body, is_negated), _distance(other, is_negated))
        case ast.Compare(left=left, ops=ops, comparators=rest) if {*map(type, ops)} <= {*_OPPOSITE}:
            values = [left, *rest]
            parts = [
                _side(a, _OPPOSITE[type(op)] if is_negated else type(op), b)
                for a, op, b in zip(values[:-1], ops, rest, strict=True)
            ]
            return _nearest(parts, ast.And(), is_negated)
    one, other = ast.Constant(1), ast.UnaryOp(ast.USub(), ast.Constant(1))
    return ast.IfExp(node, *((other, one) if is_negated else (one, other)))


def _side(left: ast.expr, kind: type[ast.cmpop], right: ast.expr) -> ast.expr:
    """The distance of one comparison; where it holds for equal numbers, theirs is above zero."""
    a, b = (left, right) if kind in (ast.Gt, ast.GtE) else (right, left)
    difference = ast.BinOp(a, ast.Sub(), b)
    if kind in (ast.Lt, ast.Gt):
        return difference
    return ast.IfExp(ast.Compare(a, [ast.NotEq()], [b]), difference, ast.Constant(1e-300))


def _nearest(parts: list[ast.expr], op: ast.boolop, is_negated: bool) -> ast.expr:
    if len(parts) == 1:
        return parts[0]
    name = "min" if isinstance(op, ast.And) != is_negated else "max"
    return ast.Call(ast.Name(name, ast.Load()), parts, [])


def function_text(
    expressions: Expressions, parameters: Sequence[str], form: SignalForm | None = None
) -> str:
    """The source of a function of ``parameters`` that returns the values of expressions.

    ``form`` is that of the result: a float, a tuple or an array; by default a float for one
    value and a tuple for several.
    """
    values = expressions.values
    lines = [f"def expression({', '.join(parameters)}):", *expressions.lines]
    if form == "array":
        lines.append(f"out = np.empty({len(values)})")
        lines += [f"out[{i}] = {value}" for i, value in enumerate(values)]
        lines.append("return out")
    elif form == "record" or (form is None and len(values) > 1):
        lines.append(f"return ({', '.join(values)},)")
    else:
        lines.append(f"return {values[0]}")
    return "\n    ".join(lines) + "\n"


@lru_cache(maxsize=1000)
def function_from(source: str) -> Callable[..., Any]:
    """The function ``expression`` that a text of this module defines; equal texts give one object.

    Its source stays readable for the compiled engine and for tracebacks.
    """
    file = f"<expression {hashlib.sha256(source.encode()).hexdigest()[:16]}>"
    # Without a modification time linecache keeps the entry.
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    # A scope of its own: functions of two expressions are both called `expression`.
    scope = dict(SCOPE)
    with PARSING:
        code = compile(source, file, "exec", dont_inherit=True)
    exec(code, scope)
    function: Callable[..., Any] = scope["expression"]
    return function


def expression_function(
    texts: str | Sequence[str],
    arguments: Mapping[str, int | None],
    constants: Mapping[str, Any] | None = None,
    let: Mapping[str, str] | None = None,
) -> Callable[..., Any]:
    """A plain function that computes expressions.

    Parameters
    ----------
    texts : one expression, or one for each component of the result.
    arguments : the parameters in order; None for a number, or the length of a vector.
    constants : further names, and their values: numbers, vectors or matrices.
    let : further names, and their expressions.

    Returns
    -------
    function : of these arguments; it returns a float for one number, and a tuple for several.

    Raises
    ------
    ExpressionError : with the column and a suggestion.
    """
    names: dict[str, Written] = {
        name: _literals(value) for name, value in (constants or {}).items()
    }
    for place, (name, length) in enumerate(arguments.items()):
        own = f"a{place}"
        names[name] = own if length is None else [f"{own}[{i}]" for i in range(length)]
    read = read_expressions([texts] if isinstance(texts, str) else texts, names, let)
    return function_from(function_text(read, [f"a{i}" for i in range(len(arguments))]))


def _literals(value: Any) -> Any:
    """A number, a list or a list of lists, as texts."""
    if isinstance(value, (list, tuple)):
        return [_literals(item) for item in value]
    return repr(float(value))


def array_of(text: str) -> FloatArray:
    """The numbers that an expression of numbers alone stands for: ``diag(1, 1, 0.1)``.

    Raises
    ------
    ExpressionError : with the column and a suggestion.
    ArithmeticError : it divides by zero, or inverts a singular matrix.
    """
    return _array_of(text).copy()


# An editor checks a graph after each edit, of which most leave its expressions alone; one of a
# hundred numbers takes 20 ms to read.
@lru_cache(maxsize=256)
def _array_of(text: str) -> FloatArray:
    read = read_expressions([text], {})
    values = function_from(function_text(read, (), "record"))()
    return np.array(values).reshape(read.shapes[0])
