"""Which topic is which port: the file robot.yaml.

In: a file and the ports of a graph. Out: topics with their codecs and limits, or every problem with
its position in the file::

    transport: {type: udp, listen: "127.0.0.1:7401", peer: "127.0.0.1:7400"}
    period: 0.01
    inputs:
      scan: {topic: /scan, timeout: 0.5}
    outputs:
      command: {topic: /cmd_vel, min: [-0.2, -1.5], max: [0.3, 1.5], rate: [1, 10]}
    dead_man: {topic: /enable, timeout: 0.3}
    ros:                                            # signals of a run, for 'runtime bag'
      plant.pose: {topic: /odom, type: nav_msgs/msg/Odometry}
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray, Scalar, SignalType
from runtime.document import Node, check_keys, decode, from_python, parse_yaml, read_file
from runtime.errors import NOWHERE, Problems, UsageError
from runtime.files import is_number
from runtime.network import Network, PortDeclaration
from spikeblocks.robot.messages import Codec, Frames

COMMON = {
    "topic": "its name, as in /scan",
    "type": "the type of its messages; by default the usual one of the signal",
    "frame": "the frame that poses are given in (odom)",
    "child": "the frame that they are the pose of (base_link)",
}
OF_INPUT = {**COMMON, "timeout": "the age (s) from which a value no longer counts"}
OF_OUTPUT = {
    **COMMON,
    "min": "the smallest command, a number or one for each component",
    "max": "the largest command",
    "rate": "the largest change of a command in a second",
}
KEYS = {
    "transport": "the adapter: {type: udp, listen: HOST:PORT, peer: HOST:PORT}",
    "period": "time between two commands (s)",
    "inputs": "the topics of the graph's inputs",
    "outputs": "the topics of the graph's outputs",
    "dead_man": "a topic that must be true for commands to be sent",
    "ros": "the topics of a run's signals, for 'runtime bag'",
}
TIMEOUT = 0.5
DEAD_MAN = "dead_man"


@dataclass(frozen=True)
class Topic:
    """One port of a graph and its topic.

    timeout : the age (s) from which a value of an input no longer counts. low, high, rate : limits
    of an output and of its change in a second, arrays of its shape.
    """

    port: str
    name: str
    codec: Codec
    timeout: float = TIMEOUT
    low: FloatArray = field(default_factory=lambda: np.array(-np.inf))
    high: FloatArray = field(default_factory=lambda: np.array(np.inf))
    rate: FloatArray = field(default_factory=lambda: np.array(np.inf))

    @property
    def size(self) -> int:
        """How many numbers a value has."""
        return math.prod(self.codec.signal.shape)


@dataclass(frozen=True)
class Ports:
    """A robot.yaml that was read: see :data:`KEYS`. ``ros`` has the entries of that section."""

    path: Path
    inputs: Mapping[str, Topic]
    outputs: Mapping[str, Topic]
    transport: Mapping[str, Any]
    period: float
    dead_man: Topic | None
    ros: Mapping[str, Mapping[str, str]]

    def mirrored(self) -> Ports:
        """The ports of the other side: what is an input here is its output, with no limits."""
        transport = dict(self.transport)
        transport["listen"], transport["peer"] = transport.get("peer"), transport.get("listen")
        given = {key: value for key, value in transport.items() if value is not None}
        return Ports(self.path, self.outputs, self.inputs, given, self.period, None, self.ros)


def read_ports(path: Path | None, network: Network | None, is_plant: bool = False) -> Ports:
    """Read a robot.yaml for a graph; for none, only ``transport`` and ``ros`` are read.

    Parameters
    ----------
    path : the file; None where each port's topic has its name, as in /scan.
    is_plant : the file is that of the controller that the graph is the plant of: the graph's
        outputs are the file's inputs.

    Raises
    ------
    GraphError : everything that is wrong, with its position.
    """
    declared: dict[str, Mapping[str, PortDeclaration]] = {"inputs": {}, "outputs": {}}
    if network is not None:
        own = network.inputs, network.outputs
        declared = dict(zip(declared, reversed(own) if is_plant else own, strict=True))
    if path is None:
        usual: dict[str, Any] = {
            side: {port: {} for port in known} for side, known in declared.items()
        }
        document = from_python(usual)
    else:
        document = parse_yaml(decode(read_file(path, (NOWHERE, "--ports")), path), str(path))
    reader = _Reader(Problems())
    check_keys(document, KEYS, "", reader.problems, "entry")
    topics = {
        side: reader.topics(document.get(side), side, known, network is not None)
        for side, known in declared.items()
    }
    ports = Ports(
        path or Path("robot.yaml"),
        inputs=topics["inputs"],
        outputs=topics["outputs"],
        transport=reader.transport(document.get("transport")),
        period=reader.number(document.get("period"), "period", 0.01),
        dead_man=reader.dead_man(document.get(DEAD_MAN)),
        ros=reader.ros(document.get("ros")),
    )
    reader.problems.raise_any()
    return ports.mirrored() if is_plant else ports


@dataclass
class _Reader:
    """Reads the parts of a robot.yaml, and collects what is wrong."""

    problems: Problems

    def is_mapping(self, node: Node | None, address: str) -> bool:
        if node is not None and not node.is_map:
            self.problems.add(node.where, address, f"expected a mapping, got {node.describe()}")
        return node is not None and node.is_map

    def transport(self, node: Node | None) -> dict[str, Any]:
        plain: dict[str, Any] = {}
        if node is not None and self.is_mapping(node, "transport"):
            plain = node.plain()
        return plain

    def number(self, node: Node | None, address: str, default: float) -> float:
        if node is None:
            return default
        if not (is_number(node.value) and math.isfinite(node.value) and node.value > 0):
            self.problems.add(
                node.where, address, f"expected a time above 0 s, got {node.describe()}"
            )
            return default
        return float(node.value)

    def string(self, node: Node, key: str, address: str, default: str = "") -> str:
        entry = node.get(key)
        if entry is None:
            return default
        if not isinstance(entry.value, str) or not entry.value:
            place = f"{address}.{key}"
            self.problems.add(entry.where, place, f"expected a name, got {entry.describe()}")
            return default
        return entry.value

    def topics(
        self, node: Node | None, side: str, known: Mapping[str, PortDeclaration], is_checked: bool
    ) -> dict[str, Topic]:
        """The topics of a section; the graph has their ports."""
        if node is None or not self.is_mapping(node, side) or not is_checked:
            return {}
        check_keys(node, known, side, self.problems, "port of the graph")
        found = {}
        for port, entry in node.items():
            if port in known:
                topic = self.topic(entry, f"{side}.{port}", known[port], side == "outputs")
                found.update({} if topic is None else {port: topic})
        return found

    def topic(
        self, node: Node, address: str, port: PortDeclaration, is_output: bool
    ) -> Topic | None:
        """One topic; None if it is wrong. The graph's own bounds are limits, too."""
        if not self.is_mapping(node, address):
            return None
        check_keys(node, OF_OUTPUT if is_output else OF_INPUT, address, self.problems, "entry")
        codec = self.codec(node, address, port.type)
        name = self.string(node, "topic", address, f"/{port.name}")
        if codec is None:
            return None
        if not is_output:
            timeout = self.number(node.get("timeout"), f"{address}.timeout", TIMEOUT)
            return Topic(port.name, name, codec, timeout)
        limits = {
            key: self.numbers(node.get(key), f"{address}.{key}", port.type, default)
            for key, default in (("min", -math.inf), ("max", math.inf), ("rate", math.inf))
        }
        low, high = np.maximum(limits["min"], port.low), np.minimum(limits["max"], port.high)
        if ((low > 0.0) | (high < 0.0)).any():
            message = "0 is not between min and max, and it is the command that stops the robot"
            self.problems.add(node.where, address, message)
        if (limits["rate"] <= 0.0).any():
            self.problems.add(node.where, f"{address}.rate", "expected numbers above 0")
        return Topic(port.name, name, codec, TIMEOUT, low, high, limits["rate"])

    def codec(self, node: Node, address: str, signal: SignalType) -> Codec | None:
        frames = Frames(
            self.string(node, "frame", address, Frames.parent),
            self.string(node, "child", address, Frames.child),
        )
        kind = node.get("type")
        try:
            return Codec.of(signal, self.string(node, "type", address), frames)
        except UsageError as error:
            where = node.where if kind is None else kind.where
            self.problems.add(where, f"{address}.type", str(error))
            return None

    def numbers(
        self, node: Node | None, address: str, signal: SignalType, default: float
    ) -> FloatArray:
        """A number for all components, or one for each."""
        values = default if node is None else node.plain()
        items = values if isinstance(values, list) else [values]
        try:
            if not all(is_number(item) and not math.isnan(item) for item in items):
                raise ValueError
            if np.shape(values) not in ((), signal.shape):
                raise ValueError
            return np.broadcast_to(np.array(values, dtype=np.float64), signal.shape)
        except ValueError:
            expected = f"expected a number, or {signal.numbers} for a {signal}"
            where = NOWHERE if node is None else node.where
            got = values if node is None else node.describe()
            self.problems.add(where, address, f"{expected}, got {got}")
            return np.full(signal.shape, default)

    def dead_man(self, node: Node | None) -> Topic | None:
        if node is None or not self.is_mapping(node, DEAD_MAN):
            return None
        check_keys(node, OF_INPUT, DEAD_MAN, self.problems, "entry")
        kind = self.string(node, "type", DEAD_MAN, "std_msgs/msg/Bool")
        timeout = self.number(node.get("timeout"), f"{DEAD_MAN}.timeout", TIMEOUT)
        name = self.string(node, "topic", DEAD_MAN, "/enable")
        try:
            return Topic(DEAD_MAN, name, Codec.of(Scalar, kind), timeout)
        except UsageError as error:
            self.problems.add(node.where, f"{DEAD_MAN}.type", str(error))
            return None

    def ros(self, node: Node | None) -> dict[str, dict[str, str]]:
        """The entries of the section ``ros`` by signal, strings by key."""
        found = {}
        entries = node.items() if node is not None and self.is_mapping(node, "ros") else ()
        for signal, entry in entries:
            address = f"ros.{signal}"
            if not self.is_mapping(entry, address):
                continue
            check_keys(entry, COMMON, address, self.problems, "entry")
            found[signal] = {
                key: text for key in COMMON if (text := self.string(entry, key, address))
            }
        return found
