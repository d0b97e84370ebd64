"""Random signals."""

from __future__ import annotations

import math
from abc import ABC
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    State,
    Vector,
    check_flat,
    check_sized,
    param,
    portable,
)


class _Random(Block, ABC):
    out = Output(Same("T"), doc="the noise")

    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default Scalar, or Vector for a list"
    )

    memory = State(name="value", like="out", doc="the output of this tick")

    @property
    def variables(self) -> dict[str, SignalType]:
        lengths = [len(value) for value in self.lists]
        count = max(lengths, default=0)
        kind = self.kind or (Vector(count) if count else Scalar)
        return {"T": kind.sized(count) if kind.symbol and count else kind}

    @property
    def lists(self) -> list[FloatArray]:
        """Parameters that have one number per component."""
        values = [self.value(name) for name in self.spec.params]
        return [value for value in values if isinstance(value, np.ndarray) and value.ndim]

    def validate(self) -> None:
        if self.variables["T"].symbol:
            message = f"expected a type with its length, as in Vector(3), got {self.kind}"
            raise ParameterError([("signal", message)])

    def validate_in(self, context: BlockContext) -> None:
        kind = context.types["out"]
        check_flat(kind, "signal")
        for name in self.spec.params:
            value = self.value(name)
            if isinstance(value, np.ndarray):
                check_sized(kind, name, value)

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.pack, state.cells = kind.pack, state.value.reshape(-1)

    def numbers(self, state: BlockState, value: FloatArray) -> FloatArray:
        """A parameter with one number per component."""
        return np.broadcast_to(value, state.cells.shape).copy()

    def output(self, state: BlockState, t: float) -> Any:
        return state.pack(state.value)


class WhiteNoise(_Random):
    """White noise up to half the sampling rate; its power does not depend on the step.

        [ WhiteNoise ] ─▶ out

    out(t_k) = mean + sqrt(density / dt) * n_k, with independent normal n_k, held between ticks:
    ``density`` is the two-sided power spectral density (unit^2/Hz), so that the integral of the
    noise has the variance density * t at any dt.
    """

    density: FloatArray = param(
        shape=[(), (None,)],
        at_least=0.0,
        tunable=True,
        doc="two-sided power spectral density, per component",
    )
    mean: FloatArray = param(
        0.0, shape=[(), (None,)], tunable=True, doc="mean value, per component"
    )

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.mean = self.numbers(state, self.mean)
        # By 1 / dt: the variance of the integral over a second is then the density at any step.
        state.sigma = np.sqrt(self.numbers(state, self.density) / state.dt)
        self.draw(state)

    def draw(self, state: BlockState) -> None:
        for i in range(len(state.cells)):
            state.cells[i] = state.mean[i] + state.sigma[i] * state.rng.standard_normal()

    def update(self, state: BlockState, t: float) -> None:
        self.draw(state)


class RandomWalk(_Random):
    """A random walk, the integral of white noise.

        [ RandomWalk ] ─▶ out

    out(t_k+1) = out(t_k) + sqrt(density * dt) * n_k, with independent normal n_k: the variance
    grows by ``density`` per second at any dt.
    """

    density: FloatArray = param(
        shape=[(), (None,)],
        at_least=0.0,
        tunable=True,
        doc="growth of the variance per second, per component",
    )
    initial: FloatArray = param(0.0, shape=[(), (None,)], doc="value at the start, per component")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.sigma = np.sqrt(self.numbers(state, self.density) * state.dt)
        state.cells[...] = self.numbers(state, self.initial)

    def update(self, state: BlockState, t: float) -> None:
        for i in range(len(state.cells)):
            state.cells[i] += state.sigma[i] * state.rng.standard_normal()


class PinkNoise(_Random):
    """Pink noise: its power density falls as 1/f, from ``lowest`` to half the sampling rate.

        [ PinkNoise ] ─▶ out

    out = sum of x_j, relaxations of corner frequencies f_j = lowest * 2^j and of equal variance
    s^2 = 2 ln(2) density: x_j' = -2 pi f_j x_j + white noise, sampled exactly. The sum of their
    spectra 2 a_j s^2 / (a_j^2 + omega^2), a_j = 2 pi f_j, is ``density`` / f (Bernamont, 1937;
    van der Ziel, 1950), the two-sided power spectral density at f between the ends, at 1 Hz
    ``density`` itself. It begins in the stationary state.
    """

    density: FloatArray = param(
        shape=[(), (None,)],
        at_least=0.0,
        tunable=True,
        doc="two-sided density at 1 Hz, per component",
    )
    lowest: float = param(0.01, unit="Hz", above=0.0, doc="frequency below which it is flat")

    parts = State("corners", like="out", doc="the relaxations, one row each")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        octaves = math.log2(max(0.5 / (context.dt * self.lowest), 1.0))
        return {"corners": int(octaves) + 1}

    def start(self, state: BlockState) -> None:
        super().start(state)
        rows = len(state.parts)
        state.cells_of = state.parts.reshape(rows, -1)
        octaves = np.array([2.0**j for j in range(rows)])
        state.keep = portable.exp(-2.0 * math.pi * self.lowest * state.dt * octaves)
        # What keeps the variance of a relaxation that was stationary at the start.
        state.renew = np.sqrt(1.0 - state.keep * state.keep)
        state.sigma = np.sqrt(2.0 * math.log(2.0) * self.numbers(state, self.density))
        for j in range(rows):
            for i in range(len(state.cells)):
                state.cells_of[j, i] = state.sigma[i] * state.rng.standard_normal()
        self.add_up(state)

    def add_up(self, state: BlockState) -> None:
        """The output is the sum of the relaxations."""
        for i in range(len(state.cells)):
            total = 0.0
            for j in range(len(state.keep)):
                total += state.cells_of[j, i]
            state.cells[i] = total

    def update(self, state: BlockState, t: float) -> None:
        for j in range(len(state.keep)):
            for i in range(len(state.cells)):
                fresh = state.renew[j] * state.sigma[i] * state.rng.standard_normal()
                state.cells_of[j, i] = state.keep[j] * state.cells_of[j, i] + fresh
        self.add_up(state)


class WhiteSignal(_Random):
    """A random signal without power above a frequency; its spectrum is even below, and it repeats.

        [ WhiteSignal ] ─▶ out

    out(t) = rms / sqrt(m) * sum over k = 1, ..., m of a_k cos(2 pi k t / period) +
    b_k sin(2 pi k t / period), with independent normal a_k and b_k, and m = high * period whole
    oscillations in a period, at most half the sampling rate: a Gaussian process whose root mean
    square is ``rms`` in expectation. Held between ticks.
    """

    period: float = param(unit="s", above=0.0, doc="after which it repeats, in whole steps")
    high: float = param(unit="Hz", above=0.0, doc="highest frequency")
    rms: FloatArray = param(
        0.5, shape=[(), (None,)], at_least=0.0, doc="root mean square, per component"
    )

    table = State("rows", like="out", doc="one period, a row per tick")
    place = State(doc="the row of this tick")

    def rows(self, dt: float) -> int:
        """The ticks in a period."""
        return max(round(self.period / dt), 1)

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        return {"rows": self.rows(context.dt)}

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        if self.high * self.rows(context.dt) * context.dt < 1.0:
            message = f"expected at least 1 / period = {1.0 / self.period:g} Hz, got {self.high:g}"
            raise ParameterError([("high", message)])

    def start(self, state: BlockState) -> None:
        super().start(state)
        rows = self.rows(state.dt)
        state.cells_of = state.table.reshape(rows, -1)
        # The highest whole oscillation below half the sampling rate: at it, a sine would be 0.
        count = min(int(self.high * rows * state.dt + 1e-9), (rows - 1) // 2)
        turn = 2.0 * math.pi / rows
        scale = self.numbers(state, self.rms) / math.sqrt(max(count, 1))
        for k in range(1, count + 1):
            a = scale * state.rng.standard_normal(len(state.cells))
            b = scale * state.rng.standard_normal(len(state.cells))
            # The remainder is exact in integers; k times an angle would lose digits as k grows.
            angle = turn * np.asarray((k * np.arange(rows)) % rows, dtype=np.float64)
            state.cells_of += portable.cos(angle)[:, None] * a
            state.cells_of += portable.sin(angle)[:, None] * b
        state.cells[:] = state.cells_of[0]

    def update(self, state: BlockState, t: float) -> None:
        row = int(state.place) + 1
        if row == len(state.cells_of):
            row = 0
        state.place[...] = row
        for i in range(len(state.cells)):
            state.cells[i] = state.cells_of[row, i]
