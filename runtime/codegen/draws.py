"""Random numbers: the methods of NumPy's generator as calls of draws.h, which gives its numbers.

In go a generator and the arguments of one of its methods, out comes a draw that is stored at once:

    state.random.normal(0.0, s)     if (!(!signbit(s))) fail
                                    const double drawn_1_ = 0.0 + s * (double)draw_normal(random);
"""

from __future__ import annotations

import ast
from collections.abc import Callable

from runtime.codegen import creation, scalars
from runtime.codegen.body import Body
from runtime.codegen.form import Call, Draw, Expr, Fail, If, Literal, Logic, Operator, Prefix, Set
from runtime.codegen.types import FLOAT, NONE
from runtime.codegen.values import Value, number, sizes_of

Size = Value | None
ZERO, ONE = number(0.0), number(1.0)


def _random(body: Body, generator: Value, size: Size = None) -> Value:
    return _drawn(body, generator, size, "uniform", lambda draw: draw)


def _standard_normal(body: Body, generator: Value, size: Size = None) -> Value:
    return _drawn(body, generator, size, "normal", lambda draw: draw)


def _standard_exponential(body: Body, generator: Value, size: Size = None) -> Value:
    return _drawn(body, generator, size, "exponential", lambda draw: draw)


def _uniform(
    body: Body, generator: Value, low: Value = ZERO, high: Value = ONE, size: Size = None
) -> Value:
    low, high = _numbers(body, low, high)
    width = body.kept(scalars.binary(body, ast.Sub(), high, low), "width")
    finite = Call("isfinite", (width.expr,))
    _sound(body, Logic("&&", (finite, Operator(">=", width.expr, Literal(0.0)))))
    return _drawn(body, generator, size, "uniform", lambda draw: _moved(body, low, width, draw))


def _normal(
    body: Body, generator: Value, loc: Value = ZERO, scale: Value = ONE, size: Size = None
) -> Value:
    loc, scale = _numbers(body, loc, scale)
    _sound(body, Prefix("!", Call("signbit", (scale.expr,))))
    return _drawn(body, generator, size, "normal", lambda draw: _moved(body, loc, scale, draw))


def _exponential(body: Body, generator: Value, scale: Value = ONE, size: Size = None) -> Value:
    (scale,) = _numbers(body, scale)
    _sound(body, Prefix("!", Call("signbit", (scale.expr,))))
    times = ast.Mult()
    of = lambda draw: scalars.binary(body, times, scale, draw)  # noqa: E731
    return _drawn(body, generator, size, "exponential", of)


# The arguments have NumPy's names.
DRAWS: dict[str, Callable[..., Value]] = {
    **{"random": _random, "standard_normal": _standard_normal, "uniform": _uniform},
    **{"standard_exponential": _standard_exponential, "normal": _normal},
    **{"exponential": _exponential},
}


def _numbers(body: Body, *values: Value) -> list[Value]:
    return [body.kept(scalars.as_float(value)) for value in values]


def _sound(body: Body, test: Expr) -> None:
    """Fail where NumPy refuses the parameters of a distribution."""
    failure = body.fail("ValueError", "parameters of a distribution are not valid")
    body.act(If(Prefix("!", Call("LIKELY", (test,))), [Fail(failure)]))


def _moved(body: Body, start: Value, width: Value, draw: Value) -> Value:
    return scalars.binary(body, ast.Add(), start, scalars.binary(body, ast.Mult(), width, draw))


def _drawn(
    body: Body, generator: Value, size: Size, function: str, of: Callable[[Value], Value]
) -> Value:
    """One draw, or an array of draws in the order in which NumPy takes them."""
    body.change()
    draw = Value(FLOAT, (Draw(generator.expr, function),))
    if size is None or size.type == NONE:
        return body.kept(of(draw), "drawn")
    made = creation.new_array(body, creation.shape_of(size), FLOAT)
    with body.loops(sizes_of(made)) as indices:
        body.act(Set(body.place(made, indices), of(draw).expr))
    return made
