"""The LiDAR against its formula, and its noise against what it is said to be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from blocks import ParameterError
from blocks.core.signals import FloatArray
from blocks.world.lidar import Lidar, bearings
from blocks.world.world import World
from runtime import check_block
from tests.blocks.worlds import OVERLAPPING, SHIPPED, started

ROOM = World(SHIPPED["paper_room"])
POSE = (0.1, -0.3, 0.7)


def scans(lidar: Lidar, world: World, n: int, seed: int = 0) -> FloatArray:
    state = started(lidar, world, seed=seed)
    rows = []
    for k in range(n):
        rows.append(lidar.output(state, 0.1 * k, POSE))
        lidar.update(state, 0.1 * k)
    return np.array(rows)


def exact(lidar: Lidar, world: World) -> FloatArray:
    directions = bearings(lidar.beams, lidar.angle_min, lidar.angle_max)
    return world.cast(POSE[0], POSE[1], POSE[2] + directions)


def test_bearings_are_those_of_the_formula() -> None:
    found = bearings(4, -math.pi, math.pi)
    np.testing.assert_allclose(found, [-math.pi, -math.pi / 2, 0.0, math.pi / 2], atol=1e-15)
    np.testing.assert_allclose(bearings(3, 0.0, 0.6), [0.0, 0.2, 0.4], atol=1e-15)
    full = np.exp(1j * bearings(360, -math.pi, math.pi))
    assert np.abs(np.diff(full, append=full[:1])).max() == pytest.approx(
        2 * math.sin(math.pi / 360)
    )


@pytest.mark.parametrize("window", [(-math.pi, math.pi), (-1.0, 0.5), (0.0, 2 * math.pi)])
def test_without_noise_a_scan_is_the_cast(window: tuple[float, float]) -> None:
    lidar = Lidar(sigma=0.0, beams=90, angle_min=window[0], angle_max=window[1])
    found = scans(lidar, ROOM, 2)
    np.testing.assert_array_equal(found, np.tile(exact(lidar, ROOM), (2, 1)))


def test_noise_is_white_and_normal() -> None:
    lidar = Lidar(sigma=0.02)
    noise = (scans(lidar, ROOM, 100) - exact(lidar, ROOM)) / 0.02
    assert stats.kstest(noise.ravel(), "norm").pvalue > 1e-3
    # Correlation of beams, and of scans, with their neighbours: 0 +- 1 / sqrt(36000).
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < 0.025
    assert abs(np.mean(noise[1:] * noise[:-1])) < 0.025


def test_drop_outs_come_as_often_as_they_should() -> None:
    lidar = Lidar(dropout=0.3)
    lost = np.isinf(scans(lidar, ROOM, 100)).mean()
    assert lost == pytest.approx(0.3, abs=4 * math.sqrt(0.3 * 0.7 / 36000))
    assert np.isinf(scans(Lidar(dropout=1.0), ROOM, 3)).all()


def test_drop_outs_and_noise_do_not_change_each_other() -> None:
    whole, holed = scans(Lidar(), ROOM, 5), scans(Lidar(dropout=0.5), ROOM, 5)
    kept = np.isfinite(holed)
    np.testing.assert_array_equal(whole[kept], holed[kept])
    noiseless = scans(Lidar(dropout=0.5, sigma=0.0), ROOM, 5)
    np.testing.assert_array_equal(np.isfinite(noiseless), kept)


def test_what_is_too_near_or_too_far_is_a_miss() -> None:
    lidar = Lidar(sigma=0.0, range_min=1.2, range_max=1.9)
    (found,) = scans(lidar, ROOM, 1)
    ranges = exact(lidar, ROOM)
    inside = (ranges >= 1.2) & (ranges <= 1.9)
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(found, np.where(inside, ranges, np.inf))
    assert np.isinf(scans(Lidar(), World({"circles": [[50.0, 0.0, 1.0]]}), 1)).all()
    beyond = Lidar(range_max=math.inf, sigma=0.0)
    assert np.isfinite(scans(beyond, World({"circles": [[50.0, 0.0, 1.0]]}), 1)).any()


def test_noise_never_makes_a_range_negative() -> None:
    found = scans(Lidar(sigma=3.0, range_min=0.0), ROOM, 20)
    assert (found >= 0.0).all()


@pytest.mark.parametrize("world", [ROOM, World(OVERLAPPING), World({"circles": [[1, 1, 0.2]]})])
def test_it_keeps_the_rules_of_blocks(world: World) -> None:
    check_block(Lidar(beams=20, dropout=0.2), world=world)


def test_it_needs_a_world() -> None:
    with pytest.raises(ParameterError, match="world: needs a world: section in the graph"):
        check_block(Lidar())


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"beams": 0}, "beams: expected an integer at least 1"),
        ({"dropout": 1.5}, "dropout: expected a number at least 0 and at most 1"),
        ({"angle_min": 1.0, "angle_max": 1.0}, "angle_max: must lie above angle_min = 1 rad"),
        ({"angle_min": -4.0}, "angle_max: from angle_min = -4 to .* is more than a full turn"),
        ({"range_min": 13.0}, "range_max: must lie above range_min = 13 m, got 12"),
    ],
)
def test_bad_parameters(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Lidar(**parameters)
