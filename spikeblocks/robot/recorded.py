"""``runtime bag``: the signals of a run as messages of ROS 2, in one MCAP file."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table, tell

if TYPE_CHECKING:
    from blocks.core import FloatArray, SignalType
    from runtime.observation import Recording, RunData
    from spikeblocks.robot.messages import Codec

    # Its address, topic and codec, times in s and values.
    _Signal = tuple[str, str, Codec, FloatArray, FloatArray]

HELP = "write a run as messages of ROS 2, in an MCAP file"
GROUP = "robots"
EXAMPLES = """
runtime bag runs/wall_following/latest -o run.mcap
runtime bag runs/wall_following/latest --ports robot.yaml
"""
SUFFIX = ".mcap"
# Types of signals that say nothing to another program.
UNWRITTEN = ("State",)


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("run", help="a run folder")
    parser.add_argument("-o", "--out", metavar="FILE", help="the bag (GRAPH.mcap)")
    parser.add_argument(
        "--ports", metavar="FILE", help="a robot.yaml, whose section 'ros' names topics and types"
    )
    parser.add_argument(
        "--only", action="store_true", help="no other signals than those of the section 'ros'"
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Write the file, and print its topics."""
    from runtime.runs import open_run
    from spikeblocks.robot.ports import read_ports

    result = open_run(options.run)
    path = Path(options.out or f"{result.title}{SUFFIX}")
    if path.suffix != SUFFIX:
        raise UsageError(f"-o: expected a file that ends in {SUFFIX}, got '{path}'")
    ros = read_ports(Path(options.ports), None).ros if options.ports else {}
    if options.only and not ros:
        raise UsageError("--only: --ports names no file with a section 'ros'")
    counts, notes = write_bag(result, path, ros, options.only)
    for note in notes:
        tell(f"note: {note}")
    if options.json:
        show_json({"file": str(path), "topics": counts, "notes": notes})
        return 0
    rows = [["topic", "messages", "type", "signal"]]
    rows += [
        [topic, str(found["messages"]), found["type"], found["signal"]]
        for topic, found in counts.items()
    ]
    show(table(rows, right=(1,)))
    show(f"bag: {path}")
    return 0


def write_bag(
    result: RunData, path: Path, ros: Mapping[str, Mapping[str, str]], only: bool = False
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Write recorded signals in the order of their times; their topics, and what is left out.

    ``only`` leaves out those that ``ros`` does not name.
    Stamps are the times of the run after its beginning by the clock, as the manifest has it.
    """
    from spikeblocks.robot.bags import BagWriter
    from spikeblocks.robot.messages import SECOND, UnfitMessageError, check

    signals, notes = _signals(result, ros, only)
    begin = _began(result)
    counts: dict[str, dict[str, Any]] = {}
    rows = []
    for place, (address, topic, codec, times, _) in enumerate(signals):
        counts[topic] = {"messages": 0, "type": codec.kind, "signal": address}
        rows += [(begin + round(t * SECOND), place, row) for row, t in enumerate(times.tolist())]
    with BagWriter(path) as bag:
        for stamp, place, row in sorted(rows):
            address, topic, codec, _, values = signals[place]
            try:
                check(values[row], codec.signal)
            except UnfitMessageError as error:
                notes += [] if "bad" in counts[topic] else [f"{address}: row {row}: {error}"]
                counts[topic]["bad"] = counts[topic].get("bad", 0) + 1
                continue
            bag.write(topic, codec, values[row], stamp)
            counts[topic]["messages"] += 1
    return counts, notes


def _began(result: RunData) -> int:
    """When the run began, in ns since the epoch."""
    try:
        return int(datetime.fromisoformat(str(result.manifest.get("started"))).timestamp()) * 10**9
    except ValueError:
        return 0


def _signals(
    result: RunData, ros: Mapping[str, Mapping[str, str]], only: bool
) -> tuple[list[_Signal], list[str]]:
    """Each recorded signal with its topic, codec, times in s and values; and what is left out.

    Raises
    ------
    UsageError : the mapping names a signal that was not recorded, or one topic twice.
    """
    from blocks.core import hint
    from runtime.runs import UNITS
    from spikeblocks.robot.messages import Codec, Frames

    columns = _columns(result)
    for name in ros:
        if name not in columns:
            suggestion = hint(name, columns) or f"; recorded are {', '.join(columns)}"
            raise UsageError(f"ros: the run has no recording of '{name}'{suggestion}")
    found: dict[str, _Signal] = {}
    notes = []
    for address, (recording, kind, values) in columns.items():
        if only and address not in ros:
            continue
        if kind in UNWRITTEN or not len(values):
            notes.append(f"{address} is not written: it is a {kind} of {len(values)} rows")
            continue
        entry = ros.get(address, {})
        topic = entry.get("topic", "/" + address.replace(".", "/"))
        if topic in found:
            raise UsageError(f"ros: topic '{topic}' is of '{found[topic][0]}' and of '{address}'")
        frames = Frames(entry.get("frame", Frames.parent), entry.get("child", Frames.child))
        codec = Codec.of(_type_of(kind, values.shape[1:]), entry.get("type", ""), frames)
        times = recording.t * UNITS[recording.time_unit]
        found[topic] = address, topic, codec, times, values
    return list(found.values()), notes


def _columns(result: RunData) -> dict[str, tuple[Recording, str, FloatArray]]:
    """The recording of each address, of several the longest, with its type and its values."""
    columns: dict[str, tuple[Recording, str, FloatArray]] = {}
    for recording in result.probes.values():
        for address, kind in zip(recording.addresses, recording.kinds, strict=False):
            before = columns.get(address)
            if before is None or len(before[2]) < len(recording.t):
                columns[address] = recording, kind, recording.column(address)
    return columns


def _type_of(kind: str, shape: tuple[int, ...]) -> SignalType:
    """The signal type of recorded values; a type of the graph's own is a vector here."""
    from blocks.core import TYPES, Vector

    signal = TYPES.get(kind)
    if signal is not None and signal.form == "array":
        return signal.sized(shape[0])
    return signal if signal is not None and signal.shape == shape else Vector(math.prod(shape))
