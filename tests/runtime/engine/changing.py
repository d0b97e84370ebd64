"""Blocks whose code depends on globals, helper functions and defaults that a test changes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks import Block, Input, Output, Scalar, State, Vector

LEVEL = 100.0
NAME = "fast"
START = 2.0


def alarm() -> float:
    return LEVEL


def scaled(x: float, by: float = START) -> float:
    return x * by


def chosen() -> float:
    return 1.0 if NAME == "fast" else 2.0


class Uses(Block):
    """A value of the module, through helper functions."""

    x = Input(Scalar)
    out = Output(Scalar)
    gain = 3.0

    def output(self, state: Any, t: float, x: float) -> float:
        return alarm() + scaled(x) + 10.0 * chosen() + self.bonus() + self.gain

    def bonus(self) -> float:
        return abs(-0.5)


class Rarely(Block):
    """A value of the module on a few ticks."""

    x = Input(Scalar)
    out = Output(Scalar)

    def output(self, state: Any, t: float, x: float) -> float:
        return alarm() if t > 0.05 else 0.0


class Tables(Block):
    """Constants in arrays, tuples and lists of the module, which are changed in place."""

    x = Input(Scalar)
    out = Output(Scalar)

    def output(self, state: Any, t: float, x: float) -> float:
        return float(TABLE[0]) + LIST[0] + PAIR[0] + CONFIG.gain


class Config:
    gain = 7.0


TABLE, LIST, PAIR, CONFIG = np.ones(2), [1.0], (1.0, 2.0), Config()


def defaults(
    x: float, g: float = LEVEL, flag: bool = True, pair: Any = (1.0, (2.0, -math.inf)), k: int = 3
) -> float:
    low = pair[1][1]
    return (x * g if flag else 0.0) + pair[0] + pair[1][0] + k + (1.0 if low < 0.0 else 0.0)


class Defaults(Block):
    """Defaults of parameters are those of the definition, whatever the globals are later."""

    x = Input(Scalar)
    out = Output(Scalar)
    row = Output(Vector(2))

    def output(self, state: Any, t: float, x: float) -> Any:
        return defaults(x) + self.own(x), np.zeros(2) + x

    def own(self, x: float, g: float = START) -> float:
        return x * g


def total(x: float, kept: Any = [0.0]) -> float:  # noqa: B006 -- what is tested
    kept[0] += x
    return float(kept[0])


class Mutable(Block):
    """A default that calls share, so that it counts."""

    x = Input(Scalar)
    out = Output(Scalar)
    y = State()

    def output(self, state: Any, t: float) -> float:
        return float(state.y)

    def update(self, state: Any, t: float, x: float) -> None:
        state.y = total(1.0)
