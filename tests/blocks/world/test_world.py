"""The world's distances and rays against brute force, closed forms and each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from blocks.core.signals import FloatArray
from blocks.world.surfaces import nearest_kernel
from blocks.world.world import World
from tests.blocks.worlds import OVERLAPPING, SHIPPED, SQUARE, brute_distance, is_free, worlds
from tests.examples import examples

SPACING = 2e-3
seeds = st.integers(0, 2**32 - 1)


def scattered(seed: int, n: int, reach: float = 4.0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-reach, reach, (n, 2))


def check_distance(world: World, points: FloatArray) -> None:
    expected, distance = brute_distance(world, points, SPACING), world.distance(points)
    clear = np.abs(distance) > 1e-9
    assert np.array_equal(np.sign(distance[clear]), np.sign(expected[clear]))
    # The nearest sample is farther than the surface, but the next sample is not far from that;
    # samples count as exposed up to 1e-5 inside of a solid.
    assert (np.abs(distance) <= np.abs(expected) + 2e-5).all()
    assert (np.abs(distance) >= np.abs(expected) - SPACING).all()


@pytest.mark.parametrize("description", [OVERLAPPING, *SHIPPED.values()])
def test_distance_is_that_to_the_nearest_of_many_surface_points(
    description: dict[str, Any],
) -> None:
    check_distance(World(description), scattered(1, 3000))


# The free space beside the second obstacle is a triangle with sides below a millimetre.
SLIVER = {
    "room": [[-1.0, 0.5], [0.0, 0.0], [-1.1, 1.1]],
    "obstacles": [
        [[-1.4, 1.1], [0.0, 1.1], [-0.9, 0.9]],
        [[-1.2, 0.9], [0.0, 1.6], [0.0, 0.0]],
    ],
}


@settings(deadline=None)
@example(World(SLIVER), 0)
@given(worlds(), seeds)
def test_distance_of_any_world(world: World, seed: int) -> None:
    check_distance(world, scattered(seed, 200))


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5))
def test_distance_in_a_square_room(x: float, y: float) -> None:
    outside = math.hypot(max(0.0, abs(x) - 2.0), max(0.0, abs(y) - 2.0))
    expected = -outside if outside > 0.0 else 2.0 - max(abs(x), abs(y))
    found = World({"room": SQUARE}).distance(np.array([[x, y]]))
    assert found == pytest.approx(expected, abs=1e-12)


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5))
def test_distance_to_a_circle_is_signed(x: float, y: float) -> None:
    found = World({"circles": [[1.0, -0.5, 0.7]]}).distance(np.array([[x, y]]))
    assert found == pytest.approx(math.hypot(x - 1.0, y + 0.5) - 0.7, abs=1e-12)


@settings(deadline=None)
@given(worlds(), seeds)
def test_nearest_is_distance_and_leads_to_the_surface(world: World, seed: int) -> None:
    points = scattered(seed, 30)
    feet = []
    for (x, y), distance in zip(points.tolist(), world.distance(points), strict=True):
        found, nx, ny = world.nearest(x, y)
        assert found == pytest.approx(distance, abs=1e-12)
        assert math.hypot(nx, ny) == pytest.approx(1.0, abs=1e-12)
        feet.append((x - found * nx, y - found * ny))
    assert np.abs(world.distance(np.array(feet))).max() < 1e-9


@settings(deadline=None)
@given(worlds(), seeds)
def test_on_a_surface_the_normal_leads_into_free_space(world: World, seed: int) -> None:
    points = scattered(seed, 30)
    for x, y in points[world.distance(points) > 0.01].tolist():
        distance, nx, ny = world.nearest(x, y)
        x, y = x - distance * nx, y - distance * ny
        distance, nx, ny = world.nearest(x, y)
        assert distance == pytest.approx(0.0, abs=1e-9)
        assert world.nearest(x + 1e-6 * nx, y + 1e-6 * ny)[0] == pytest.approx(1e-6, abs=1e-9)


# Wedges whose tips touch, one of them and a wall, and a disc that touches a wall and a tip.
TOUCHING = {
    "room": SQUARE,
    "obstacles": [
        [[0, 0], [-1, 1], [-1, -1]],
        [[0, 0], [1, -0.2], [1, 1]],
        [[0.5, -2], [0.8, -1.5], [0.2, -1.5]],
    ],
    "circles": [[-1.5, 1.5, 0.5], [-0.5, -1.5, 0.5]],
}


def corners_of(world: World) -> list[tuple[float, float]]:
    polygons = [*([] if world.room is None else [world.room]), *world.obstacles]
    return [(x, y) for polygon in polygons for x, y in polygon.tolist()]


@pytest.mark.parametrize("description", [TOUCHING, *SHIPPED.values()])
def test_the_normal_of_a_corner_leads_away_as_fast_as_any_direction(
    description: dict[str, Any],
) -> None:
    check_corners(World(description))


@settings(deadline=None)
@given(worlds())
def test_the_normal_of_any_corner_leads_away_as_fast_as_any_direction(world: World) -> None:
    check_corners(world)


def check_corners(world: World) -> None:
    step, angles = 1e-6, np.linspace(0.0, math.tau, 720, endpoint=False)
    around = step * np.column_stack((np.cos(angles), np.sin(angles)))
    surfaces = world.arrays
    for x, y in corners_of(world):
        distance, nx, ny = world.nearest(x, y)
        if abs(distance) > 1e-12:
            continue  # buried in another solid
        assert math.hypot(nx, ny) == pytest.approx(1.0, abs=1e-12)
        fastest = world.distance(np.add((x, y), around)).max() / step
        found = world.distance(np.array([[x + step * nx, y + step * ny]]))[0] / step
        assert found >= fastest - 1e-4
        assert nearest_kernel(surfaces, x, y) == (distance, nx, ny)


@settings(deadline=None)
@given(worlds(), seeds)
def test_rays_end_on_the_first_surface(world: World, seed: int) -> None:
    starts = scattered(seed, 50, reach=2.0)
    starts = starts[is_free(world, starts) & (np.abs(world.distance(starts)) > 1e-6)]
    assume(len(starts))
    x, y = starts[0].tolist()
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, 40)
    ranges = world.cast(x, y, angles)
    unit = np.column_stack((np.cos(angles), np.sin(angles)))
    hit = np.isfinite(ranges)
    ends = starts[0] + ranges[hit, None] * unit[hit]
    assert np.abs(world.distance(ends)).max(initial=0.0) < 1e-9
    share = np.linspace(0.0, 1.0, 200, endpoint=False)
    length = np.where(hit, ranges, 10.0)
    between = starts[0] + (share[:, None, None] * length[:, None]) * unit
    assert world.distance(between.reshape(-1, 2)).min() > -1e-9
    assert world.room is None or hit.all()


@examples(40)
@given(worlds(), seeds)
def test_rays_are_as_long_as_walking_by_the_distance_says(world: World, seed: int) -> None:
    """Sphere tracing: a step by the distance cannot miss a surface."""
    start = scattered(seed, 1, reach=2.0)
    assume(world.distance(start)[0] > 0.01)
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, 30)
    unit = np.column_stack((np.cos(angles), np.sin(angles)))
    travelled = np.zeros(len(angles))
    for _ in range(100):
        travelled = np.minimum(travelled + world.distance(start + travelled[:, None] * unit), 50.0)
    x, y = start[0].tolist()
    ranges = np.minimum(world.cast(x, y, angles), 50.0)
    # A ray that grazes a surface walks there in ever smaller steps.
    arrived = np.abs(world.distance(start + travelled[:, None] * unit)) < 1e-12
    done = arrived | (travelled == 50.0)
    assert (travelled <= ranges + 1e-9).all()
    np.testing.assert_allclose(travelled[done], ranges[done], rtol=0.0, atol=1e-6)


def test_rays_in_a_square_room_are_the_closed_form() -> None:
    angles = np.linspace(-math.pi, math.pi, 720, endpoint=False)
    with np.errstate(divide="ignore"):
        expected = np.minimum(2.0 / np.abs(np.cos(angles)), 2.0 / np.abs(np.sin(angles)))
    found = World({"room": SQUARE}).cast(0.0, 0.0, angles)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_rays_do_not_slip_through_corners() -> None:
    corners = np.array([[-1.3, -0.7], [0.9, -1.1], [1.7, 0.3], [0.2, 1.9], [-1.1, 0.8]])
    world = World({"room": corners.tolist()})
    for x, y in scattered(3, 500, reach=0.5).tolist():
        offset = corners - (x, y)
        found = world.cast(x, y, np.arctan2(offset[:, 1], offset[:, 0]))
        np.testing.assert_allclose(found, np.hypot(offset[:, 0], offset[:, 1]), rtol=1e-9)


def test_a_ray_that_hits_nothing_is_infinite() -> None:
    world = World({"circles": [[2.0, 0.0, 0.5]], "obstacles": [[[-1, -1], [-2, -1], [-1, -2]]]})
    angles = np.array([0.0, math.pi / 2, math.pi, -0.75 * math.pi, 0.5])
    found = world.cast(0.0, 0.0, angles)
    np.testing.assert_allclose(found, [1.5, math.inf, math.inf, math.sqrt(2.0), math.inf])


def test_a_world_never_changes() -> None:
    world = World(OVERLAPPING)
    with pytest.raises(AttributeError, match="cannot change"):
        world.room = None  # type: ignore[assignment]
    with pytest.raises(ValueError, match="read-only"):
        world.circles[0, 0] = 1.0


def test_worlds_are_equal_when_their_descriptions_are() -> None:
    for description in (OVERLAPPING, *SHIPPED.values()):
        world = World(description)
        assert World(world.description) == world
        assert hash(World(world.description)) == hash(world)
    assert World(SHIPPED["paper_room"]) != World(SHIPPED["l_room"])


def test_corners_may_run_either_way_round() -> None:
    clockwise = World({"room": SQUARE[::-1], "obstacles": [[[0, 0], [1, 0], [0, 1]]]})
    other = World({"room": SQUARE, "obstacles": [[[0, 1], [1, 0], [0, 0]]]})
    points = scattered(5, 500)
    np.testing.assert_array_equal(clockwise.distance(points), other.distance(points))


@pytest.mark.parametrize("name", list(SHIPPED))
def test_shipped_worlds_leave_room_to_start(name: str) -> None:
    assert World(SHIPPED[name]).nearest(0.0, 0.0)[0] > 0.5
