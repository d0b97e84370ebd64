"""Functions of any signals, written as expressions."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from blocks.core import (
    BlockContext,
    BlockState,
    Equations,
    Output,
    ParameterError,
    Same,
    SignalType,
    items,
    param,
    value_type,
    width_of,
)


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
    but compute. Where an input may have misses, as a Scan, the values may be infinite, too.
    """

    out = Output(Same("T", own_unit=True), doc="the values of the expressions")
    passes_misses: ClassVar[bool] = True

    expression: tuple[str, ...] = param(
        doc="an expression such as 'u[0]*u[1] - sin(t)', or a list of them"
    )
    kind: SignalType | None = param(
        None,
        name="signal",
        doc="the output's type, or names and units of its components: {x: m, f: N}",
    )

    def validate(self) -> None:
        problems = self.name_problems({})
        if not problems:
            self.sizes_of({"expression": self.expression})
            if width_of(self.resolved) != self._width and self.expected_inputs(self.expression):
                problems = [("signal", self._expected(self._width))]
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
        return value_type(self.kind, self._width, self.expression)

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    def validate_in(self, context: BlockContext) -> None:
        read = self.read(items("expression", self.expression), self.input_count(context))
        if len(read.values) != width_of(self.resolved):
            raise ParameterError([("signal", self._expected(len(read.values)))])

    def start(self, state: BlockState) -> None:
        flags = state.context.terms["u"]
        connected = [i for i, flag in enumerate(flags) if flag]
        parts = [f"u[{connected.index(i)}]" if flag else "0.0" for i, flag in enumerate(flags)]
        form = self.resolved.form
        state.evaluate = self.function("expression", self.expression, parts, form)
        state.constants = self.constant_values

    def output(self, state: BlockState, t: float, u: tuple[float, ...]) -> Any:
        return state.evaluate(t, u, state.constants)
