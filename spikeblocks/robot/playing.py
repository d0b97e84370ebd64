"""``runtime play``: a controller on recorded inputs, its commands beside the recorded ones."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json, add_no_modules, at_least, integer
from runtime.errors import UsageError
from runtime.terminal import number, show, show_json, table, tell

if TYPE_CHECKING:
    from blocks.core import FloatArray
    from runtime.graph import Graph
    from runtime.sessions import Session
    from spikeblocks.robot.bags import Recorded
    from spikeblocks.robot.ports import Ports

HELP = "run a controller on a bag, and compare its commands"
GROUP = "robots"
EXAMPLES = """
runtime play controller.yaml --bag log.mcap
runtime play controller.yaml --bag log.mcap --tolerance 0.001
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph whose inputs the bag has")
    parser.add_argument("--bag", required=True, help="a .mcap, .db3 or .bag file, or a folder")
    parser.add_argument(
        "--ports", metavar="FILE", help="a robot.yaml with the topics; by default /PORT of each"
    )
    parser.add_argument(
        "--until", type=at_least(0.0, above=True), metavar="S", help="how much of the bag (all)"
    )
    parser.add_argument("--seed", type=integer(0, 2**31 - 1), metavar="N", help="of the run")
    parser.add_argument(
        "--tolerance",
        type=at_least(0.0),
        metavar="X",
        help="exit code 1 if a number of a command differs by more",
    )
    parser.add_argument(
        "--out", default="runs", metavar="DIR", help="folder for run folders (runs)"
    )
    add_no_modules(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Play the bag, write the run folder, and print how commands differ."""
    from runtime.graph import load
    from runtime.runs import link_latest, new_folder
    from spikeblocks.robot.ports import read_ports

    graph = load(options.graph, modules=not options.no_modules).check()
    if options.seed is not None:
        graph = graph.set("run.seed", options.seed)
    ports = read_ports(Path(options.ports) if options.ports else None, graph.network)
    played = play(graph, Path(options.bag), ports, options.until)
    folder = new_folder(Path(options.out), graph.title)
    played.session.result().save(folder)
    link_latest(folder)
    for note in played.notes:
        tell(f"note: {note}")
    differ = [each for each in played.differences.values() if each["largest"] is not None]
    if options.json:
        facts = {"seconds": played.session.t, "inputs": played.counts, "notes": played.notes}
        show_json({**facts, "outputs": played.differences, "folder": str(folder)})
    else:
        show(played.text())
        show(f"run folder: {folder}")
    limit = options.tolerance
    return int(limit is not None and any(each["largest"] > limit for each in differ))


@dataclass(frozen=True)
class Played:
    """A session that has run on a bag. counts : messages of each input.

    differences : of each component of an output that the bag has: ``messages``, ``rms`` and
    ``largest`` of the difference, ``at`` (s) where it is largest, ``recorded``, the rms of the
    recorded one.
    """

    session: Session
    counts: Mapping[str, int]
    differences: Mapping[str, dict[str, Any]]
    notes: list[str]

    def text(self) -> str:
        """The differences as a table."""
        inputs = ", ".join(f"{count} of {name}" for name, count in self.counts.items())
        rows = [["command", "messages", "recorded rms", "difference rms", "largest", "at (s)"]]
        for name, d in self.differences.items():
            cells = [number(d[key]) for key in ("recorded", "rms", "largest", "at")]
            rows.append([name, str(d["messages"]), *cells])
        compared = table(rows, right=range(1, 6)) if self.differences else "no command to compare"
        return f"played {self.session.t:g} s: {inputs}\n{compared}"


def play(graph: Graph, path: Path, ports: Ports, until: float | None = None) -> Played:
    """Run a graph on the messages of a bag.

    Time 0 of the graph is when the last of its inputs is first seen, as of ``runtime drive``. A
    message acts at the first tick that is not before its stamp.

    Raises
    ------
    UsageError : the bag lacks a topic of an input, or the graph has no inputs.
    """
    from spikeblocks.robot.bags import BagReader
    from spikeblocks.robot.messages import SECOND

    network = graph.network
    if not ports.inputs:
        raise UsageError("the graph has no input that a topic is for; 'inputs:' declares them")
    if network.time_unit != "s":
        raise UsageError(
            f"run.time_unit: expected s for recorded messages, got {network.time_unit}"
        )
    with BagReader(path) as bag:
        inputs = {
            name: bag.read(t.name, t.codec.signal, t.codec.frames)
            for name, t in ports.inputs.items()
        }
        outputs = {
            name: bag.read(t.name, t.codec.signal, t.codec.frames)
            for name, t in ports.outputs.items()
            if t.name in bag.topics
        }
    notes = [note for each in (*inputs.values(), *outputs.values()) for note in each.notes]
    missing = [t.name for name, t in ports.outputs.items() if name not in outputs]
    notes += [f"the bag has no topic '{name}' to compare with" for name in missing]
    begin = max(int(each.stamps[0]) for each in inputs.values())
    ends = [int(each.stamps[-1]) for each in (*inputs.values(), *outputs.values())]
    last = max(ends) if until is None else min(max(ends), begin + round(until * SECOND))
    step = round(network.dt * SECOND)
    session = graph.set("run.until", ((last - begin) // step + 1) * network.dt).session()
    pairs = _step_through(session, _events(inputs, outputs, begin, last, step), graph)
    counts = {name: len(each.stamps) for name, each in inputs.items()}
    return Played(session, counts, _differences(pairs, outputs, network.dt), notes)


# What happens at a tick: (tick, 0 for an input and 1 for an output, the port, the value).
_Event = tuple[int, int, str, "FloatArray"]


def _events(
    inputs: Mapping[str, Recorded],
    outputs: Mapping[str, Recorded],
    begin: int,
    last: int,
    step: int,
) -> list[_Event]:
    """The messages in the order of their ticks, inputs first."""
    events: list[_Event] = []
    for is_output, each in enumerate((inputs, outputs)):
        for name, recorded in each.items():
            for stamp, values in zip(recorded.stamps.tolist(), recorded.values, strict=True):
                # A stamp that rounding has put just after its tick belongs to it.
                tick = -((begin - stamp + step // 1000) // step)
                if stamp <= last and (tick >= 0 or not is_output):
                    events.append((max(0, tick), is_output, name, values))
    return sorted(events, key=lambda event: event[:2])


def _step_through(
    session: Session, events: list[_Event], graph: Graph
) -> dict[str, list[tuple[int, FloatArray, FloatArray]]]:
    """Run a session through events; (tick, recorded, computed) of each output's message."""
    import numpy as np

    pairs: dict[str, list[tuple[int, FloatArray, FloatArray]]] = {}
    for tick, is_output, name, values in events:
        session.step(tick - session.tick)
        if is_output:
            computed = session.read(str(graph.network.outputs[name].end))
            pairs.setdefault(name, []).append((tick, values, np.asarray(computed)))
        else:
            session.write(name, values)
    return pairs


def _differences(
    pairs: Mapping[str, list[tuple[int, FloatArray, FloatArray]]],
    outputs: Mapping[str, Recorded],
    dt: float,
) -> dict[str, dict[str, Any]]:
    import numpy as np

    found: dict[str, dict[str, Any]] = {}
    for name, rows in pairs.items():
        signal = outputs[name].codec.signal
        ticks = [row[0] for row in rows]
        recorded, computed = (
            np.array([row[i] for row in rows]).reshape(len(rows), math.prod(signal.shape))
            for i in (1, 2)
        )
        names = [f"{name}.{part}" for part in signal.names] if signal.shape else [name]
        for column, label in enumerate(names):
            difference = np.abs(computed[:, column] - recorded[:, column])
            worst = int(difference.argmax())
            found[label] = {
                "messages": len(rows),
                "recorded": float(np.sqrt(np.mean(recorded[:, column] ** 2))),
                "rms": float(np.sqrt(np.mean(difference**2))),
                "largest": float(difference[worst]),
                "at": ticks[worst] * dt,
            }
    return found
