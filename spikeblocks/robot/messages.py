"""A signal to and from a message of ROS, as numbers of the signal type's shape.

In: a signal type and a type of messages. Out: what converts one into the other::

    codec = Codec.of(Scan(360), "sensor_msgs/msg/LaserScan")
    data = codec.encode(ranges, stamp=1_700_000_000_000_000_000)    # CDR, as ROS 2 sends it
    codec.decode(data)                                              # (360,), inf where a ray missed

Messages are made and read by rosbags, which needs no installation of ROS. Angles are in rad, x is
forward and y left, in ROS as here. A message holds the full pose of a body; of it, x, y and the
rotation around z are read, and the rest is written as zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from blocks.core import FloatArray, SignalType
from runtime.errors import MissingExtraError, UsageError

FULL_TURN = 2.0 * math.pi
SECOND = 1_000_000_000  # in ns
SCAN_START = -math.pi  # the bearing of a Scan's first beam, as of the block Lidar


class UnfitMessageError(ValueError):
    """A message does not hold a value of the signal's type; the text says why."""


@dataclass(frozen=True)
class Frames:
    """The names of coordinate frames: what poses are given in, and what they are the pose of."""

    parent: str = "odom"
    child: str = "base_link"


@dataclass(frozen=True)
class Form:
    """How one type of messages holds values of some signal types.

    write : a message of (factory, values, stamp in ns, frames). read : values of (message, type,
    frames); None if the message is of something else. holds : names of signal types, or "any".
    """

    holds: tuple[str, ...]
    write: Callable[[Factory, FloatArray, int, Frames], Any] | None
    read: Callable[[Any, SignalType, Frames], Any]


class Factory:
    """Makes messages of ROS 2 (Humble) by the last parts of their types' names."""

    def __init__(self) -> None:
        try:
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise MissingExtraError("messages of ROS", "ros") from None
        self.store = get_typestore(Stores.ROS2_HUMBLE)

    def make(self, kind: str, **fields: Any) -> Any:
        """A message; fields that are not given are zero, empty or messages of such."""
        package, name = kind.split("/")
        made = self.store.types[f"{package}/msg/{name}"]
        for field, description in self.store.fielddefs[f"{package}/msg/{name}"][1]:
            fields.setdefault(field, self._empty(description))
        return made(**fields)

    def _empty(self, description: Any) -> Any:
        """The empty value of a field, which rosbags describes as (kind, details)."""
        kind, details = description[0].name, description[1]
        if kind == "NAME":
            package, _, name = details.split("/")
            return self.make(f"{package}/{name}")
        if kind == "BASE":
            return {"string": "", "bool": False}.get(details[0], 0)
        inner, length = details  # of an array or a sequence
        if inner[0].name == "BASE" and inner[1][0] != "string":
            return np.zeros(length if kind == "ARRAY" else 0, dtype=inner[1][0])
        return []

    def header(self, stamp: int, frame: str) -> Any:
        seconds, rest = divmod(stamp, SECOND)
        time = self.make("builtin_interfaces/Time", sec=seconds, nanosec=rest)
        return self.make("std_msgs/Header", stamp=time, frame_id=frame)

    def pose(self, values: FloatArray) -> Any:
        x, y, theta = map(float, values[:3])
        turn = self.make(
            "geometry_msgs/Quaternion", z=math.sin(0.5 * theta), w=math.cos(0.5 * theta)
        )
        place = self.make("geometry_msgs/Point", x=x, y=y)
        return self.make("geometry_msgs/Pose", position=place, orientation=turn)

    def twist(self, values: FloatArray) -> Any:
        linear = self.make("geometry_msgs/Vector3", x=float(values[0]))
        angular = self.make("geometry_msgs/Vector3", z=float(values[1]))
        return self.make("geometry_msgs/Twist", linear=linear, angular=angular)


@cache
def factory() -> Factory:
    """The factory of all messages; loading their definitions takes 0.2 s."""
    return Factory()


def _write_scan(f: Factory, values: FloatArray, stamp: int, frames: Frames) -> Any:
    step = FULL_TURN / len(values)
    return f.make(
        "sensor_msgs/LaserScan",
        header=f.header(stamp, frames.child),
        angle_min=SCAN_START,
        angle_max=SCAN_START + FULL_TURN - step,
        angle_increment=step,
        range_max=math.inf,
        ranges=values.astype(np.float32),
    )


def _read_scan(message: Any, signal: SignalType, frames: Frames) -> FloatArray:
    """The ranges at a Scan's bearings, each of the nearest ray; inf where there is none."""
    ranges = np.asarray(message.ranges, dtype=np.float64)
    step = float(message.angle_increment)
    if not len(ranges) or not math.isfinite(step) or step == 0.0:
        raise UnfitMessageError(f"a scan of {len(ranges)} ranges with an increment of {step:g} rad")
    beams = signal.length if isinstance(signal.length, int) else len(ranges)
    angles = SCAN_START + FULL_TURN / beams * np.arange(beams)
    # Whole turns are taken off, since one lidar counts from -pi and another one from 0.
    turns = (angles - float(message.angle_min)) * math.copysign(1.0, step)
    ray = np.round(np.mod(turns + 0.5 * abs(step), FULL_TURN) / abs(step) - 0.5).astype(int)
    is_seen = ray < len(ranges)
    found = np.where(is_seen, ranges[np.minimum(ray, len(ranges) - 1)], np.inf)
    with np.errstate(invalid="ignore"):
        is_hit = (found >= message.range_min) & (found <= message.range_max)
    return np.where(is_hit, found, np.inf)  # NaN and 0 are misses of some drivers


def _yaw(turn: Any) -> float:
    """The rotation around z of a quaternion."""
    norm = turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2
    if not math.isfinite(norm) or abs(norm - 1.0) > 0.1:
        raise UnfitMessageError(f"a quaternion with a squared norm of {norm:g}, not 1")
    return math.atan2(
        2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2)
    )


def _read_pose(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y, _yaw(pose.orientation)]


def _read_twist(twist: Any) -> list[float]:
    return [twist.linear.x, twist.angular.z]


def _write_odometry(f: Factory, values: FloatArray, stamp: int, frames: Frames) -> Any:
    return f.make(
        "nav_msgs/Odometry",
        header=f.header(stamp, frames.parent),
        child_frame_id=frames.child,
        pose=f.make("geometry_msgs/PoseWithCovariance", pose=f.pose(values)),
    )


def _read_odometry(message: Any, signal: SignalType, frames: Frames) -> list[float]:
    if signal.name == "Twist":
        return _read_twist(message.twist.twist)
    return _read_pose(message.pose.pose)


def _write_transform(f: Factory, values: FloatArray, stamp: int, frames: Frames) -> Any:
    pose = f.pose(values)
    place = f.make("geometry_msgs/Vector3", x=pose.position.x, y=pose.position.y)
    moved = f.make("geometry_msgs/Transform", translation=place, rotation=pose.orientation)
    stamped = f.make(
        "geometry_msgs/TransformStamped",
        header=f.header(stamp, frames.parent),
        child_frame_id=frames.child,
        transform=moved,
    )
    return f.make("tf2_msgs/TFMessage", transforms=[stamped])


def _read_transform(message: Any, signal: SignalType, frames: Frames) -> list[float] | None:
    for each in message.transforms:
        names = (each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/"))
        if names == (frames.parent, frames.child):
            moved = each.transform
            return [moved.translation.x, moved.translation.y, _yaw(moved.rotation)]
    return None  # of other frames


def _write_path(f: Factory, values: FloatArray, stamp: int, frames: Frames) -> Any:
    header = f.header(stamp, frames.parent)
    poses = [f.make("geometry_msgs/PoseStamped", header=header, pose=f.pose(row)) for row in values]
    return f.make("nav_msgs/Path", header=header, poses=poses)


def _read_path(message: Any, signal: SignalType, frames: Frames) -> FloatArray:
    """Points with their curvature, which a message does not hold: by differences of the angle."""
    poses = np.array([_read_pose(each.pose) for each in message.poses]).reshape(-1, 3)
    if len(poses) < 2:
        raise UnfitMessageError(f"a path of {len(poses)} poses")
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    bend = np.zeros(len(poses))
    if (steps > 0.0).all():
        bend = np.gradient(np.unwrap(poses[:, 2]), along)
    return np.column_stack([poses, bend])


def _write_numbers(f: Factory, values: FloatArray, stamp: int, frames: Frames) -> Any:
    return f.make("std_msgs/Float64MultiArray", data=np.ravel(values).astype(np.float64))


ANY = ("any",)
FORMS: dict[str, Form] = {
    "sensor_msgs/msg/LaserScan": Form(("Scan",), _write_scan, _read_scan),
    "geometry_msgs/msg/Twist": Form(
        ("Twist",), lambda f, v, stamp, frames: f.twist(v), lambda m, s, frames: _read_twist(m)
    ),
    "geometry_msgs/msg/TwistStamped": Form(
        ("Twist",),
        lambda f, v, stamp, frames: f.make(
            "geometry_msgs/TwistStamped", header=f.header(stamp, frames.child), twist=f.twist(v)
        ),
        lambda m, s, frames: _read_twist(m.twist),
    ),
    "nav_msgs/msg/Odometry": Form(("Pose", "Twist"), _write_odometry, _read_odometry),
    "geometry_msgs/msg/PoseStamped": Form(
        ("Pose",),
        lambda f, v, stamp, frames: f.make(
            "geometry_msgs/PoseStamped", header=f.header(stamp, frames.parent), pose=f.pose(v)
        ),
        lambda m, s, frames: _read_pose(m.pose),
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": Form(
        ("Pose",), None, lambda m, s, frames: _read_pose(m.pose.pose)
    ),
    "nav_msgs/msg/Path": Form(("Path",), _write_path, _read_path),
    "tf2_msgs/msg/TFMessage": Form(("Pose",), _write_transform, _read_transform),
    "std_msgs/msg/Float64": Form(
        ("Scalar",),
        lambda f, v, stamp, frames: f.make("std_msgs/Float64", data=float(v)),
        lambda m, s, frames: m.data,
    ),
    "std_msgs/msg/Bool": Form(
        ("Scalar",),
        lambda f, v, stamp, frames: f.make("std_msgs/Bool", data=bool(v)),
        lambda m, s, frames: float(m.data),
    ),
    "std_msgs/msg/Float64MultiArray": Form(ANY, _write_numbers, lambda m, s, frames: m.data),
}
# What a signal is written as unless a mapping says otherwise; others as Float64MultiArray.
DEFAULTS = {
    "Scan": "sensor_msgs/msg/LaserScan",
    "Twist": "geometry_msgs/msg/Twist",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "Path": "nav_msgs/msg/Path",
    "Scalar": "std_msgs/msg/Float64",
}
NUMBERS = "std_msgs/msg/Float64MultiArray"


@dataclass(frozen=True)
class Codec:
    """Converts values of one signal type to and from messages of one type."""

    signal: SignalType
    kind: str
    frames: Frames
    form: Form

    @staticmethod
    def of(signal: SignalType, kind: str = "", frames: Frames | None = None) -> Codec:
        """The codec of a signal type, with the default type of messages if none is named.

        Raises
        ------
        UsageError : messages of that type are not known, or do not hold such signals.
        """
        kind = kind or DEFAULTS.get(signal.name, NUMBERS)
        if kind.count("/") == 1:
            kind = kind.replace("/", "/msg/")
        form = FORMS.get(kind)
        if form is None:
            raise UsageError(f"no messages of type '{kind}'; known are {', '.join(FORMS)}")
        if form.holds != ANY and signal.name not in form.holds:
            fitting = [name for name, f in FORMS.items() if {signal.name, *ANY} & {*f.holds}]
            message = f"a message of type '{kind}' holds no {signal}"
            raise UsageError(f"{message}; such signals are in {', '.join(fitting)}")
        return Codec(signal, kind, frames or Frames(), form)

    def encode(self, values: Any, stamp: int) -> bytes:
        """A message in CDR with a stamp in ns.

        Raises
        ------
        UsageError : messages of this type are only read.
        """
        if self.form.write is None:
            raise UsageError(f"messages of type '{self.kind}' are read, not written")
        array = np.asarray(values, dtype=np.float64)
        message = self.form.write(factory(), array, stamp, self.frames)
        return bytes(factory().store.serialize_cdr(message, self.kind))

    def decode(self, data: bytes) -> FloatArray | None:
        """The values of a message in CDR; None if it is of something else.

        Raises
        ------
        UnfitMessageError : it is no such message, or holds no value of the signal's type.
        """
        try:
            message = factory().store.deserialize_cdr(data, self.kind)
        except Exception as error:  # noqa: BLE001 -- rosbags raises what its generated code does
            reason = f"{type(error).__name__}: {error}"
            raise UnfitMessageError(f"not a message of {self.kind} ({reason})") from None
        return self.read(message)

    def read(self, message: Any) -> FloatArray | None:
        """As :meth:`decode`, of a message that rosbags has read."""
        try:
            found = self.form.read(message, self.signal, self.frames)
        except (AttributeError, TypeError, OverflowError) as error:
            raise UnfitMessageError(f"not a message of {self.kind}: {error}") from None
        return None if found is None else check(np.asarray(found, np.float64), self.signal)


def check(values: FloatArray, signal: SignalType) -> FloatArray:
    """Numbers that a message holds, in the shape of a signal type; any length if that is open.

    Raises
    ------
    UnfitMessageError : there are too many or too few, or one is not finite.
    """
    if signal.symbol:
        width = len(signal.components) or 1
        signal = signal.sized(values.size // width)
    if values.size != math.prod(signal.shape):
        raise UnfitMessageError(f"expected {signal.numbers} for a {signal}, got {values.size}")
    shaped = values.reshape(signal.shape)
    if problem := signal.wrong(shaped):
        raise UnfitMessageError(problem)
    return shaped
