"""Nonlinear elements without memory, component by component."""

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
    check_sized,
    nearest,
    param,
    spread_to,
)


class _Cornered(Elementwise):
    """An element that bends where its input passes a limit: a solver's step ends there."""

    follows = True

    def crossings(self, context: BlockContext) -> list[str]:
        return ["either"] * (2 * math.prod(context.types["out"].shape))

    def guards(self, state: BlockState, t: float, input: Any) -> FloatArray:
        found = np.empty(2 * state.size)
        for i in range(state.size):
            x = float(input if state.form == "scalar" else input[i])
            found[2 * i], found[2 * i + 1] = state.low[i] - x, x - state.high[i]
        return found


class Clip(_Cornered):
    """Limit each component of a signal.

        input ─▶ [ Clip ] ─▶ out

    out = min(max(input, low), high), each component.
    """

    low: FloatArray = param(
        -math.inf,
        shape=[(), (None,)],
        finite=False,
        tunable=True,
        doc="lower limit, or one per component",
    )
    high: FloatArray = param(
        math.inf,
        shape=[(), (None,)],
        finite=False,
        tunable=True,
        doc="upper limit, or one per component",
    )

    def validate(self) -> None:
        if {self.low.ndim, self.high.ndim} <= {0, 1} and not _ordered(self.low, self.high):
            message = f"expected at least low = {self.low.tolist()}, got {self.high.tolist()}"
            raise ParameterError([("high", message)])

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        for name in ("low", "high"):
            check_sized(context.types["out"], name, self.value(name))

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.low, state.high = spread_to(self.low, state.size), spread_to(self.high, state.size)

    def of(self, state: BlockState, x: float, i: int) -> float:
        return float(min(max(x, state.low[i]), state.high[i]))


class DeadZone(_Cornered):
    """Ignore small values.

        input ─▶ [ DeadZone ] ─▶ out

    out = 0 for low <= input <= high, input - low below and input - high above, each component.
    """

    low: float = param(tunable=True, doc="lower end of the zone")
    high: float = param(tunable=True, doc="upper end of the zone")

    def validate(self) -> None:
        if self.high < self.low:
            raise ParameterError(
                [("high", f"expected at least low = {self.low:g}, got {self.high:g}")]
            )

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.low, state.high = np.full(state.size, self.low), np.full(state.size, self.high)

    def of(self, state: BlockState, x: float, i: int) -> float:
        if x < self.low:
            return x - self.low
        return x - self.high if x > self.high else 0.0


class Quantizer(Elementwise):
    """Round to whole steps.

        input ─▶ [ Quantizer ] ─▶ out

    out = step * round((input - offset) / step) + offset, each component; halfway cases go to the
    even number of steps.
    """

    step: float = param(above=0.0, tunable=True, doc="size of a step")
    offset: float = param(0.0, tunable=True, doc="a value that is kept as it is")

    def of(self, state: BlockState, x: float, i: int) -> float:
        return self.step * nearest((x - self.offset) / self.step) + self.offset


def _ordered(low: FloatArray, high: FloatArray) -> bool:
    """Whether no lower limit is above its upper one, as far as the lengths agree."""
    if low.ndim and high.ndim and low.shape != high.shape:
        return True  # reported with the lengths
    return bool(np.all(low <= high))
