"""Expressions: values against Python's own arithmetic, errors with a column, and no execution."""

from __future__ import annotations

import inspect
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blocks.core import (
    ARRAYS,
    CREATION,
    ExpressionError,
    Expressions,
    expression_function,
    function_text,
    read_expressions,
)
from blocks.core.expression_text import MAX_LENGTH
from blocks.core.scalar_functions import FUNCTIONS, SCOPE, ceil, floor, modulo, nearest
from tests.examples import examples

NAMES = {"u": ["u[0]", "u[1]", "u[2]"], "t": "t", "a": "c[0]", "pose.x": "p[0]"}
NUMBERS = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("u[0]*u[1] - sin(t)", 3.0 * -2.0 - math.sin(0.7)),
        ("-a**2", -6.25),
        ("2**-2", 0.25),
        ("u[-1] + u[2]", 10.0),
        ("7 // 2 + 7 % 4 - -7 % 4", 3.0 + 3.0 - 1.0),
        ("1 if t > 0.5 else 1/0", 1.0),
        ("(0 < t < 1) + (t == 0.7)", 2.0),
        ("t > 0 and not u[1] > 0 or 1/0", 1.0),
        ("norm(u)", math.sqrt(9.0 + 4.0 + 25.0)),
        ("sum(u) + mean(u) + min(u) + max(u)", 6.0 + 2.0 - 2.0 + 5.0),
        ("sum(u[1:3])", 3.0),
        ("min(1, t, 3) + max(1, t, 3)", 3.7),
        ("round(2.5) + round(3.5) + round(-0.4)", 6.0),
        ("wrap(3*pi) + clip(9, -1, 1) + sign(-4)", math.pi),
        ("hypot(3, 4) + atan2(1, 1)", 5.0 + math.pi / 4),
        ("  2 *\n  t", 1.4),
    ],
)
def test_an_expression_has_the_value_of_its_arithmetic(text: str, expected: float) -> None:
    f = expression_function(text, {"u": 3, "t": None}, {"a": 2.5})
    assert f([3.0, -2.0, 5.0], 0.7) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("name", [n for n, (call, count) in FUNCTIONS.items() if count == 1])
def test_functions_of_one_number_agree_with_python(name: str) -> None:
    inside = 1.25 if name == "acosh" else 0.625
    own = {"abs": abs, "round": round, "sign": np.sign, "wrap": lambda x: x}
    expected = own.get(name) or getattr(math, name)
    value = expression_function(f"{name}(x)", {"x": None})(inside)
    assert value == expected(inside)
    assert isinstance(value, float)


@given(x=st.floats(-1e18, 1e18), y=st.floats(-1e3, 1e3).filter(lambda y: abs(y) > 1e-3))
def test_whole_parts_and_remainders_agree_with_python(x: float, y: float) -> None:
    assert floor(x) == math.floor(x)
    assert ceil(x) == math.ceil(x)
    assert nearest(x) == round(x)
    assert modulo(x, y) == x % y


@given(st.lists(NUMBERS, min_size=3, max_size=3), NUMBERS)
def test_several_expressions_make_one_function(u: list[float], t: float) -> None:
    f = expression_function(["u[0] + t", "u[1]*u[2]"], {"u": 3, "t": None})
    assert f(np.array(u), t) == (u[0] + t, u[1] * u[2])
    assert "def expression" in inspect.getsource(f)
    assert f is expression_function(["u[0] + t", "u[1]*u[2]"], {"u": 3, "t": None})


@pytest.mark.parametrize(
    ("text", "column", "part"),
    [
        ("", 1, "expected an expression"),
        ("u[0] + sni(t)", 8, "did you mean 'sin'?"),
        ("1 + 2x", 6, "expected an operator after '2'"),
        ("t^2", 3, "a power is written '**'"),
        ("1 if u else 2", 6, "'u' has 3 components; write one of them, as in 'u[0]'"),
        ("u[3]", 3, "'u[0]' to 'u[2]'"),
        ("u[t]", 3, "an index is an integer"),
        ("1 + math.sin(t)", 5, "write 'sin' in place of 'math.sin'"),
        ("t = 3", 3, "'==' compares"),
        ("pose.y", 1, "did you mean 'pose.x'?"),
        ("2*(t", 3, "was never closed"),
        ("t + θ", 5, "unexpected character 'θ'"),
        ("t && 1", 4, "write 'and', 'or' and 'not'"),
        ("atan2(t)", 1, "takes 2 argument(s), got 1"),
        ("t(2)", 1, "a product needs '*'"),
        ("   arctan(t)", 4, "write 'atan'"),
        ("t[0]", 1, "'t' is a number"),
        ("tt + 1", 1, "did you mean"),
        ("1e999", 1, "too large"),
        ("u[2:1]", 3, "the range is empty"),
        ("lambda: 1", 1, "a lambda is not allowed"),
    ],
)
def test_an_error_has_a_column_and_a_suggestion(text: str, column: int, part: str) -> None:
    with pytest.raises(ExpressionError, match=".") as caught:
        read_expressions([text], NAMES)
    assert part in caught.value.message
    assert caught.value.column == column


HOSTILE = [
    "__import__('os').system('true')",
    "().__class__.__bases__[0].__subclasses__()",
    "u.__class__",
    "open('/etc/passwd')",
    "[x for x in u]",
    "(t := 5)",
    "f'{t}'",
    "exec",
    "u[__import__('os')]",
    "9**9**9**9**9",
    "u[10**9]",
    "-" * 1999 + "1",
    "(" * 900 + "t" + ")" * 900,
    "t" + "+t" * 900,
    "[" * 500,
    "0<" * 500 + "1",
    "(0<" * 40 + "t" + "<1)" * 40,
    "not " * 400 + "t",
    "sin(" * 300 + "t" + ")" * 300,
    "1 if " * 200 + "t" + " else 2" * 200,
    "1" * 5000,
    "1" * 1500,
    "t\x00",
    "\\u0074",
    "#",
    "t;t",
    "await t",
    "yield",
    "*u",
    "sin(*u)",
    "sin(x=t)",
    "t if t else",
    "'%s' % t",
    "None",
    "...",
    "2j",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_nothing_but_arithmetic_is_accepted(text: str) -> None:
    try:
        found = read_expressions([text], NAMES)
    except ExpressionError as error:
        assert 1 <= error.column <= max(1, min(len(text), MAX_LENGTH))
    else:
        only_arithmetic(found)


def only_arithmetic(read: Expressions) -> None:
    """A written text runs without any builtin, and gives floats or an error of arithmetic."""
    scope: dict[str, Any] = {"__builtins__": {}, **SCOPE}
    exec(function_text(read, ("u", "t", "c", "p"), "record"), scope)
    try:
        values = scope["expression"]([1.0, 2.0, 3.0], 0.5, [2.0], [0.1, 0.2])
    except (ArithmeticError, ValueError):
        return
    assert all(isinstance(value, float) for value in values)


WORDS = ["u", "u[0]", "t", "a", "pose.x", "x", "(", ")", "[", "]", "+", "-", "*", "/", "**", "%"]
WORDS += ["//", "<", "==", "!=", " and ", " or ", " not ", " if ", " else ", ",", ".", "1", "2.5"]
WORDS += ["1e9", ":", "lambda", "__class__", "__import__", "'os'", " for ", " in ", "=", "^", "\n"]
WORDS += [*FUNCTIONS, *ARRAYS, *CREATION, "range(3)", " if ", ".T", "@"]


@examples(400)
@given(st.lists(st.sampled_from(WORDS), max_size=25).map("".join) | st.text(max_size=60))
def test_any_text_is_a_number_or_an_expression_error(text: str) -> None:
    try:
        found = read_expressions([text], NAMES)
    except ExpressionError as error:
        assert error.message
        return
    only_arithmetic(found)


TREES = st.recursive(
    st.sampled_from(["x", "y", "1.5", "2", "0.25"]),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*"]), inner).map(lambda p: f"({''.join(p)})"),
        inner.map(lambda p: f"-{p}"),
        inner.map(lambda p: f"sin({p})"),
        inner.map(lambda p: f"abs({p})"),
        st.tuples(inner, inner, inner).map(lambda p: f"({p[0]} if {p[1]} < {p[2]} else {p[0]})"),
    ),
    max_leaves=12,
)


@examples(200)
@given(TREES, st.floats(-10, 10), st.floats(-10, 10))
def test_values_are_those_of_python(text: str, x: float, y: float) -> None:
    f = expression_function(text, {"x": None, "y": None})
    assert f(x, y) == eval(text, {"sin": math.sin, "abs": abs, "x": x, "y": y})


INTEGERS = st.recursive(
    st.integers(0, 10**18).map(str),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "%", "//"]), inner).map(
            lambda parts: f"({' '.join(parts)})"
        ),
        st.tuples(inner, st.integers(0, 60)).map(lambda parts: f"({parts[0]} ** {parts[1]})"),
        inner.map(lambda text: f"(-{text})"),
    ),
    max_leaves=6,
)


@given(INTEGERS)
@example("((12 ** 30) ** 38)")
@example("((-1) ** 9000)")
def test_integers_alone_are_python_s_or_refused(text: str) -> None:
    try:
        value = eval(text)
    except ZeroDivisionError:
        return
    try:
        found = expression_function(text, {})()
    except ExpressionError as error:
        assert abs(value) > 2**53 or "// " in text or "**" in text  # or a part of it
        assert "no float has exactly this value" in str(error) or "too large" in str(error)
        return
    except OverflowError:
        return  # the power has more digits than are computed exactly, and is no float
    assert found == value
    assert isinstance(found, float)


def test_an_integer_that_no_float_has_is_refused_where_it_is_used() -> None:
    assert expression_function("3**40 % 1000", {})() == 3**40 % 1000
    assert expression_function("3**40 % 1000 + x", {"x": None})(1.0) == 3**40 % 1000 + 1.0
    for text in ("3**40", "x + 3**40", "x > 9007199254740993", "sqrt(3**40)", "-3**40"):
        with pytest.raises(ExpressionError, match="no float has exactly this value"):
            expression_function(text, {"x": None})
    assert expression_function("3.0**40", {})() == 3.0**40
