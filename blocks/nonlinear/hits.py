"""A counter of the times at which a signal passes a level."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    Scalar,
    State,
    param,
)

SIGNS = {"rising": 1.0, "falling": -1.0, "either": 0.0}


class HitCrossing(Block):
    """Find when a signal passes a level.

        input ─▶ [ HitCrossing ] ─▶ count, time

    count is how often input has passed ``level`` in ``direction``, and time when it last did, 0
    before. Where the input is continuous, the times are located between ticks; otherwise a hit is
    at the first tick beyond the level. A probe ``{events: name}`` records the located times.
    """

    signal = Input(Scalar, name="input", doc="any number")
    count = Output(Scalar, doc="the hits so far")
    time = Output(Scalar, unit="s", doc="the time of the last one; 0 before the first")

    level: float = param(0.0, tunable=True, doc="what the input passes")
    direction: str = param("either", choices=tuple(SIGNS), doc="the way in which it counts")

    hits = State(doc="the hits so far")
    last = State(unit="s", doc="the time of the last one")
    side = State(doc="1 where the input was above the level, -1 where it was not")

    def start(self, state: BlockState) -> None:
        state.side[...] = math.nan
        state.sign = SIGNS[self.direction]

    def output_count(self, state: BlockState, t: float) -> float:
        return float(state.hits)

    def output_time(self, state: BlockState, t: float) -> float:
        return float(state.last)

    def update(self, state: BlockState, t: float, input: float) -> None:
        now = 1.0 if input > self.level else -1.0
        if now * float(state.side) < 0.0 and now * state.sign >= 0.0:
            state.hits[...] = float(state.hits) + 1.0
            state.last[...] = t
        state.side[...] = now

    def crossings(self, context: BlockContext) -> tuple[str, ...]:
        return (self.direction,)

    def guards(self, state: BlockState, t: float, input: float) -> FloatArray:
        return np.array([input - self.level])

    def event(self, state: BlockState, t: float, which: float, input: float) -> None:
        now = 1.0 if input > self.level else -1.0
        # The side before may be older than a crossing in the other direction, which is no event.
        state.side[...] = -now
        self.update(state, t, input)
