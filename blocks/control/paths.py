"""Reference paths: curves sampled evenly along their arc length, as (x, y, theta, kappa) rows."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Output,
    ParameterError,
    Path,
    arctan2,
    cos,
    param,
    sin,
    solve,
)

CurveFunction = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
OVERSAMPLING = 20
FINEST = 20_000


def curvature(first: FloatArray, second: FloatArray) -> FloatArray:
    """Signed curvature (1/m) of a parametric plane curve, positive where it bends left.

    kappa = (x' y'' - x'' y') / (x'^2 + y'^2)^(3/2): the paper's equation (section III-C)
    without its absolute value. ``first`` and ``second`` are derivatives of shape (n, 2); kappa
    is 0 where the speed is 0.
    """
    speed = np.hypot(first[:, 0], first[:, 1])
    cross = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    kappa = np.zeros_like(cross)
    np.divide(cross, speed * speed * speed, out=kappa, where=speed > 0.0)
    return kappa


def sample_evenly(
    curve: CurveFunction, start: float, stop: float, n: int, closed: bool
) -> FloatArray:
    """Sample a parametric curve at ``n`` points evenly spaced along its arc length.

    Parameters
    ----------
    curve : maps parameters (m,) to position, first and second derivative, each (m, 2).
    start, stop : the parameter's range.
    n : number of samples; a closed curve's last sample is one spacing before its first.

    Returns
    -------
    Array (n, 4) of x (m), y (m), theta (rad, continuous along the curve), kappa (1/m).
    """
    fine = np.linspace(start, stop, max(OVERSAMPLING * n, FINEST) + 1)
    _, first, _ = curve(fine)
    speed = np.hypot(first[:, 0], first[:, 1])
    arc = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))))
    wanted = np.linspace(0.0, arc[-1], n, endpoint=not closed)
    position, first, second = curve(np.interp(wanted, arc, fine))
    theta = np.unwrap(arctan2(first[:, 1], first[:, 0]))
    return np.column_stack((position, theta, curvature(first, second)))


def interpolating_spline(u: FloatArray, points: FloatArray, degree: int, periodic: bool) -> Any:
    """The spline of ``scipy.interpolate.make_interp_spline``, on its knots.

    Its coefficients are recomputed, since SciPy's come from LAPACK.

    Parameters
    ----------
    u : rising parameters, (n,). points : (n, 2); the last is the first one if ``periodic``.
    """
    # scipy stays off the start-up path
    from scipy.interpolate import BSpline, make_interp_spline

    spline = make_interp_spline(u, points, k=degree, bc_type="periodic" if periodic else None)
    wrap = degree if periodic else 0  # the last coefficients are the first ones once more
    n = len(spline.c) - wrap
    design = BSpline.design_matrix(u[:n], spline.t, degree).toarray()
    design[:, :wrap] += design[:, n:]
    coefficients = solve(design[:, :n], points[:n])
    return BSpline(
        spline.t, np.concatenate((coefficients, coefficients[:wrap])), degree, spline.extrapolate
    )


class _PathBlock(Block):
    path = Output(Path("samples"), constant=True, doc="the curve, evenly sampled by arc length")

    samples: int = param(2001, at_least=2, doc="number of samples along the path")

    @cached_property
    def sampled(self) -> FloatArray:
        """The path as an array (samples, 4)."""
        array = self.sample()
        array.setflags(write=False)
        return array

    def sample(self) -> FloatArray:
        raise NotImplementedError

    def output(self, state: BlockState, t: float) -> FloatArray:
        return self.sampled


class LinePath(_PathBlock):
    """A straight line parallel to the x axis, walked from ``x_start`` to ``x_end``.

        [ LinePath ] ─▶ path

    theta is 0, or pi where x_end lies before x_start; kappa is 0.
    """

    y: float = param(0.0, unit="m", doc="the line's y")
    x_start: float = param(0.0, unit="m", doc="x of the first sample")
    x_end: float = param(40.0, unit="m", doc="x of the last sample")

    def validate(self) -> None:
        if self.x_end == self.x_start:
            raise ParameterError([("x_end", "the line has no length: x_end equals x_start")])

    def sample(self) -> FloatArray:
        x = np.linspace(self.x_start, self.x_end, self.samples)
        heading = 0.0 if self.x_end > self.x_start else math.pi
        n = self.samples
        return np.column_stack((x, np.full(n, self.y), np.full(n, heading), np.zeros(n)))


class SinePath(_PathBlock):
    """A sine along the x axis, y = amplitude * sin(2 pi x / wavelength) (paper, case B).

    [ SinePath ] ─▶ path
    """

    amplitude: float = param(1.0, unit="m", doc="half the height from trough to crest")
    wavelength: float = param(2.0 * math.pi, unit="m", above=0.0, doc="length of one period")
    x_start: float = param(0.0, unit="m", doc="x of the first sample")
    x_end: float = param(40.0, unit="m", doc="x of the last sample")

    def validate(self) -> None:
        if self.x_end <= self.x_start:
            raise ParameterError([("x_end", f"must lie beyond x_start = {self.x_start:g} m")])

    def sample(self) -> FloatArray:
        k = 2.0 * math.pi / self.wavelength

        def curve(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            s, c = self.amplitude * sin(k * x), self.amplitude * k * cos(k * x)
            ones, zeros = np.ones_like(x), np.zeros_like(x)
            return (
                np.column_stack((x, s)),
                np.column_stack((ones, c)),
                np.column_stack((zeros, -k * k * s)),
            )

        return sample_evenly(curve, self.x_start, self.x_end, self.samples, closed=False)


class CirclePath(_PathBlock):
    """A full circle that begins at the centre's right hand, at angle 0.

    [ CirclePath ] ─▶ path

    kappa is 1 / radius counterclockwise and -1 / radius clockwise.
    """

    center: FloatArray = param((0.0, 0.0), unit="m", shape=(2,), doc="the centre's x and y")
    radius: float = param(1.0, unit="m", above=0.0, doc="the circle's radius")
    clockwise: bool = param(False, doc="walk it with the centre on the right hand")

    def sample(self) -> FloatArray:
        turn = -1.0 if self.clockwise else 1.0
        angle = turn * np.linspace(0.0, 2.0 * math.pi, self.samples, endpoint=False)
        return np.column_stack(
            (
                self.center[0] + self.radius * cos(angle),
                self.center[1] + self.radius * sin(angle),
                angle + turn * 0.5 * math.pi,
                np.full(self.samples, turn / self.radius),
            )
        )


class WaypointPath(_PathBlock):
    """A B-spline that passes through every waypoint (chord-length parametrisation).

    [ WaypointPath ] ─▶ path

    The interpolating spline is scipy.interpolate.make_interp_spline, periodic if ``closed``.
    """

    points: FloatArray = param(unit="m", shape=(None, 2), doc="the waypoints' x and y")
    degree: int = param(3, at_least=1, at_most=5, doc="degree of the spline; 1 is a polygon")
    closed: bool = param(False, doc="join the last waypoint to the first")

    def validate(self) -> None:
        gaps = np.linalg.norm(np.diff(self._corners, axis=0), axis=1)
        if len(self.points) <= self.degree:
            raise ParameterError(
                [("points", f"a spline of degree {self.degree} needs at least {self.degree + 1}")]
            )
        if not gaps.all():
            where = int(np.argmin(gaps))
            message = f"points {where} and {where + 1} are the same"
            if where + 1 == len(self.points):
                message = "the first and the last point are the same; 'closed' joins them itself"
            raise ParameterError([("points", message)])

    @property
    def _corners(self) -> FloatArray:
        points = self.points
        return np.vstack((points, points[:1])) if self.closed else points

    def sample(self) -> FloatArray:
        corners = self._corners
        chord = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        u = np.concatenate(([0.0], np.cumsum(chord)))
        spline = interpolating_spline(u, corners, self.degree, self.closed and self.degree > 1)
        first, second = spline.derivative(1), spline.derivative(min(2, self.degree))

        def curve(at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            bend = second(at) if self.degree > 1 else np.zeros((len(at), 2))
            return spline(at), first(at), bend

        return sample_evenly(curve, 0.0, float(u[-1]), self.samples, self.closed)
