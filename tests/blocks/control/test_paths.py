"""Paths against closed forms, other interpolators of scipy, and theorems of plane curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline, splev, splprep

import blocks
from blocks.control.paths import curvature
from blocks.core.signals import FloatArray
from tests.examples import examples

BEAN = [[0.0, 0.0], [2.0, -0.3], [3.0, 1.5], [1.2, 2.6], [-0.5, 1.4], [-0.9, 0.6]]
HILL = [[0.0, 0.0], [1.0, 0.5], [2.1, 0.8], [3.0, 0.7], [4.0, 0.2], [5.1, -0.2], [6.0, -0.1]]
SHAPES = [(BEAN, True), (BEAN[::-1], True), (BEAN, False), (HILL, False)]
lengths = st.floats(-20.0, 20.0)


def gaps(path: FloatArray, closed: bool = False) -> FloatArray:
    """Distances from sample to sample."""
    points = np.vstack((path[:, :2], path[:1, :2])) if closed else path[:, :2]
    return np.asarray(np.hypot(*np.diff(points, axis=0).T))


def turned(path: FloatArray) -> FloatArray:
    """Angles of the chord over two samples, against the heading of the sample between."""
    chord = path[2:, :2] - path[:-2, :2]
    off = np.arctan2(chord[:, 1], chord[:, 0]) - path[1:-1, 2]
    return np.asarray(np.remainder(off + math.pi, math.tau) - math.pi)


@given(lengths, lengths, lengths, st.integers(2, 50))
def test_line(y: float, start: float, end: float, n: int) -> None:
    if abs(start - end) < 1e-3:
        return
    path = blocks.LinePath(y=y, x_start=start, x_end=end, samples=n).sampled
    assert path.shape == (n, 4)
    assert path[0, 0] == start
    assert path[-1, 0] == pytest.approx(end)
    assert (path[:, 1] == y).all()
    np.testing.assert_allclose(gaps(path), abs(end - start) / (n - 1), rtol=1e-9)
    forward = np.column_stack((np.cos(path[:, 2]), np.sin(path[:, 2])))
    expected = np.tile([math.copysign(1.0, end - start), 0.0], (n, 1))
    np.testing.assert_allclose(forward, expected, atol=1e-15)
    assert not path[:, 3].any()


@given(lengths, lengths, st.floats(0.01, 50.0), st.booleans(), st.integers(2, 400))
def test_circle(x: float, y: float, radius: float, clockwise: bool, n: int) -> None:
    path = blocks.CirclePath(center=[x, y], radius=radius, clockwise=clockwise, samples=n).sampled
    side = -1.0 if clockwise else 1.0
    # The centre lies at the radius to the left of every sample, or to its right.
    left = np.column_stack((-np.sin(path[:, 2]), np.cos(path[:, 2])))
    centers = path[:, :2] + side * radius * left
    np.testing.assert_allclose(centers, np.tile([x, y], (n, 1)), atol=1e-12 * (50 + radius))
    np.testing.assert_allclose(path[:, 3], side / radius)
    # The last sample is one spacing before the first.
    chord = 2.0 * radius * math.sin(math.pi / n)
    np.testing.assert_allclose(gaps(path, closed=True), chord, rtol=1e-9)
    np.testing.assert_allclose(path[0, :2], [x + radius, y])
    np.testing.assert_allclose(np.diff(path[:, 2]), side * math.tau / n, rtol=1e-9)


sines: list[dict[str, Any]] = [
    {},
    {"amplitude": 0.4, "wavelength": 3.0, "x_start": -2.0, "x_end": 7.3},
    {"amplitude": -2.0, "wavelength": 5.0, "samples": 301},
    {"amplitude": 0.0},
]


@pytest.mark.parametrize("parameters", sines)
def test_sine(parameters: dict[str, Any]) -> None:
    block = blocks.SinePath(**parameters)
    x, y, theta, kappa = block.sampled.T
    k, a = math.tau / block.wavelength, block.amplitude
    np.testing.assert_allclose(y, a * np.sin(k * x), atol=1e-14)
    slope, bend = a * k * np.cos(k * x), -a * k * k * np.sin(k * x)
    np.testing.assert_allclose(theta, np.arctan(slope), atol=1e-14)
    np.testing.assert_allclose(kappa, bend / (1.0 + slope**2) ** 1.5, atol=1e-13)
    assert x[0] == block.x_start
    assert x[-1] == pytest.approx(block.x_end, abs=1e-12)


@pytest.mark.parametrize("n", [2, 3, 7, 40, 2001])
def test_sine_is_even_along_its_arc(n: int) -> None:
    """However few the samples, the way between two is the same, by quadrature."""
    block = blocks.SinePath(samples=n)
    x = block.sampled[:, 0]

    def speed(at: float) -> float:
        return math.sqrt(1.0 + math.cos(at) ** 2)

    pairs = list(pairwise(x))[:: max(1, n // 40)]
    way = np.array([quad(speed, a, b, limit=400)[0] for a, b in pairs])
    total = quad(speed, 0.0, 40.0, limit=1000)[0]
    np.testing.assert_allclose(way, total / (n - 1), rtol=1e-5)


def test_the_default_sine_is_the_papers() -> None:
    path = blocks.SinePath().sampled
    np.testing.assert_allclose(path[:, 1], np.sin(path[:, 0]), atol=1e-14)


def waypoint(points: list[list[float]], degree: int, closed: bool, n: int = 2001) -> FloatArray:
    return blocks.WaypointPath(points=points, degree=degree, closed=closed, samples=n).sampled


def even(
    curve: Callable[[FloatArray], FloatArray], end: float, n: int, closed: bool
) -> tuple[FloatArray, FloatArray]:
    """Evenly spaced points on a curve by brute force, and their parameters."""
    fine = np.linspace(0.0, end, 400_001)
    points = curve(fine)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    at = np.interp(np.linspace(0.0, arc[-1], n, endpoint=not closed), arc, fine)
    return curve(at), at


def chords(points: list[list[float]], closed: bool) -> tuple[FloatArray, FloatArray]:
    corners = np.array([*points, points[0]] if closed else points)
    return corners, np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))


@pytest.mark.parametrize(("points", "closed"), SHAPES)
def test_cubic_is_scipys_cubic_spline(points: list[list[float]], closed: bool) -> None:
    path = waypoint(points, 3, closed)
    corners, u = chords(points, closed)
    spline = CubicSpline(u, corners, bc_type="periodic" if closed else "not-a-knot")
    expected, at = even(spline, u[-1], 2001, closed)
    np.testing.assert_allclose(path[:, :2], expected, atol=1e-6)
    first, second = spline(at, 1), spline(at, 2)
    off = path[:, 2] - np.arctan2(first[:, 1], first[:, 0])
    np.testing.assert_allclose(np.sin(off), 0.0, atol=1e-5)
    assert (np.cos(off) > 0.0).all()
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    expected_kappa = cross / np.hypot(*first.T) ** 3
    np.testing.assert_allclose(path[:, 3], expected_kappa, atol=1e-4)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_every_degree_is_fitpacks_spline(degree: int, closed: bool) -> None:
    """splprep is Dierckx's Fortran, make_interp_spline de Boor's collocation."""
    corners, u = chords(BEAN, closed)
    tck, _ = splprep(corners.T, u=u, k=degree, s=0.0, per=closed)
    expected, _ = even(lambda at: np.column_stack(splev(at, tck)), u[-1], 2001, closed)
    np.testing.assert_allclose(waypoint(BEAN, degree, closed)[:, :2], expected, atol=1e-6)


@pytest.mark.parametrize("closed", [False, True])
def test_degree_one_is_the_polygon(closed: bool) -> None:
    corners, u = chords(BEAN, closed)
    at = np.linspace(0.0, u[-1], 1001, endpoint=not closed)
    path = waypoint(BEAN, 1, closed, 1001)
    expected = np.column_stack([np.interp(at, u, column) for column in corners.T])
    np.testing.assert_allclose(path[:, :2], expected, atol=1e-12)
    assert not path[:, 3].any()
    edge = np.minimum(np.searchsorted(u, at, side="right"), len(u) - 1)
    direction = (corners[edge] - corners[edge - 1]) / (u[edge] - u[edge - 1])[:, None]
    heading = np.column_stack((np.cos(path[:, 2]), np.sin(path[:, 2])))
    np.testing.assert_allclose(heading, direction, atol=1e-12)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
@pytest.mark.parametrize(("points", "closed"), SHAPES)
def test_waypoints_are_passed_evenly(points: list[list[float]], degree: int, closed: bool) -> None:
    path = waypoint(points, degree, closed, 4001)
    steps = gaps(path, closed)
    if degree == 1:  # the chord across a corner is shorter than the way around it
        np.testing.assert_allclose(np.sort(steps)[len(points) :], np.median(steps), rtol=1e-9)
    else:
        np.testing.assert_allclose(steps, steps.mean(), rtol=1e-4)
    for point in points:
        nearest = np.hypot(*(path[:, :2] - point).T).min()
        assert nearest <= 0.5 * steps.mean() * (1.0 + 1e-3)
    np.testing.assert_allclose(path[0, :2], points[0], atol=1e-12)
    if not closed:
        np.testing.assert_allclose(path[-1, :2], points[-1], atol=1e-12)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("points", [BEAN, BEAN[::-1]])
def test_heading_and_curvature_are_differences(
    points: list[list[float]], degree: int, closed: bool
) -> None:
    path = waypoint(points, degree, closed, 8001)
    step = gaps(path).mean()
    # A parabola's curvature jumps at its knots, and the chord over a knot sees both sides.
    jump = np.abs(np.diff(path[:, 3])).max()
    assert np.abs(turned(path)).max() < step**2 + step * jump
    kappa = (path[2:, 2] - path[:-2, 2]) / (2.0 * step)
    smooth = np.abs(kappa - path[1:-1, 3])
    assert np.quantile(smooth, 0.99) < 1e-3
    if degree > 2:
        assert smooth.max() < 0.02


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize(("points", "turns"), [(BEAN, 1.0), (BEAN[::-1], -1.0)])
def test_a_closed_path_turns_once_around(
    points: list[list[float]], degree: int, turns: float
) -> None:
    """Hopf: the curvature of a simple closed curve adds up to 2 pi; clockwise, to -2 pi."""
    path = waypoint(points, degree, True, 4001)
    length = gaps(path, closed=True).sum()
    assert path[:, 3].mean() * length == pytest.approx(turns * math.tau, rel=1e-3)
    # Across the seam the heading goes on, where the last sample is one spacing before the first.
    step = length / 4001
    seam = path[0, 2] + turns * math.tau - path[-1, 2]
    assert seam == pytest.approx(step * 0.5 * (path[0, 3] + path[-1, 3]), abs=5e-3)
    # Green: the area is to the left of a path that goes counterclockwise.
    x, y = path[:, 0], path[:, 1]
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert math.copysign(1.0, area) == turns


@examples(40)
@given(st.floats(0.2, 8.0), st.integers(12, 40), st.booleans(), st.integers(3, 5))
def test_waypoints_on_a_circle(radius: float, n: int, clockwise: bool, degree: int) -> None:
    angle = np.linspace(0.0, math.tau, n, endpoint=False) * (-1.0 if clockwise else 1.0)
    points = radius * np.column_stack((np.cos(angle), np.sin(angle)))
    path = waypoint(points.tolist(), degree, True, 500)
    bound = (math.tau / n) ** 4  # a cubic's error, in parts of the radius
    np.testing.assert_allclose(np.hypot(path[:, 0], path[:, 1]) / radius, 1.0, atol=0.01 * bound)
    side = -1.0 if clockwise else 1.0
    np.testing.assert_allclose(path[:, 3] * radius, side, atol=0.2 * (math.tau / n) ** 2)


def test_theta_is_continuous_over_many_turns() -> None:
    angle = np.linspace(0.0, 6.0 * math.pi, 40)
    points = np.column_stack(((2 + 0.2 * angle) * np.cos(angle), (2 + 0.2 * angle) * np.sin(angle)))
    path = waypoint(points.tolist(), 3, False, 3000)
    assert np.abs(np.diff(path[:, 2])).max() < 0.05
    expected = 6.0 * math.pi
    assert path[-1, 2] - path[0, 2] == pytest.approx(expected, abs=0.2)


@given(st.floats(0.1, 10.0), st.floats(-3.0, 3.0), st.floats(0.2, 4.0))
def test_curvature_does_not_see_the_speed(radius: float, phase: float, rate: float) -> None:
    """A circle walked at the speed r * rate * exp(t) has curvature 1 / r all the same."""
    t = np.linspace(0.0, 1.0, 9)
    angle, speed = phase + rate * np.exp(t), rate * np.exp(t)
    tangent = np.column_stack((-np.sin(angle), np.cos(angle)))
    inwards = -np.column_stack((np.cos(angle), np.sin(angle)))
    first = radius * speed[:, None] * tangent
    second = radius * (speed[:, None] * tangent + speed[:, None] ** 2 * inwards)
    np.testing.assert_allclose(curvature(first, second), 1.0 / radius, rtol=1e-9)
    np.testing.assert_allclose(curvature(-first, second), -1.0 / radius, rtol=1e-9)


def test_curvature_is_zero_where_the_curve_stands() -> None:
    moving_then_standing = np.array([[0.0, 2.0], [0.0, 0.0]])
    bend = np.array([[-1.0, 0.0], [1.0, 1.0]])
    np.testing.assert_array_equal(curvature(moving_then_standing, bend), [0.25, 0.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: blocks.LinePath(x_start=3, x_end=3), "x_end: the line has no length"),
        (lambda: blocks.LinePath(samples=1), "samples: expected an integer at least 2, got 1"),
        (lambda: blocks.LinePath(samples=10.0), "samples: expected an integer at least 2, got 10"),
        (lambda: blocks.SinePath(x_start=3, x_end=2), "x_end: must lie beyond x_start = 3 m"),
        (lambda: blocks.SinePath(wavelength=0), "wavelength: expected a number above 0 m, got 0"),
        (lambda: blocks.CirclePath(radius=-1), "radius: expected a number above 0 m, got -1"),
        (
            lambda: blocks.CirclePath(center=[1, 2, 3]),
            "center: expected an array of 2 numbers in m",
        ),
        (lambda: blocks.WaypointPath(), "points: missing; expected an array of n x 2 numbers"),
        (lambda: blocks.WaypointPath(points=[[0, 0, 0]]), "points: expected an array of n x 2"),
        (lambda: blocks.WaypointPath(points=HILL[:3]), "points: a spline of degree 3 needs at lea"),
        (
            lambda: blocks.WaypointPath(points=HILL, degree=6),
            "degree: expected an integer at least",
        ),
        (
            lambda: blocks.WaypointPath(points=[*HILL[:3], HILL[2], HILL[3]]),
            "points: points 2 and 3 are the same",
        ),
        (
            lambda: blocks.WaypointPath(points=[*BEAN, BEAN[0]], closed=True),
            "points: the first and the last point are the same; 'closed' joins them itself",
        ),
    ],
)
def test_bad_parameters(make: Callable[[], blocks.Block], message: str) -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        make()
    assert message in str(caught.value)


def test_a_path_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        blocks.CirclePath().sampled[0, 0] = 1.0
