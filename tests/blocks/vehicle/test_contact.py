"""The robot's body against the world: it never gets in, slides along, and lets go."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blocks import DifferentialDrive, ParameterError
from blocks.core.signals import FloatArray, PoseValue, TwistValue
from blocks.vehicle.contact import slide
from blocks.world.world import World
from runtime import check_block
from tests.blocks.worlds import OVERLAPPING, SHIPPED, SQUARE, started, worlds

R = 0.12
ROOM = World(SHIPPED["paper_room"])


def drive(
    world: World | None,
    commands: list[TwistValue],
    x0: PoseValue = (0.0, 0.0, 0.0),
    dt: float = 0.01,
    radius: float = R,
) -> FloatArray:
    """Rows of x, y, theta, clearance, contact: before each command, and after the last."""
    plant = DifferentialDrive(x0=list(x0), body_radius=radius)
    state = started(plant, world, dt=dt)
    rows = [(*plant.output_pose(state, 0.0), *plant.output(state, 0.0))]
    for command in commands:
        plant.update(state, 0.0, command)
        rows.append((*plant.output_pose(state, 0.0), *plant.output(state, 0.0)))
    return np.array(rows)


def check_outside(world: World, rows: FloatArray, radius: float = R) -> None:
    distance = world.distance(rows[:, :2])
    assert distance.min() >= radius - 1e-9
    gap = np.maximum(distance - radius, 0.0) if radius else distance
    np.testing.assert_allclose(rows[:, 3], gap, rtol=0.0, atol=1e-12)
    assert np.array_equal(rows[:, 4], rows[:, 3] <= 1e-6)


wild = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
usual = st.tuples(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))


@settings(deadline=None)
@given(
    st.sampled_from(sorted(SHIPPED)),
    st.lists(wild, max_size=10),
    st.sampled_from([0.001, 0.01, 0.1]),
)
def test_no_command_drives_it_into_a_wall(name: str, commands: list[TwistValue], dt: float) -> None:
    world = World(SHIPPED[name])
    check_outside(world, drive(world, [c for c in commands for _ in range(5)], dt=dt))


@settings(deadline=None)
@given(worlds(), st.lists(usual, min_size=1, max_size=8), st.integers(0, 2**32 - 1))
def test_no_world_lets_it_in(world: World, commands: list[TwistValue], seed: int) -> None:
    starts = np.random.default_rng(seed).uniform(-2.0, 2.0, (200, 2))
    starts = starts[world.distance(starts) > R]
    if not len(starts):
        return
    x, y = starts[0].tolist()
    check_outside(world, drive(world, [c for c in commands for _ in range(25)], (x, y, 0.0)))


@settings(deadline=None)
@given(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300))
def test_no_leap_gets_through_a_wall(dx: float, dy: float) -> None:
    world = World({"room": [[-5, -5], [5, -5], [5, 5], [-5, 5]], "obstacles": [
        [[1, -5], [1.001, -5], [1.001, 5], [1, 5]]
    ]})  # fmt: skip
    x, y, gap = slide(world, 0.0, 0.0, 1.0 - R, dx, dy, R)
    assert -5.0 + R - 1e-9 <= x <= 1.0 - R + 1e-9
    assert abs(y) <= 5.0 - R + 1e-9
    assert gap >= -1e-9


@pytest.mark.parametrize("angle", [0.1, 0.8, 1.4, -0.6])
def test_it_slides_along_a_wall_at_the_tangential_speed(angle: float) -> None:
    world = World({"room": SQUARE})
    v, ticks = 0.5, 100
    rows = drive(world, [(v, 0.0)] * ticks, (2.0 - R, 0.0, angle))
    check_outside(world, rows)
    assert rows[:, 4].all()
    np.testing.assert_allclose(rows[:, 0], 2.0 - R, atol=1e-10)
    way = np.minimum(v * math.sin(angle) * 0.01 * np.arange(ticks + 1), 2.0 - R)
    np.testing.assert_allclose(rows[:, 1], np.maximum(way, R - 2.0), atol=1e-9)
    assert np.array_equal(rows[:, 2], np.full(ticks + 1, angle))


def test_it_comes_to_rest_in_a_corner_and_leaves_it() -> None:
    world = World({"room": SQUARE})
    rows = drive(world, [(0.5, 0.0)] * 1000 + [(-0.5, 0.0)] * 10, (0.0, 0.0, 0.6))
    check_outside(world, rows)
    np.testing.assert_allclose(rows[1000, :2], 2.0 - R, atol=1e-9)
    back = rows[1000, :2] - 0.05 * np.array([math.cos(0.6), math.sin(0.6)])
    np.testing.assert_allclose(rows[-1, :2], back, atol=1e-9)
    assert rows[1000, 4] == 1.0
    assert rows[-1, 4] == 0.0


def test_it_slides_around_a_cylinder() -> None:
    """Pushed along x, it goes around at v sin(phi) / (r + R): tan(phi / 2) grows like exp(t)."""
    world = World({"circles": [[0.0, 0.0, 0.5]]})
    reach, phi0, v, dt = 0.5 + R, 0.2, 0.1, 1e-3
    start = (-reach * math.cos(phi0), reach * math.sin(phi0), 0.0)
    rows = drive(world, [(v, 0.0)] * 4000, start, dt)
    check_outside(world, rows)
    phi = np.pi - np.arctan2(rows[:, 1], rows[:, 0])
    t = dt * np.arange(len(rows))
    expected = 2.0 * np.arctan(math.tan(phi0 / 2) * np.exp(v * t / reach))
    touching = expected < 0.5 * math.pi
    assert touching.sum() > 1000
    np.testing.assert_allclose(phi[touching], expected[touching], atol=2e-3)


def test_away_from_walls_it_moves_as_without_a_world() -> None:
    commands = [(0.2, 1.5 * math.sin(0.05 * k)) for k in range(300)]
    free, held = drive(None, commands, radius=0.0), drive(ROOM, commands)
    assert held[:, 3].min() > 0.0
    # Adding a step's displacement to a position rounds otherwise than adding its parts.
    np.testing.assert_allclose(held[:, :3], free[:, :3], rtol=0.0, atol=1e-13)


def test_without_a_world_nothing_is_near() -> None:
    rows = drive(None, [(1.0, 0.0)] * 3, radius=0.0)
    assert np.array_equal(rows[:, 3:], np.tile([1000.0, 0.0], (4, 1)))


def test_without_a_body_it_is_a_point_that_nothing_stops() -> None:
    rows = drive(World({"room": SQUARE}), [(10.0, 0.0)] * 30, radius=0.0)
    np.testing.assert_allclose(rows[:, 0], 0.1 * np.arange(31), atol=1e-12)
    np.testing.assert_allclose(rows[:, 3], 2.0 - rows[:, 0], atol=1e-12)
    assert not rows[:, 4].any()


def test_it_must_fit_where_it_starts() -> None:
    with pytest.raises(ParameterError) as caught:
        drive(ROOM, [], (1.9, -1.0, 0.0))
    message = "a body of radius 0.12 m does not fit at (1.9, -1): the nearest surface is 0.1 m away"
    assert caught.value.problems == [("x0", message)]
    with pytest.raises(ParameterError, match=r"does not fit at \(3, 0\)$"):
        drive(ROOM, [], (3.0, 0.0, 0.0))


def test_a_body_needs_a_world() -> None:
    with pytest.raises(ParameterError, match="body_radius: a body needs a world"):
        drive(None, [])


@pytest.mark.parametrize("radius", [0.0, R])
def test_it_keeps_the_rules_of_blocks(radius: float) -> None:
    check_block(DifferentialDrive(body_radius=radius), world=World(OVERLAPPING), ticks=30, dt=0.1)
