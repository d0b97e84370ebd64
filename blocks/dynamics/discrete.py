"""Filters and integrators in discrete time, component by component."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import (
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    State,
    param,
)
from blocks.dynamics.delays import Recalling


class DiscreteTransferFunction(Recalling):
    """A filter in discrete time, given as a transfer function in z.

        input ─▶ [ DiscreteTransferFunction ] ─▶ out

    out(z) = (b0 z^m + ... + bm) / (a0 z^n + ... + an) input(z), each component, with m <= n, at
    the block's own ``dt``; computed in the transposed direct form II, as scipy's ``lfilter``. With
    m < n, ``out`` depends on earlier inputs alone and breaks loops. The filter starts at rest.
    """

    out = Output(Same("T"), through="input", doc="the filtered signal")

    numerator: FloatArray = param(shape=(None,), doc="b0, ..., bm: powers of z, the highest first")
    denominator: FloatArray = param(shape=(None,), doc="a0, ..., an: the highest first")

    memory = State("order", like="out", name="memory", doc="the delayed sums of the filter")

    def validate(self) -> None:
        check_rational(self.numerator, self.denominator)
        if self.initial.any():
            raise ParameterError([("initial", "the filter starts at rest; leave it out")])

    def sizes(self) -> dict[str, int]:
        if "denominator" not in self.__dict__:
            return {}
        return {"order": max(1, len(np.atleast_1d(self.denominator)) - 1)}

    @property
    def indirect(self) -> tuple[str, ...]:
        return () if self.coefficients[0][0] != 0.0 else ("input",)

    @property
    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """b and a of equal length, with a[0] = 1."""
        # At least two: a filter of degree 0 has a state that stays 0, in place of a special case.
        b = np.zeros(max(2, len(self.denominator)))
        a = np.zeros(len(b))
        numerator = np.trim_zeros(self.numerator, "f")
        count = len(self.denominator)
        a[:count] = self.denominator / self.denominator[0]
        if len(numerator):
            b[count - len(numerator) : count] = numerator / self.denominator[0]
        return b, a

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.b, state.a = self.coefficients
        state.direct = bool(state.b[0] != 0.0)
        state.rows = len(state.b) - 1
        state.cells = state.memory.reshape(state.rows, -1)

    def output(self, state: BlockState, t: float, input: Any = 0.0) -> Any:
        out = np.zeros(state.size)
        if state.direct:
            self.store(state, out, input)
        for i in range(state.size):
            out[i] = state.b[0] * out[i] + state.cells[0, i]
        return self.packed(state, out)

    def update(self, state: BlockState, t: float, input: Any, out: Any) -> None:
        x, y = np.zeros(state.size), np.zeros(state.size)
        self.store(state, x, input)
        self.store(state, y, out)
        for i in range(state.size):
            for j in range(state.rows):
                following = state.cells[j + 1, i] if j + 1 < state.rows else 0.0
                state.cells[j, i] = following + state.b[j + 1] * x[i] - state.a[j + 1] * y[i]


class DiscreteIntegrator(Recalling):
    """The sum of a signal times the step, an integral in discrete time.

        input, reset ─▶ [ DiscreteIntegrator ] ─▶ out

    With h = gain dt, each component: ``forward`` out(t_k+1) = out(t_k) + h input(t_k); ``backward``
    out(t_k) = out(t_k-1) + h input(t_k); ``trapezoidal`` out(t_k) = out(t_k-1) + h (input(t_k-1) +
    input(t_k)) / 2; the sum starts at ``initial`` and stays within ``lower`` and ``upper``. Where
    ``reset`` is above 0.5, the next value is ``initial``. ``forward`` breaks loops.
    """

    out = Output(Same("T"), doc="the integral")
    signal = Input(Same("T", own_unit=True), name="input", doc="what to integrate")
    reset = Input(Scalar, default=0.0, doc="above 0.5: back to the initial value")

    method: str = param(
        "forward", choices=("forward", "backward", "trapezoidal"), doc="rule of integration"
    )
    gain: float = param(1.0, tunable=True, doc="factor of the input")
    lower: float = param(-math.inf, finite=False, tunable=True, doc="lower limit of each component")
    upper: float = param(math.inf, finite=False, tunable=True, doc="upper limit of each component")

    total = State(like="out", name="total", doc="the sum before this tick's input")

    def validate(self) -> None:
        if not self.lower < self.upper:
            message = f"expected a limit above lower = {self.lower:g}, got {self.upper:g}"
            raise ParameterError([("upper", message)])
        if (self.initial < self.lower).any() or (self.initial > self.upper).any():
            message = f"expected values within the limits, {self.lower:g} to {self.upper:g}"
            raise ParameterError([("initial", f"{message}, got {self.initial.tolist()}")])

    @property
    def indirect(self) -> tuple[str, ...]:
        return ("input",) if self.method == "forward" else ()

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.cells = state.total.reshape(-1)
        state.cells[:] = state.first
        # One formula for the three rules: the share of h that counts in this tick's output.
        shares = {"forward": 0.0, "backward": 1.0, "trapezoidal": 0.5}
        state.now = shares[self.method] * self.gain * state.dt
        state.later = (1.0 - shares[self.method]) * self.gain * state.dt

    def output(self, state: BlockState, t: float, input: Any = 0.0) -> Any:
        out = np.zeros(state.size)
        if self.method != "forward":
            self.store(state, out, input)
        for i in range(state.size):
            total = state.cells[i] + state.now * out[i]
            out[i] = min(max(total, self.lower), self.upper)
        return self.packed(state, out)

    def update(self, state: BlockState, t: float, input: Any, reset: float, out: Any) -> None:
        x, y = np.zeros(state.size), np.zeros(state.size)
        self.store(state, x, input)
        self.store(state, y, out)
        for i in range(state.size):
            # From the limited output, and limited itself: a sum that ran on would wind up.
            total = min(max(y[i] + state.later * x[i], self.lower), self.upper)
            state.cells[i] = state.first[i] if reset > 0.5 else total


def check_rational(numerator: FloatArray, denominator: FloatArray) -> None:
    """Check that a transfer function is proper.

    Raises
    ------
    ParameterError : it is not, or it has no degree.
    """
    if not len(denominator) or denominator[0] == 0.0:
        message = f"expected a highest coefficient other than 0, got {denominator.tolist()}"
        raise ParameterError([("denominator", message)])
    if not len(numerator):
        raise ParameterError([("numerator", "expected at least one number")])
    degree = len(np.trim_zeros(numerator, "f")) - 1
    if degree > len(denominator) - 1:
        message = f"improper: expected a degree of at most {len(denominator) - 1}, that of the "
        message += f"denominator, got {degree}; a Derivative with a filter is proper"
        raise ParameterError([("numerator", message)])
