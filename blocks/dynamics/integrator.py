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

EDGES = ("rising", "falling", "either", "level")


class Integrator(Block):
    """The integral of a signal over time.

        input, reset, initial_input ─▶ [ Integrator ] ─▶ out

    out' = input, out(0) = initial, each component. Between ``lower`` and ``upper`` only: at a
    limit, input that points outwards is ignored, so that the integrator leaves the limit as soon as
    the input turns (anti-windup by conditional integration). Where ``reset`` rises above 0.5, out
    becomes ``initial_input``, or ``initial`` if nothing is wired to that, and is integrated on from
    there; with ``edge: level`` it stays there while ``reset`` is above 0.5. The times of limits and
    resets are located between ticks. ``out`` depends on the state alone: it breaks loops.
    """

    signal = Input(Same("T", own_unit=True), name="input", doc="what to integrate")
    reset = Input(Scalar, default=0.0, doc="where it passes 0.5: back to the initial value")
    begin = Input(Same("T"), name="initial_input", default=math.nan, doc="the value after a reset")
    out = Output(Same("T"), doc="the integral")

    initial: FloatArray | None = param(
        None, doc="value at the start, a number or one per component; default 0"
    )
    lower: float | None = param(None, doc="lower limit of each component; default none")
    upper: float | None = param(None, doc="upper limit of each component; default none")
    edge: str = param("rising", choices=EDGES, doc="what of reset counts")

    x = State(name="integral", like="out", continuous=True, doc="the integral")
    at = State(name="at", like="out", doc="1 at the upper limit, -1 at the lower one, 0 between")
    held = State(1, doc="1 while reset holds the integral, else 0")
    was = State(1, doc="1 where reset was above 0.5 on the last tick, else 0")

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
        state.located, state.is_level = state.context.located, self.edge == "level"
        state.cells, state.firsts = state.integral.reshape(-1), state.first.reshape(-1)
        state.ends = state.at.reshape(-1)
        state.limits = 2 * len(state.cells) if state.limited else 0
        state.guarded = state.limits + ("reset" in state.context.wired)

    def discretized(self, method: str, step: float) -> Block:
        rules = {"tustin": "trapezoidal", "zoh": "forward", "matched": "forward"}
        return DiscreteIntegrator(**self.parameters(), method=rules[method])

    def couplings(self, context: BlockContext) -> list[list[int]]:
        # Each of its own state, which may be at a limit.
        return [[i] for i in range(math.prod(context.types["out"].shape))]

    def output(self, state: BlockState, t: float) -> Any:
        return state.pack(state.integral)

    def update(self, state: BlockState, t: float, reset: float, initial_input: Any) -> None:
        on, was = reset > 0.5, state.was[0] > 0.0
        rises = on and not was and self.edge != "falling"
        falls = was and not on and self.edge != "rising"
        if rises or falls or (on and state.is_level):
            self.put_back(state, reset, initial_input)
        state.was[0] = 1.0 if on else 0.0

    def crossings(self, context: BlockContext) -> list[str]:
        is_limited = self.lower is not None or self.upper is not None
        limits = 2 * math.prod(context.types["out"].shape) if is_limited else 0
        return ["either"] * limits + ([self.edge] if "reset" in context.wired else [])

    def guards(self, state: BlockState, t: float, input: Any, reset: float) -> FloatArray:
        found = np.empty(state.guarded)
        if state.limits > 0:
            if state.form == "scalar":
                self.guard(state, found, 0, input)
            elif state.form == "record":
                for i in range(len(input)):
                    self.guard(state, found, i, input[i])
            else:
                for i, value in enumerate(input.flat):
                    self.guard(state, found, i, value)
        if state.guarded > state.limits:
            found[state.limits] = reset - 0.5
        return found

    def guard(self, state: BlockState, found: FloatArray, i: int, rate: float) -> None:
        """The two of a component: above zero beyond a limit, and there while input holds it."""
        x, end = state.cells[i], state.ends[i]
        found[2 * i], found[2 * i + 1] = x - state.high, state.low - x
        if end != 0.0:
            found[2 * i] = rate if end > 0.0 else -1.0
            found[2 * i + 1] = -rate if end < 0.0 else -1.0

    def event(
        self, state: BlockState, t: float, which: float, reset: float, initial_input: Any
    ) -> None:
        k = int(which)
        if k >= state.limits:
            self.put_back(state, reset, initial_input)
            return
        i = k // 2
        if state.ends[i] != 0.0:
            state.ends[i] = 0.0
        else:
            state.ends[i] = 1.0 - 2.0 * float(k % 2)
            state.cells[i] = state.high if k % 2 == 0 else state.low

    def put_back(self, state: BlockState, reset: float, value: Any) -> None:
        """What a reset does; with ``edge: level``, both at its beginning and at its end."""
        if state.is_level:
            state.held[0] = 1.0 if reset > 0.5 else 0.0
            if reset <= 0.5:
                return
        if state.form == "scalar":
            self.begin_at(state, 0, value)
        elif state.form == "record":
            for i in range(len(value)):
                self.begin_at(state, i, value[i])
        else:
            for i, each in enumerate(value.flat):
                self.begin_at(state, i, each)

    def begin_at(self, state: BlockState, i: int, value: float) -> None:
        first = state.firsts[i] if math.isnan(value) else value
        state.cells[i] = min(max(first, state.low), state.high)
        state.ends[i] = 0.0

    def derivative(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._rate(state, 0, input)
        if state.held[0] != 0.0:
            return np.zeros(state.integral.shape)
        if not state.limited:
            return input
        rates = np.array(input)
        if state.located:
            rates[state.at != 0.0] = 0.0
            return rates
        # The sign of the input decides and not the limit alone: held at a limit for good, the state
        # would not leave it when the input turns.
        x = state.integral
        rates[((x >= state.high) & (rates > 0.0)) | ((x <= state.low) & (rates < 0.0))] = 0.0
        return rates

    @kernel_of(derivative)
    def _derivative_kernel(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._rate(state, 0, input)
        rates = np.zeros(len(state.cells))
        if state.form == "record":
            for i in range(len(input)):
                rates[i] = self._rate(state, i, input[i])
        else:
            for i, value in enumerate(input.flat):
                rates[i] = self._rate(state, i, value)
        return rates.reshape(state.integral.shape)

    def _rate(self, state: BlockState, i: int, rate: float) -> float:
        """The rate of change of one component."""
        if state.held[0] != 0.0:
            return 0.0
        if not state.limited:
            return rate
        if state.located:
            # No stage of a step sees the limit: the step ends there.
            return 0.0 if state.ends[i] != 0.0 else rate
        x = state.cells[i]
        outwards = (x >= state.high and rate > 0.0) or (x <= state.low and rate < 0.0)
        return 0.0 if outwards else rate

    def project(self, state: BlockState) -> None:
        # A step of the solver may end beyond a limit that it met within the step.
        if state.limited:
            for i in range(len(state.cells)):
                state.cells[i] = min(max(state.cells[i], state.low), state.high)
