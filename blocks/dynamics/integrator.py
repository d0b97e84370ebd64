"""The integral of any signal over time."""

from __future__ import annotations

import math
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
    Same,
    Scalar,
    State,
    check_sized,
    kernel_of,
    param,
)
from blocks.dynamics.discrete import DiscreteIntegrator


class Integrator(Block):
    """The integral of a signal over time.

        input, reset ─▶ [ Integrator ] ─▶ out

    out' = input, out(0) = initial, each component. Between ``lower`` and ``upper`` only: at a
    limit, input that points outwards is ignored, so that the integrator leaves the limit as soon as
    the input turns (anti-windup by conditional integration). Where ``reset`` is above 0.5 at a
    tick, out is set to ``initial`` after that tick and stays there until the next one. ``out``
    depends on the state alone: it breaks loops.
    """

    signal = Input(Same("T", own_unit=True), name="input", doc="what to integrate")
    reset = Input(Scalar, default=0.0, doc="above 0.5: back to the initial value")
    out = Output(Same("T"), doc="the integral")

    initial: FloatArray | None = param(
        None, doc="value at the start, a number or one per component; default 0"
    )
    lower: float | None = param(None, doc="lower limit of each component; default none")
    upper: float | None = param(None, doc="upper limit of each component; default none")

    x = State(name="integral", like="out", continuous=True, doc="the integral")
    held = State(1, doc="1 while reset holds the integral, else 0")

    def validate(self) -> None:
        low, high = self.limits
        if not low < high:
            raise ParameterError(
                [("upper", f"expected a limit above lower = {low:g}, got {high:g}")]
            )
        if self.initial is not None and not ((low <= self.initial) & (self.initial <= high)).all():
            message = f"expected values within the limits, {low:g} to {high:g}"
            raise ParameterError([("initial", f"{message}, got {self.initial.tolist()}")])

    @property
    def limits(self) -> tuple[float, float]:
        """The limits, infinite where there is none."""
        low = -math.inf if self.lower is None else self.lower
        return low, math.inf if self.upper is None else self.upper

    def validate_in(self, context: BlockContext) -> None:
        check_sized(context.types["out"], "initial", self.initial)

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        first = 0.0 if self.initial is None else self.initial
        state.first = np.broadcast_to(first, kind.shape).copy()
        state.integral[...] = state.first
        state.pack, state.form = kind.pack, kind.form
        state.low, state.high = self.limits
        state.limited = self.lower is not None or self.upper is not None
        state.cells, state.firsts = state.integral.reshape(-1), state.first.reshape(-1)

    def discretized(self, method: str, step: float) -> Block:
        rules = {"tustin": "trapezoidal", "zoh": "forward", "matched": "forward"}
        return DiscreteIntegrator(**self.parameters(), method=rules[method])

    def couplings(self, context: BlockContext) -> list[list[int]]:
        # Each of its own state, which may be at a limit.
        return [[i] for i in range(math.prod(context.types["out"].shape))]

    def output(self, state: BlockState, t: float) -> Any:
        return state.pack(state.integral)

    def update(self, state: BlockState, t: float, reset: float) -> None:
        # Held until the next tick: the solver goes on between ticks and would integrate away from
        # the value that was set.
        state.held[0] = 1.0 if reset > 0.5 else 0.0
        if reset > 0.5:
            for i in range(len(state.cells)):
                state.cells[i] = state.firsts[i]

    def derivative(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._rate(state, state.cells[0], input)
        if state.held[0] != 0.0:
            return np.zeros(state.integral.shape)
        if not state.limited:
            return input
        # The sign of the input decides and not the limit alone: held at a limit for good, the state
        # would not leave it when the input turns.
        x, rates = state.integral, np.array(input)
        rates[((x >= state.high) & (rates > 0.0)) | ((x <= state.low) & (rates < 0.0))] = 0.0
        return rates

    @kernel_of(derivative)
    def _derivative_kernel(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._rate(state, state.cells[0], input)
        rates = np.zeros(len(state.cells))
        if state.form == "record":
            for i in range(len(input)):
                rates[i] = self._rate(state, state.cells[i], input[i])
        else:
            for i, value in enumerate(input.flat):
                rates[i] = self._rate(state, state.cells[i], value)
        return rates.reshape(state.integral.shape)

    def _rate(self, state: BlockState, x: float, rate: float) -> float:
        """The rate of change of one component."""
        outwards = (x >= state.high and rate > 0.0) or (x <= state.low and rate < 0.0)
        return 0.0 if outwards or state.held[0] != 0.0 else rate

    def project(self, state: BlockState) -> None:
        # A step of the solver may end beyond a limit that it met within the step.
        if state.limited:
            for i in range(len(state.cells)):
                state.cells[i] = min(max(state.cells[i], state.low), state.high)
