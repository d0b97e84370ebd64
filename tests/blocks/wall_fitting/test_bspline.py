"""B-splines against scipy.interpolate, and against what defines them."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import interpolate

from blocks.wall_fitting import bspline
from tests.examples import examples

SIZES = st.integers(0, 7).flatmap(lambda k: st.tuples(st.just(k), st.integers(k + 1, k + 25)))
PARAMETERS = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20).map(np.array)


def random_points(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 2))


def test_knots_are_the_papers() -> None:
    # n = 5, k = 3: 0 and 1 four times each, and k/(n-k+1) = 1/3, 2/3 between.
    expected = [0, 0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1, 1]
    np.testing.assert_allclose(bspline.knots(6, 3), expected, rtol=0.0, atol=1e-16)
    with pytest.raises(ValueError, match="degree 3 needs at least 4 points"):
        bspline.knots(3, 3)


@settings(deadline=None)
@given(size=SIZES, t=PARAMETERS, derivative=st.integers(0, 3))
def test_curves_and_derivatives_equal_scipy(
    size: tuple[int, int], t: np.ndarray, derivative: int
) -> None:
    degree, n = size
    points = random_points(n)
    t = np.concatenate((t, [0.0, 1.0], bspline.knots(n, degree)))
    ours = bspline.BSpline(points, degree)(t, derivative)
    theirs = interpolate.BSpline(bspline.knots(n, degree), points, degree)
    expected = theirs(t, nu=derivative) if derivative <= degree else np.zeros((len(t), 2))
    scale = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=1e-12 * scale)


@settings(deadline=None)
@given(size=SIZES, t=PARAMETERS)
def test_the_basis_is_a_local_partition_of_unity(size: tuple[int, int], t: np.ndarray) -> None:
    degree, n = size
    at, knots = bspline.basis(t, n, degree), bspline.knots(n, degree)
    np.testing.assert_allclose(at.sum(axis=1), 1.0, rtol=1e-13)
    assert (at >= 0.0).all()
    for i in range(n):
        outside = (t < knots[i]) | (t > knots[i + degree + 1])
        assert not at[outside, i].any()
    for derivative in (1, 2):
        slopes = bspline.basis(t, n, degree, derivative)
        scale = max(1.0, float(np.abs(slopes).max()))
        np.testing.assert_allclose(slopes.sum(axis=1), 0.0, atol=1e-12 * scale)


@settings(deadline=None)
@given(size=SIZES, moved=st.integers(0, 40))
def test_a_control_point_moves_its_spans_alone(size: tuple[int, int], moved: int) -> None:
    degree, n = size
    moved %= n
    points, knots, t = random_points(n), bspline.knots(n, degree), np.linspace(0.0, 1.0, 101)
    other = points.copy()
    other[moved] += 1.0
    change = (bspline.BSpline(points, degree)(t) != bspline.BSpline(other, degree)(t)).any(axis=1)
    inside = (t >= knots[moved]) & (t <= knots[moved + degree + 1])
    assert not change[~inside].any()


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_curves_begin_and_end_at_their_outer_points_along_the_polygon(degree: int) -> None:
    points = random_points(9)
    curve = bspline.BSpline(points, degree)
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(curve(ends), points[[0, -1]], rtol=1e-14)
    # Clamped: P'(0) = k / (t_{k+1} - t_1) (P_1 - P_0), where t_{k+1} = 1 / (n - k + 1).
    slope = degree * (len(points) - degree)
    expected = slope * np.array([points[1] - points[0], points[-1] - points[-2]])
    np.testing.assert_allclose(curve(ends, 1), expected, rtol=1e-12)
    assert not bspline.basis(np.array([-0.1, 1.1]), 9, degree).any()


def test_matrices_are_cached_and_cannot_be_changed() -> None:
    first = bspline.basis_matrices(12, 3, 60)
    assert first is bspline.basis_matrices(12, 3, 60)
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0, 0] = 1.0
    t = np.linspace(0.0, 1.0, 60)
    curve = bspline.BSpline(random_points(12))
    np.testing.assert_allclose(curve.positions(60), curve(t), rtol=1e-14)
    for derivative in range(3):
        np.testing.assert_array_equal(first[derivative], bspline.basis(t, 12, 3, derivative))


def test_fitting_finds_the_points_of_a_spline() -> None:
    points, t = random_points(8), np.sort(np.random.default_rng(1).uniform(size=100))
    t[[0, -1]] = 0.0, 1.0
    data = bspline.BSpline(points, 3)(t)
    np.testing.assert_allclose(bspline.fit(data, 8, 3, t).points, points, atol=1e-10)


def test_fitting_is_scipys_least_squares() -> None:
    rng = np.random.default_rng(2)
    data = np.cumsum(rng.uniform(0.0, 1.0, (80, 2)), axis=0)
    t = bspline.chord_length(data)
    theirs = interpolate.make_lsq_spline(t, data, bspline.knots(10, 3), k=3)
    np.testing.assert_allclose(bspline.fit(data, 10).points, theirs.c, rtol=1e-9)


def test_even_fits_are_fits_with_even_parameters() -> None:
    data = random_points(50)
    expected = bspline.fit(data, 9, 4, np.linspace(0.0, 1.0, 50)).points
    np.testing.assert_allclose(bspline.fit_even(data, 9, 4).points, expected, atol=1e-12)
    with pytest.raises(ValueError, match="60 control points need as many data, got 50"):
        bspline.fit_even(data, 60)


def test_smoothing_bridges_spans_without_data() -> None:
    t = np.concatenate((np.linspace(0.0, 0.2, 40), np.linspace(0.8, 1.0, 40)))
    data = np.column_stack((t, np.sin(t)))
    at = np.linspace(0.0, 1.0, 50)
    bridged = bspline.fit(data, 20, 3, t, smoothing=1e-6)(at)
    np.testing.assert_allclose(bridged, np.column_stack((at, np.sin(at))), atol=0.02)


def test_much_smoothing_leaves_even_steps() -> None:
    points = bspline.fit(random_points(80), 20, 3, smoothing=1e6).points
    assert np.abs(np.diff(points, n=2, axis=0)).max() < 1e-4
    assert np.abs(points - points.mean(axis=0)).max() > 1e-2


def test_chord_lengths() -> None:
    line = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 9.0], [3.0, 9.0]])
    np.testing.assert_allclose(bspline.chord_length(line), [0.0, 0.5, 1.0, 1.0])
    np.testing.assert_allclose(bspline.chord_length(np.ones((3, 2))), [0.0, 0.5, 1.0])


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_fitted_circle_has_its_curvature_and_tangents(turn: float) -> None:
    angle = turn * np.linspace(0.0, 4.0, 300)
    circle = 0.5 * np.column_stack((np.cos(angle), np.sin(angle)))
    at = bspline.fit(circle, 20, 5).at(np.linspace(0.02, 0.98, 100))
    np.testing.assert_allclose(at.kappa, turn / 0.5, rtol=1e-3)
    radial = np.arctan2(at.position[:, 1], at.position[:, 0])
    np.testing.assert_allclose(at.theta, np.unwrap(radial) + turn * 0.5 * math.pi, atol=1e-4)


@examples(25)
@given(seed=st.integers(0, 1000))
def test_even_samples_are_even_along_the_arc(seed: int) -> None:
    points = np.cumsum(np.random.default_rng(seed).uniform(0.0, 0.1, (12, 2)), axis=0)
    curve = bspline.BSpline(points)
    fine = curve(np.linspace(0.0, 1.0, 20001))
    arc = bspline.arc_length(fine)
    spacing = 0.8 * arc[-1] / 49
    samples = curve.sampled_evenly(spacing, 50, start=0.1 * arc[-1])
    found = [arc[np.argmin(((fine - p) ** 2).sum(axis=1))] for p in samples.position]
    expected = 0.1 * arc[-1] + spacing * np.arange(50)
    np.testing.assert_allclose(found, expected, atol=1e-3 * arc[-1])
    # The derivatives belong to the same places.
    exact = curve.at(np.interp(expected, arc, np.linspace(0.0, 1.0, 20001)))
    np.testing.assert_allclose(samples.theta, exact.theta, atol=0.02)


def test_even_samples_of_a_short_curve_lie_closer() -> None:
    curve = bspline.BSpline(np.column_stack((np.linspace(0.0, 0.5, 8), np.zeros(8))))
    samples = curve.sampled_evenly(0.1, 11, start=0.3)
    np.testing.assert_allclose(samples.position[:, 0], np.linspace(0.0, 0.5, 11), atol=1e-12)


def test_no_scipy_at_run_time() -> None:
    code = "import sys, blocks.wall_fitting; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
