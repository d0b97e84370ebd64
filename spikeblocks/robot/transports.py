"""Transports: how values of topics leave and arrive; one small interface, and UDP, serial, zenoh.

An adapter of your own is a class with ``open``, ``send``, ``receive`` and ``close``::

    transport: {type: my_adapter.py:MyAdapter, device: /dev/spidev0.0}

or one of an installed package, ``type: my_package.adapters:MyAdapter``.
"""

from __future__ import annotations

import importlib
import os
import runpy
import socket
import struct
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from blocks.core import FloatArray
from runtime.errors import MissingExtraError, UsageError
from runtime.files import is_number
from spikeblocks.robot import frames
from spikeblocks.robot.messages import UnfitMessageError, factory
from spikeblocks.robot.ports import Ports, Topic
from spikeblocks.robot.safety import Arrival

MOST_AT_ONCE = 1000  # messages in one call, so that a flood does not stop the loop


class Received(NamedTuple):
    """A message: its port, how it came and its values; or why it is none of a topic's."""

    port: str
    arrival: Arrival
    values: FloatArray | None
    problem: str = ""


def bad(problem: object) -> Received:
    """A message that holds no value."""
    return Received("", Arrival(0, 0, 0), None, str(problem))


class Adapter(ABC):
    """Sends and receives values of topics.

    Parameters
    ----------
    options : the section ``transport`` of robot.yaml. ports : the topics; ``incoming`` are those
    that arrive.
    """

    def __init__(self, options: Mapping[str, Any], ports: Ports) -> None:
        self.options = options
        dead_man = [] if ports.dead_man is None else [ports.dead_man]
        self.incoming: Sequence[Topic] = [*ports.inputs.values(), *dead_man]
        self.sender = int.from_bytes(os.urandom(4), "little")
        self._sent: Counter[str] = Counter()

    def next(self, topic: Topic) -> Arrival:
        """What identifies the next message of a topic."""
        self._sent[topic.name] += 1
        return Arrival(time.monotonic_ns(), self.sender, self._sent[topic.name])

    def option(self, name: str, default: Any = None) -> Any:
        """An option of the transport.

        Raises
        ------
        UsageError : it is missing, and there is no default.
        """
        value = self.options.get(name, default)
        if value is None:
            raise UsageError(f"transport: '{name}' is missing, for {self.options.get('type')}")
        return value

    @abstractmethod
    def open(self) -> None:
        """Begin; raises OSError or UsageError if that is not possible."""

    @abstractmethod
    def send(self, topic: Topic, values: FloatArray) -> None:
        """Send a value; an OSError is counted, and the loop goes on."""

    @abstractmethod
    def receive(self) -> list[Received]:
        """What has come since the last call; never waits."""

    @abstractmethod
    def close(self) -> None:
        """End."""


def address(text: Any, name: str) -> tuple[str, int]:
    """A host and a port: ``192.168.1.7:7400``."""
    host, _, port = str(text).rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise UsageError(f"transport.{name}: expected HOST:PORT, got '{text}'")
    return host.strip("[]"), int(port)


class UDP(Adapter):
    """Frames as datagrams: ``listen`` is the own address, ``peer`` that of the other side.

    Datagrams from other hosts than the peer's are not read.
    """

    def open(self) -> None:
        own = address(self.option("listen"), "listen")
        self._topics = {frames.topic_number(t.name): t for t in self.incoming}
        family = socket.AF_INET6 if ":" in own[0] else socket.AF_INET
        peer = address(self.option("peer"), "peer")
        self._peer = socket.getaddrinfo(*peer, family, socket.SOCK_DGRAM)[0][4]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.bind(own)
        self._socket.setblocking(False)

    def send(self, topic: Topic, values: FloatArray) -> None:
        self._socket.sendto(frames.pack(topic.name, values, self.next(topic)), self._peer)

    def receive(self) -> list[Received]:
        found: list[Received] = []
        for _ in range(MOST_AT_ONCE):
            try:
                data, origin = self._socket.recvfrom(frames.MOST)
            except BlockingIOError:
                break
            except ConnectionError:  # a datagram that we sent was refused: there is no peer yet
                continue
            if origin[0] == self._peer[0]:
                found.append(read_frame(data, self._topics))
        return found

    def close(self) -> None:
        self._socket.close()


def read_frame(data: bytes, topics: dict[int, Topic]) -> Received:
    try:
        topic, arrival, values = frames.unpack(data, topics)
    except UnfitMessageError as error:
        return bad(error)
    return Received(topic.port, arrival, values)


class Serial(Adapter):
    """Frames on a serial line: ``device`` and ``baud`` (115200)."""

    def open(self) -> None:
        try:
            import serial
        except ImportError:
            raise MissingExtraError("serial lines", "robot") from None
        baud = self.option("baud", 115200)
        if not is_number(baud):
            raise UsageError(f"transport.baud: expected a number, got {baud!r}")
        self._topics = {frames.topic_number(t.name): t for t in self.incoming}
        self._line = serial.Serial(self.option("device"), int(baud), timeout=0, write_timeout=0.05)
        self._rest = b""

    def send(self, topic: Topic, values: FloatArray) -> None:
        self._line.write(frames.stuff(frames.pack(topic.name, values, self.next(topic))))

    def receive(self) -> list[Received]:
        self._rest += self._line.read(MOST_AT_ONCE * 1024)
        *whole, self._rest = self._rest.split(b"\0")
        self._rest = self._rest[-frames.MOST :]  # without a zero byte it is noise
        found = []
        for each in filter(None, whole):
            try:
                found.append(read_frame(frames.unstuff(each), self._topics))
            except UnfitMessageError as error:
                found.append(bad(error))
        return found

    def close(self) -> None:
        self._line.close()


class Zenoh(Adapter):
    """Messages of ROS 2 as rmw_zenoh sends them: CDR, with its keys and attachments.

    ``peer`` is a locator to connect to, as in tcp/127.0.0.1:7447 of a router, ``listen`` one to
    listen on; ``domain`` is the number of the ROS domain (0).
    """

    # name, int64, name, int64, name, 16 bytes; names and bytes with their length before them.
    ATTACHMENT = struct.Struct("<B15sqB16sqB10sB16s")
    NAMES = (b"sequence_number", b"source_timestamp", b"source_gid")

    def open(self) -> None:
        try:
            import zenoh
        except ImportError:
            raise MissingExtraError("zenoh", "robot") from None
        config = zenoh.Config()
        config.insert_json5("scouting/multicast/enabled", "false")
        for option, kind in (("listen", "listen"), ("peer", "connect")):
            locator = self.options.get(option)
            endpoints = "[]" if locator is None else f'["{locator}"]'
            config.insert_json5(f"{kind}/endpoints", endpoints)
        try:
            self._session: Any = zenoh.open(config)
        except zenoh.ZError as error:
            raise UsageError(f"transport: zenoh does not start: {error}") from None
        # Threads of zenoh append, this loop takes: a deque needs no lock for that.
        self._queue: deque[Received] = deque(maxlen=MOST_AT_ONCE)
        self._subscribed = [
            self._session.declare_subscriber(self.key(t, "*"), partial(self._take, t))
            for t in self.incoming
        ]
        self._publishers: dict[str, Any] = {}

    def key(self, topic: Topic, digest: str = "") -> str:
        """The key of a topic, as rmw_zenoh makes it from name, type and the type's hash."""
        kind = topic.codec.kind
        package, _, name = kind.split("/")
        digest = digest or factory().store.hash_rihs01(kind)
        parts = (self.option("domain", 0), topic.name.strip("/"))
        return f"{parts[0]}/{parts[1]}/{package}::msg::dds_::{name}_/{digest}"

    def _take(self, topic: Topic, sample: Any) -> None:
        """Runs in a thread of zenoh."""
        try:
            arrival = self._arrival(bytes(sample.attachment or b""))
            values = topic.codec.decode(bytes(sample.payload))
        except UnfitMessageError as error:
            self._queue.append(bad(f"{topic.name}: {error}"))
            return
        if values is not None:
            self._queue.append(Received(topic.port, arrival, values))

    def _arrival(self, attachment: bytes) -> Arrival:
        if len(attachment) != self.ATTACHMENT.size:
            raise UnfitMessageError(f"an attachment of {len(attachment)} bytes")
        found = self.ATTACHMENT.unpack(attachment)
        if found[1:8:3] != self.NAMES:
            raise UnfitMessageError("an attachment that is not of rmw_zenoh")
        return Arrival(found[5], int.from_bytes(found[9], "little"), found[2])

    def send(self, topic: Topic, values: FloatArray) -> None:
        arrival = self.next(topic)
        if topic.name not in self._publishers:
            self._publishers[topic.name] = self._session.declare_publisher(self.key(topic))
        sender = self.sender.to_bytes(16, "little")
        stamp = time.time_ns()
        attachment = self.ATTACHMENT.pack(
            *(15, self.NAMES[0], arrival.sequence, 16, self.NAMES[1], stamp),
            *(10, self.NAMES[2], 16, sender),
        )
        payload = topic.codec.encode(values, stamp)
        self._publishers[topic.name].put(payload, attachment=attachment)

    def receive(self) -> list[Received]:
        return [self._queue.popleft() for _ in range(len(self._queue))]

    def close(self) -> None:
        self._session.close()


ADAPTERS: dict[str, type[Adapter]] = {"udp": UDP, "serial": Serial, "zenoh": Zenoh}


def adapter_of(ports: Ports, modules: bool = True) -> Adapter:
    """The adapter that a robot.yaml names.

    Raises
    ------
    UsageError : there is none of that name, or ``modules`` forbids to run its file.
    """
    kind = str(ports.transport.get("type", "udp"))
    place, _, name = kind.rpartition(":")
    if not place:
        if kind not in ADAPTERS:
            known = ", ".join(ADAPTERS)
            raise UsageError(f"transport.type: no adapter '{kind}'; known are {known}, FILE:CLASS")
        return ADAPTERS[kind](ports.transport, ports)
    found = _class_of(place, name, ports.path.parent, modules)
    if not (isinstance(found, type) and issubclass(found, Adapter)):
        raise UsageError(f"transport.type: '{place}' has no subclass of Adapter named '{name}'")
    made: Adapter = found(ports.transport, ports)
    return made


def _class_of(place: str, name: str, folder: Path, modules: bool) -> object:
    """What a Python file, or an installed module, has under a name."""
    if not place.endswith(".py"):
        try:
            return getattr(importlib.import_module(place), name, None)
        except ImportError as error:
            raise UsageError(f"transport.type: cannot import '{place}': {error}") from None
    path = folder / place
    if not modules:
        raise UsageError(f"'{path}' is executed, as Python would, which is refused (--no-modules)")
    if not path.is_file():
        raise UsageError(f"transport.type: there is no file '{path}'")
    return runpy.run_path(str(path)).get(name)
