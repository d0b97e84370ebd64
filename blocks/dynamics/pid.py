"""PID controllers, in continuous and in discrete time.

An error goes in, a control signal comes out; gains in three structures are those of one::

    pid: {type: PID, structure: ideal, kp: 2, ki: 0.5, kd: 0.1}  # 2 (1 + 0.5 / s + 0.1 s)
"""

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
    check_flat,
    param,
)
from blocks.core.portable import flush, flush_due
from blocks.dynamics.delays import Recalling

STRUCTURES = ("parallel", "ideal", "series")
# The share of an integral's step that this tick's error adds to this tick's output, by rule.
NOW = {"backward": 1.0, "tustin": 0.5, "zoh": 0.0}


class PID(Block):
    """A PID controller for any signal, with limits and anti-windup.

        error, reset ─▶ [ PID ] ─▶ out

    Each component: v = kp e + i + d with d = kd n (e - f), f' = n (e - f), a derivative with a
    filter of bandwidth n; out = min(max(v, lower), upper); i' = ki e + tracking (out - v), so that
    the integral stays near what the limits allow (anti-windup by back-calculation; Astrom and
    Hagglund, PID Controllers, 1995, section 3.5). Where ``reset`` is above 0.5 at a tick, both
    states go to their initial values. The path-following controller is a PathPID.

    This is the ``parallel`` structure, kp + ki / s + kd s; ``ideal`` (the standard form) is
    kp (1 + ki / s + kd s) with ki = 1 / Ti and kd = Td, ``series`` kp (1 + ki / s) (1 + kd s);
    the s of a derivative stands for n s / (s + n). They are converted to the first.
    """

    error = Input(Same("T"), doc="reference minus measurement")
    reset = Input(Scalar, default=0.0, doc="above 0.5: back to the initial states")
    out = Output(Same("T", own_unit=True), doc="the control signal")

    kp: float = param(1.0, tunable=True, doc="proportional gain")
    ki: float = param(0.0, tunable=True, doc="integral gain, per second")
    kd: float = param(0.0, tunable=True, doc="derivative gain, seconds")
    structure: str = param("parallel", choices=STRUCTURES, doc="what the gains multiply")
    n: float = param(
        100.0, unit="1/s", above=0.0, tunable=True, doc="bandwidth of the derivative's filter"
    )
    lower: float = param(-math.inf, finite=False, tunable=True, doc="lower limit of each component")
    upper: float = param(math.inf, finite=False, tunable=True, doc="upper limit of each component")
    tracking: float | None = param(
        None,
        unit="1/s",
        at_least=0.0,
        tunable=True,
        doc="gain of the back-calculation; default ki / kp, or 1",
    )
    initial: float = param(0.0, doc="integral at the start")

    integral = State(like="out", continuous=True, doc="the integral part i")
    filtered = State(like="out", continuous=True, doc="the filtered error f")

    def validate(self) -> None:
        check_limits(self.lower, self.upper)

    def validate_in(self, context: BlockContext) -> None:
        check_flat(context.types["out"], "error")

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.integral[...] = self.initial
        state.i, state.f = state.integral.reshape(-1), state.filtered.reshape(-1)
        state.kp, state.ki, state.kd = parallel(self.structure, self.kp, self.ki, self.kd, self.n)
        state.tracking = tracking_of(self.tracking, state.kp, state.ki)

    def unlimited(self, state: BlockState, e: float, j: int) -> float:
        """One component before the limits."""
        # kd s / (1 + s / n) without a derivative of e, which a signal of steps does not have.
        slope = state.kd * self.n * (e - state.f[j])
        return float(state.kp * e + state.i[j] + slope)

    def limited(self, v: float) -> float:
        """A value within the limits."""
        return min(max(v, self.lower), self.upper)

    def rate(self, state: BlockState, e: float, j: int) -> float:
        """The rate of change of the integral."""
        v = self.unlimited(state, e, j)
        return float(state.ki * e + state.tracking * (self.limited(v) - v))

    def output(self, state: BlockState, t: float, error: Any) -> Any:
        if state.form == "scalar":
            return self.limited(self.unlimited(state, error, 0))
        out = np.empty(state.size)
        for j in range(state.size):
            out[j] = self.limited(self.unlimited(state, error[j], j))
        if state.form == "array":
            return out
        return state.pack(out)

    def discretized(self, method: str, step: float) -> Block:
        if method == "matched":
            raise ParameterError([("", "a PID has no matched form; take tustin or zoh")])
        return DiscretePID(**{**self.parameters(), "n": self.n, "method": method})

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


class DiscretePID(Recalling):
    """A PID controller in discrete time for any signal, with limits and anti-windup.

        error, reset ─▶ [ DiscretePID ] ─▶ out

    Each component, h the block's own ``dt``: v = kp e_k + i_k + d_k, with the integral
    i_k = i_k-1 + ki h e_k of the backward rule and the derivative d_k = kd (e_k - e_k-1) / h; with
    a filter of bandwidth n, d_k = (d_k-1 + kd n (e_k - e_k-1)) / (1 + n h) (Astrom and Wittenmark,
    Computer-Controlled Systems, 1997, section 8.5). out = min(max(v, lower), upper), and then
    i_k += tracking h (out - v). Before the first tick the error was ``initial_error``. Where
    ``reset`` is above 0.5, the controller begins anew at the next tick. By ``method`` it is a PID
    sampled by Tustin's rule, or exactly for errors that hold between its ticks (zoh).
    """

    signal = Input(Same("T"), name="error", doc="reference minus measurement")
    reset = Input(Scalar, default=0.0, doc="above 0.5: back to the initial states")
    out = Output(Same("T", own_unit=True), doc="the control signal")

    kp: float = param(1.0, tunable=True, doc="proportional gain")
    ki: float = param(0.0, tunable=True, doc="integral gain, per second")
    kd: float = param(0.0, tunable=True, doc="derivative gain, seconds")
    structure: str = param("parallel", choices=STRUCTURES, doc="what the gains multiply, as in PID")
    method: str = param("backward", choices=tuple(NOW), doc="rule of integral and derivative")
    n: float | None = param(
        None,
        unit="1/s",
        above=0.0,
        tunable=True,
        doc="bandwidth of the derivative's filter; default no filter",
    )
    lower: float = param(-math.inf, finite=False, tunable=True, doc="lower limit of each component")
    upper: float = param(math.inf, finite=False, tunable=True, doc="upper limit of each component")
    tracking: float | None = param(
        None,
        unit="1/s",
        at_least=0.0,
        tunable=True,
        doc="gain of the back-calculation; default ki / kp, or 1",
    )
    initial: FloatArray = param(0.0, shape=[(), (None,)], doc="integral at the start")
    initial_error: float = param(0.0, doc="error before the first tick, each component")

    integral = State(like="out", doc="the integral part i")
    slope = State(like="out", doc="the derivative part d")
    previous = State(like="out", doc="the error of the last tick")

    def validate(self) -> None:
        check_limits(self.lower, self.upper)
        if self.n is None and self.kd and self.method != "backward":
            raise ParameterError([("n", f"missing; the derivative of {self.method} has a filter")])

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.i, state.d = state.integral.reshape(-1), state.slope.reshape(-1)
        state.e = state.previous.reshape(-1)
        # Without a filter, n is infinite: nothing is left of the last slope.
        n = math.inf if self.n is None else self.n
        state.kp, ki, kd = parallel(self.structure, self.kp, self.ki, self.kd, n)
        state.tracked = tracking_of(self.tracking, state.kp, ki) * state.dt
        # All rules are d_k = kept d_k-1 + rise (e_k - e_k-1), and an integral of which a share of
        # this tick's error counts at once.
        state.kept, state.rise = 1.0 / (1.0 + n * state.dt), kd / (1.0 / n + state.dt)
        if self.method == "tustin" and kd:
            state.kept = (2.0 - n * state.dt) / (2.0 + n * state.dt)
            state.rise = 2.0 * kd * n / (2.0 + n * state.dt)
        elif self.method == "zoh" and kd:
            state.kept, state.rise = math.exp(-n * state.dt), kd * n
        state.step = ki * state.dt
        state.now = state.step * NOW[self.method]
        self.begin(state)

    def begin(self, state: BlockState) -> None:
        """Set the initial states."""
        for j in range(state.size):
            state.i[j], state.d[j], state.e[j] = state.first[j], 0.0, self.initial_error

    def unlimited(self, state: BlockState, e: float, j: int) -> float:
        """One component before the limits."""
        slope = state.kept * state.d[j] + state.rise * (e - state.e[j])
        return float(state.kp * e + state.i[j] + state.now * e + slope)

    def output(self, state: BlockState, t: float, error: Any) -> Any:
        out = np.zeros(state.size)
        self.store(state, out, error)
        for j in range(state.size):
            out[j] = min(max(self.unlimited(state, out[j], j), self.lower), self.upper)
        return self.packed(state, out)

    def update(self, state: BlockState, t: float, error: Any, reset: float, out: Any) -> None:
        if reset > 0.5:
            self.begin(state)
            return
        e, limited = np.zeros(state.size), np.zeros(state.size)
        self.store(state, e, error)
        self.store(state, limited, out)
        for j in range(state.size):
            # With the states of this tick's output, before any of them moves.
            excess = self.unlimited(state, e[j], j) - limited[j]
            state.i[j] += state.step * e[j] - state.tracked * excess
            state.d[j] = state.kept * state.d[j] + state.rise * (e[j] - state.e[j])
            state.e[j] = e[j]
        if flush_due(t, state.dt):
            flush(state.integral)
            flush(state.slope)


def parallel(
    structure: str, kp: float, ki: float, kd: float, n: float
) -> tuple[float, float, float]:
    """The gains of the parallel structure that computes the same.

    In the series structure, ki / s times kd n s / (s + n) is ki kd (1 - s / (s + n)): a share of
    the proportional part, and less of the derivative. It is so in discrete time, too.
    """
    if structure == "series":
        return kp * (1.0 + ki * kd), kp * ki, kp * kd * (1.0 - ki / n)
    return (kp, kp * ki, kp * kd) if structure == "ideal" else (kp, ki, kd)


def check_limits(lower: float, upper: float) -> None:
    """Check that two limits leave a range.

    Raises
    ------
    ParameterError : they do not.
    """
    if not lower < upper:
        message = f"expected a limit above lower = {lower:g}, got {upper:g}"
        raise ParameterError([("upper", message)])


def tracking_of(tracking: float | None, kp: float, ki: float) -> float:
    """The gain of the back-calculation (1/s); by default 1 / Ti = ki / kp."""
    natural = ki / kp if kp > 0.0 and ki > 0.0 else 1.0
    return natural if tracking is None else tracking
