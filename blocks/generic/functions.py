"""Functions of any signals, written as expressions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    Expression,
    ExpressionError,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    Vector,
    function_from,
    function_text,
    misnamed,
    param,
    read_expression,
)

PARAMETERS = ("t", "u", "c")
VARIABLES = {"u": "the inputs"}


class Function(Block):
    """Compute expressions of any signals, the time and constants.

        u ─▶ [ Function ] ─▶ out

    out = expression(u, t), a number; a list of expressions gives a vector, or the record type that
    ``signal`` states. ``u[0]``, ``u[1]``, ... are the components of all signals that are wired to
    ``u``, in order; ``names`` gives them names. All signals are floats, and arithmetic is that of
    Python's floats; integers alone are computed exactly, so that ``3**40 % 1000`` is 801, and one
    that no float has is an error. There are the functions of ``math``, ``sign``, ``clip``,
    ``wrap``, ``sum``, ``mean``, ``norm``, ``min`` and ``max``; ``a if u[0] > 1 else b`` decides.
    An expression cannot do anything but compute.
    """

    inputs = Input(
        Scalar,
        variadic=True,
        spread="inputs",
        name="u",
        doc="any signals; their components in order are u[0], u[1], ...",
    )
    out = Output(Same("T", own_unit=True), doc="the values of the expressions")

    expression: tuple[str, ...] = param(
        doc="an expression such as 'u[0]*u[1] - sin(t)', or a list of them, one per component"
    )
    constants: Mapping[str, float] | None = param(
        None, doc="names that the expressions use, with their values: {a: 1.5}"
    )
    names: tuple[str, ...] | None = param(
        None, doc="names of the components of u, in order: [x, v]"
    )
    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default Scalar, or a Vector for a list"
    )

    def validate(self) -> None:
        names = self.names or ()
        problems = [("names", text) for _, text in misnamed(names, VARIABLES)]
        constants = misnamed(self.constants or (), VARIABLES, names)
        problems += [("constants", text) for _, text in constants]
        if self.resolved.symbol or _size(self.resolved) != len(self.expression):
            message = f"expected a type of {len(self.expression)} components, one per expression, "
            problems.append(("signal", message + f"got {self.kind}"))
        if problems:
            raise ParameterError(problems)
        # How many components u has is known only in a graph.
        used = [int(number) for text in self.expression for number in _BRACKETED.findall(text)]
        self.read(len(names) or 1 + max(used, default=0))

    def why_not_finite(self) -> str:
        return (
            "an expression leaves its domain, as the root or logarithm of a negative number, or "
            "exceeds all floats; limit its inputs: 'sqrt(max(u[0], 0))'"
        )

    @cached_property
    def resolved(self) -> SignalType:
        """The output's type."""
        count = len(self.expression)
        kind = self.kind or (Scalar if count == 1 else Vector(count))
        return kind.sized(count) if kind.symbol else kind

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    def validate_in(self, context: BlockContext) -> None:
        count = context.count("u")
        if self.names is not None and len(self.names) != count:
            message = f"expected {count} names, one for each component of u, got "
            raise ParameterError([("names", message + str(len(self.names)))])
        self.read(count)

    def read(self, count: int, connected: tuple[int, ...] | None = None) -> list[Expression]:
        """The expressions, with ``count`` components in u, those not ``connected`` being zero.

        Raises
        ------
        ParameterError : one is not valid.
        """
        places = range(count) if connected is None else connected
        parts = [f"u[{places.index(i)}]" if i in places else "0.0" for i in range(count)]
        own = dict(zip(self.names or (), parts, strict=False))
        own |= {name: f"c[{i}]" for i, name in enumerate(self.constants or ())}
        expressions = []
        for number, text in enumerate(self.expression):
            try:
                expressions.append(read_expression(text, {"u": parts, "t": "t", **own}))
            except ExpressionError as error:
                which = f"number {number}, " if len(self.expression) > 1 else ""
                short = text if len(text) <= 60 else text[:57] + "..."
                message = f"{which}column {error.column} of '{short}': {error.message}"
                raise ParameterError([("expression", message)]) from None
        return expressions

    def start(self, state: BlockState) -> None:
        flags = state.context.terms["u"]
        connected = tuple(i for i, flag in enumerate(flags) if flag)
        form = self.resolved.form
        state.evaluate = function_from(
            function_text(self.read(len(flags), connected), PARAMETERS, form)
        )
        state.constants = tuple((self.constants or {}).values()) or (0.0,)

    def output(self, state: BlockState, t: float, u: tuple[float, ...]) -> Any:
        return state.evaluate(t, u, state.constants)


_BRACKETED = re.compile(r"\[[^\]]*?(\d{1,3})\s*\]")


def _size(kind: SignalType) -> int:
    shape = kind.shape
    return 0 if len(shape) > 1 else (shape[0] if shape else 1)
