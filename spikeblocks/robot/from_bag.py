"""A topic of a bag as a signal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path

import numpy as np

from blocks.core import (
    BlockContext,
    FloatArray,
    ParameterError,
    SignalType,
    param,
    require,
)
from blocks.files import read
from blocks.limits import RECORDED
from blocks.sources import Table
from runtime.errors import UsageError
from spikeblocks.robot.bags import BagReader, Recorded
from spikeblocks.robot.messages import SECOND, Frames


class FromBag(Table):
    """A topic of a bag over time: of ROS 1 (.bag), of ROS 2 (.mcap, .db3, or a folder).

        [ FromBag ] ─▶ out

    Between two messages the value holds, or changes linearly; before the first one it is that one,
    after the last one the last. A Scan has ``inf`` for misses, and holds. Times begin with the
    first message of the bag, of any topic, so that topics of one bag stay together; ``start:
    topic`` begins with the first one of this topic, and a number is the time since the epoch (s)
    that becomes 0. Messages that hold no value of the type are left out. ``file`` is relative to
    the graph's own file. Needs the extra ``ros``.
    """

    path: str = param(name="file", doc="a bag: .bag, .mcap, .db3 or a folder of ROS 2")
    topic: str = param(doc="the topic, as in /scan")
    method: str = param("hold", choices=("hold", "linear"), doc="what lies between two messages")
    begin: str = param("bag", name="start", doc="what is time 0: bag, topic, or s since the epoch")
    stamps: str = param(
        "log", choices=("log", "header"), doc="when a message was written to the bag, or sent"
    )
    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default is the usual one of such messages"
    )
    frame: str = param("odom", doc="of a transform: the frame that it is given in")
    child: str = param("base_link", doc="of a transform: the frame that it is the pose of")

    @cached_property
    def recorded(self) -> Recorded:
        """The messages of the topic; the bag is read once."""
        require("rosbags", "FromBag", "ros")
        self.contents  # noqa: B018 -- reports a bag that a run could not keep
        try:
            with BagReader(Path(self.path)) as bag:
                frames = Frames(self.frame, self.child)
                return bag.read(self.topic, self.kind, frames, self.stamps == "header")
        except UsageError as error:
            place = "topic" if "topic '" in str(error) else "file"
            raise ParameterError([(place, str(error))]) from None

    @cached_property
    def origin(self) -> int:
        """The stamp (ns) that is time 0."""
        recorded = self.recorded
        if self.begin in ("bag", "topic"):
            return recorded.begin if self.begin == "bag" else int(recorded.stamps[0])
        try:
            return round(float(self.begin) * SECOND)
        except (ValueError, OverflowError):
            message = f"expected bag, topic or a time in s since the epoch, got '{self.begin}'"
            raise ParameterError([("start", message)]) from None

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        recorded = self.recorded
        # Differences of integers: a float of seconds since the epoch is exact to 0.2 us only.
        values = recorded.values
        if self.method == "linear" and recorded.codec.signal.form == "record":
            # From pi to -pi an angle goes on, and not through 0.
            is_angle = np.array(recorded.codec.signal.units) == "rad"
            values = np.where(is_angle, np.unwrap(values, axis=0), values)
        return (recorded.stamps - self.origin) / SECOND, values

    def validate(self) -> None:
        if len(self.rows[0]) < 2:
            message = f"expected at least 2 messages of topic '{self.topic}', got one"
            raise ParameterError([("topic", message)])
        if self.rows[1].ndim > 2:
            message = f"a {self.recorded.codec.signal} is a table, which no block plays back"
            raise ParameterError([("topic", message)])
        self.check_type("file")

    @property
    def files(self) -> Mapping[str, bytes]:
        return self.contents

    @cached_property
    def contents(self) -> dict[str, bytes]:
        """The files of the bag, which a run keeps."""
        root = Path(self.path).resolve()
        try:
            inside = sorted(p for p in root.iterdir() if p.is_file()) if root.is_dir() else [root]
            return {str(name): read(name, RECORDED) for name in inside}
        except OSError as error:
            message = f"cannot read '{self.path}': {error.strerror}"
            raise ParameterError([("file", message)]) from None

    def notes(self, context: BlockContext, steps: Mapping[str, tuple[float, ...]]) -> Iterable[str]:
        return self.recorded.notes

    @property
    def how(self) -> str:
        return self.method

    @property
    def stated(self) -> SignalType | None:
        return self.kind or self.recorded.codec.signal
