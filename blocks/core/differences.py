"""Jacobians by differences that are compared: with several steps, and from both sides.

In: a function of a vector, and a point. Out: its Jacobian, and the entries that do not settle. Of
f(x) = max(x, 0) at 1: 1; at 0: 0 from below and 1 from above, which is reported.

One step does not do: one that is right for a state of 1 is lost in the rounding of u^2 at
u = 1e5, and at a limit the difference of a value on it and one beyond it grows with 1 / step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blocks.core.signals import FloatArray

Function = Callable[[FloatArray], FloatArray]
# Steps, relative to a number or to 1 if it is smaller. Each is ten times the one before: a smooth
# function's one-sided slopes then differ by a tenth, those at a kink as much as before.
STEPS = 10.0 ** np.arange(-9, 4)
ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
CLEAR = 25.0  # times what rounding explains
KINK = 1e-4  # a difference of the slopes of both sides, of the larger one
AGREE = 0.1  # a difference of the slopes of two steps in one range, of a slope
GROWN = 10.0  # a difference of the slopes of two steps, of the least so far
SETTLED = 1e-3  # a difference of the slopes of two steps, of a slope
WRONG = (ArithmeticError, ValueError, LookupError)  # outside of a function's domain


@dataclass(frozen=True)
class Unsettled:
    """An entry of a Jacobian for which differences disagree.

    below, above : slopes to smaller and to larger values; NaN for one that does not settle.
    """

    row: int
    column: int
    below: float
    above: float


def jacobian(function: Function, point: FloatArray) -> tuple[FloatArray, list[Unsettled]]:
    """The Jacobian (rows, columns) of a function at a point, and entries that do not settle.

    Where only one side settles, the entry is the slope to that side; where both do and differ, it
    is the one to larger values; where none does, 0.
    """
    here = function(point)
    matrix, unsettled = np.zeros((len(here), len(point))), list[Unsettled]()
    for j in range(len(point)):
        sides = _Sides(function, point, j, here)
        matrix[:, j], found = sides.slopes()
        unsettled += [Unsettled(i, j, below, above) for i, below, above in found]
    return matrix, unsettled


class _Sides:
    """A function on both sides of a point along one axis, at all steps: (steps, rows)."""

    def __init__(self, function: Function, point: FloatArray, j: int, here: FloatArray) -> None:
        steps = STEPS * max(1.0, abs(float(point[j])))
        # By the difference that the rounded numbers have, not by the step.
        up, down = point[j] + steps - point[j], point[j] - (point[j] - steps)
        high = np.array([_at(function, point, j, point[j] + step, here) for step in steps])
        low = np.array([_at(function, point, j, point[j] - step, here) for step in steps])
        self.above = (high - here) / up[:, None]
        self.below = (here - low) / down[:, None]
        self.central = (high - low) / (up + down)[:, None]
        largest = np.fmax(np.fmax(np.abs(high), np.abs(low)), np.abs(here))
        self.noise = ROUNDING * largest / steps[:, None]

    def slopes(self) -> tuple[FloatArray, list[tuple[int, float, float]]]:
        """The slope of each row, and for those that do not settle the slopes of both sides."""
        values, errors = _best(self.central, self.noise)
        loose = self._kinks() | ~_is_settled(values, errors, self.noise)
        if not loose.any():
            return values, []
        sides = {}
        for name, slopes in (("below", self.below), ("above", self.above)):
            side, error = _best(slopes, self.noise)
            sides[name] = np.where(_is_settled(side, error, self.noise), side, np.nan)
        below, above = sides["below"], sides["above"]
        one = np.where(np.isnan(above), below, above)
        values = np.where(loose, np.nan_to_num(one), values)
        return values, [(int(i), float(below[i]), float(above[i])) for i in np.flatnonzero(loose)]

    def _kinks(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """The rows whose slopes differ by sides however small the step is."""
        gap = np.abs(self.above - self.below)
        # What is left of it at a step of 0, if it shrinks with the step.
        limit = np.abs(10.0 * gap[:-1] - gap[1:]) / 9.0
        limit = np.where(np.isfinite(limit), limit, 0.0)
        noise = np.where(np.isfinite(self.noise), CLEAR * self.noise, np.inf)[:-1]
        # At the smallest step that shows what the largest gap is: kinks farther away do not count.
        first = np.argmax(noise < 1e-2 * limit.max(axis=0), axis=0)
        rows = np.arange(gap.shape[1])
        size = np.fmax(np.abs(self.above), np.abs(self.below))[first, rows]
        here, next_one = limit[first, rows], limit[np.minimum(first + 1, len(limit) - 1), rows]
        found = (here > noise[first, rows] + KINK * size) & (here > 0.5 * next_one)
        return np.asarray(found, dtype=np.bool_)


def _at(
    function: Function, point: FloatArray, j: int, value: float, here: FloatArray
) -> FloatArray:
    moved = point.copy()
    moved[j] = value
    try:
        return function(moved)
    except WRONG:
        return np.full(len(here), np.nan)


def _best(slopes: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The slope (rows,) that differs least from that of the next larger step, and its error.

    Of the first steps that agree: where a function is bounded, those of far larger steps agree
    as well, on 0. And of those before the difference grows again: of x + sin(x), two steps that
    are whole periods agree exactly, on the slope of x.
    """
    change = np.abs(np.diff(slopes, axis=0))
    size = np.fmax(np.abs(slopes[:-1]), np.abs(slopes[1:]))
    agree = change <= CLEAR * noise[:-1] + AGREE * size
    least = np.minimum.accumulate(np.where(agree, change, np.inf), axis=0)
    grows = change > GROWN * least + CLEAR * noise[:-1]
    left = np.logical_or.accumulate(np.logical_or.accumulate(agree) & (~agree | grows))
    errors = np.where(agree & ~left, change + noise[:-1], np.inf)
    k, rows = np.argmin(errors, axis=0), np.arange(slopes.shape[1])
    return slopes[k, rows], errors[k, rows]


def _is_settled(
    values: FloatArray, errors: FloatArray, noise: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether steps agree on slopes, as far as rounding lets them."""
    allowed = SETTLED * np.abs(values) + CLEAR * np.nanmin(noise, axis=0) + 1e-9
    return np.asarray(np.isfinite(values) & (errors <= allowed), dtype=np.bool_)
