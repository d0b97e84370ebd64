"""Arithmetic of numbers, with Python's results, or NumPy's for elements of arrays.

In go values of numbers, out comes the value of the result; what Python does and C does not is
refused here, or checked while running.

    binary(body, ast.Add(), x, y)       of floats: Operator("+", x, y)
                                        of our ints: Call("int_add", (CTX, i, j, failure))
    binary(body, ast.Div(), x, y)       Call("divide", (CTX, x, y, failure)): division by zero
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from runtime.codegen.body import Body
from runtime.codegen.form import CTX, Call, Expr, Literal, Operator, Prefix
from runtime.codegen.types import BOOL, EITHER, FLOAT, INT, NotTypedError, Number, join
from runtime.codegen.values import UNKNOWN, Value, converted, number

PLAIN: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
WHOLE_NAMES: dict[type, str] = {ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply"}
LOGICAL = (ast.BitAnd, ast.BitOr, ast.BitXor)
BITS: dict[type, str] = {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^"}
SHIFTS: dict[type, str] = {ast.LShift: "shift_left", ast.RShift: "shift_right"}
PYTHON: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
COMPARED: dict[type, tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
}
# Functions of the math module that give the bits of the C library's (math.gamma and math.lgamma do
# not). TOTAL ones have a result for every number, the others raise for some: see REAL in support.h.
TOTAL = {name: name for name in ("atan", "tanh", "asinh", "erf", "erfc", "cbrt", "fabs")}
TOTAL_TWO = {"atan2": "atan2", "copysign": "copysign", "hypot": "length_of"}
REAL = tuple(
    """
    sin cos tan asin acos sinh cosh acosh atanh exp exp2 expm1 log log1p log2 log10 sqrt
""".split()
)
REAL_TWO = {"fmod": "real_fmod", "remainder": "real_remainder", "pow": "real_power"}
TESTS = ("isnan", "isinf", "isfinite")
WHOLE = {"floor": "floor", "ceil": "ceil", "trunc": "trunc"}


def as_number(value: Value) -> Value:
    """A number, or the only element that an array has.

    Raises
    ------
    NotTypedError : it is no number.
    """
    if not isinstance(value.type, Number):
        raise NotTypedError(f"computes with a {value.type}")
    return value


def as_float(value: Value) -> Value:
    return converted(as_number(value), FLOAT)


def call(name: str, *arguments: Expr, kind: Number = FLOAT) -> Value:
    """A call in C."""
    return Value(kind, (Call(name, arguments),))


def tested(name: str, x: Value) -> Value:
    """``isnan``, ``isinf`` or ``isfinite``, of which C says that it is not zero."""
    return Value(BOOL, (Operator("!=", Call(name, (x.expr,)), Literal(0)),))


def truth(value: Value) -> Value:
    """Whether a number is not zero."""
    if value.const is not UNKNOWN:
        return number(bool(value.const))
    if as_number(value).type == BOOL:
        return value
    zero = Literal(0.0) if value.type == FLOAT else Literal(0)
    return Value(BOOL, (Operator("!=", value.expr, zero),))


def negated(body: Body, value: Value) -> Value:
    """``-x``."""
    if value.const is not UNKNOWN:
        return number(-value.const)
    kind = as_number(value).type
    if kind == BOOL:
        raise NotTypedError("negates a bool, which NumPy refuses and Python does not; use int(...)")
    if kind == EITHER:
        raise NotTypedError("negates an int or float, which differ in -0; write 0.0 instead of 0")
    if kind == INT and body.check and value.low is None:
        return _checked(body, "int_subtract", number(0), value)
    return Value(kind, (Prefix("-", value.expr),))


def inverted(value: Value) -> Value:
    """``not`` of a value."""
    value = truth(value)
    if value.const is not UNKNOWN:
        return number(not value.const)
    return Value(BOOL, (Prefix("!", value.expr),))


def common(a: Value, b: Value) -> Number:
    """The type of a result of two numbers."""
    kinds = (a.type, b.type)
    return FLOAT if FLOAT in kinds else EITHER if EITHER in kinds else INT


def binary(body: Body, op: ast.operator, a: Value, b: Value, each: bool = False) -> Value:
    """An operator of two numbers.

    Parameters
    ----------
    each : of elements of arrays, which NumPy divides by zero without an error.
    """
    a, b = as_number(a), as_number(b)
    found = _fold(op, a, b)
    if found is not None:
        return found
    if a.type == BOOL and b.type == BOOL and not isinstance(op, (*LOGICAL, ast.Div)):
        # True + True is 2 in Python, and True for NumPy's bools.
        raise NotTypedError("computes with two bools; use int(...), or '&', '|' and '^'")
    kind = common(a, b)
    if type(op) in BITS or type(op) in SHIFTS:
        return _bits(body, op, a, b)
    if type(op) in PLAIN:
        return _arithmetic(body, op, converted(a, kind), converted(b, kind), each)
    if isinstance(op, ast.Div):
        return _divide(body, a, b, each)
    if kind == EITHER:
        raise NotTypedError("divides or raises an int or float; write 0.0 instead of 0, or float()")
    a, b = converted(a, kind), converted(b, kind)
    if isinstance(op, ast.Pow):
        return _power(body, a, b, each)
    if isinstance(op, (ast.FloorDiv, ast.Mod)):
        return _whole(body, op, a, b, each)
    raise NotTypedError(f"uses the operator {type(op).__name__} on numbers")


def _arithmetic(body: Body, op: ast.operator, a: Value, b: Value, each: bool) -> Value:
    """``+``, ``-`` and ``*`` of numbers of one type."""
    plain = _plain(op, a, b)
    if a.type == EITHER:
        return call("either", CTX, plain.expr, body.too_large(), kind=EITHER)
    if a.type == FLOAT or not body.check or _is_small(plain):
        return plain
    name = WHOLE_NAMES[type(op)]
    if each:
        return call(f"wrap_{name}", a.expr, b.expr, kind=INT)
    found = _checked(body, f"int_{name}", a, b)
    return replace(found, low=plain.low, high=plain.high)


def _is_small(value: Value) -> bool:
    """Whether an integer is certainly far from 64 bits."""
    bounds = (value.low, value.high)
    return all(isinstance(bound, int) and abs(bound) < 2**62 for bound in bounds)


def _checked(body: Body, name: str, *values: Value) -> Value:
    """A function of integers that fails beyond 64 bits."""
    return call(name, CTX, *(v.expr for v in values), body.too_large(), kind=INT)


def _divide(body: Body, a: Value, b: Value, each: bool) -> Value:
    """``/``: Python divides integers exactly, NumPy's arrays divide floats."""
    a, b = (v if each else body.exact(v) for v in (a, b))
    a, b = converted(a, FLOAT), converted(b, FLOAT)
    if each or (b.const is not UNKNOWN and b.const != 0):
        return Value(FLOAT, (Operator("/", a.expr, b.expr),))
    return call("divide", CTX, a.expr, b.expr, _no_zero(body, "float division by zero"))


def _fold(op: ast.operator, a: Value, b: Value) -> Value | None:
    if a.const is UNKNOWN or b.const is UNKNOWN or type(op) not in PYTHON:
        return None
    try:
        found = PYTHON[type(op)](a.const, b.const)
    except (ArithmeticError, TypeError):
        return None  # fails while running, if it is reached
    return number(found) if isinstance(found, (bool, int, float)) else None


def _plain(op: ast.operator, a: Value, b: Value) -> Value:
    low, high = _bounds(op, a, b) if a.type == INT else (None, None)
    return Value(a.type, (Operator(PLAIN[type(op)], a.expr, b.expr),), low=low, high=high)


def _bounds(op: ast.operator, a: Value, b: Value) -> tuple[int | None, int | None]:
    highs = [v.high for v in (a, b)]
    if isinstance(op, ast.Sub):
        known = a.low is not None and isinstance(b.high, int)
        low = a.low - b.high + 1 if known else None  # type: ignore[operator]
        top = isinstance(a.high, int) and b.low is not None
        return low, a.high - b.low if top else None  # type: ignore[operator]
    if a.low is None or b.low is None:
        return None, None
    both = all(isinstance(h, int) for h in highs)
    if isinstance(op, ast.Add):
        return a.low + b.low, a.high + b.high - 1 if both else None  # type: ignore[operator]
    if a.low >= 0 and b.low >= 0:
        high = (a.high - 1) * (b.high - 1) + 1 if both else None  # type: ignore[operator]
        return a.low * b.low, high
    return None, None


def _bits(body: Body, op: ast.operator, a: Value, b: Value) -> Value:
    if {FLOAT, EITHER} & {a.type, b.type}:
        raise NotTypedError("uses bitwise operators on floats")
    if type(op) in SHIFTS:
        return _checked(body, SHIFTS[type(op)], converted(a, INT), converted(b, INT))
    kind = BOOL if a.type == BOOL and b.type == BOOL else INT
    a, b = converted(a, kind), converted(b, kind)
    return Value(kind, (Operator(BITS[type(op)], a.expr, b.expr),))


def _no_zero(body: Body, message: str) -> Expr:
    return body.fail("ZeroDivisionError", message)


def _power(body: Body, a: Value, b: Value, each: bool) -> Value:
    if a.type == INT:
        return _checked(body, "int_power", a, b)
    if each:
        if b.const == 2:
            return _plain(ast.Mult(), a, a)
        return call("np_power", a.expr, b.expr)
    return call("real_power", CTX, a.expr, b.expr, _domain(body, "**"))


def _domain(body: Body, name: str) -> Expr:
    """The number of the failure of a function that has no result."""
    return body.fail("ValueError", f"no finite real result of {name}")


def _whole(body: Body, op: ast.operator, a: Value, b: Value, each: bool) -> Value:
    """``//`` and ``%``."""
    divides = isinstance(op, ast.FloorDiv)
    if a.type == FLOAT:
        if not divides and b.const is not UNKNOWN and b.const != 0:
            return call("modulo", a.expr, b.expr)
        if each:
            return call("np_floor_divide" if divides else "np_modulo", a.expr, b.expr)
        message = "float floor division by zero" if divides else "float modulo"
        name = "floor_divide" if divides else "modulo_checked"
        return call(name, CTX, a.expr, b.expr, _no_zero(body, message))
    positive = b.const is not UNKNOWN and b.const > 0
    if positive and a.low is not None and a.low >= 0:
        sign = "/" if divides else "%"
        high = None if divides else b.const
        return Value(INT, (Operator(sign, a.expr, b.expr),), low=0, high=high)
    name = "int_floor_divide" if divides else "int_modulo"
    message = "integer division or modulo by zero"
    found = call(name, CTX, a.expr, b.expr, _no_zero(body, message), kind=INT)
    if divides or b.low is None or b.low < 0:
        return found
    high = b.const if positive else b.expr if b.expr.is_stable else None
    return replace(found, low=0, high=high)


def compared(body: Body, op: ast.cmpop, a: Value, b: Value) -> Value:
    """A comparison of two numbers."""
    a, b = as_number(a), as_number(b)
    if type(op) not in COMPARED:
        raise NotTypedError(f"compares numbers by {type(op).__name__}")
    sign, python = COMPARED[type(op)]
    if a.const is not UNKNOWN and b.const is not UNKNOWN:
        return number(bool(python(a.const, b.const)))
    if a.type != b.type and INT in (a.type, b.type) and BOOL not in (a.type, b.type):
        a, b = body.exact(a), body.exact(b)
    kind = FLOAT if {FLOAT, EITHER} & {a.type, b.type} else INT
    left, right = converted(a, kind), converted(b, kind)
    return Value(BOOL, (Operator(sign, left.expr, right.expr),))


def extreme(body: Body, name: str, values: list[Value]) -> Value:
    """``min`` or ``max`` of numbers, from the left as in Python."""
    found = values[0]
    for other in values[1:]:
        a, b = as_number(found), as_number(other)
        if a.const is not UNKNOWN and b.const is not UNKNOWN:
            found = number(min(a.const, b.const) if name == "min" else max(a.const, b.const))
            continue
        kind = a.type if a.type == b.type else join(a.type, b.type)
        if kind == BOOL:
            raise NotTypedError(f"takes the {name} of bools; use 'and' or 'or'")
        if kind == EITHER:
            a, b = body.exact(a), body.exact(b)
        a, b = converted(a, kind), converted(b, kind)
        function = {"min": "least", "max": "greatest"}[name]
        function = f"int_{function}" if kind == INT else function
        low, high = None, None
        if kind == INT:
            low, high = _extreme_bounds(name, a, b)
        found = Value(kind, (Call(function, (a.expr, b.expr)),), low=low, high=high)
    return found


def _extreme_bounds(name: str, a: Value, b: Value) -> tuple[int | None, int | None]:
    lows = [v.low for v in (a, b) if v.low is not None]
    highs = [v.high for v in (a, b) if isinstance(v.high, int)]
    if name == "max":
        return max(lows, default=None), max(highs) if len(highs) == 2 else None
    return min(lows) if len(lows) == 2 else None, min(highs, default=None)


def absolute(body: Body, value: Value) -> Value:
    """``abs`` of a number."""
    value = as_number(value)
    if value.const is not UNKNOWN:
        return number(abs(value.const))
    if value.type == BOOL:
        raise NotTypedError("takes the absolute value of a bool; use int(...)")
    if value.type != INT:
        return call("fabs", value.expr, kind=FLOAT if value.type == FLOAT else EITHER)
    return replace(_checked(body, "int_abs", value), low=0)


def whole(body: Body, value: Value, function: str = "") -> Value:
    """A float as an int64, after rounding by a C function."""
    value = as_number(value)
    if value.type in (INT, BOOL):
        return converted(value, INT)
    if value.const is not UNKNOWN and math.isfinite(value.const):
        python: dict[str, Callable[[float], int]] = {"floor": math.floor, "ceil": math.ceil}
        return number((python | {"rint": round}).get(function, int)(value.const))
    rounded = Call(function, (value.expr,)) if function else value.expr
    message = "cannot convert float NaN, infinity or more than 64 bits to integer"
    failure = body.fail("ValueError", message)
    return call("to_int", CTX, rounded, failure, kind=INT)


def function(body: Body, name: str, values: list[Value]) -> Value:
    """A function of the math module."""
    if name in WHOLE and len(values) == 1:
        return whole(body, values[0], WHOLE[name] if name != "trunc" else "")
    numbers = [as_float(value) for value in values]
    known = [value.const for value in numbers]
    if all(value is not UNKNOWN for value in known):
        try:
            found = getattr(math, name, None)(*known)  # type: ignore[misc]
            if isinstance(found, (bool, float)):
                return number(found)
        except (ArithmeticError, ValueError, TypeError):
            pass  # fails while running, if it is reached
    given = [value.expr for value in numbers]
    if len(given) == 1 and name in TOTAL:
        return call(TOTAL[name], *given)
    if len(given) == 1 and name in REAL:
        return call(f"real_{name}", CTX, *given, _domain(body, f"math.{name}"))
    if len(given) == 1 and name in TESTS:
        return tested(name, numbers[0])
    if len(given) == 2 and name in TOTAL_TWO:
        return call(TOTAL_TWO[name], *given)
    if len(given) == 2 and name in REAL_TWO:
        return call(REAL_TWO[name], CTX, *given, _domain(body, f"math.{name}"))
    if len(given) == 2 and name == "log":
        logs = [call("real_log", CTX, each, _domain(body, "math.log")) for each in given]
        return binary(body, ast.Div(), logs[0], logs[1])
    factors = {"radians": math.pi / 180.0, "degrees": 180.0 / math.pi}
    if name in factors and len(given) == 1:
        return _plain(ast.Mult(), numbers[0], number(factors[name]))
    raise NotTypedError(f"calls math.{name} with {len(given)} numbers, which is not compiled")
