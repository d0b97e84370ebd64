"""``runtime drive``: a controller in real time, whose inputs and outputs are topics."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from runtime.arguments import add_json, add_no_modules, at_least, integer
from runtime.errors import UsageError
from runtime.files import write_whole
from runtime.terminal import show, show_json, tell

HELP = "run a controller in real time; its inputs and outputs are topics"
GROUP = "robots"
EXAMPLES = """
runtime drive controller.yaml --ports robot.yaml --for 60
runtime drive controller.yaml --ports robot.yaml --log drive.mcap
runtime drive controller.yaml --ports robot.yaml --header robot_frames.h
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph with inputs and outputs")
    add_driving(parser)
    parser.add_argument(
        "--header", metavar="FILE", help="only write a C header of the frames of UDP and serial"
    )


def add_driving(parser: ArgumentParser) -> None:
    """Declare the options that a plant has as well."""
    parser.add_argument("--ports", required=True, metavar="FILE", help="a robot.yaml: the topics")
    parser.add_argument(
        "--for",
        dest="seconds",
        type=at_least(0.0, above=True),
        metavar="S",
        help="how long, by the clock (run.until); Ctrl-C ends it, too",
    )
    parser.add_argument("--seed", type=integer(0, 2**31 - 1), metavar="N", help="of the run")
    parser.add_argument(
        "--log", metavar="FILE", help="write every message that counts, and every command, as MCAP"
    )
    parser.add_argument(
        "--out", default="runs", metavar="DIR", help="folder for run folders (runs)"
    )
    add_no_modules(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Drive, and print what happened."""
    if options.header:
        from spikeblocks.robot.frames import c_header

        write_whole(Path(options.header), c_header(_read(options, False)[1]))
        show(options.header)
        return 0
    return run_driver(options, is_plant=False)


def _read(options: Namespace, is_plant: bool) -> tuple[Any, Any]:
    from runtime.graph import load
    from spikeblocks.robot.ports import read_ports

    graph = load(options.graph, modules=not options.no_modules).check()
    if options.seed is not None:
        graph = graph.set("run.seed", options.seed)
    return graph, read_ports(Path(options.ports), graph.network, is_plant)


def run_driver(options: Namespace, is_plant: bool) -> int:
    """Run a controller, or a plant; write its run folder, and print what happened."""
    from runtime.runs import link_latest, new_folder
    from spikeblocks.robot.bags import BagWriter
    from spikeblocks.robot.driving import Driver
    from spikeblocks.robot.transports import adapter_of

    graph, ports = _read(options, is_plant)
    seconds = options.seconds or graph.network.until
    adapter = adapter_of(ports, modules=not options.no_modules)
    with ExitStack() as stack:
        log = stack.enter_context(BagWriter(Path(options.log))) if options.log else None
        driver = Driver(graph, ports, adapter, is_plant=is_plant, log=log)
        shown = _ChangesShown(driver, options.json)
        try:
            driver.run(seconds, shown)
        except OSError as error:
            raise UsageError(f"transport: {error.strerror or error}") from None
        finally:
            shown(None)
            folder = new_folder(Path(options.out), graph.title)
            driver.session.result().save(folder)
            link_latest(folder)
            facts = {**driver.facts(), "folder": str(folder)}
            if options.json:
                show_json(facts)
            else:
                show(driving_text(facts))
    return 0


class _ChangesShown:
    """Prints changes of the state when they happen."""

    def __init__(self, driver: Any, quiet: bool) -> None:
        self.driver, self.quiet, self.count = driver, quiet, 0

    def __call__(self, state: object) -> None:
        changes = self.driver.changes
        if len(changes) > self.count and not self.quiet:
            for at, text in changes[self.count :]:
                tell(f"{at:8.2f} s  {text}")
            self.count = len(changes)


def driving_text(facts: dict[str, Any]) -> str:
    """What happened, in lines."""
    counts = ", ".join(f"{count} of {name}" for name, count in facts["received"].items())
    sent = ", ".join(f"{count} of {name}" for name, count in facts["sent"].items())
    lines = [f"ran {facts['seconds']:g} s; received {counts or 'nothing'}; sent {sent}"]
    for name, found in facts["dropped"].items():
        lines.append(f"dropped {found['messages']} of {name}; the first: {found['first']}")
    late = facts["late_s"]
    if late["p50"] is not None:
        times = ", ".join(f"{1e3 * late[key]:.3g} ms ({key})" for key in late)
        lines.append(f"periods began late by {times}; {facts['overruns']} overruns")
    return "\n".join([*lines, f"run folder: {facts['folder']}"])
