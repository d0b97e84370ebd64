"""A PID controller in continuous time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    State,
    check_flat,
    param,
)


class PID(Block):
    """A PID controller for any signal, with limits and anti-windup.

        error, reset ─▶ [ PID ] ─▶ out

    Each component: v = kp e + i + d with d = kd n (e - f), f' = n (e - f), a derivative with a
    filter of bandwidth n; out = min(max(v, lower), upper); i' = ki e + tracking (out - v), so that
    the integral stays near what the limits allow (anti-windup by back-calculation; Astrom and
    Hagglund, PID Controllers, 1995, section 3.5). Where ``reset`` is above 0.5 at a tick, both
    states go to their initial values. The path-following controller is a PathPID.
    """

    error = Input(Same("T"), doc="reference minus measurement")
    reset = Input(Scalar, default=0.0, doc="above 0.5: back to the initial states")
    out = Output(Same("T", own_unit=True), doc="the control signal")

    kp: float = param(1.0, doc="proportional gain")
    ki: float = param(0.0, doc="integral gain, per second")
    kd: float = param(0.0, doc="derivative gain, seconds")
    n: float = param(100.0, unit="1/s", above=0.0, doc="bandwidth of the derivative's filter")
    lower: float = param(-math.inf, finite=False, doc="lower limit of each component")
    upper: float = param(math.inf, finite=False, doc="upper limit of each component")
    tracking: float | None = param(
        None, unit="1/s", at_least=0.0, doc="gain of the back-calculation; default ki / kp, or 1"
    )
    initial: float = param(0.0, doc="integral at the start")

    integral = State(like="out", continuous=True, doc="the integral part i")
    filtered = State(like="out", continuous=True, doc="the filtered error f")

    def validate(self) -> None:
        if not self.lower < self.upper:
            message = f"expected a limit above lower = {self.lower:g}, got {self.upper:g}"
            raise ParameterError([("upper", message)])

    def validate_in(self, context: BlockContext) -> None:
        check_flat(context.types["out"], "error")

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.integral[...] = self.initial
        state.i, state.f = state.integral.reshape(-1), state.filtered.reshape(-1)
        natural = self.ki / self.kp if self.kp > 0.0 and self.ki > 0.0 else 1.0
        state.tracking = natural if self.tracking is None else self.tracking

    def unlimited(self, state: BlockState, e: float, j: int) -> float:
        """One component before the limits."""
        slope = self.kd * self.n * (e - state.f[j])
        return float(self.kp * e + state.i[j] + slope)

    def limited(self, v: float) -> float:
        """A value within the limits."""
        return min(max(v, self.lower), self.upper)

    def rate(self, state: BlockState, e: float, j: int) -> float:
        """The rate of change of the integral."""
        v = self.unlimited(state, e, j)
        return float(self.ki * e + state.tracking * (self.limited(v) - v))

    def output(self, state: BlockState, t: float, error: Any) -> Any:
        if state.form == "scalar":
            return self.limited(self.unlimited(state, error, 0))
        out = np.empty(state.size)
        for j in range(state.size):
            out[j] = self.limited(self.unlimited(state, error[j], j))
        if state.form == "array":
            return out
        return state.pack(out)

    def update(self, state: BlockState, t: float, reset: float) -> None:
        if reset > 0.5:
            for j in range(state.size):
                state.i[j] = self.initial
                state.f[j] = 0.0

    def derivative(self, state: BlockState, t: float, error: Any) -> Any:
        if state.form == "scalar":
            return self.rate(state, error, 0), self.n * (error - state.f[0])
        integral, filtered = np.empty(state.size), np.empty(state.size)
        for j in range(state.size):
            integral[j] = self.rate(state, error[j], j)
            filtered[j] = self.n * (error[j] - state.f[j])
        return integral, filtered
