"""Arithmetic and logic without memory: products, norms, angles, comparisons."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    Elementwise,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    modulo,
    param,
    wrap,
)

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
LOGIC = ("and", "or", "nand", "nor", "xor", "not")


class Product(Block):
    """Multiply signals of one type, component by component, and divide by others.

        factors[0], factors[1], ... ─▶ [ Product ] ─▶ out

    out = the product of factors_i ^ powers_i, in the order written; a power is 1 (multiply) or -1
    (divide). A factor whose block was removed counts as one, and its power is skipped; with no
    factors, out is one.
    """

    factors = Input(Same("T"), variadic=True, doc="what to multiply; none: one")
    out = Output(Same("T", own_unit=True), doc="the product")

    powers: FloatArray | None = param(
        None, shape=(None,), doc="1 to multiply by or -1 to divide by, per factor; default all 1"
    )

    def validate(self) -> None:
        if self.powers is not None and not np.isin(self.powers, (-1.0, 1.0)).all():
            message = f"expected only 1 and -1, got {self.powers.tolist()}"
            raise ParameterError([("powers", message)])

    def validate_in(self, context: BlockContext) -> None:
        written, kind = len(context.terms["factors"]), context.types["out"]
        if self.powers is not None and len(self.powers) != written:
            message = f"expected {written} powers, one per factor, got {len(self.powers)}"
            raise ParameterError([("powers", message)])
        if len(kind.shape) > 1:
            message = f"expected numbers, records or vectors, got {kind}"
            raise ParameterError([("factors", message)])

    def start(self, state: BlockState) -> None:
        flags = state.context.terms["factors"]
        powers = np.ones(len(flags)) if self.powers is None else self.powers
        state.powers = tuple(powers[np.array(flags, dtype=bool)].tolist())
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.one = kind.filled(1.0)

    def output(self, state: BlockState, t: float, factors: tuple[Any, ...]) -> Any:
        if len(factors) == 0:
            return state.one
        if state.form == "scalar":
            total = 1.0
            for power, factor in zip(state.powers, factors, strict=True):
                total = self.times(total, factor, power)
            return total
        out = np.ones(state.size)
        for power, factor in zip(state.powers, factors, strict=True):
            for j in range(state.size):
                out[j] = self.times(out[j], factor[j], power)
        if state.form == "array":
            return out
        return state.pack(out)

    def times(self, total: float, factor: float, power: float) -> float:
        """A product times one more factor, or divided by it."""
        # A division and not a product with the reciprocal, which rounds twice.
        if power > 0.0:
            return float(total) * float(factor)
        return float(total) / float(factor)


class Norm(Block):
    """The length of a vector, or of several signals together.

        inputs[0], inputs[1], ... ─▶ [ Norm ] ─▶ out

    out = sqrt(sum of squares) of all components; the sum of magnitudes for ``order: 1``, and the
    largest magnitude for ``order: max``. Components of a removed block count as zero.
    """

    inputs = Input(Scalar, variadic=True, spread="inputs", doc="numbers, records or vectors")
    out = Output(Scalar, doc="the norm, at least 0")

    order: str = param("2", choices=("1", "2", "max"), doc="which norm")

    def output(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> float:
        total = 0.0
        if len(inputs) == 0:
            return total
        for i in range(len(inputs)):
            size = math.fabs(inputs[i])
            if self.order == "2":
                total += size * size
            elif self.order == "1":
                total += size
            else:
                total = max(total, size)
        return math.sqrt(total) if self.order == "2" else total


class Wrap(Elementwise):
    """Wrap angles to one turn.

        input ─▶ [ Wrap ] ─▶ out

    out = input + 2 pi n in [low, low + 2 pi), each component; with the default low = -pi in
    (-pi, pi], as errors of angles are wrapped elsewhere.
    """

    low: float | None = param(None, unit="rad", doc="start of the turn; default: (-pi, pi]")

    def of(self, state: BlockState, x: float, i: int) -> float:
        if self.low is None:
            return wrap(x)
        # Rounding may lift a small negative part to a whole turn.
        part = modulo(x - self.low, 2.0 * math.pi)
        return self.low + (0.0 if part >= 2.0 * math.pi else part)


class Compare(Block):
    """Compare two numbers, or a number with a constant.

        input, other ─▶ [ Compare ] ─▶ out

    out = 1 where ``input operator other`` holds, and 0 elsewhere. An ``other`` that is not wired
    is ``value``. Where the signals are continuous, the times at which out changes are located
    between ticks (not those of == and !=).
    """

    signal = Input(Scalar, name="input", doc="left of the operator")
    other = Input(Scalar, default=0.0, doc="right of the operator; added to value")
    out = Output(Scalar, doc="1 where it holds, 0 elsewhere")

    operator: str = param(">", choices=COMPARISONS, doc="the comparison")
    number: float = param(0.0, name="value", tunable=True, doc="what an input is compared with")

    def output(self, state: BlockState, t: float, input: float, other: float) -> float:
        right = other + self.number
        if self.operator == "<":
            holds = input < right
        elif self.operator == "<=":
            holds = input <= right
        elif self.operator == ">":
            holds = input > right
        elif self.operator == ">=":
            holds = input >= right
        elif self.operator == "==":
            holds = input == right
        else:
            holds = input != right
        return 1.0 if holds else 0.0

    def crossings(self, context: BlockContext) -> tuple[str, ...]:
        return () if self.operator in ("==", "!=") else ("either",)

    def guards(self, state: BlockState, t: float, input: float, other: float) -> FloatArray:
        distance = input - (other + self.number)
        # Equal numbers belong to those above, or to those below.
        if distance == 0.0 and (self.operator == ">=" or self.operator == "<"):
            distance = 1e-300
        return np.array([distance])


class Logic(Block):
    """Combine truth values: a number is true above 0.5.

        inputs[0], inputs[1], ... ─▶ [ Logic ] ─▶ out

    out = 1 or 0: ``and``, ``or`` and ``xor`` (an odd number is true) of all inputs, ``nand`` and
    ``nor`` the opposite, ``not`` that of one input. An input whose block was removed is left out.
    """

    inputs = Input(Scalar, variadic=True, spread="inputs", doc="truth values")
    out = Output(Scalar, doc="1 for true, 0 for false")

    operator: str = param("and", choices=LOGIC, doc="how they are combined")

    def validate_in(self, context: BlockContext) -> None:
        count = len(context.terms["inputs"])
        if self.operator == "not" and count != 1:
            raise ParameterError([("operator", f"'not' takes one input, got {count}")])

    def output(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> float:
        true = 0
        if len(inputs) > 0:
            for i in range(len(inputs)):
                if inputs[i] > 0.5:
                    true += 1
        if self.operator == "and":
            holds = true == len(inputs)
        elif self.operator == "or":
            holds = true > 0
        elif self.operator == "xor":
            holds = true % 2 == 1
        elif self.operator == "nand":
            holds = true < len(inputs)
        else:
            holds = true == 0
        return 1.0 if holds else 0.0
