"""Contours, kinks and the floor of the distance error against closed forms and brute force."""

from __future__ import annotations

import math
from typing import Any

import contourpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from blocks.core.signals import FloatArray
from blocks.world.level_set import loops
from blocks.world.world import World
from tests.blocks.worlds import OVERLAPPING, SHIPPED, SQUARE, worlds

D = 0.18
seeds = st.integers(0, 2**32 - 1)


def length(points: FloatArray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def check_contour(world: World, d: float, seed: int) -> None:
    spacing = 0.01
    found = world.offset_contour(d, spacing)
    for loop in found:
        assert np.array_equal(loop[0], loop[-1])
        assert np.hypot(*np.diff(loop, axis=0).T).max() < 1.01 * spacing
        assert np.abs(world.distance(loop) - d).max() < 1e-7
    samples = np.concatenate([np.empty((0, 2)), *found])
    # Complete: from wherever there is more room, the path to the wall crosses it.
    points = np.random.default_rng(seed).uniform(-3, 3, (300, 2))
    for x, y in points[world.distance(points) > d].tolist():
        distance, nx, ny = world.nearest(x, y)
        crossing = np.array([x - (distance - d) * nx, y - (distance - d) * ny])
        assert np.hypot(*(samples - crossing).T).min() < 0.51 * spacing


# Walls that are flush, of which other solids cut only the longer one's carrier.
FLUSH = {
    "room": [[0.0, 0.0], [0.0, 0.1], [-0.1, 0.1]],
    "obstacles": [[[0.0, 0.2], [0.1, 0.1], [-0.1, 0.1]], [[0.0, 0.0], [0.0, 0.1], [0.1, -0.2]]],
}


@pytest.mark.parametrize("d", [0.005, 0.01, 0.02])
def test_flush_walls_have_one_contour(d: float) -> None:
    """A right isosceles triangle of sides 1 and sqrt(2) has the inradius 1 / (2 + sqrt(2))."""
    inside = 1.0 - d / (0.1 / (2 + math.sqrt(2)))
    (loop,) = World(FLUSH).offset_contour(d, 1e-3)
    assert length(loop) == pytest.approx(0.1 * (2 + math.sqrt(2)) * inside, rel=1e-9)
    check_contour(World(FLUSH), d, seed=0)


@pytest.mark.parametrize("description", [OVERLAPPING, *SHIPPED.values()])
@pytest.mark.parametrize("d", [0.05, D, 0.5])
def test_the_contour_is_all_of_the_level_set(description: dict[str, Any], d: float) -> None:
    check_contour(World(description), d, seed=1)


@settings(deadline=None)
@given(worlds(), st.integers(1, 60), seeds)
def test_the_contour_of_any_world(world: World, cm: int, seed: int) -> None:
    check_contour(world, cm / 100, seed)


@pytest.mark.parametrize("name", list(SHIPPED))
def test_the_wall_is_to_the_right(name: str) -> None:
    world = World(SHIPPED[name])
    for loop in world.offset_contour(D):
        middle, steps = 0.5 * (loop[1:] + loop[:-1]), np.diff(loop, axis=0)
        left = np.column_stack((-steps[:, 1], steps[:, 0])) / np.hypot(*steps.T)[:, None]
        # A kink's neighbourhood aside, where leaving one surface is approaching another.
        away = world.reachable(middle, D, 0.05)
        rise = world.distance(middle + 1e-3 * left) - world.distance(middle)
        np.testing.assert_allclose(rise[away], 1e-3, rtol=1e-3)


def test_length_around_a_convex_obstacle() -> None:
    """Steiner's formula: the perimeter and a full circle."""
    world = World({"obstacles": [[[0, 0], [2, 0], [2.5, 1], [0, 1.5]]]})
    perimeter = 2 + math.hypot(0.5, 1) + math.hypot(2.5, 0.5) + 1.5
    (loop,) = world.offset_contour(0.3, 1e-3)
    assert length(loop) == pytest.approx(perimeter + 2 * math.pi * 0.3, rel=1e-6)
    assert len(world.kinks(0.3)) == 0


def test_length_and_kinks_of_the_papers_room() -> None:
    """Each cylinder replaces a chord of the square, 2 sqrt(R^2 - h^2), by an arc."""
    world = World(SHIPPED["paper_room"])
    expected, kinks = 8 * (2 - D), 4
    for r in (0.5, 0.4, 0.3, 0.2):
        R, h = r + D, r - D
        expected += R * (math.pi + 2 * math.asin(h / R)) - 2 * math.sqrt(R * R - h * h)
        kinks += 2
    (loop,) = world.offset_contour(D, 1e-3)
    assert length(loop) == pytest.approx(expected, rel=1e-6)
    found = world.kinks(D)
    assert len(found) == kinks
    half = math.sqrt(0.68**2 - 0.32**2)
    for x, y in [(0.3 - half, -1.82), (0.3 + half, -1.82), (1.82, 1.82), (-1.82, -1.82)]:
        assert np.hypot(*(found - (x, y)).T).min() < 1e-12


def test_reachable_is_all_but_discs_around_kinks() -> None:
    world = World({"room": SQUARE})
    points = np.array([[1.82, 1.82], [1.82, 1.63], [1.82, 1.61], [0.0, -1.82]])
    assert world.reachable(points, D, 0.2).tolist() == [False, False, True, True]
    assert World({"circles": [[0, 0, 1]]}).reachable(points, D, 0.2).all()


def test_no_contour_where_nothing_is_that_wide() -> None:
    world = World({"room": [[0, 0], [1, 0], [1, 1], [0, 1]]})
    assert world.offset_contour(0.51) == []
    assert world.kinks(0.51).shape == (0, 2)
    assert math.isnan(world.kink_floor(0.51, 0.1))
    with pytest.raises(ValueError, match="above 0 m"):
        world.offset_contour(0.0)


def test_surfaces_close_around_free_space() -> None:
    world = World(OVERLAPPING)
    for loop in loops(list(world.surfaces)):
        ends = [complex(p.at(np.array(p.length))) for p in loop]
        begins = [complex(p.at(np.array(0.0))) for p in loop]
        assert np.abs(np.array(ends) - np.roll(begins, -1)).max() < 1e-9


@pytest.mark.parametrize("rho", [0.1, 0.2, 0.5])
def test_floor_of_a_square_room(rho: float) -> None:
    """In a right angle, an arc's distance is d + rho (1 - cos(a)), a from -45 to 45 degrees."""
    side = 2 * (2 - D)
    error = 4 * 2 * rho**2 * (math.pi / 4 - math.sin(math.pi / 4))
    length = 4 * (side - 2 * rho) + 2 * math.pi * rho
    assert World({"room": SQUARE}).kink_floor(D, rho) == pytest.approx(error / length, rel=1e-4)


def test_floor_is_nothing_without_kinks() -> None:
    world = World({"circles": [[0.0, 0.0, 0.4]]})
    assert world.kink_floor(D, 0.2) < 1e-12
    room = World(SHIPPED["column_room"])
    assert room.kink_floor(D, 0.2, near=(1.1, 0.5)) < 1e-12
    assert room.kink_floor(D, 0.2, near=(-2.0, -1.0)) > 1e-4


def opened(world: World, d: float, rho: float, near: tuple[float, float]) -> float:
    """The floor by brute force: roll a disc of radius rho along the contour, from inside.

    The loop that the disc leaves is the boundary of all discs whose centres are at distance
    d + rho or more.
    """
    x, y = np.meshgrid(np.arange(-3.5, 3.7, 0.01), np.arange(-2.8, 3.7, 0.01))
    points = np.column_stack((x.ravel(), y.ravel()))
    distance = world.distance(points)
    away = np.where(distance >= d + rho, 0.0, 2.0 * rho)
    near_edge = (distance < d + rho) & (distance > d - 0.02)
    edge = np.concatenate(world.offset_contour(d + rho, 1e-3))
    away[near_edge], _ = cKDTree(edge).query(points[near_edge], distance_upper_bound=2.0 * rho)
    away = np.minimum(away, 2.0 * rho)
    lines = contourpy.contour_generator(x, y, away.reshape(x.shape)).lines(rho)
    line = min(lines, key=lambda line: np.hypot(*(line - near).T).min())
    middle, step = 0.5 * (line[1:] + line[:-1]), np.hypot(*np.diff(line, axis=0).T)
    return float(np.abs(world.distance(middle) - d) @ step / step.sum())


@pytest.mark.parametrize(
    ("name", "near", "rho"),
    [
        ("paper_room", (0.0, -2.0), 0.2),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("paper_room", (0.0, -2.0), 0.1),
                ("paper_room", (0.0, -2.0), 0.3),
                ("cluttered_room", (-3.0, -1.5), 0.2),
                ("l_room", (-1.5, -1.5), 0.2),
                ("outdoor", (-3.0, -2.0), 0.3),
            )
        ),
    ],
)
def test_floor_is_that_of_a_rolling_disc(name: str, near: tuple[float, float], rho: float) -> None:
    world = World(SHIPPED[name])
    assert world.kink_floor(D, rho, near) == pytest.approx(
        opened(world, D, rho, near), rel=0.03, abs=2e-5
    )


def test_floor_is_unknown_where_no_arc_fits() -> None:
    dead_end = [[0, 0], [0.5, 0], [0.5, 2], [3, 2], [3, 4], [0, 4]]
    assert math.isnan(World({"room": dead_end}).kink_floor(D, 0.2))
    assert World({"room": dead_end}).kink_floor(D, 0.05) > 0.0
