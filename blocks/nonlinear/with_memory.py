"""Nonlinear elements whose output depends on what came before, component by component."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    Elementwise,
    FloatArray,
    ParameterError,
    State,
    check_sized,
    param,
)


class _Stepped(Elementwise):
    """An element that remembers its output of the last tick."""

    memory = State(name="previous", like="out", doc="the output of the last tick")

    initial: FloatArray = param(
        0.0, shape=[(), (None,)], doc="output before the first tick, or one per component"
    )

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        check_sized(context.types["out"], "initial", self.initial)

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.previous[...] = self.initial
        state.cells = state.previous.reshape(-1)

    def update(self, state: BlockState, t: float, out: Any) -> None:
        self.store(state, state.cells, out)


class RateLimiter(_Stepped):
    """Limit how fast a signal changes.

        input ─▶ [ RateLimiter ] ─▶ out

    out(t_k) = out(t_k-1) + min(max(input - out(t_k-1), falling dt), rising dt), each component.
    """

    rising: float = param(above=0.0, tunable=True, doc="largest rate of increase, per second")
    falling: float | None = param(
        None,
        below=0.0,
        tunable=True,
        doc="largest rate of decrease, negative, per second; default -rising",
    )

    def start(self, state: BlockState) -> None:
        super().start(state)
        falling = -self.rising if self.falling is None else self.falling
        state.up, state.down = self.rising * state.dt, falling * state.dt

    def of(self, state: BlockState, x: float, i: int) -> float:
        # x itself where it is within the limits: the last output plus the change would round.
        change = x - state.cells[i]
        if change > state.up:
            return float(state.cells[i] + state.up)
        if change < state.down:
            return float(state.cells[i] + state.down)
        return x


class Backlash(_Stepped):
    """Play between gears: the output follows only once the gap is closed.

        input ─▶ [ Backlash ] ─▶ out

    out = input - width/2 where that is above the last output, input + width/2 where that is below
    it, and the last output between the two, each component.
    """

    width: float = param(above=0.0, tunable=True, doc="width of the gap")

    def of(self, state: BlockState, x: float, i: int) -> float:
        half = 0.5 * self.width
        return float(min(max(state.cells[i], x - half), x + half))


class Relay(_Stepped):
    """Switch with hysteresis, like a thermostat.

        input ─▶ [ Relay ] ─▶ out

    out changes to ``high`` where input rises to ``switch_on``, to ``low`` where it falls to
    ``switch_off``, and keeps its value in between, each component. ``initial`` is one of the two,
    or a number nearer to one of them. Where the input is continuous, the times at which it switches
    are located between ticks; there a Relay without hysteresis (two equal thresholds) that its own
    output pushes back would switch without end.
    """

    switch_on: float = param(0.0, tunable=True, doc="input at which the output changes to high")
    switch_off: float = param(0.0, tunable=True, doc="input at which the output changes to low")
    low: float = param(0.0, tunable=True, doc="output while off")
    high: float = param(1.0, tunable=True, doc="output while on")

    def validate(self) -> None:
        if self.switch_off > self.switch_on:
            message = f"expected at most switch_on = {self.switch_on:g}, got {self.switch_off:g}"
            raise ParameterError([("switch_off", message)])

    def of(self, state: BlockState, x: float, i: int) -> float:
        if x >= self.switch_on:
            return self.high
        if x <= self.switch_off:
            return self.low
        return self.high if self.is_on(state.cells[i]) else self.low

    def crossings(self, context: BlockContext) -> list[str]:
        return ["either"] * math.prod(context.types["out"].shape)

    def guards(self, state: BlockState, t: float, input: Any) -> FloatArray:
        # Above zero where the output is to be high; 1e-300 where a threshold itself counts.
        found = np.empty(state.size)
        for i in range(state.size):
            x = float(input if state.form == "scalar" else input[i])
            if not self.is_on(state.cells[i]):
                found[i] = x - self.switch_on if x != self.switch_on else 1e-300
            elif x == self.switch_off and self.switch_off == self.switch_on:
                found[i] = 1e-300
            else:
                found[i] = x - self.switch_off
        return found

    def event(self, state: BlockState, t: float, which: float) -> None:
        i = int(which)
        state.cells[i] = self.low if self.is_on(state.cells[i]) else self.high

    def is_on(self, out: float) -> bool:
        # By distance, since ``initial`` need not be one of the two.
        return abs(out - self.high) < abs(out - self.low)
