"""Blocks without memory that take their type from what is wired to them."""

from __future__ import annotations

from functools import cached_property
from operator import add
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    PortType,
    Same,
    Scalar,
    SignalType,
    Twist,
    TwistValue,
    Vector,
    as_matrix,
    kernel_of,
    param,
    show,
    times,
)


class Constant(Block):
    """A value that never changes.

    [ Constant ] ─▶ value
    """

    constant = Output(Same("T"), name="value", constant=True, doc="the value")

    number: FloatArray = param(
        name="value",
        finite=False,
        tunable=True,
        doc="a number, or one number per component",
    )
    signal: SignalType | None = param(
        None, doc="the signal type: Twist, Pose, ...; default Scalar, or Vector(n) for n numbers"
    )

    def validate(self) -> None:
        kind = self.kind
        if kind.symbol or kind.shape != self.number.shape:
            message = f"expected {kind.numbers} for {kind.name}, got {self.number.tolist()}"
            raise ParameterError([("value", message)])
        if message := kind.wrong(self.number):
            raise ParameterError([("value", message)])

    @cached_property
    def kind(self) -> SignalType:
        """The signal type of the value; an open length is the value's own."""
        rows = len(self.number) if self.number.ndim else 0
        kind = self.signal or (Vector(rows) if self.number.ndim == 1 and rows else Scalar)
        return kind.sized(rows) if kind.symbol and rows else kind

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.kind}

    def output(self, state: BlockState, t: float) -> Any:
        return self.kind.pack(self.number) if self.number.ndim else self.number.item()


class Sum(Block):
    """Add any number of signals of one type.

        terms[0], terms[1], ... ─▶ [ Sum ] ─▶ out

    out = sum of sign_i * terms_i, in the order written. A term whose block was removed counts
    as zero and its sign is skipped; with no terms, out is zero.
    """

    terms = Input(Same("T"), variadic=True, doc="what to add; none: zero")
    out = Output(Same("T"), doc="the sum")

    signs: FloatArray | None = param(None, shape=(None,), doc="+1 or -1 per term; default all +1")

    def validate(self) -> None:
        if self.signs is not None and not np.isin(self.signs, (-1.0, 1.0)).all():
            raise ParameterError([("signs", f"expected only 1 and -1, got {self.signs.tolist()}")])

    def validate_in(self, context: BlockContext) -> None:
        written = len(context.terms["terms"])
        if self.signs is not None and len(self.signs) != written:
            raise ParameterError(
                [("signs", f"expected {written} signs, one per term, got {len(self.signs)}")]
            )

    def start(self, state: BlockState) -> None:
        connected = np.array(state.context.terms["terms"], dtype=bool)
        signs = np.ones(len(connected)) if self.signs is None else self.signs
        state.signs = tuple(signs[connected].tolist())
        state.plain = all(sign == 1.0 for sign in state.signs)
        state.zero = state.context.types["out"].zero()

    def output(self, state: BlockState, t: float, terms: tuple[Any, ...]) -> Any:
        if not terms:
            return state.zero
        # Most sums have no minus: multiplying by 1.0 would cost as much as adding.
        if not state.plain:
            terms = tuple(scaled(v, s) for s, v in zip(state.signs, terms, strict=True))
        total = terms[0]
        for term in terms[1:]:
            total = added(total, term)
        return total


def added(a: Any, b: Any) -> Any:
    """The sum of two values of one signal type, in the signal's own form."""
    return tuple(map(add, a, b)) if isinstance(a, tuple) else a + b


@kernel_of(added)
def _added_kernel(a: Any, b: Any) -> Any:
    if isinstance(a, tuple):
        return tuple([x + y for x, y in zip(a, b, strict=True)])
    return a + b


def scaled(value: Any, factor: float) -> Any:
    """A signal value times a number, in the signal's own form."""
    # A list inside: for two or three components, a generator costs more than the products.
    if isinstance(value, tuple):
        return tuple([factor * part for part in value])
    return factor * value


class Gain(Block):
    """Multiply a signal by a number, each of its components by its own, or a vector by a matrix.

        input ─▶ [ Gain ] ─▶ out

    out = gain * input, each component; with a matrix of m rows and n columns, out = gain @ input,
    a vector of m components from one of n. A column, such as ``ones(m, 1)``, makes a vector of one
    number. The gain may have a unit, so that of ``out`` is free: a Gain converts between units.
    """

    signal = Input(Same("T"), name="input", doc="what to scale")
    out = Output(Same("T", own_unit=True), through="input", doc="gain times input")

    gain: FloatArray = param(
        shape=[(), (None,), (None, None)],
        tunable=True,
        doc="the factor, one per component, or a matrix by rows",
    )

    def validate(self) -> None:
        if self.gain.ndim == 2 and super().variables:
            message = "a matrix gives the types of input and output; leave 'signal' out"
            raise ParameterError([("signal", message)])

    def port_type(self, name: str) -> PortType:
        if self.gain.ndim < 2:
            return super().port_type(name)
        rows, columns = self.gain.shape
        return Vector(columns if name == "input" else rows)

    def instead(self, wanted: SignalType) -> str:
        if self.gain.ndim != 1 or wanted.shape not in ((), (1,)):
            return ""
        return f"; a number is the product with one row, gain: {[self.gain.tolist()]}"

    def validate_in(self, context: BlockContext) -> None:
        kind = context.types["out"]
        if self.gain.ndim == 1 and self.gain.shape != kind.shape:
            expected = f"a number or {kind.numbers}" if kind.shape else "a number"
            message = f"expected {expected} for {kind}, got {self.gain.tolist()}"
            if kind.shape:
                message += as_matrix(self.gain, self.spec.params["gain"])
            else:
                column = show([[factor] for factor in self.gain.tolist()])
                message += f"; one number times each is a column, gain: {column}"
            raise ParameterError([("gain", message)])

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.by = ("number", "component", "matrix")[self.gain.ndim]
        state.factor = self.gain.item() if state.by == "number" else 1.0
        state.factors = np.ravel(self.gain).copy()
        state.matrix = np.atleast_2d(self.gain).copy()

    def output(self, state: BlockState, t: float, input: Any) -> Any:
        if state.by == "number":
            return scaled(input, state.factor)
        if state.by == "matrix":
            return times(state.matrix, input)
        out = np.empty(len(state.factors))
        for i in range(len(state.factors)):
            out[i] = state.factors[i] * input[i]
        if state.form == "array":
            return out
        return state.pack(out)


class Mux(Block):
    """Join a speed and a turn rate to a twist.

    v, omega ─▶ [ Mux ] ─▶ out
    """

    v = Input(Scalar, unit="m/s", default=0.0, doc="speed")
    omega = Input(Scalar, unit="rad/s", default=0.0, doc="turn rate")
    out = Output(Twist, doc="[v, omega]")

    def output(self, state: BlockState, t: float, v: float, omega: float) -> TwistValue:
        return v, omega


class Switch(Block):
    """Pass on one of two signals.

        select, off, on ─▶ [ Switch ] ─▶ out

    out = on where select > 0.5, off elsewhere. Both signals are computed all the time. Under
    ``bypass``, ``on`` replaces the block.
    """

    select = Input(Scalar, doc="which signal")
    off = Input(Same("T"), doc="passed on while select is 0.5 or less")
    on = Input(Same("T"), doc="passed on while select is above 0.5")
    out = Output(Same("T"), through="on", doc="the selected signal")

    def output(self, state: BlockState, t: float, select: float, off: Any, on: Any) -> Any:
        return on if select > 0.5 else off
