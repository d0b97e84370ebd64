"""What happens to measurements on their way: some are lost, all take their time.

A value and its stamp go in; the last one that arrived and its stamp come out, held until the next::

    gps.position, gps.stamp ─▶ Dropout ─▶ Latency ─▶ filter.measurement, filter.stamp
"""

from __future__ import annotations

import math
from abc import ABC
from typing import Any

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    Componentwise,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    State,
    param,
)

NEVER = -1.0  # the stamp before the first measurement
EARLY = 1e-6  # of a step: what arrives so little after a tick has arrived at it


class _Transport(Componentwise, ABC):
    """Measurements of any type, each with a stamp."""

    stamped = Input(
        Scalar,
        unit="s",
        default=NEVER,
        doc="when the input was measured, new with each measurement; without a wire, each tick of "
        "the block has one",
    )

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.is_stamped = "stamped" in state.context.wired

    def time_of(self, state: BlockState, t: float, stamped: float) -> float:
        """The stamp of what is at the input."""
        return stamped if state.is_stamped else t


class Dropout(_Transport):
    """Lose measurements: at random, in bursts, or where there is none.

        input, stamped, valid ─▶ [ Dropout ] ─▶ out, stamp

    Each measurement is lost with ``probability``, independently, or in bursts of ``burst``
    measurements on average: the two states of Gilbert's channel (Gilbert, Capacity of a burst-noise
    channel, 1960), with P(lost after lost) = 1 - 1 / burst. It is lost as well where ``valid`` is
    not above 0.5, as that of a camera that sees nothing. ``out`` and ``stamp`` hold the last one
    that was not lost; the stamp is -1 before the first.
    """

    valid = Input(Scalar, default=1.0, doc="above 0.5 where there is a measurement")
    out = Output(Same("T"), through="input", doc="the last measurement that was not lost")
    stamp = Output(Scalar, unit="s", doc="when it was measured; -1 before the first")

    probability: float = param(0.0, at_least=0.0, at_most=1.0, doc="share that is lost")
    burst: float | None = param(
        None, at_least=1.0, doc="mean number lost in a row; default: independent of each other"
    )

    held = State(like="out", doc="the last measurement that was not lost")
    last = State(3, doc="its stamp; the stamp seen last; 1 if the next one is lost")

    def validate(self) -> None:
        share = self.probability
        if self.burst is not None and share < 1.0 and share > self.burst * (1.0 - share):
            least = share / (1.0 - share)
            text = f"expected at least {least:.3g} for a share of {share:g}, got {self.burst:g}"
            raise ParameterError([("burst", text)])

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.cells = state.held.reshape(-1)
        state.last[0], state.last[1] = NEVER, NEVER
        state.after_lost = state.after_good = self.probability
        if self.burst is not None and self.probability < 1.0:
            state.after_lost = 1.0 - 1.0 / self.burst
            # So that the share that is lost is the one asked for.
            state.after_good = self.probability / (1.0 - self.probability) / self.burst
        state.last[2] = 1.0 if state.rng.random() < self.probability else 0.0

    def passes(self, state: BlockState, now: float, valid: float) -> bool:
        """Whether the input is new, and is not lost."""
        return bool(now != state.last[1] and now >= 0.0 and valid > 0.5 and not state.last[2] > 0.0)

    def output(
        self, state: BlockState, t: float, input: Any, stamped: float, valid: float
    ) -> tuple[Any, float]:
        now = self.time_of(state, t, stamped)
        if self.passes(state, now, valid):
            return input, now
        return self.packed(state, state.cells.copy()), float(state.last[0])

    def update(self, state: BlockState, t: float, input: Any, stamped: float, valid: float) -> None:
        now = self.time_of(state, t, stamped)
        if now == state.last[1] or now < 0.0:
            return
        if self.passes(state, now, valid):
            self.store(state, state.cells, input)
            state.last[0] = now
        chance = state.after_lost if state.last[2] > 0.0 else state.after_good
        state.last[1] = now
        state.last[2] = 1.0 if state.rng.random() < chance else 0.0


class Latency(_Transport):
    """Measurements that take their time, each another one.

        input, stamped ─▶ [ Latency ] ─▶ out, stamp

    A measurement that is new at t arrives at t + latency + jitter * n, n uniform in [0, 1), at the
    next tick and at least one tick later (Nilsson, Real-time control systems with delays, 1998).
    With ``ordered``, it does not overtake earlier ones, as on a line; otherwise it may, as between
    networks. ``out`` is the one that arrived last, and ``stamp`` when it was measured, -1 before
    the first.
    """

    out = Output(Same("T"), through="input", doc="the measurement that arrived last")
    stamp = Output(Scalar, unit="s", doc="when it was measured; -1 before the first")

    latency: float = param(unit="s", at_least=0.0, doc="the least time on the way")
    jitter: float = param(0.0, unit="s", at_least=0.0, doc="up to how much longer")
    ordered: bool = param(True, doc="none overtakes another")

    queue = State("rows", like="out", ring="head", doc="the last measurements")
    times = State("rows", 2, ring="head", doc="the stamp of each, and when it arrives (s)")
    head = State(3, doc="how many there were; the stamp of the last; when it arrives (s)")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        # One that overtook others is held until one arrives that was measured after it arrived:
        # for twice the longest time.
        longest = int((self.latency + self.jitter) / context.dt + 1.0 - EARLY)
        return {"rows": (longest if self.ordered else 2 * longest) + 2}

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rows = len(state.times)
        state.cells = state.queue.reshape(state.rows, -1)
        state.times[:, 0], state.times[:, 1] = NEVER, math.inf
        state.head[1], state.head[2] = NEVER, NEVER

    def output(self, state: BlockState, t: float) -> tuple[Any, float]:
        latest, newest = NEVER, NEVER
        row = -1
        for i in range(state.rows):
            stamp, arrival = state.times[i, 0], state.times[i, 1]
            # Of those that arrive in the same tick, the one that was measured last.
            ticks = math.floor(arrival / state.dt + 1.0 - EARLY) if arrival < math.inf else math.inf
            if arrival <= t + EARLY * state.dt and (
                ticks > latest or (ticks == latest and stamp > newest)
            ):
                latest, newest, row = float(ticks), float(stamp), i
        cells = np.zeros(state.size)
        for j in range(state.size):
            if row >= 0:
                cells[j] = state.cells[row, j]
        return self.packed(state, cells), newest

    def update(self, state: BlockState, t: float, input: Any, stamped: float) -> None:
        now = self.time_of(state, t, stamped)
        if now == state.head[1] or now < 0.0:
            return
        arrival = max(t + self.latency + self.jitter * state.rng.random(), t + state.dt)
        if self.ordered:
            arrival = max(arrival, state.head[2])
        row = int(state.head[0]) % state.rows
        state.times[row, 0], state.times[row, 1] = now, arrival
        self.store(state, state.cells[row], input)
        state.head[0] += 1.0
        state.head[1], state.head[2] = now, arrival
