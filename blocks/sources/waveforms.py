"""Signals that are given functions of time."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import Block, BlockState, FloatArray, Output, ParameterError, Scalar, param

# Times are compared with this tolerance, in steps: 3 * 0.1 s is not below 0.3 s.
EARLY = 1e-9
# Of one source, more than a solver can end its steps at.
MOST_PULSES = 10_000_001


class Clock(Block):
    """The time.

        [ Clock ] ─▶ time

    time = t.
    """

    out = Output(Scalar, name="time", unit="s", doc="the time")

    def output(self, state: BlockState, t: float) -> float:
        return t


class Sine(Block):
    """A sine wave.

        [ Sine ] ─▶ out

    out = offset + amplitude * sin(2 pi frequency t + phase).
    """

    out = Output(Scalar, doc="the wave")

    amplitude: float = param(1.0, tunable=True, doc="half of the wave's height")
    frequency: float = param(1.0, unit="Hz", tunable=True, doc="periods per second")
    phase: float = param(0.0, unit="rad", tunable=True, doc="phase at t = 0")
    offset: float = param(0.0, tunable=True, doc="mean value")

    def output(self, state: BlockState, t: float) -> float:
        angle = 2.0 * math.pi * self.frequency * t + self.phase
        return self.offset + self.amplitude * math.sin(angle)


class Step(Block):
    """A step at a given time.

        [ Step ] ─▶ out

    out = before for t < time, and after from then on. Steps of a solver end at that time, which
    need not be at a tick.
    """

    out = Output(Scalar, doc="the step")

    time: float = param(0.0, unit="s", doc="when the step happens")
    before: float = param(0.0, tunable=True, doc="value before the step")
    after: float = param(1.0, tunable=True, doc="value from the step on")

    @property
    def stepwise(self) -> bool:
        return True

    def edges(self, until: float) -> tuple[float, ...]:
        return (self.time,)

    def start(self, state: BlockState) -> None:
        state.since = self.time - EARLY * state.dt

    def output(self, state: BlockState, t: float) -> float:
        return self.after if t >= state.since else self.before


class Ramp(Block):
    """A ramp that begins at a given time, and may end at another.

        [ Ramp ] ─▶ out

    out = initial + slope * (min(t, stop) - start) for t > start, and initial before.
    """

    out = Output(Scalar, doc="the ramp")

    slope: float = param(1.0, tunable=True, doc="change per second")
    begin: float = param(0.0, unit="s", name="start", doc="when the ramp begins")
    stop: float = param(math.inf, unit="s", finite=False, doc="when it ends; default never")
    initial: float = param(0.0, tunable=True, doc="value before the ramp")

    def validate(self) -> None:
        if self.stop < self.begin:
            message = f"expected a time from start = {self.begin:g} s on, got {self.stop:g} s"
            raise ParameterError([("stop", message)])

    def edges(self, until: float) -> tuple[float, ...]:
        return self.begin, self.stop

    def output(self, state: BlockState, t: float) -> float:
        return self.initial + self.slope * max(0.0, min(t, self.stop) - self.begin)


class Pulse(Block):
    """Pulses that repeat: rectangles, trapezoids, triangles or saw teeth.

        [ Pulse ] ─▶ out

    From ``start`` on, each period begins with an edge of ``rise`` seconds from ``low`` to ``high``,
    stays there for ``width`` seconds, and returns within ``fall`` seconds. A triangle has a width
    of 0 and two edges of half a period. With ``width: 0`` and no edges nothing is seen. Steps of a
    solver end where out jumps or bends.
    """

    out = Output(Scalar, doc="the pulses")

    low: float = param(0.0, tunable=True, doc="value between pulses")
    high: float = param(1.0, tunable=True, doc="value of a pulse")
    period: float = param(1.0, unit="s", above=0.0, doc="time from pulse to pulse")
    width: float | None = param(
        None, unit="s", at_least=0.0, doc="time at high; default half a period without the edges"
    )
    rise: float = param(0.0, unit="s", at_least=0.0, doc="duration of the rising edge")
    fall: float = param(0.0, unit="s", at_least=0.0, doc="duration of the falling edge")
    begin: float = param(0.0, unit="s", name="start", doc="when the first pulse begins")
    count: int = param(0, at_least=0, doc="number of pulses; 0: without end")

    def validate(self) -> None:
        if self.rise + self.fall > self.period * (1.0 + EARLY):
            message = f"expected edges that fit into period = {self.period:g} s, got "
            raise ParameterError([("fall", f"{message}{self.rise:g} + {self.fall:g} s")])
        if self.width is not None:
            total = self.rise + self.width + self.fall
            if total > self.period * (1.0 + EARLY):
                message = f"expected a pulse that fits into period = {self.period:g} s, got "
                raise ParameterError([("width", f"{message}{total:g} s with its edges")])

    @property
    def stepwise(self) -> bool:
        return self.rise == 0.0 and self.fall == 0.0

    @property
    def jumps(self) -> bool:
        return (self.rise == 0.0) != (self.fall == 0.0)

    @property
    def plateau(self) -> float:
        """The time at high."""
        half = 0.5 * self.period - 0.5 * (self.rise + self.fall)
        return max(0.0, half) if self.width is None else self.width

    def edges(self, until: float) -> FloatArray:
        number = math.ceil(max(0.0, until - self.begin) / self.period)
        number = min(number, self.count or number, MOST_PULSES)
        within = np.cumsum([0.0, self.rise, self.plateau, self.fall])
        times: FloatArray = self.begin + np.arange(number)[:, None] * self.period + within
        return np.unique(times)

    def start(self, state: BlockState) -> None:
        state.plateau = self.plateau
        state.limit = float(self.count) if self.count else math.inf
        state.early = EARLY * min(state.dt, self.period)

    def output(self, state: BlockState, t: float) -> float:
        since = t - self.begin
        if since < -state.early:
            return self.low
        part = (since + state.early) % self.period
        begun = (since + state.early - part) / self.period
        x = max(0.0, part - state.early)
        if begun > state.limit - 0.5:
            return self.low
        # A time within the tolerance of an edge's end belongs to what follows.
        if x < self.rise - state.early:
            return float(self.low + (self.high - self.low) * (x / self.rise))
        x -= self.rise
        if x < state.plateau - state.early:
            return self.high
        x -= state.plateau
        if x < self.fall - state.early:
            return float(self.high + (self.low - self.high) * (max(0.0, x) / self.fall))
        return self.low


class Chirp(Block):
    """A sine whose frequency changes with time.

        [ Chirp ] ─▶ out

    out = offset + amplitude * sin(phi(t) + phase), where phi' = 2 pi f(t), and f goes from f0 at
    t = 0 to f1 at t = duration: linearly, f = f0 + (f1 - f0) t / duration, or by a constant factor
    per second, f = f0 (f1 / f0)^(t / duration). After that it continues by the same rule.
    """

    out = Output(Scalar, doc="the wave")

    f0: float = param(0.1, unit="Hz", at_least=0.0, doc="frequency at the start")
    f1: float = param(10.0, unit="Hz", at_least=0.0, doc="frequency after the duration")
    duration: float = param(10.0, unit="s", above=0.0, doc="time from f0 to f1")
    method: str = param("linear", choices=("linear", "logarithmic"), doc="how it changes")
    amplitude: float = param(1.0, tunable=True, doc="half of the wave's height")
    phase: float = param(0.0, unit="rad", tunable=True, doc="phase at t = 0")
    offset: float = param(0.0, tunable=True, doc="mean value")

    def validate(self) -> None:
        if self.method == "logarithmic" and not (self.f0 > 0.0 and self.f1 > 0.0):
            message = "expected f0 and f1 above 0 Hz for a logarithmic chirp"
            raise ParameterError([("method", f"{message}, got {self.f0:g} and {self.f1:g}")])

    def start(self, state: BlockState) -> None:
        state.growth = 0.0
        if self.method == "logarithmic":
            state.growth = math.log(self.f1 / self.f0) / self.duration

    def output(self, state: BlockState, t: float) -> float:
        if state.growth != 0.0:
            turns = self.f0 * math.expm1(state.growth * t) / state.growth
        elif self.method == "logarithmic":
            turns = self.f0 * t
        else:
            turns = self.f0 * t + 0.5 * (self.f1 - self.f0) / self.duration * t * t
        return self.offset + self.amplitude * math.sin(2.0 * math.pi * turns + self.phase)
