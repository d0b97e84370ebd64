"""An equation that is solved for one unknown."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from blocks.core import (
    BlockContext,
    BlockState,
    Equations,
    Output,
    ParameterError,
    Scalar,
    param,
)

MAX_HALVINGS = 1100  # of the largest interval of floats


class AlgebraicConstraint(Equations):
    """The number z that satisfies an equation: what an algebraic loop would have to find.

        u ─▶ [ AlgebraicConstraint ] ─▶ out

    out = z with expression(z, u, t) = 0 between ``low`` and ``high``, found by bisection to the
    last bit. The expression must have different signs at the two ends; of several solutions it is
    any. A loop of memoryless blocks, such as a diode in series with a resistor, is written as the
    equation of its one unknown.
    """

    out = Output(Scalar, doc="z")

    expression: str = param(doc="what is zero at the solution: 'z - u[0] + r*i0*exp(z/v)'")
    low: float = param(doc="lower end of the interval that holds z")
    high: float = param(doc="its upper end")
    arguments: ClassVar[tuple[str, ...]] = ("z", "t", "u", "c")

    def own_names(self) -> dict[str, Any]:
        return {"z": "z"}

    def validate(self) -> None:
        problems = self.name_problems({"z": "the output"})
        if not self.low < self.high:
            message = f"expected more than low = {self.low:g}, got {self.high:g}"
            problems.append(("high", message))
        if problems:
            raise ParameterError(problems)
        self._check(None)

    def validate_in(self, context: BlockContext) -> None:
        self._check(self.input_count(context))

    def _check(self, count: int | None) -> None:
        sizes = self.sizes_of({"expression": (self.expression,)}, count)
        if sizes.get("expression", 1) != 1:
            raise ParameterError([("expression", "expected one number, got several")])

    def why_not_finite(self) -> str:
        return (
            f"the expression has the same sign at low = {self.low:g} and at high = {self.high:g}, "
            "or is not a number between them; choose an interval with one solution"
        )

    def start(self, state: BlockState) -> None:
        count = len(state.context.terms["u"])
        state.rest = self.function("expression", [self.expression], count, "scalar")
        state.constants = self.constant_values

    def output(self, state: BlockState, t: float, u: tuple[float, ...]) -> float:
        low, high = self.low, self.high
        below = state.rest(low, t, u, state.constants)
        above = state.rest(high, t, u, state.constants)
        if below == 0.0:
            return low
        if above == 0.0:
            return high
        if not (below < 0.0 < above or above < 0.0 < below):
            return math.nan
        # Bisection, not Newton's method: it needs no slope, cannot leave the interval, and ends at
        # the same bits whatever the last solution was.
        for _ in range(MAX_HALVINGS):
            middle = 0.5 * low + 0.5 * high  # the sum of the two may overflow
            if middle <= low or middle >= high:
                break
            rest = state.rest(middle, t, u, state.constants)
            if not math.isfinite(rest):
                return math.nan
            if (rest < 0.0) == (below < 0.0):
                low = middle
            else:
                high = middle
        return high
