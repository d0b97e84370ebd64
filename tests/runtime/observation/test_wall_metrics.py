"""Metrics of wall following against worlds in which the answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blocks import World
from runtime.observation import wall_metrics
from runtime.observation.metrics import METRIC_KINDS, Metric, Series

D = 0.2
POST = World({"circles": [[1.0, -1.0, 0.5]]})
ROOM = World({"room": [[0, 0], [4, 0], [4, 4], [0, 4]], "circles": [[2.0, 0.5, 0.5]]})


def around(world: World, turns: float, error: float, side: float = -1.0) -> np.ndarray:
    """A path around the post at d + error, after an approach; clockwise for side -1."""
    x, y, r = world.circles[0]
    angle = side * np.linspace(0.0, turns * math.tau, 2001)
    way = np.column_stack(
        (x + (r + D + error) * np.cos(angle), y + (r + D + error) * np.sin(angle))
    )
    return np.vstack((np.column_stack((np.linspace(4.0, x + r + D, 50), np.full(50, y))), way))


@pytest.mark.parametrize("error", [0.0, 0.05, -0.1])
def test_the_mean_error_around_a_post(error: float) -> None:
    way = around(POST, 1.0, error)
    options = {"distance": D, "turning_radius": 0.2}
    reached = len(wall_metrics.since_reached(POST, way, D))
    expected = abs(error) * 2001 / reached
    for metric in (
        wall_metrics.distance_mae,
        wall_metrics.distance_mae_cylinders,
        wall_metrics.distance_mae_reachable,
    ):
        assert metric(POST, way, options) == pytest.approx(expected, abs=2e-4)
    assert wall_metrics.distance_floor(POST, way, options) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.25])
def test_turns_around_a_post(turns: float) -> None:
    """The contour runs with the wall on its right; the other direction is negative."""
    ways = {side: around(POST, turns, 0.0, side) for side in (1.0, -1.0)}
    counted = {side: wall_metrics.loops(POST, way, {"distance": D}) for side, way in ways.items()}
    assert sorted(counted.values()) == pytest.approx([-turns, turns], abs=0.02)


@pytest.mark.parametrize("error", [0.03, 0.1, -0.05])
def test_a_robot_that_stays_off_the_contour_has_its_error(error: float) -> None:
    way = around(POST, 1.0, error)[50:]
    assert wall_metrics.distance_mae(POST, way, {"distance": D}) == pytest.approx(abs(error))
    assert abs(wall_metrics.loops(POST, way, {"distance": D})) == pytest.approx(1.0, abs=0.02)
    # An approach counts from twice that error on.
    far = np.column_stack((np.linspace(4.0, way[0, 0], 1000), np.full(1000, way[0, 1])))
    counted = wall_metrics.since_reached(POST, np.vstack((far, way)), D)
    if error > 0.0:
        assert POST.distance(counted[:1])[0] - D == pytest.approx(2.0 * error, abs=4e-3)
    assert wall_metrics.since_reached(POST, way[:0], D).shape == (0, 2)


def test_a_pose_that_never_reaches_the_contour_has_no_error_and_no_turns() -> None:
    far = np.column_stack((np.linspace(4.0, 5.0, 50), np.zeros(50)))
    assert math.isnan(wall_metrics.distance_mae(POST, far, {"distance": D}))
    assert math.isnan(wall_metrics.strayed(POST, far, {"distance": D}))
    assert wall_metrics.loops(POST, far, {"distance": D}) == 0.0


@pytest.mark.parametrize("error", [0.03, 0.05, -0.1])
def test_straying_is_from_the_loop_that_was_reached_first(error: float) -> None:
    """At another post the robot is as far from the first contour as the posts are apart."""
    way = around(POST, 1.0, error)
    assert wall_metrics.strayed(POST, way, {"distance": D}) == pytest.approx(abs(error), abs=1e-3)
    posts = World({"circles": [*POST.circles.tolist(), [10.0, -1.0, 0.5]]})
    there = np.vstack((way, [[10.0 - 0.5 - D, -1.0]]))
    assert wall_metrics.strayed(posts, there, {"distance": D}) == pytest.approx(
        10.0 - 1.0 - 2.0 * (0.5 + D), abs=1e-3
    )
    assert wall_metrics.distance_mae(posts, there[-1:], {"distance": D}) < 1e-9


def test_only_positions_clear_of_the_walls_count_as_along_a_cylinder() -> None:
    """Over the top of a half-sunk cylinder, and along the wall beside it."""
    angle = np.linspace(0.25 * math.pi, 0.75 * math.pi, 400)
    over = np.column_stack((2.0 + 0.73 * np.cos(angle), 0.5 + 0.73 * np.sin(angle)))
    start = np.array([[2.0, 0.5 + 0.5 + D]])
    beside = np.column_stack((np.linspace(3.2, 3.8, 400), np.full(400, D)))
    options = {"distance": D}
    alone = wall_metrics.distance_mae_cylinders(ROOM, np.vstack((start, over)), options)
    both = wall_metrics.distance_mae_cylinders(ROOM, np.vstack((start, over, beside)), options)
    assert alone == pytest.approx(0.03, abs=1e-3)
    assert both == alone


def test_first_time() -> None:
    series = {"of": Series(np.arange(5) * 0.1, np.array([0.0, 0.2, 1.0, 0.0, 1.0]))}
    assert METRIC_KINDS["first_time"].value(series, {}) == pytest.approx(0.2)
    assert METRIC_KINDS["first_time"].value(series, {"level": 2.0}) is None


@pytest.mark.parametrize("kind", ["distance_mae", "distance_mae_cylinders", "strayed", "loops"])
def test_a_contour_that_is_crossed_while_exploring_does_not_count(kind: str) -> None:
    """A robot crosses the contour of one post before it follows that of another."""
    posts = World({"circles": [*POST.circles.tolist(), [10.0, -1.0, 0.5]]})
    crossing = np.column_stack((np.linspace(2.5, 1.5 + D - 0.1, 60), np.full(60, -1.0)))
    following = around(World({"circles": [[10.0, -1.0, 0.5]]}), 1.0, 0.0)[50:]
    way = np.vstack((crossing, crossing[::-1], following))
    t = 0.05 * np.arange(len(way))
    engaged = (t >= t[len(way) - len(following)]).astype(float)
    probes = {"pose": Series(t, way), "engaged": Series(t[::2], engaged[::2])}

    def value(**inputs: str) -> float | None:
        return Metric("m", kind, {"of": "pose"} | inputs, {"distance": D}).value(probes, posts)

    found = value(engaged="engaged")
    assert found is not None
    if kind == "loops":
        assert abs(found) == pytest.approx(1.0, abs=0.02)
        assert abs(value() or 0.0) < 0.5
    else:
        # ``strayed`` uses points of the contour, 1 cm apart.
        assert found == pytest.approx(0.0, abs=5.1e-3 if kind == "strayed" else 1e-3)
        assert (value() or 0.0) > 10.0 * found

    probes["engaged"] = Series(t, np.zeros(len(t)))
    assert value(engaged="engaged") == (0.0 if kind == "loops" else None)
