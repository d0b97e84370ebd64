"""``runtime run``: simulate, record, draw the probes, print the metrics."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import Once, add_output, at_least, rare, seconds
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.cli.commands.running import run_graph
from runtime.cli.commands.showing import present
from runtime.errors import UsageError

if TYPE_CHECKING:
    from runtime.runs import Result

HELP = "simulate, record, draw the probes, print the metrics"
EXAMPLES = """
runtime run starters/adaptive --vs without=adaptive
runtime run my.yaml --set lqr.q='[1, 1, 1]' --seed 3
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    add_output(parser, "runs", "run folders")
    parser.add_argument(
        "--vs",
        action=Once,
        metavar="CHANGE=VALUE",
        help="also run with one more change, and draw both runs in the same pictures: "
        "without=adaptive, bypass=limit, replace=lqr=PathPID, with=conditions/lag, "
        "set=lqr.q=[1,1,1]",
    )
    rare(parser).add_argument(
        "--labels", default="", metavar="A,B", help="names of both runs in the pictures of --vs"
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="run again whenever the graph is saved, with the last run in the same pictures",
    )
    rare(parser).add_argument(
        "--checkpoint",
        action=Once,
        type=seconds,
        metavar="TIME",
        help="write the state of the run that often, as 60s or 5min of the clock: "
        "'runtime resume' goes on after whatever ended it",
    )
    add_real_time(parser)
    rare(parser).add_argument("--profile", action="store_true", help="show the time per block")
    parser.add_argument("--animate", action="store_true", help="also write plots/animation.gif")


def add_real_time(parser: ArgumentParser) -> None:
    """Declare the options of a run in real time."""
    group = rare(parser)
    group.add_argument(
        "--real-time",
        action="store_true",
        help="let every tick wait for the clock, and report how late ticks were",
    )
    group.add_argument(
        "--speed",
        action=Once,
        type=at_least(0.0, above=True),
        metavar="FACTOR",
        help="with --real-time: seconds of the graph in one of the clock (1)",
    )
    group.add_argument(
        "--overrun",
        choices=("catch-up", "skip"),
        help="with --real-time, where ticks end after the next are due: run without waiting "
        "until the clock is reached (catch-up, the default), or leave out the due times that "
        "have passed, and stay behind (skip)",
    )
    group.add_argument(
        "--priority",
        action="store_true",
        help="with --real-time: run under SCHED_FIFO, if the system has and allows it",
    )


def run(options: Namespace) -> int:
    """Simulate, write the run folder and its pictures, print the metrics."""
    if not options.watch:
        graph = changed_graph(options.graph, options).check()
        return present(run_graph(options, graph), options)
    if options.json:
        raise UsageError("--watch prints one result after the other; --json prints one object")
    from runtime.cli.commands.watching import Done, watch

    def once(before: Result | None) -> Done:
        outcome = run_graph(options, changed_graph(options.graph, options).check(), before)
        files = [Path(name) for name in outcome.graph.texts]
        return Done(present(outcome, options), outcome.result, files)

    return watch(options.graph, once)
