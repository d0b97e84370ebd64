"""Directed lines and arcs of the plane, of which the contours of a world consist.

Points are complex numbers x + iy (m) here: a turn is then a product, and a left normal is i times
the direction. Positions on a curve are arc lengths s (m) from its start; a curve's carrier is the
whole line or circle that it lies on.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from blocks.core import FloatArray, arctan2

ComplexArray = npt.NDArray[np.complex128]

# Lengths (m) below this are rounding errors.
ROUNDING = 1e-9
TANGENT = 1e-12  # m^2


@dataclass(frozen=True)
class Line:
    """A straight line from ``start`` to ``end``."""

    start: complex
    end: complex

    @property
    def length(self) -> float:
        return abs(self.end - self.start)

    @property
    def along(self) -> complex:
        """The unit vector of its direction."""
        return (self.end - self.start) / self.length

    def at(self, s: FloatArray) -> ComplexArray:
        """The points at arc lengths ``s``."""
        return np.asarray(self.start + self.along * s, dtype=complex)

    def tangent(self, s: FloatArray) -> ComplexArray:
        """Unit vectors of the direction at arc lengths ``s``."""
        return np.full(s.shape, self.along)

    def locate(self, point: complex) -> float:
        """Arc length of the foot of a point on the carrier."""
        return ((point - self.start) * self.along.conjugate()).real

    def off(self, point: complex) -> float:
        """Distance of a point from the carrier (m)."""
        return abs(((point - self.start) * self.along.conjugate()).imag)

    def cut(self, begin: float, end: float) -> Line:
        """The part of the carrier between two arc lengths."""
        return Line(self.start + self.along * begin, self.start + self.along * end)

    def shifted(self, by: float) -> Line:
        """The parallel curve at a distance to the left."""
        return Line(self.start + 1j * self.along * by, self.end + 1j * self.along * by)


@dataclass(frozen=True)
class Arc:
    """An arc about ``centre`` from the angle ``begin``, over ``sweep`` (rad, left is positive)."""

    centre: complex
    radius: float
    begin: float
    sweep: float

    @property
    def length(self) -> float:
        return abs(self.sweep) * self.radius

    @property
    def rate(self) -> float:
        """Change of the angle per arc length (1/m); its sign is that of the turn."""
        return math.copysign(1.0 / self.radius, self.sweep)

    def at(self, s: FloatArray) -> ComplexArray:
        """The points at arc lengths ``s``."""
        turned = np.exp(1j * (self.begin + self.rate * s))
        return np.asarray(self.centre + self.radius * turned, dtype=complex)

    def tangent(self, s: FloatArray) -> ComplexArray:
        """Unit vectors of the direction at arc lengths ``s``."""
        turn = math.copysign(1.0, self.sweep) * 1j
        return np.asarray(turn * np.exp(1j * (self.begin + self.rate * s)), dtype=complex)

    def locate(self, point: complex) -> float:
        """Arc length of the foot of a point on the carrier, measured past the nearer end."""
        middle = self.begin + 0.5 * self.sweep
        return 0.5 * self.length + wrapped(cmath.phase(point - self.centre) - middle) / self.rate

    def off(self, point: complex) -> float:
        """Distance of a point from the carrier (m)."""
        return abs(abs(point - self.centre) - self.radius)

    def cut(self, begin: float, end: float) -> Arc:
        """The part of the carrier between two arc lengths."""
        return replace(self, begin=self.begin + self.rate * begin, sweep=self.rate * (end - begin))

    def shifted(self, by: float) -> Arc:
        """The parallel curve at a distance to the left."""
        return replace(self, radius=self.radius + (by if self.sweep < 0.0 else -by))


LineOrArc = Line | Arc


def wrapped(angle: float) -> float:
    """The same angle from -pi to pi."""
    return math.remainder(angle, 2.0 * math.pi)


def foot(curve: LineOrArc, points: ComplexArray) -> ComplexArray:
    """The point of the curve nearest to each of ``points``, in an array of the same shape."""
    if isinstance(curve, Line):
        s = ((points - curve.start) * np.conj(curve.along)).real
    else:
        middle = curve.begin + 0.5 * curve.sweep
        ahead = (points - curve.centre) * cmath.exp(-1j * middle)
        turn = arctan2(ahead.imag, ahead.real)
        s = 0.5 * curve.length + turn / curve.rate
    return curve.at(np.clip(s, 0.0, curve.length))


def meetings(a: LineOrArc, b: LineOrArc) -> list[complex]:
    """Where two carriers meet: up to two points, none for parallel lines or equal circles."""
    if isinstance(a, Line) and isinstance(b, Line):
        sine = (a.along.conjugate() * b.along).imag
        if abs(sine) < ROUNDING:
            return []
        return [a.start + a.along * ((b.start - a.start).conjugate() * b.along).imag / sine]
    if isinstance(b, Line):
        a, b = b, a
    if isinstance(a, Line) and isinstance(b, Arc):
        middle, along = a.start + a.along * a.locate(b.centre), a.along
        square = b.radius**2 - abs(b.centre - middle) ** 2
    elif isinstance(a, Arc) and isinstance(b, Arc):
        apart = abs(b.centre - a.centre)
        if apart < ROUNDING:
            return []
        unit = (b.centre - a.centre) / apart
        reach = 0.5 * (apart + (a.radius**2 - b.radius**2) / apart)
        middle, along = a.centre + reach * unit, 1j * unit
        square = a.radius**2 - reach**2
    # Touching carriers share one point; two close ones would be rounding errors.
    if abs(square) < TANGENT:
        return [middle]
    if square < 0.0:
        return []
    half = math.sqrt(square)
    return [middle - half * along, middle + half * along]
