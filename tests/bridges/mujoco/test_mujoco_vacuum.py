"""The robot in MuJoCo against the ideal unicycle, against statics, and against Coulomb."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from blocks import ParameterError, World
from blocks.core import BlockState
from blocks.core.signals import FloatArray
from runtime import check_block
from spikeblocks.mujoco.robot_model import SKID_CLEARANCE
from spikeblocks.mujoco.vacuum import WHEEL_RATES, MujocoVacuum
from tests.blocks.outputs import outputs
from tests.blocks.worlds import SHIPPED, started

DT = 0.01
G = 9.81
HALL = World({"room": [[-5, -5], [5, -5], [5, 5], [-5, 5]]})
Commands = list[tuple[float, float]]


def during(seconds: float, v: float, omega: float) -> Commands:
    return [(v, omega)] * round(seconds / DT)


def driven(robot: MujocoVacuum, commands: Commands, world: World = HALL) -> BlockState:
    state = started(robot, world, dt=DT)
    for k, command in enumerate(commands):
        robot.update(state, k * DT, command)
    return state


def ideal(commands: Iterable[tuple[float, float]], parts: int = 50) -> FloatArray:
    """The pose of a unicycle from rest, its ramps 1 m/s^2 and 8 rad/s^2: midpoint rule."""
    x = y = theta = v = omega = 0.0
    h = DT / parts
    for wanted_v, wanted_omega in commands:
        for _ in range(parts):
            before = v, omega
            v += min(h, max(-h, wanted_v - v))
            omega += min(8.0 * h, max(-8.0 * h, wanted_omega - omega))
            mean, turn = 0.5 * (v + before[0]), 0.5 * (omega + before[1])
            x += h * mean * math.cos(theta + 0.5 * h * turn)
            y += h * mean * math.sin(theta + 0.5 * h * turn)
            theta += h * turn
    return np.array((x, y, theta))


STOP = during(1.0, 0.0, 0.0)
MANOEUVRES = {
    "straight": during(5.0, 0.3, 0.0) + STOP,
    "circle": during(2.0 * math.pi / 0.5, 0.2, 0.5) + STOP,
    "two turns on the spot": during(4.0 * math.pi, 0.0, 1.0) + STOP,
}


@pytest.mark.parametrize("name", MANOEUVRES)
def test_it_goes_where_the_ideal_unicycle_goes(name: str) -> None:
    robot = MujocoVacuum()
    state = driven(robot, MANOEUVRES[name])
    pose, odometry = np.array(outputs(robot, state).pose), np.array(outputs(robot, state).odometry)
    off = pose - ideal(MANOEUVRES[name])
    assert math.hypot(off[0], off[1]) < 5e-3
    assert abs(off[2]) < math.radians(1.0)
    error = odometry - pose
    assert math.hypot(error[0], error[1]) < 2e-3
    assert abs(error[2]) < math.radians(0.5)


def test_the_way_hangs_on_no_physics_step() -> None:
    robots = [MujocoVacuum(physics_step=h) for h in (0.001, 0.002, 0.0025)]
    ends = [outputs(robot, driven(robot, MANOEUVRES["circle"])).pose for robot in robots]
    np.testing.assert_allclose(ends, [ends[0]] * 3, atol=5e-4)


def test_it_starts_at_its_pose() -> None:
    robot = MujocoVacuum(x0=[1.0, -2.0, 4.0])
    state = driven(robot, [])
    assert outputs(robot, state).pose == pytest.approx((1.0, -2.0, 4.0))
    robot.update(state, 0.0, (0.0, 0.0))
    assert outputs(robot, state).pose == pytest.approx((1.0, -2.0, 4.0), abs=1e-4)


def test_at_rest_the_caster_carries_what_the_lever_rule_says() -> None:
    robot = MujocoVacuum(mass=5.0, centre_of_mass=0.03, caster=0.1)
    state = driven(robot, STOP)
    carried = {"caster": 0.0, "left": 0.0, "right": 0.0}
    wrench = np.zeros(6)
    mujoco.mj_forward(state.model, state.data)
    for i, contact in enumerate(state.data.contact):
        mujoco.mj_contactForce(state.model, state.data, i, wrench)
        carried[state.model.geom(contact.geom[1]).name] += wrench[0]
    assert sum(carried.values()) == pytest.approx(5.0 * G, rel=1e-3)
    assert carried["caster"] == pytest.approx(5.0 * G * 0.03 / 0.1, rel=1e-2)
    assert carried["left"] == pytest.approx(carried["right"], rel=1e-3)


def test_on_a_slippery_patch_it_starts_as_fast_as_friction_lets_it() -> None:
    """Two spinning wheels that carry N push with mu N, which also takes load off the caster."""
    mu, seconds = 0.02, 1.0
    robot = MujocoVacuum(patch=[0.0, 0.0, 0.5], patch_friction=mu)
    state = driven(robot, during(seconds, 0.6, 0.0))
    distance, counted = outputs(robot, state).pose[0], outputs(robot, state).odometry[0]
    fraction = 1.0 - robot.centre_of_mass / robot.caster
    assert distance == pytest.approx(0.5 * mu * fraction * G * seconds**2, rel=0.05)
    assert counted == pytest.approx(0.6 * seconds - 0.5 * 0.6**2, rel=0.05)


def test_beside_the_patch_and_before_its_time_wheels_hold() -> None:
    aside = MujocoVacuum(patch=[0.0, 1.0, 0.5], patch_friction=0.02)
    later = MujocoVacuum(patch=[0.0, 0.0, 0.5], patch_friction=0.02, start=2.0)
    for robot in (aside, later):
        state = driven(robot, during(1.0, 0.3, 0.0))
        distance, counted = outputs(robot, state).pose[0], outputs(robot, state).odometry[0]
        assert distance == pytest.approx(counted, abs=2e-3)


@pytest.mark.parametrize(
    ("fault", "v", "omega"),
    [
        ({}, 0.2, 0.4),
        ({"turn_gain": 0.65}, 0.2, 0.65 * 0.4),
        ({"yaw_bias": -0.15}, 0.2, 0.25),
        # Left v - omega track / 2 = 0.153 m/s, right 0.247 m/s, of which half is left.
        ({"wheel_gain": [1.0, 0.5]}, 0.1383, (0.1235 - 0.153) / 0.235),
        ({"turn_gain": 0.65, "stop": 2.0}, 0.2, 0.4),
        ({"turn_gain": 0.65, "start": 8.0}, 0.2, 0.4),
    ],
)
def test_faults_act_at_the_wheels(fault: dict[str, Any], v: float, omega: float) -> None:
    robot = MujocoVacuum(**fault)
    state = driven(robot, during(4.0, 0.2, 0.4))
    rims = outputs(robot, state).wheels
    assert 0.5 * (rims[0] + rims[1]) == pytest.approx(v, rel=0.01)
    assert (rims[1] - rims[0]) / 0.235 == pytest.approx(omega, rel=0.01)
    before = np.array(outputs(robot, state).pose)
    for k in range(100):
        robot.update(state, 4.0 + k * DT, (0.2, 0.4))
    moved = np.array(outputs(robot, state).pose) - before
    assert moved[2] == pytest.approx(omega, rel=0.02, abs=1e-3)
    assert math.hypot(*moved[:2]) == pytest.approx(v, rel=0.02)


def test_a_wall_stops_it_with_no_more_than_its_wheels_can_push() -> None:
    robot, world = MujocoVacuum(), World(SHIPPED["paper_room"])
    state = started(robot, world, dt=DT)
    force, near = [], []
    for k in range(1000):
        robot.update(state, k * DT, (0.3, 0.6 * math.sin(0.01 * k)))
        near.append(world.nearest(*outputs(robot, state).pose[:2])[0])
        force.append(outputs(robot, state).contact)
    touching = np.array(force) > 0.5
    assert touching.sum() > 100
    assert min(near) == pytest.approx(robot.body_radius, abs=3e-3)
    # Away from the wall there is no force, and on it mu m g at most, in the mean.
    assert not (touching & (np.array(near) > robot.body_radius + 2e-3)).any()
    assert np.mean(np.array(force)[touching]) < 1.2 * robot.friction * robot.mass * G


def test_motors_and_ramps_have_limits() -> None:
    robot = MujocoVacuum(acceleration=0.25, wheel_speed_max=0.2)
    state = driven(robot, during(0.4, 0.5, 0.0))
    assert outputs(robot, state).wheels == pytest.approx((0.1, 0.1), abs=2e-3)
    for k in range(300):
        robot.update(state, k * DT, (0.5, 0.0))
    assert outputs(robot, state).wheels == pytest.approx((0.2, 0.2), abs=1e-3)
    weak = MujocoVacuum(torque_max=0.01)
    state = driven(weak, during(1.0, 0.6, 0.0))
    # Force 2 T / r moves the mass and turns two wheels and their gears.
    inertia = 2.0 * (weak.armature + 0.5 * weak.wheel_mass * weak.wheel_radius**2)
    effective = weak.mass + inertia / weak.wheel_radius**2
    speed = 2.0 * 0.01 / weak.wheel_radius / effective
    assert state.physics[WHEEL_RATES] * weak.wheel_radius == pytest.approx([speed] * 2, rel=0.02)


@pytest.mark.parametrize(("acceleration", "lifts"), [(3.0, False), (5.0, True)])
def test_it_tips_onto_its_skid_when_it_starts_too_fast(acceleration: float, lifts: bool) -> None:
    """The caster lifts where a h > g c, h and c being how high and ahead the centre of mass is:
    3.8 m/s^2 here. The skid, 2 mm above the floor and as far back, then stops the tilt.
    """
    robot = MujocoVacuum(acceleration=acceleration)
    state = started(robot, HALL, dt=DT)
    tilts = []
    for k in range(100):
        robot.update(state, k * DT, (0.6, 0.0))
        tilts.append(outputs(robot, state).tilt)
    onto_skid = math.asin(SKID_CLEARANCE / robot.caster)
    assert max(tilts) == pytest.approx(onto_skid if lifts else 0.0, abs=0.1 * onto_skid)
    assert tilts[-1] < 0.1 * onto_skid


def test_a_simulation_that_breaks_down_says_so(tmp_path: Path, monkeypatch: Any) -> None:
    """MuJoCo itself would put the robot back to where it started, and go on."""
    monkeypatch.chdir(tmp_path)
    robot = MujocoVacuum()
    state = driven(robot, during(0.1, 0.3, 0.0))
    state.physics[WHEEL_RATES] = 1e200
    with pytest.raises(ArithmeticError, match="the simulation became unstable"):
        robot.update(state, 0.1, (0.3, 0.0))


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"patch": [0.0, 0.0, 0.1], "wheel_gain": [1.0, 0.5], "turn_gain": 0.5, "start": 0.05},
        {"scan_period": 0.03, "x0": [0.0, 0.0, 3.1]},
    ],
)
def test_it_keeps_the_rules_of_blocks(parameters: dict[str, Any]) -> None:
    """Among them: a run that resumes from its declared states continues bit-identically."""
    check_block(MujocoVacuum(**parameters), world=World(SHIPPED["paper_room"]), ticks=30)


def test_a_seed_changes_noise_and_nothing_else() -> None:
    robot = MujocoVacuum()
    poses, scans = [], []
    for seed in (0, 0, 1):
        state = started(robot, HALL, dt=DT, seed=seed)
        for k in range(30):
            robot.update(state, k * DT, (0.3, 1.0))
        poses.append(outputs(robot, state).pose)
        scans.append(outputs(robot, state).scan)
    assert poses[0] == poses[1] == poses[2]
    assert scans[0].tobytes() == scans[1].tobytes()
    assert (scans[0] != scans[2]).all()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"range_min": 2.0, "range_max": 1.0}, "range_max: must lie above range_min = 2 m"),
        ({"mass": 0.2}, "mass: two wheels of 0.15 kg are part of it"),
        ({"track": 0.4}, "track: reaches 0.21 m from the middle, out of hull_radius = 0.17 m"),
        ({"centre_of_mass": -0.01}, "centre_of_mass: must lie between the axle"),
        ({"patch": [0, 0, 0]}, "patch: its radius must be above 0 m"),
        ({"start": 3.0, "stop": 2.0}, "stop: must lie after start = 3 s"),
        ({"physics_step": 0.01}, "physics_step: expected a number above 0 and at most 0.0025"),
    ],
)
def test_parameters_that_cannot_be(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        MujocoVacuum(**parameters)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"physics_step": 0.0015}, "physics_step: must be a whole part of the block's step"),
        ({"scan_period": 0.015}, "scan_period: must be a multiple of the block's step"),
        ({"x0": [4.9, 0, 0]}, r"x0: a hull of radius 0.17 m does not fit .* is 0.1 m away"),
    ],
)
def test_settings_that_cannot_be(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        started(MujocoVacuum(**parameters), HALL, dt=DT)


def test_it_needs_a_world() -> None:
    with pytest.raises(ParameterError, match="needs a world: section"):
        started(MujocoVacuum(), None, dt=DT)


def test_the_library_does_not_load_mujoco() -> None:
    script = (
        "import sys, blocks, runtime.cli; blocks.MujocoVacuum(); print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("False\n", "")
