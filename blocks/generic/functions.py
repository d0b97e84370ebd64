"""Functions of any signals, written as expressions."""

from __future__ import annotations

<<<<<<< HEAD
=======
import re
from collections.abc import Mapping
>>>>>>> main
from functools import cached_property
from typing import Any

from blocks.core import (
<<<<<<< HEAD
=======
    Block,
>>>>>>> main
    BlockContext,
    BlockState,
    Equations,
    Output,
    ParameterError,
    Same,
    SignalType,
<<<<<<< HEAD
    items,
=======
    Vector,
    function_from,
    function_text,
    misnamed,
>>>>>>> main
    param,
    value_type,
    width_of,
)

<<<<<<< HEAD
=======
PARAMETERS = ("t", "u", "c")
VARIABLES = {"u": "the inputs"}
>>>>>>> main

class Function(Equations):
    """Compute expressions of any signals, the time and constants.

        u ─▶ [ Function ] ─▶ out

    out = expression(u, t), a number or a vector; a list of expressions gives the vector of all
    their components, or the record type that ``signal`` states. ``u[0]``, ``u[1]``, ... are the
    components of all signals that are wired to ``u``, in order; ``names`` gives them names, and
    ``let`` names what several expressions use. There are sums, lists and slices over an index,
    matrices with ``@``, ``inv`` and ``solve``, and the functions of ``math``: docs/expressions.md
    has the whole language. All numbers are floats; integers alone are computed exactly, so that
    ``3**40 % 1000`` is 801, and one that no float has is an error. An expression cannot do anything
    but compute.
    """

    out = Output(Same("T", own_unit=True), doc="the values of the expressions")

    expression: tuple[str, ...] = param(
        doc="an expression such as 'u[0]*u[1] - sin(t)', or a list of them"
    )
    kind: SignalType | None = param(
        None,
        name="signal",
        doc="the output's type, or names and units of its components: {x: m, f: N}",
    )

    def validate(self) -> None:
<<<<<<< HEAD
        problems = self.name_problems()
        if not problems:
            self.sizes_of({"expression": self.expression})
            if width_of(self.resolved) != self._width and self.expected_inputs(self.expression):
                problems = [("signal", self._expected(self._width))]
=======
        names = self.names or ()
        problems = [("names", text) for _, text in misnamed(names, VARIABLES)]
        constants = misnamed(self.constants or (), VARIABLES, names)
        problems += [("constants", text) for _, text in constants]
        if self.resolved.symbol or _size(self.resolved) != len(self.expression):
            message = f"expected a type of {len(self.expression)} components, one per expression, "
            problems.append(("signal", message + f"got {self.kind}"))
>>>>>>> main
        if problems:
            raise ParameterError(problems)

    def _expected(self, width: int) -> str:
        message = f"expected a type of {width} components, as the expressions have, "
        return message + f"got {self.resolved}; write it as signal: Vector({width})"

    def why_not_finite(self) -> str:
        return (
            "an expression leaves its domain, as the root or logarithm of a negative number, or "
            "exceeds all floats; limit its inputs: 'sqrt(max(u[0], 0))'"
        )

    @cached_property
    def _width(self) -> int:
        return self.width("expression", self.expression)

    @property
    def resolved(self) -> SignalType:
        """The output's type."""
        return value_type(self.kind, self._width)

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    def validate_in(self, context: BlockContext) -> None:
<<<<<<< HEAD
        read = self.read(items("expression", self.expression), self.input_count(context))
        if len(read.values) != width_of(self.resolved):
            raise ParameterError([("signal", self._expected(len(read.values)))])
=======
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
>>>>>>> main

    def start(self, state: BlockState) -> None:
        flags = state.context.terms["u"]
        connected = [i for i, flag in enumerate(flags) if flag]
        parts = [f"u[{connected.index(i)}]" if flag else "0.0" for i, flag in enumerate(flags)]
        form = self.resolved.form
        state.evaluate = self.function("expression", self.expression, parts, form)
        state.constants = self.constant_values

    def output(self, state: BlockState, t: float, u: tuple[float, ...]) -> Any:
        return state.evaluate(t, u, state.constants)
<<<<<<< HEAD
=======


_BRACKETED = re.compile(r"\[[^\]]*?(\d{1,3})\s*\]")


def _size(kind: SignalType) -> int:
    shape = kind.shape
    return 0 if len(shape) > 1 else (shape[0] if shape else 1)
>>>>>>> main
