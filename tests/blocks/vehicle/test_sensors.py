"""Pose noise: its distribution, its whiteness, and what it depends on.

Seeds are fixed, so a test either passes for good or fails for good; levels are such that a
correct generator would fail one seed in ten thousand.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import blocks
import runtime
from blocks.core.signals import FloatArray

N = 20_000
TINY = 1e-4


def record(name: str = "noise", seed: int = 0, n: int = N, **parameters: float) -> FloatArray:
    """The noise alone: measured minus true, for a robot that stands."""
    graph = runtime.Graph(dt=0.01, until=n * 0.01, seed=seed)
    graph = graph.add("true", blocks.Constant(value=[1.0, -2.0, 0.5], signal="Pose"))
    graph = graph.add(name, blocks.PoseNoise(**parameters))
    graph = graph.connect("true.value", f"{name}.pose")
    measured = graph.probe(f"{name}.measured").run()[f"{name}.measured"]
    return np.asarray(measured - [1.0, -2.0, 0.5])


@pytest.fixture(scope="module")
def noise() -> FloatArray:
    return record(seed=3, sigma_position=0.05, sigma_heading=0.1)


@pytest.mark.parametrize(("column", "sigma"), [(0, 0.05), (1, 0.05), (2, 0.1)])
def test_each_component_is_normal(noise: FloatArray, column: int, sigma: float) -> None:
    assert len(noise) == N
    assert stats.kstest(noise[:, column], stats.norm(0.0, sigma).cdf).pvalue > TINY
    # N s^2 / sigma^2 is chi-squared, sqrt(N) mean / sigma is normal.
    spread = float(np.sum(noise[:, column] ** 2)) / sigma**2
    assert TINY < stats.chi2(N).cdf(spread) < 1.0 - TINY
    mean = noise[:, column].mean() * np.sqrt(N) / sigma
    assert TINY < stats.norm.cdf(mean) < 1.0 - TINY


def test_it_is_white(noise: FloatArray) -> None:
    """Ljung and Box: autocorrelations up to lag 20, of each component and across them."""
    centred = noise / noise.std(axis=0)
    for i in range(3):
        for j in range(3):
            lags = range(1, 21) if i == j else range(21)
            r = np.array([np.mean(centred[: N - k, i] * centred[k:, j]) for k in lags])
            assert stats.chi2(len(r)).sf(N * np.sum(r**2)) > TINY, (i, j)


def test_seed_and_name_make_independent_noise(noise: FloatArray) -> None:
    others = [
        record(seed=4, sigma_position=0.05, sigma_heading=0.1),
        record("other", seed=3, sigma_position=0.05, sigma_heading=0.1),
    ]
    for other in others:
        for column in range(3):
            assert stats.pearsonr(noise[:, column], other[:, column]).pvalue > TINY
            assert not np.isin(noise[:, column], other[:, column]).any()


def test_the_same_seed_and_name_make_the_same_noise(noise: FloatArray) -> None:
    again = record(seed=3, n=100, sigma_position=0.05, sigma_heading=0.1)
    np.testing.assert_array_equal(again, noise[:100])


def test_other_blocks_do_not_change_it() -> None:
    """With a second noise in the graph, the first stays as it is: ablations stay paired."""

    def first(second: bool) -> FloatArray:
        graph = runtime.Graph(dt=0.01, until=0.5, seed=9)
        graph = graph.add("true", blocks.Constant(value=[0.0, 0.0, 0.0], signal="Pose"))
        for name in ("a", "b") if second else ("b",):
            graph = graph.add(name, blocks.PoseNoise()).connect("true.value", f"{name}.pose")
        return np.asarray(graph.probe("b.measured").run()["b.measured"])

    np.testing.assert_array_equal(first(True), first(False))


def test_deviations_scale_the_same_draws() -> None:
    one = record(n=50, sigma_position=1.0, sigma_heading=1.0)
    scaled = record(n=50, sigma_position=0.2, sigma_heading=3.0)
    np.testing.assert_allclose(scaled, one * [0.2, 0.2, 3.0], rtol=1e-9, atol=1e-12)


def test_without_deviation_the_pose_passes() -> None:
    assert not record(n=20, sigma_position=0.0, sigma_heading=0.0).any()


def test_the_papers_deviations_are_the_default() -> None:
    """sigma_p = 0.05 m and sigma_theta = 0.1 rad (section IV-B)."""
    plain = blocks.PoseNoise()
    assert (plain.sigma_position, plain.sigma_heading) == (0.05, 0.1)


def test_bad_deviations() -> None:
    with pytest.raises(blocks.ParameterError, match="sigma_position: expected a number at least 0"):
        blocks.PoseNoise(sigma_position=-0.1)
