"""The explorer in closed loop: it touches nothing, finds a wall, and bears any scan."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from blocks import DifferentialDrive, ParameterError, Scan
from blocks.core.signals import FloatArray
from blocks.vehicle.explorer import Explorer
from blocks.world.lidar import Lidar, bearings
from blocks.world.world import World
from runtime import check_block
from tests.blocks.worlds import SHIPPED, started

DT, SCAN_DT, R = 0.05, 0.1, 0.12
ROOM = World(SHIPPED["paper_room"])


@dataclass
class Run:
    """Rows over time: poses (n, 3), commands (n, 2), engaged (n,), clearance (n,)."""

    pose: FloatArray
    command: FloatArray
    engaged: FloatArray
    clearance: FloatArray

    @property
    def t(self) -> FloatArray:
        return DT * np.arange(len(self.engaged))


def explore(
    world: World, seconds: float, seed: int = 0, turn_gain: float = 1.0, **parameters: float
) -> Run:
    """Explorer at 20 Hz, LiDAR at 10 Hz and plant, in a loop; the turn rate times a gain."""
    explorer = Explorer(**parameters)
    lidar, plant = Lidar(beams=360), DifferentialDrive(body_radius=R)
    states = started(explorer, dt=DT, seed=seed), started(lidar, world, dt=SCAN_DT, seed=seed)
    state, scanner = states
    body = started(plant, world, dt=DT)
    rows = []
    for k in range(round(seconds / DT)):
        t, pose = k * DT, plant.output_pose(body, 0.0)
        if k % 2 == 0:
            scan = lidar.output(scanner, t, pose)
            lidar.update(scanner, t)
        command, engaged = explorer.output(state, t, scan, pose)
        explorer.update(state, t, pose, command, engaged)
        rows.append((*pose, *command, engaged, plant.output(body, t)[0]))
        plant.update(body, t, (command[0], turn_gain * command[1]))
    table = np.array(rows)
    return Run(table[:, :3], table[:, 3:5], table[:, 5], table[:, 6])


@pytest.mark.parametrize("name", list(SHIPPED))
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_it_touches_nothing_and_finds_a_wall(name: str, seed: int) -> None:
    run = explore(World(SHIPPED[name]), 60.0, seed)
    assert run.clearance[run.engaged == 0.0].min() > 0.0
    assert run.engaged[-1] == 1.0
    # Latched, not before its time, and at a wall.
    first = int(run.engaged.argmax())
    assert run.engaged[first:].all()
    assert run.t[first] >= 6.0 - 1e-9
    assert run.clearance[first] + R < 0.45 + 0.05


@pytest.mark.parametrize("name", list(SHIPPED))
@pytest.mark.parametrize("turn_gain", [pytest.param(1.0, marks=pytest.mark.slow), 0.5])
def test_wandering_for_long_touches_nothing(name: str, turn_gain: float) -> None:
    run = explore(World(SHIPPED[name]), 120.0, 1, turn_gain, explore_time=1e3)
    assert run.clearance.min() > 0.0
    assert not run.engaged.any()
    assert np.ptp(run.pose[:, 0]) > 1.0


def test_commands_keep_their_limits() -> None:
    run = explore(ROOM, 30.0, 2, v_r=0.15, omega_max=0.8)
    assert set(run.command[:, 0]) <= {0.0, 0.15}
    assert np.abs(run.command[:, 1]).max() <= 0.8


def test_the_seed_decides_its_turns() -> None:
    first, again, other = (explore(ROOM, 6.0, seed).pose for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def misses(beams: int = 360) -> FloatArray:
    return np.full(beams, np.inf)


def test_after_wandering_it_drives_straight_and_holds_its_heading() -> None:
    """Nothing in sight, and a drift of the heading: it turns against the drift."""
    explorer = Explorer(explore_time=1.0)
    state = started(explorer, dt=DT)
    theta, headings = 0.3, []
    for k in range(200):
        pose = (0.0, 0.0, theta)
        command, engaged = explorer.output(state, k * DT, misses(), pose)
        explorer.update(state, k * DT, pose, command, engaged)
        theta += DT * (command[1] + 0.15)
        headings.append(pose[2])
        assert command[0] == 0.2
        assert engaged == 0.0
    # Its course is the heading of the last tick of wandering; 0.15 / gain is what remains.
    assert headings[-1] - headings[19] == pytest.approx(0.15 / 2.0, abs=1e-6)


def test_random_turn_rates_hold_for_a_while() -> None:
    explorer = Explorer(explore_time=1e3, wander_rate=0.6, wander_hold=1.5)
    state = started(explorer, dt=DT)
    rates = []
    for k in range(3000):
        pose = (0.0, 0.0, 0.0)
        command, engaged = explorer.output(state, k * DT, misses(), pose)
        explorer.update(state, k * DT, pose, command, engaged)
        rates.append(command[1])
    changes = np.flatnonzero(np.diff(rates))
    assert np.abs(rates).max() <= 0.6
    assert set(np.diff(changes)) == {30}
    drawn = np.array(rates)[changes]
    assert abs(drawn.mean()) < 4 * 0.6 / math.sqrt(3 * len(drawn))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_blocked_it_turns_in_place_away_and_never_back(side: float) -> None:
    explorer = Explorer()
    state = started(explorer, dt=DT)
    directions = bearings(360, -math.pi, math.pi)
    pose = (0.0, 0.0, 0.0)
    for k, at in enumerate((0.2 * side, -0.2 * side, 0.4 * side)):
        scan = misses()
        scan[np.abs(directions - at) < 0.1] = 0.25
        command, engaged = explorer.output(state, k * DT, scan, pose)
        explorer.update(state, k * DT, pose, command, engaged)
        assert command == (0.0, -side * 1.5)
    command, _ = explorer.output(state, 3 * DT, misses(), pose)
    assert command[0] == 0.2


def test_what_is_beside_or_behind_does_not_stop_it() -> None:
    explorer = Explorer(explore_time=0.0)
    directions = bearings(360, -math.pi, math.pi)
    scan = misses()
    scan[np.abs(directions) > 1.3] = 0.25
    command, engaged = explorer.output(started(explorer), 0.0, scan, (0.0, 0.0, 0.0))
    assert command == (0.2, 0.0)
    assert engaged == 1.0


@pytest.mark.parametrize("window", [(-math.pi, math.pi), (0.0, 2 * math.pi), (-1.0, 1.0)])
def test_it_knows_left_from_right_in_any_window(window: tuple[float, float]) -> None:
    explorer = Explorer(angle_min=window[0], angle_max=window[1])
    lidar = Lidar(beams=180, sigma=0.0, angle_min=window[0], angle_max=window[1])
    for y in (0.06, -0.06):
        world = World({"circles": [[0.3, y, 0.05]]})
        scan = lidar.output(started(lidar, world), 0.0, (0.0, 0.0, 0.0))
        state = started(explorer, beams=180)
        (v, omega), _ = explorer.output(state, 0.0, scan, (0.0, 0.0, 0.0))
        assert v == 0.0
        assert math.copysign(1.0, omega) == -math.copysign(1.0, y)


@pytest.mark.parametrize(
    "scan",
    [
        misses(),
        np.full(360, np.nan),
        np.where(np.arange(360) % 2, np.nan, np.inf),
        np.where(np.arange(360) % 2, np.nan, 3.0),
        np.where(np.arange(360) == 200, 0.3, np.inf),
        np.full(360, 0.01),
        np.zeros(360),
    ],
)
def test_it_bears_any_scan(scan: FloatArray) -> None:
    explorer = Explorer(explore_time=0.5)
    state = started(explorer, dt=DT)
    before, pose = scan.copy(), (0.0, 0.0, 0.0)
    for k in range(40):
        command, engaged = explorer.output(state, k * DT, scan, pose)
        explorer.update(state, k * DT, pose, command, engaged)
        assert all(math.isfinite(part) for part in command)
        assert engaged in (0.0, 1.0)
    assert np.array_equal(scan, before, equal_nan=True)
    assert engaged == (1.0 if np.nanmin(scan, initial=np.inf) < 0.45 else 0.0)


def test_it_stays_engaged_when_the_wall_is_gone() -> None:
    explorer = Explorer(explore_time=0.0)
    state = started(explorer)
    pose = (0.0, 0.0, 0.0)
    for scan, expected in ((misses(), 0.0), (np.full(360, 0.4), 1.0), (misses(), 1.0)):
        command, engaged = explorer.output(state, 0.0, scan, pose)
        explorer.update(state, 0.0, pose, command, engaged)
        assert engaged == expected


def test_it_keeps_the_rules_of_blocks() -> None:
    check_block(Explorer(), {"scan": Scan(30)}, ticks=50, dt=0.1)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"engage_distance": 0.3}, "engage_distance: must lie above stop_distance = 0.3 m"),
        ({"avoid_distance": 0.2}, "avoid_distance: must lie above stop_distance = 0.3 m"),
        ({"angle_min": 4.0}, "angle_max: must lie above angle_min = 4 rad"),
        ({"v_r": 0.0}, "v_r: expected a number above 0 m/s"),
    ],
)
def test_bad_parameters(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Explorer(**parameters)


def test_who_has_lost_the_wall_turns_to_the_nearest_return() -> None:
    """Within a few seconds it looks at it, from wherever that was, and stops turning when near."""
    for bearing in (-2.8, -1.0, 0.5, 3.0):
        explorer = Explorer(explore_time=0.0)
        state = started(explorer, dt=DT)
        explorer.update(state, 0.0, (0.0, 0.0, 0.0), (0.2, 0.0), 1.0)
        x, y, theta = 0.0, 0.0, 0.0
        world = World({"circles": [[2.0 * math.cos(bearing), 2.0 * math.sin(bearing), 0.3]]})
        for k in range(300):
            scan = world.cast(x, y, theta + bearings(360, -math.pi, math.pi))
            (v, omega), engaged = explorer.output(state, k * DT, scan, (x, y, theta))
            assert engaged == 1.0
            if scan.min() < 0.45:
                break
            x, y, theta = (
                x + DT * v * math.cos(theta),
                y + DT * v * math.sin(theta),
                theta + DT * omega,
            )
        assert omega == 0.0
        assert world.distance(np.array([[x, y]]))[0] < 0.45


def test_a_lost_robot_between_two_walls_decides_for_one() -> None:
    """Both equally near, with noise: it does not stay in the middle."""
    world = World({"room": [[-9.0, -1.2], [9.0, -1.2], [9.0, 1.2], [-9.0, 1.2]]})
    explorer, rng = Explorer(explore_time=0.0), np.random.default_rng(3)
    state = started(explorer, dt=DT)
    explorer.update(state, 0.0, (0.0, 0.0, 0.0), (0.2, 0.0), 1.0)
    x, y, theta = -5.0, 0.0, 0.0
    scan = np.empty(360)
    for k in range(200):
        if k % 2 == 0:
            exact = world.cast(x, y, theta + bearings(360, -math.pi, math.pi))
            scan = exact + 0.01 * rng.standard_normal(360)
        (v, omega), _ = explorer.output(state, k * DT, scan, (x, y, theta))
        v, omega = 0.5 * v, 0.5 * omega  # as the graph's search does
        x, y = x + DT * v * math.cos(theta), y + DT * v * math.sin(theta)
        theta += DT * omega
    assert abs(y) > 0.3
