"""Bag files: signals written as MCAP, topics read from bags of ROS 1 and ROS 2.

In: values with their stamps in ns. Out: a file that Foxglove and ``ros2 bag`` open, and back::

    with BagWriter(Path("run.mcap")) as bag:
        bag.write("/scan", codec, ranges, stamp)
    with BagReader(Path("run.mcap")) as bag:
        topic = bag.read("/scan", Scan(360))      # topic.stamps (n,), topic.values (n, 360)

The same signals give the same bytes.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from blocks.core import FloatArray, SignalType, hint
from blocks.limits import RECORDED_NUMBERS
from runtime.errors import MissingExtraError, UsageError
from runtime.files import open_file, system_errors
from spikeblocks.robot.messages import Codec, Frames, UnfitMessageError, factory

QOS = (
    "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2\n"
    + "".join(
        f"  {each}:\n    sec: 9223372036\n    nsec: 854775807\n"
        for each in ("deadline", "lifespan")
    )
    + "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false"
)
SUFFIXES = (".bag", ".mcap", ".db3")


class BagWriter:
    """Writes messages to one MCAP file; it is complete when the writer is closed.

    Raises
    ------
    UsageError : the file cannot be written. MissingExtraError : mcap or rosbags is not installed.
    """

    def __init__(self, path: Path) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise MissingExtraError("writing bags", "ros") from None
        factory()
        self.path = path
        with system_errors(f"write '{path}'"):
            file = open_file(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        self._file = os.fdopen(file, "wb")
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2", library="spikeblocks")
        self._channels: dict[str, tuple[int, str]] = {}
        self.counts: dict[str, int] = {}

    def write(self, topic: str, codec: Codec, values: Any, stamp: int) -> None:
        """Append a value as a message; ``stamp`` in ns is the time of the log, too."""
        channel, kind = self._channels.get(topic) or self._add(topic, codec.kind)
        if kind != codec.kind:
            raise UsageError(f"topic '{topic}': messages of '{kind}' and of '{codec.kind}'")
        self.counts[topic] += 1
        self._writer.add_message(
            channel_id=channel,
            log_time=stamp,
            publish_time=stamp,
            sequence=self.counts[topic],
            data=codec.encode(values, stamp),
        )

    def _add(self, topic: str, kind: str) -> tuple[int, str]:
        text, _ = factory().store.generate_msgdef(kind, ros_version=2)
        schema = self._writer.register_schema(kind, "ros2msg", text.encode())
        metadata = {"offered_qos_profiles": QOS}
        channel = self._writer.register_channel(topic, "cdr", schema, metadata)
        self._channels[topic], self.counts[topic] = (channel, kind), 0
        return channel, kind

    def close(self) -> None:
        self._writer.finish()
        self._file.close()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True)
class Recorded:
    """What a bag has of one topic: stamps in ns (n,), values (n, ...) of a signal type.

    ``begin`` is the stamp of the bag's first message of any topic.
    ``bad`` counts messages that hold no such value; ``first_bad`` says what is wrong with the
    first of them, and where. ``repeated`` counts messages whose stamp is not after the one before.
    """

    codec: Codec
    stamps: npt.NDArray[np.int64]
    values: FloatArray
    begin: int
    bad: int = 0
    first_bad: str = ""
    repeated: int = 0

    @property
    def notes(self) -> list[str]:
        """What was left out, a line each."""
        notes = (
            [f"{self.bad} bad messages left out; the first: {self.first_bad}"] if self.bad else []
        )
        if self.repeated:
            notes.append(f"{self.repeated} messages left out that are not after the one before")
        return notes


@dataclass
class Collected:
    """The messages of a topic that were read so far, as the fields of :class:`Recorded`."""

    codec: Codec
    topic: str
    stamps: list[int] = field(default_factory=list)
    rows: list[FloatArray] = field(default_factory=list)
    count: int = 0
    bad: int = 0
    first_bad: str = ""
    repeated: int = 0

    @property
    def numbers(self) -> int:
        return len(self.rows) * self.rows[0].size if self.rows else 0

    def add(self, stamp: int, message: Any, by_header: bool) -> None:
        """Take a message, or the exception of one that could not be read."""
        self.count += 1
        try:
            if isinstance(message, Exception):
                raise UnfitMessageError(str(message))
            values = self.codec.read(message)
            stamp = _header_stamp(message) if by_header else stamp
            if values is not None and self.rows and values.shape != self.rows[0].shape:
                first = f"that of the first one {self.rows[0].shape}"
                raise UnfitMessageError(f"its shape is {values.shape}, {first}")
        except UnfitMessageError as error:
            self.bad += 1
            self.first_bad = self.first_bad or f"message {self.count} of {self.topic}: {error}"
            return
        if values is None:  # of another frame
            return
        if self.stamps and stamp <= self.stamps[-1]:
            self.repeated += 1
            return
        self.stamps.append(stamp)
        self.rows.append(values)

    def recorded(self, begin: int) -> Recorded:
        codec = self.codec
        if codec.signal.symbol:
            codec = replace(codec, signal=codec.signal.sized(len(self.rows[0])))
        stamps, values = np.array(self.stamps), np.array(self.rows)
        return Recorded(codec, stamps, values, begin, self.bad, self.first_bad, self.repeated)


class BagReader:
    """A bag: a .bag file of ROS 1, a .mcap or .db3 file, or a folder of ROS 2.

    Raises
    ------
    UsageError : there is no such bag, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.highlevel import AnyReader
        except ImportError:
            raise MissingExtraError("reading bags", "ros") from None
        self.path = path
        if path.suffix not in SUFFIXES and not path.is_dir():
            expected = f"expected {', '.join(SUFFIXES)} or a folder of ROS 2"
            raise UsageError(f"'{path}' is no bag; {expected}")
        self._stack = ExitStack()
        # Files of ROS 2 before Iron have no definitions of their messages.
        with _bag_errors(path):
            self._bag = AnyReader([path], default_typestore=factory().store)
            self._stack.enter_context(self._bag)

    @property
    def topics(self) -> dict[str, str]:
        """The type of messages of each topic."""
        return {each.topic: each.msgtype for each in self._bag.connections}

    @property
    def start(self) -> int:
        """The stamp of the first message of any topic."""
        return int(self._bag.start_time)

    def read(
        self,
        topic: str,
        signal: SignalType | None = None,
        frames: Frames | None = None,
        by_header: bool = False,
    ) -> Recorded:
        """All messages of a topic as values of a signal type, by default the usual one.

        Parameters
        ----------
        by_header : stamps are those of the messages' headers, which sensors set, and not the times
            at which they were written to the bag.

        Raises
        ------
        UsageError : there is no such topic, it holds no such signals, or no message is usable.
        """
        if topic not in self.topics:
            suggestion = hint(topic, self.topics) or f"; it has {', '.join(sorted(self.topics))}"
            raise UsageError(f"'{self.path}' has no topic '{topic}'{suggestion}")
        kind = self.topics[topic]
        codec = Codec.of(signal or usual_signal(kind), kind, frames)
        found = Collected(codec, topic)
        with _bag_errors(self.path):
            for stamp, message in self._messages(topic):
                found.add(stamp, message, by_header)
                if found.numbers > RECORDED_NUMBERS:
                    limit = f"more than {RECORDED_NUMBERS:,} numbers"
                    raise UsageError(f"topic '{topic}' of '{self.path}' has {limit}; cut the bag")
        if not found.rows:
            reason = f"; the first is bad: {found.first_bad}" if found.bad else ""
            raise UsageError(f"'{self.path}' has no usable message of topic '{topic}'{reason}")
        return found.recorded(self.start)

    def _messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """The stamp and the message of each; the exception of one that cannot be read."""
        from rosbags.highlevel import AnyReaderError

        connections = [each for each in self._bag.connections if each.topic == topic]
        for connection, stamp, data in self._bag.messages(connections):
            try:
                yield stamp, self._bag.deserialize(data, connection.msgtype)
            except (AnyReaderError, ValueError, ArithmeticError, LookupError) as error:
                yield stamp, error

    def close(self) -> None:
        self._stack.close()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def _bag_errors(path: Path) -> Iterator[None]:
    """What a damaged bag makes rosbags raise, as a UsageError that names the file."""
    try:
        yield
    except UsageError:
        raise
    except OSError as error:
        raise UsageError(f"cannot read '{path}': {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 -- of damaged files it raises what comes up
        raise UsageError(f"'{path}' is no bag, or damaged: {error}") from None


def _header_stamp(message: Any) -> int:
    header = getattr(message, "header", None)
    if header is None and getattr(message, "transforms", None):
        header = message.transforms[0].header
    if header is None:
        raise UnfitMessageError("it has no header with a stamp; take the stamps of the log")
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def usual_signal(kind: str) -> SignalType:
    """The signal type of messages of a type, of those that it can hold the first one."""
    from blocks.core import signal_type
    from spikeblocks.robot.messages import ANY, FORMS

    form = FORMS.get(kind)
    if form is None:
        raise UsageError(
            f"no signal is made of messages of type '{kind}'; known: {', '.join(FORMS)}"
        )
    return signal_type("Vector" if form.holds == ANY else form.holds[0])
