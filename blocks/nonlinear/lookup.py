"""Functions given by a table of points."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    Elementwise,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    check_ascending,
    param,
    piece,
)

OUTSIDE = ("hold", "extrapolate", "error")


class LookupTable(Elementwise):
    """A function of one variable, given by points.

        input ─▶ [ LookupTable ] ─▶ out

    out = f(input), each component: the value of the next lower point (``hold``), a straight line
    between two points, or a cubic through all of them (scipy's CubicSpline, not-a-knot; or
    PchipInterpolator, which does not overshoot). Outside the points, the first or last value holds;
    ``extrapolate`` continues the outermost piece; ``error`` ends the run.
    """

    out = Output(Same("T", own_unit=True), doc="the function's value")

    x: FloatArray = param(shape=(None,), doc="where the function is given, in ascending order")
    y: FloatArray = param(shape=(None,), tunable=True, doc="its values there")
    method: str = param(
        "linear", choices=("hold", "linear", "cubic", "pchip"), doc="what lies between two points"
    )
    outside: str = param("hold", choices=OUTSIDE, doc="what lies outside the points")

    def validate(self) -> None:
        check_ascending(self.x, "x")
        if len(self.y) != len(self.x):
            message = f"expected {len(self.x)} values, one per x, got {len(self.y)}"
            raise ParameterError([("y", message)])

    @cached_property
    def coefficients(self) -> FloatArray:
        """Of each piece (n - 1, 4): polynomial in the distance from its lower end."""
        from scipy.interpolate import CubicSpline, PchipInterpolator

        coefficients = np.zeros((len(self.x) - 1, 4))
        coefficients[:, 0] = self.y[:-1]
        if self.method == "linear":
            coefficients[:, 1] = np.diff(self.y) / np.diff(self.x)
        elif self.method != "hold":
            kind = CubicSpline if self.method == "cubic" else PchipInterpolator
            coefficients[:] = kind(self.x, self.y).c[::-1].T
        return coefficients

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.x, state.y = self.x.copy(), self.y.copy()
        state.table = self.coefficients.copy()

    def why_not_finite(self) -> str:
        return _outside(self.outside, f"input is outside of x, {self.x[0]:g} to {self.x[-1]:g}")

    def of(self, state: BlockState, x: float, i: int) -> float:
        last = len(state.x) - 1
        if x < state.x[0] or x > state.x[last]:
            # Not an exception: the engine finds the NaN, adds block, tick and time, and asks
            # `why_not_finite`, under both engines alike.
            if self.outside == "error":
                return math.nan
            if self.outside == "hold" or self.method == "hold":
                return float(state.y[0]) if x < state.x[0] else float(state.y[last])
        # The last point belongs to no piece of a table that holds.
        if x == state.x[last]:
            return float(state.y[last])
        k = piece(state.x, x)
        d = x - state.x[k]
        low = state.table[k, 0] + d * state.table[k, 1]
        return float(low + d * d * (state.table[k, 2] + d * state.table[k, 3]))


class LookupTable2D(Block):
    """A function of two variables, given on a grid.

        x, y ─▶ [ LookupTable2D ] ─▶ out

    out = f(x, y): the value of the next lower point (``hold``), or bilinear between four points
    (scipy's RegularGridInterpolator). Outside the grid as for LookupTable.
    """

    first = Input(Scalar, name="x", doc="first variable")
    second = Input(Scalar, name="y", doc="second variable")
    out = Output(Scalar, doc="the function's value")

    xs: FloatArray = param(name="x", shape=(None,), doc="rows of the grid, in ascending order")
    ys: FloatArray = param(name="y", shape=(None,), doc="columns of the grid, in ascending order")
    values: FloatArray = param(
        shape=(None, None), tunable=True, doc="the function's values: a list for each x"
    )
    method: str = param("linear", choices=("hold", "linear"), doc="what lies between points")
    outside: str = param("hold", choices=OUTSIDE, doc="what lies outside the grid")

    def validate(self) -> None:
        check_ascending(self.xs, "x")
        check_ascending(self.ys, "y")
        if self.values.shape != (len(self.xs), len(self.ys)):
            rows, columns = self.values.shape
            message = f"expected {len(self.xs)} lists of {len(self.ys)} numbers, got {rows} of "
            raise ParameterError([("values", f"{message}{columns}")])

    def start(self, state: BlockState) -> None:
        state.xs, state.ys = self.xs.copy(), self.ys.copy()
        state.values = self.values.copy()

    def why_not_finite(self) -> str:
        grid = f"x, {self.xs[0]:g} to {self.xs[-1]:g}, or of y, {self.ys[0]:g} to {self.ys[-1]:g}"
        return _outside(self.outside, f"point is outside of {grid}")

    def output(self, state: BlockState, t: float, x: float, y: float) -> float:
        if self.outside != "extrapolate":
            inside_x = min(max(x, state.xs[0]), state.xs[len(state.xs) - 1])
            inside_y = min(max(y, state.ys[0]), state.ys[len(state.ys) - 1])
            if self.outside == "error" and (inside_x != x or inside_y != y):
                return math.nan
            x, y = inside_x, inside_y
        i, j = piece(state.xs, x), piece(state.ys, y)
        a = (x - state.xs[i]) / (state.xs[i + 1] - state.xs[i])
        b = (y - state.ys[j]) / (state.ys[j + 1] - state.ys[j])
        if self.method == "hold":
            # At the upper end of the grid its own point counts.
            i, j = i + int(a >= 1.0), j + int(b >= 1.0)
            return float(state.values[i, j])
        low = (1.0 - b) * state.values[i, j] + b * state.values[i, j + 1]
        high = (1.0 - b) * state.values[i + 1, j] + b * state.values[i + 1, j + 1]
        return float((1.0 - a) * low + a * high)


def _outside(outside: str, message: str) -> str:
    """Why a table has no value."""
    if outside != "error":
        return ""
    return f"the {message}; give more points, or choose 'outside: hold' or 'extrapolate'"
