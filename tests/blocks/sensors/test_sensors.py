"""Sensors against their closed forms: variances, correlations, and what arrives when."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import blocks
import runtime
from tests.blocks.responses import problems, respond

N = 4000
STILL = [np.zeros((N, 3)), np.zeros((N, 3)), np.tile([1.0, 0, 0, 0], (N, 1))]


def imu(of: str, dt: float = 0.01, **entry: Any) -> Any:
    inputs = dict(zip(("rate", "acceleration", "attitude"), STILL, strict=True))
    return respond({"type": "IMU", **entry}, inputs, dt=dt, of=of)


@pytest.mark.parametrize("dt", [0.01, pytest.param(0.001, marks=pytest.mark.slow)])
def test_the_density_of_an_imu_does_not_depend_on_the_step(dt: float) -> None:
    gyro = imu("gyro", dt, gyro_noise=2e-3, gyro_walk=0.0)
    # The integral over a second has the deviation of the density, at any step.
    assert gyro.std() * math.sqrt(dt) == pytest.approx(2e-3, rel=0.05)
    force = imu("accelerometer", dt, accelerometer_noise=3e-3, accelerometer_walk=0.0)
    np.testing.assert_allclose(force.mean(0), [0, 0, 9.81], atol=5e-3 / math.sqrt(N * dt))
    assert (force - force.mean(0)).std() * math.sqrt(dt) == pytest.approx(3e-3, rel=0.05)


def test_a_bias_walks_from_where_it_begins() -> None:
    entry = {"gyro_noise": 0.0, "gyro_walk": 0.5, "gyro_bias": [0.1, 0, -0.1]}
    gyro = imu("gyro", **entry)
    np.testing.assert_allclose(gyro[0], [0.1, 0, -0.1])
    assert np.diff(gyro, axis=0).std() == pytest.approx(0.5 * math.sqrt(0.01), rel=0.05)
    # Independent steps: no correlation between neighbours.
    steps = np.diff(gyro[:, 0])
    assert abs(np.corrcoef(steps[1:], steps[:-1])[0, 1]) < 0.05


@given(st.lists(st.floats(-1, 1), min_size=10, max_size=10))
def test_an_imu_measures_in_the_body(numbers: Any) -> None:
    q = np.array(numbers[:4]) + np.array([2.5, 0, 0, 0])
    rate, acceleration = np.array(numbers[4:7]), np.array(numbers[7:])
    entry = {"type": "IMU"} | dict.fromkeys(
        ("gyro_noise", "gyro_walk", "accelerometer_noise", "accelerometer_walk"), 0.0
    )
    rows = {"rate": rate, "acceleration": acceleration, "attitude": q}
    inputs = {name: np.tile(row, (2, 1)) for name, row in rows.items()}
    turn = Rotation.from_quat(q[[1, 2, 3, 0]])
    found = respond(entry, inputs, of="accelerometer")[0]
    np.testing.assert_allclose(
        found, turn.inv().apply(acceleration + np.array([0, 0, 9.81])), atol=1e-12
    )
    np.testing.assert_allclose(respond(entry, inputs, of="gyro")[0], rate, atol=1e-15)


def test_a_receiver_has_white_noise_and_a_slow_drift() -> None:
    entry = {"type": "GPS", "noise": [0.5, 0.5, 1.0], "drift": [2.0, 2.0, 4.0], "tau": 0.5}
    where = np.tile([1.0, -2.0, 3.0], (N, 1))
    fix = respond(entry, {"position": where}, dt=0.1, of="fix") - where
    # Variance at once: both; between neighbours: the drift's alone, e^(-dt / tau) of it.
    np.testing.assert_allclose(fix.var(0), [4.25, 4.25, 17.0], rtol=0.15)
    shared = (fix[1:] * fix[:-1]).mean(0)
    np.testing.assert_allclose(shared, np.array([4, 4, 16]) * math.exp(-0.2), rtol=0.2)
    speed = respond({**entry, "velocity_noise": [0.1, 0.2, 0.3]}, {"position": where}, of="course")
    np.testing.assert_allclose(speed.std(0), [0.1, 0.2, 0.3], rtol=0.05)


@pytest.mark.parametrize("form", [1, 3, 4])
def test_a_compass_takes_a_heading_a_pose_or_a_quaternion(form: int) -> None:
    psi = np.linspace(-3.1, 3.1, 50)
    rows = {
        1: psi,
        3: np.column_stack([psi, 2 * psi, psi]),
        4: np.column_stack([np.cos(psi / 2), 0 * psi, 0 * psi, np.sin(psi / 2)]),
    }[form]
    entry = {"type": "Compass", "noise": 0.0, "declination": 0.3, "deviation": [0.1, -0.2]}
    found = respond(entry, {"attitude": [rows]}, of="heading")
    expected = psi + 0.3 + 0.1 * np.sin(psi) - 0.2 * np.cos(psi)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * expected), atol=1e-12)
    assert (np.abs(found) <= math.pi).all()
    assert "got 2 in attitude" in problems(entry, ["Twist"], "attitude")


def test_odometry_without_errors_follows_the_arc() -> None:
    motion = np.tile([0.5, 0.4], (500, 1))
    entry = {"type": "WheelOdometry", "noise": 0.0, "x0": [1, 2, 0.5]}
    blocks_in = {"motion": motion}
    found = respond_twist(entry, blocks_in)
    t = 0.01 * np.arange(500)
    theta = 0.5 + 0.4 * t
    x = 1 + 1.25 * (np.sin(theta) - math.sin(0.5))
    y = 2 - 1.25 * (np.cos(theta) - math.cos(0.5))
    np.testing.assert_allclose(found, np.column_stack([x, y, theta]), atol=1e-9)
    # Whole counts: never more than one short per wheel.
    coarse = respond_twist({**entry, "resolution": 0.01}, blocks_in)
    assert 0 < np.abs(coarse[:, 2] - theta).max() <= 0.01 / 0.3 + 1e-9
    # A robot whose right wheel counts 2 % more seems to turn by that.
    scaled = respond_twist({**entry, "scale": [1.0, 1.02]}, {"motion": motion * [1, 0]})
    np.testing.assert_allclose(scaled[-1, 2] - 0.5, 0.02 * 0.5 * t[-1] / 0.3, rtol=1e-9)


def respond_twist(entry: dict[str, Any], inputs: dict[str, Any]) -> Any:
    """The pose of an odometry whose motion is a Twist."""
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 5.0, "engine": "python"},
            "blocks": {
                "it": entry,
                "m": {
                    "type": "Constant",
                    "value": inputs["motion"][0].tolist(),
                    "signal": "Twist",
                },
            },
            "wires": {"it": {"motion": "m.value"}},
            "probes": {"y": "it.pose"},
        }
    )
    return np.asarray(graph.run()["y"])


def test_noise_of_odometry_grows_with_the_way() -> None:
    entry = {"type": "WheelOdometry", "noise": 0.1, "wheel_base": 1e6}
    ends = []
    for seed in range(60):
        graph = runtime.load(
            {
                "run": {"dt": 0.05, "until": 2.05, "seed": seed, "engine": "python"},
                "blocks": {
                    "it": entry,
                    "m": {"type": "Constant", "value": [2.0, 0.0], "signal": "Twist"},
                },
                "wires": {"it": {"motion": "m.value"}},
                "probes": {"y": "it.pose.x"},
            }
        )
        ends.append(graph.run()["y"][-1])
    # 4 m; the mean of two wheels has half the variance of one: 0.1^2 * 4 / 2.
    assert np.mean(ends) == pytest.approx(4.0, abs=4 * math.sqrt(0.02 / 60))
    assert np.var(ends) == pytest.approx(0.02, rel=0.5)


def lost(ticks: int = 20000, **entry: Any) -> Any:
    """Which measurements of a Dropout are lost."""
    y = np.arange(float(ticks))
    stamp = respond({"type": "Dropout", **entry}, {"input": y}, of="stamp")
    return np.diff(stamp, prepend=-1.0) == 0.0


def test_losses_are_as_many_and_as_long_as_asked_for() -> None:
    alone = lost(probability=0.3)
    assert alone.mean() == pytest.approx(0.3, abs=0.02)
    bursts = lost(probability=0.3, burst=5.0)
    assert bursts.mean() == pytest.approx(0.3, abs=0.04)
    begins = np.sum(bursts[1:] & ~bursts[:-1])
    assert bursts.sum() / begins == pytest.approx(5.0, rel=0.15)
    assert alone.sum() / np.sum(alone[1:] & ~alone[:-1]) == pytest.approx(1 / 0.7, rel=0.1)


def test_what_is_lost_or_not_valid_leaves_the_last_one() -> None:
    y, valid = np.arange(10.0), np.array([0, 0, 1, 1, 0, 0, 1, 0, 1, 1.0])
    inputs = {"input": y, "valid": valid}
    out = respond({"type": "Dropout"}, inputs, of="out", dt=0.5)
    np.testing.assert_array_equal(out, [0, 0, 2, 3, 3, 3, 6, 6, 8, 9])
    stamp = respond({"type": "Dropout"}, inputs, of="stamp", dt=0.5)
    np.testing.assert_allclose(stamp, [-1, -1, 1, 1.5, 1.5, 1.5, 3, 3, 4, 4.5])


def test_a_stamped_signal_is_lost_as_a_whole() -> None:
    stamps = np.repeat(np.arange(500.0), 4)
    inputs = {"input": stamps, "stamped": stamps}
    out = respond({"type": "Dropout", "probability": 0.5}, inputs, of="stamp")
    assert set(np.flatnonzero(np.diff(out)) % 4) == {3}  # at the tick of a new one alone
    assert len(set(out)) == pytest.approx(250, abs=50)


@example(0.078125, 0.296875, False, 1)  # a short queue forgot the one that arrived last
@given(
    st.floats(0, 0.3),
    st.floats(0, 0.3),
    st.booleans(),
    st.sampled_from([1, 3]),
)
def test_a_measurement_arrives_within_its_time(
    latency: float, jitter: float, ordered: bool, hold: int
) -> None:
    ticks, dt = 120, 0.05
    stamps = dt * (np.arange(ticks) // hold * hold)
    entry = {"type": "Latency", "latency": latency, "jitter": jitter, "ordered": ordered}
    inputs = {"input": 100 * stamps, "stamped": stamps}
    out, found = (respond(entry, inputs, of=of, dt=dt) for of in ("out", "stamp"))
    some = found >= 0
    np.testing.assert_allclose(out[some], 100 * found[some], atol=1e-9)
    assert not out[~some].any()
    if ordered:
        assert (np.diff(found) >= 0).all()
    came = np.flatnonzero(np.diff(found, prepend=-1.0) != 0)
    ages = dt * came - found[came]
    # Up to the next tick, and where each tick has one, until the one after it hides it.
    least = max(latency, dt)
    assert (ages >= least - 1e-9).all() and (ages <= max(latency + jitter, dt) + dt + 1e-9).all()


def test_a_fixed_latency_is_a_delay() -> None:
    y = np.random.default_rng(1).standard_normal((60, 2))
    found = respond({"type": "Latency", "latency": 0.03}, {"input": y})
    expected = respond({"type": "Delay", "delay": 0.03}, {"input": y})
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_bursts_that_cannot_be_are_refused() -> None:
    with pytest.raises(blocks.ParameterError, match="expected at least 9 for a share of 0.9"):
        blocks.Dropout(probability=0.9, burst=2.0)
