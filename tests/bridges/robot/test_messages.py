"""Messages: what is written is read back, and other drivers' messages are read as they mean it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blocks import Path, Pose, Scalar, Scan, Twist, Vector, WheelSpeeds
from runtime.errors import UsageError

pytest.importorskip("rosbags")
from spikeblocks.robot.messages import (
    FORMS,
    SCAN_START,
    Codec,
    Frames,
    UnfitMessageError,
    factory,
)

FINITE = st.floats(-1e6, 1e6)
ANGLE = st.floats(-math.pi, math.pi)
SCAN = "sensor_msgs/msg/LaserScan"


@given(x=FINITE, y=FINITE, theta=ANGLE, kind=st.sampled_from(sorted(FORMS)))
def test_poses_come_back_from_every_message_that_holds_them(
    x: float, y: float, theta: float, kind: str
) -> None:
    if "Pose" not in FORMS[kind].holds or FORMS[kind].write is None:
        return
    codec = Codec.of(Pose, kind)
    back = codec.decode(codec.encode((x, y, theta), 5))
    assert back is not None
    assert back[:2].tolist() == [x, y]
    # As directions, since pi and -pi are one; half of the angle is stored, to rounding.
    assert np.allclose(np.exp(1j * back[2]), np.exp(1j * theta), atol=1e-14)


@given(st.lists(st.floats(0.01, 30.0) | st.just(math.inf), min_size=2, max_size=50))
def test_scans_come_back_with_their_misses_to_single_precision(ranges: list[float]) -> None:
    codec = Codec.of(Scan(len(ranges)))
    back = codec.decode(codec.encode(ranges, 5))
    assert back is not None
    assert back.tolist() == np.array(ranges, np.float32).astype(float).tolist()


@given(st.lists(FINITE, min_size=1, max_size=9))
def test_numbers_of_any_type_come_back_as_an_array(values: list[float]) -> None:
    codec = Codec.of(Vector(len(values)))
    back = codec.decode(codec.encode(values, 0))
    assert codec.kind.endswith("Float64MultiArray")
    assert back is not None
    assert back.tolist() == values


def scan_of(beams: int, start: float, step: float, lidar_range: float = 10.0) -> bytes:
    """A scan of a room whose distance at bearing a is 2 + cos(a)."""
    angles = start + step * np.arange(beams)
    message = factory().make(
        "sensor_msgs/LaserScan",
        angle_min=start,
        angle_increment=step,
        range_min=0.5,
        range_max=lidar_range,
        ranges=(2.0 + np.cos(angles)).astype(np.float32),
    )
    return bytes(factory().store.serialize_cdr(message, SCAN))


@pytest.mark.parametrize(
    ("start", "step"),
    [(-math.pi, 2 * math.pi / 360), (0.0, 2 * math.pi / 360), (math.pi, -2 * math.pi / 720)],
    ids=["from -pi", "from 0, as a TurtleBot", "clockwise, twice as fine"],
)
def test_a_scan_is_read_at_its_own_bearings(start: float, step: float) -> None:
    beams = round(2 * math.pi / abs(step))
    back = Codec.of(Scan(360)).decode(scan_of(beams, start, step))
    bearings = SCAN_START + 2 * math.pi / 360 * np.arange(360)
    assert back is not None
    assert np.allclose(back, 2.0 + np.cos(bearings), atol=0.5 * abs(step) + 1e-6)
    if beams == 360:
        assert np.allclose(back, 2.0 + np.cos(bearings), atol=1e-6)


def test_rays_that_a_lidar_does_not_have_and_ranges_out_of_its_range_are_misses() -> None:
    back = Codec.of(Scan(8)).decode(scan_of(5, -math.pi / 2, math.pi / 4, lidar_range=2.8))
    assert back is not None
    # At -180, -135, -90, -45, 0, 45, 90, 135 degrees; ahead it is 3 m, beyond the range.
    assert np.isinf(back).tolist() == [True, True, False, False, True, False, False, True]


def test_a_transform_of_other_frames_is_not_ours() -> None:
    kind = "tf2_msgs/msg/TFMessage"
    data = Codec.of(Pose, kind, Frames("odom", "base_link")).encode((1, 2, 0.5), 0)
    assert Codec.of(Pose, kind, Frames("map", "odom")).decode(data) is None


def test_the_curvature_of_a_path_is_that_of_its_circle() -> None:
    angle = np.linspace(0.0, 1.0, 200)
    circle = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), angle + math.pi / 2, 0 * angle])
    codec = Codec.of(Path(200))
    back = codec.decode(codec.encode(circle, 0))
    assert back is not None
    assert np.allclose(back[:, :3], circle[:, :3], atol=1e-12)
    assert np.allclose(back[:, 3], 0.5, rtol=1e-5)


@pytest.mark.parametrize(
    ("signal", "values", "reads", "problem"),
    [
        (Twist, (math.nan, 0.0), Twist, "expected finite numbers for a Twist, got nan at \\[0\\]"),
        (Vector(3), (1, 2, 3), Vector(2), "expected 2 numbers for a Vector\\(2\\), got 3"),
    ],
)
def test_unfit_messages_are_said_to_be_so(signal, values, reads, problem: str) -> None:
    data = Codec.of(signal).encode(values, 0)
    with pytest.raises(UnfitMessageError, match=problem):
        Codec.of(reads, Codec.of(signal).kind).decode(data)


@given(data=st.binary(max_size=200), kind=st.sampled_from(sorted(FORMS)))
def test_random_bytes_are_unfit_and_never_another_error(data: bytes, kind: str) -> None:
    held = {"Scan": Scan(5), "Twist": Twist, "Pose": Pose, "Path": Path(3), "Scalar": Scalar}
    codec = Codec.of(held.get(FORMS[kind].holds[0], Vector(2)), kind)
    try:
        values = codec.decode(data)
    except UnfitMessageError:
        return
    assert values is None or values.shape == codec.signal.shape


def test_what_no_message_holds_is_refused_with_those_that_do() -> None:
    with pytest.raises(UsageError, match="holds no WheelSpeeds; such signals are in std_msgs"):
        Codec.of(WheelSpeeds, "geometry_msgs/msg/Twist")
    with pytest.raises(UsageError, match="no messages of type 'a/msg/B'; known are sensor_msgs"):
        Codec.of(Twist, "a/B")
