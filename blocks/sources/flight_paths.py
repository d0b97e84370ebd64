"""Smooth paths in space over time, with the derivatives that a controller feeds forward.

Out come position, velocity, acceleration and jerk, each a Vector(3)::

    eight: {type: Lemniscate, size: [2, 1, 0.3], period: 8}
    route: {type: MinimumSnap, waypoints: [[0, 0, 0], [2, 0, 1], [2, 3, 1]], times: [0, 2, 5]}
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Output,
    ParameterError,
    Vector,
    param,
    size_of,
    solve,
)

DEGREE = 7  # of the polynomials whose fourth derivative, integrated, is least


class _FlightPath(Block, ABC):
    """A position over time, with three derivatives."""

    position = Output(Vector(3), unit="m", doc="p(t)")
    velocity = Output(Vector(3), unit="m/s", doc="p'")
    acceleration = Output(Vector(3), unit="m/s^2", doc="p''")
    jerk = Output(Vector(3), unit="m/s^3", doc="p'''")

    @abstractmethod
    def output(
        self, state: BlockState, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """p and three derivatives."""


class Lemniscate(_FlightPath):
    """A figure of eight, the lemniscate of Gerono, that is flown in a period.

        [ Lemniscate ] ─▶ position, velocity, acceleration, jerk

    p = centre + (a sin(w t), b sin(2 w t), c sin(w t)) with w = 2 pi / period and size = (a, b, c):
    through its centre at t = 0, where it is fastest, and tilted by c.
    """

    size: FloatArray = param([2.0, 1.0, 0.0], unit="m", shape=(3,), doc="a, b, c: half extents")
    centre: FloatArray = param([0.0, 0.0, 0.0], unit="m", shape=(3,), doc="of the eight")
    period: float = param(10.0, unit="s", above=0.0, doc="time for the whole eight")

    def start(self, state: BlockState) -> None:
        state.size, state.centre = self.size.copy(), self.centre.copy()
        state.omega = 2.0 * math.pi / self.period * np.array([1.0, 2.0, 1.0])

    def output(
        self, state: BlockState, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        p, v, a, j = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
        for i in range(3):
            w, size = state.omega[i], state.size[i]
            s, c = math.sin(w * t), math.cos(w * t)
            p[i] = state.centre[i] + size * s
            v[i] = size * w * c
            a[i] = -size * w * w * s
            j[i] = -size * w * w * w * c
        return p, v, a, j


class MinimumSnap(_FlightPath):
    """The path through waypoints at given times whose snap, the fourth derivative, is least.

        [ MinimumSnap ] ─▶ position, velocity, acceleration, jerk

    It minimises the integral of |p''''|^2, at rest in the first and the last waypoint: polynomials
    of degree 7 with six continuous derivatives where they meet (Mellinger and Kumar, Minimum snap
    trajectory generation and control for quadrotors, 2011). Before and after it stands still.
    """

    waypoints: FloatArray = param(unit="m", shape=(None, 3), doc="at least two points, a row each")
    times: FloatArray = param(unit="s", shape=(None,), doc="when each is passed, in order")

    def validate(self) -> None:
        n = len(self.waypoints)
        if n < 2:
            raise ParameterError([("waypoints", f"expected at least two, got {n}")])
        if self.times.shape != (n,):
            text = f"expected {n} times, one per waypoint, got {size_of(self.times)}"
            raise ParameterError([("times", text)])
        wrong = np.flatnonzero(np.diff(self.times) <= 0.0)
        if len(wrong):
            first, second = self.times[wrong[0]], self.times[wrong[0] + 1]
            text = f"expected times that rise, got {second:g} s after {first:g} s"
            raise ParameterError([("times", text)])

    def start(self, state: BlockState) -> None:
        state.times = self.times.copy()
        state.spans = np.diff(self.times)
        state.pieces = minimum_snap(self.waypoints, state.spans)

    def output(
        self, state: BlockState, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        p, v, a, j = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
        k = 0
        while k < len(state.spans) - 1 and t >= state.times[k + 1]:
            k += 1
        span = state.spans[k]
        s = (t - state.times[k]) / span
        rests = s < 0.0 or s > 1.0
        s = min(max(s, 0.0), 1.0)
        for i in range(3):
            # Horner's rule for the value and, without their factorials, three derivatives.
            y0, y1, y2, y3 = 0.0, 0.0, 0.0, 0.0
            for d in range(DEGREE, -1, -1):
                y3 = y3 * s + y2
                y2 = y2 * s + y1
                y1 = y1 * s + y0
                y0 = y0 * s + state.pieces[k, d, i]
            p[i] = y0
            if not rests:
                v[i] = y1 / span
                a[i] = 2.0 * y2 / (span * span)
                j[i] = 6.0 * y3 / (span * span * span)
        return p, v, a, j


def minimum_snap(points: FloatArray, spans: FloatArray) -> FloatArray:
    """Coefficients (k, 8, 3) of k pieces through points (k + 1, 3), in s = time / span of each.

    The eight conditions per piece: its ends are given, six derivatives agree where two meet, and
    three are zero at both ends of the path.
    """
    k, n = len(spans), DEGREE + 1
    matrix, sides = np.zeros((n * k, n * k)), np.zeros((n * k, 3))
    # Derivative d of s^e at 1, over d!: so that numbers stay near 1. At 0, 1 where e = d.
    at_one = np.array([[math.comb(e, d) for e in range(n)] for d in range(n)], dtype=float)
    row = 0
    for i in range(k):
        here = slice(n * i, n * (i + 1))
        matrix[row, n * i], sides[row] = 1.0, points[i]
        matrix[row + 1, here], sides[row + 1] = at_one[0], points[i + 1]
        row += 2
        for d in range(1, 7) if i + 1 < k else ():
            matrix[row, here] = at_one[d]
            matrix[row, n * (i + 1) + d] = -((spans[i] / spans[i + 1]) ** d)
            row += 1
    for d in range(1, 4):
        matrix[row, d] = 1.0
        matrix[row + 1, n * (k - 1) :] = at_one[d]
        row += 2
    return solve(matrix, sides).reshape(k, n, 3)
