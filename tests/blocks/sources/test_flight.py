"""Paths in space against splines of scipy and their own derivatives; wind against its spectrum."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import make_interp_spline

import blocks
from blocks.sources.wind import lengths_and_deviations, noise_covariance
from tests.blocks.direct import state_of
from tests.blocks.responses import respond

OUTPUTS = ("position", "velocity", "acceleration", "jerk")


def path_at(block: Any, times: Any) -> Any:
    """All four outputs at times, (4, n, 3)."""
    state = state_of(block)
    return np.array([block.output(state, float(t)) for t in times]).transpose(1, 0, 2)


@given(
    st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=2, max_size=6),
    st.lists(st.floats(0.3, 3.0), min_size=5, max_size=5),
)
def test_minimum_snap_is_the_spline_of_degree_seven(points: Any, spans: Any) -> None:
    times = np.concatenate([[0.5], 0.5 + np.cumsum(spans[: len(points) - 1])])
    block = blocks.MinimumSnap(waypoints=np.array(points), times=times)
    rest = [(order, np.zeros(3)) for order in (1, 2, 3)]
    spline = make_interp_spline(times, np.array(points), k=7, bc_type=(rest, rest))
    t = np.linspace(times[0], times[-1], 60)[1:-1]
    for order, found in enumerate(path_at(block, t)):
        expected = spline.derivative(order)(t) if order else spline(t)
        scale = max(np.abs(expected).max(), 1.0)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * scale)


def test_it_rests_before_and_after() -> None:
    block = blocks.MinimumSnap(waypoints=[[0, 1, 2], [3, 4, 5]], times=[1, 2])
    position, *others = path_at(block, [0.0, 0.99, 2.01, 9.0])
    np.testing.assert_allclose(position, [[0, 1, 2], [0, 1, 2], [3, 4, 5], [3, 4, 5]], atol=1e-12)
    assert not np.any(others)


def test_a_lemniscate_and_its_derivatives() -> None:
    block = blocks.Lemniscate(size=[2, 1, 0.5], centre=[1, 2, 3], period=5.0)
    t = np.linspace(0, 5, 2001)
    p, v, a, j = path_at(block, t)
    x, y = (p[:, :2] - [1, 2]).T
    # Gerono's quartic, x^4 = a^2 (x^2 - (a y / 2 b)^2) with y = b sin 2 phi = 2 b sin cos.
    np.testing.assert_allclose(x**4, 4 * (x**2 - y**2), atol=1e-12)
    for one, other in ((p, v), (v, a), (a, j)):
        slope = np.gradient(one, t, axis=0, edge_order=2)
        np.testing.assert_allclose(slope, other, atol=2e-4 * np.abs(other).max())


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"times": [0, 1]}, "expected 3 times"),
        ({"times": [0, 2, 1]}, "expected times that rise, got 1 s after 2 s"),
        ({"waypoints": [[0, 0, 0]], "times": [0]}, "expected at least two, got 1"),
    ],
)
def test_wrong_routes_are_refused(change: dict[str, Any], part: str) -> None:
    given_to: dict[str, Any] = {"waypoints": np.eye(3), "times": [0, 1, 2]}
    with pytest.raises(blocks.ParameterError, match=part.replace("(", r"\(")):
        blocks.MinimumSnap(**{**given_to, **change})


@pytest.mark.parametrize("a", [1e-6, 1e-3, 0.3, 2.0, 50.0])
def test_the_noise_of_a_step_is_that_of_its_integrals(a: float) -> None:
    end = min(a, 40.0)
    for (i, k), power in {(0, 0): 0, (0, 1): 1, (1, 1): 2}.items():
        exact = quad(lambda r, d=power: r**d * math.exp(-2 * r), 0, end, epsabs=0, epsrel=1e-13)[0]
        assert noise_covariance(a)[i, k] == pytest.approx(exact, rel=1e-9)


def test_scale_lengths_and_deviations_are_those_of_the_specification() -> None:
    # At 1000 ft all lengths are 1000 ft and all deviations equal, where the higher model begins.
    lengths, sigmas = lengths_and_deviations(304.8, 10.0)
    np.testing.assert_allclose(lengths, 304.8, rtol=1e-9)
    np.testing.assert_allclose(sigmas, 1.0, rtol=1e-9)


def test_wind_has_drydens_variance_and_spectrum() -> None:
    dt, n, airspeed = 0.2, 100_000, 20.0
    entry = {"type": "DrydenWind", "altitude": 30.0, "airspeed": airspeed, "speed": 10.0}
    rows = respond({**entry, "mean": [3, 0, -1]}, {}, ticks=n, dt=dt, of="wind", engine="auto")
    gusts = rows - [3, 0, -1]
    lengths, sigmas = lengths_and_deviations(30.0, 10.0)
    np.testing.assert_allclose(gusts.std(0), sigmas, rtol=0.06)
    for i, (length, sigma) in enumerate(zip(lengths, sigmas, strict=True)):
        tau = length / airspeed
        lag = int(tau / dt)
        found = (gusts[lag:, i] * gusts[:-lag, i]).mean()
        r = lag * dt / tau
        # The correlations of von Karman's and Dryden's f (along) and g (across).
        expected = math.exp(-r) * (1.0 if i == 0 else 1.0 - 0.5 * r)
        assert found / sigma**2 == pytest.approx(expected, abs=0.05)
