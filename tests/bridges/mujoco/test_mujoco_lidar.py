"""The LiDAR in MuJoCo against rays in the plane, and the model against its description."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from blocks import ParameterError, World
from blocks.core.signals import FloatArray
from blocks.world.lidar import bearings
from spikeblocks.mujoco.robot_model import SEEN_GROUP, WALL_HEIGHT, BeamCaster, model_of, model_text
from spikeblocks.mujoco.vacuum import MujocoVacuum
from tests.blocks.outputs import outputs
from tests.blocks.worlds import OVERLAPPING, SHIPPED, is_free, started, worlds
from tests.examples import examples

DT = 0.01
AROUND = bearings(360, -math.pi, math.pi)


def between(world: World, pose: FloatArray, found: FloatArray, slack: float) -> np.ndarray:
    """Which ranges lie between those of the plane to either side, a hair off in angle and place.

    A ray that grazes a corner hits it or what is behind it.
    """
    x, y, theta = pose
    near = np.array(
        [
            world.cast(x + dx, y + dy, theta + AROUND + turn)
            for turn in (-1e-4, 0.0, 1e-4)
            for dx, dy in ((0.0, 0.0), (1e-4, 0.0), (-1e-4, 0.0), (0.0, 1e-4), (0.0, -1e-4))
        ]
    )
    low, high = near.min(axis=0) - slack, near.max(axis=0) + slack
    return (low <= found) & (found <= high)


@pytest.mark.parametrize("name", ["paper_room", "cluttered_room"])
def test_a_moving_robot_scans_from_where_it_is(name: str) -> None:
    """No step late: at 0.3 m/s that would be 0.6 mm a physics step, and 6 mm a tick."""
    world = World(SHIPPED[name])
    robot = MujocoVacuum(sigma=0.0, scan_period=DT, range_max=50.0)
    state = started(robot, world, dt=DT)
    for k in range(150):
        robot.update(state, k * DT, (0.3, 0.8))
        if k % 10 == 9:
            pose = np.array(outputs(robot, state).pose)
            assert between(world, pose, outputs(robot, state).scan, 2e-4).all()


@examples(40)
@given(worlds(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_any_world_looks_as_it_does_in_the_plane(world: World, x: float, y: float) -> None:
    assume(is_free(world, np.array([[x, y]]))[0] and world.nearest(x, y)[0] > 0.01)
    robot = MujocoVacuum()
    try:
        model = model_of(robot, world)
    except ParameterError:
        assume(False)
        raise
    data = mujoco.MjData(model)
    data.qpos[:2] = x, y
    found = BeamCaster(mujoco, model, data, AROUND, SEEN_GROUP, 100.0).cast()
    assert between(world, np.array([x, y, 0.0]), found, 1e-4).all()


def test_noise_has_its_deviation_and_limits_hold() -> None:
    world = World({"room": [[-3, -3], [3, -3], [3, 3], [-3, 3]]})
    robot = MujocoVacuum(sigma=0.02, scan_period=DT, range_min=3.05, range_max=4.0)
    state = started(robot, world, dt=DT)
    exact = world.cast(0.0, 0.0, AROUND)
    scans = []
    for k in range(60):
        scans.append(outputs(robot, state).scan)
        robot.update(state, k * DT, (0.0, 0.0))
    found = np.array(scans)
    clear = (exact > 3.2) & (exact < 3.8)
    noise = (found - exact)[:, clear]
    assert np.std(noise) == pytest.approx(0.02, rel=0.05)
    assert abs(np.mean(noise)) < 1e-3
    assert np.isinf(found[:, exact > 4.1]).all()
    seen = found[np.isfinite(found)]
    assert seen.min() >= 3.05
    assert seen.max() <= 4.0


def test_a_scan_holds_until_the_next_one() -> None:
    robot = MujocoVacuum(scan_period=0.05)
    state = started(robot, World(SHIPPED["paper_room"]), dt=DT)
    scans = []
    for k in range(20):
        scans.append(outputs(robot, state).scan.tobytes())
        robot.update(state, k * DT, (0.3, 0.5))
    for k, scan in enumerate(scans):
        assert scan == scans[k - k % 5]
    assert len(set(scans)) == 4


def test_a_tilted_robot_sees_the_floor() -> None:
    world = World({"room": [[-3, -3], [3, -3], [3, 3], [-3, 3]]})
    robot = MujocoVacuum(sigma=0.0)
    model = model_of(robot, world)
    data = mujoco.MjData(model)
    pitch = math.radians(2.0)  # nose down; beams back stay below the top of the wall
    data.qpos[3:7] = math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0
    ranges = BeamCaster(mujoco, model, data, np.array([0.0, math.pi]), SEEN_GROUP, 12.0).cast()
    up = robot.lidar_height - robot.wheel_radius
    height = robot.wheel_radius + up * math.cos(pitch)
    assert ranges[0] == pytest.approx(height / math.sin(pitch))
    ahead = up * math.sin(pitch)
    assert ranges[1] == pytest.approx((3.0 + ahead) / math.cos(pitch))


def test_the_model_is_what_it_is_said_to_be() -> None:
    robot = MujocoVacuum(mass=4.2, centre_of_mass=0.03, hull_radius=0.2)
    model = model_of(robot, World(OVERLAPPING))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body("robot").id
    assert model.body_subtreemass[body] == pytest.approx(4.2)
    assert data.subtree_com[body][0] == pytest.approx(0.03)
    assert model.geom("hull").size[0] == 0.2
    assert model.geom("wall0").contype[0] != 0
    tops = data.geom_xpos[:, 2] + model.geom_rbound
    assert tops[model.geom("wall0").id] > WALL_HEIGHT


def test_thin_walls_make_a_model() -> None:
    sliver = {"obstacles": [[[1.0, -1.0], [1.002, -1.0], [1.002, 1.0], [1.0, 1.0]]]}
    text = model_text(MujocoVacuum(), World(sliver))
    assert mujoco.MjModel.from_xml_string(text).nmesh == 4


def test_walls_of_a_plain_room_are_boxes() -> None:
    model = model_of(MujocoVacuum(), World({"room": [[0, 0], [4, 1], [3, 5], [-1, 4]]}))
    assert model.nmesh == 0
    kinds = {int(model.geom(f"wall{i}").type[0]) for i in range(4)}
    assert kinds == {int(mujoco.mjtGeom.mjGEOM_BOX)}
