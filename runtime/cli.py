"""The command line: ``runtime run graph.yaml`` and its sisters.

Exit codes: 0 fine; 1 it ran and an expectation failed; 2 usage or an invalid graph; 3 the
simulation failed (what was recorded is kept); 4 an optional extra is missing; 130 interrupted.
Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from runtime.errors import SpikeblocksError

EPILOG = """examples:
  runtime run line_actuator_failure                  a shipped graph, by name
  runtime run my.yaml --without adaptive --seed 3    an ablation
  runtime run my.yaml --set lqr.q='[1, 1, 1]'        another value
  runtime run my.yaml --wire lqr.error=error.state   another wire
"""


class _Parser(argparse.ArgumentParser):
    """Ends with exit code 2 and one line that says how to go on."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; '{self.prog} --help' shows the usage\n")


class _Change(argparse.Action):
    """Collects --with, --set, --wire, --without, --bypass in the order they were written."""

    def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
        changes = [*(namespace.changes or []), (self.option_strings[0].lstrip("-"), values)]
        namespace.changes = changes


def _with_graph(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("graph", help="a YAML file, or the name of a shipped graph")
    _with_changes(parser)


def _with_changes(parser: argparse.ArgumentParser) -> None:
    change = parser.add_argument_group("changes to the graph, applied in the order written")
    for flag, form, text in (
        ("--with", "GRAPH", "lay a graph, or part of one, on top, as 'extends' does"),
        ("--set", "PATH=YAML", "set an entry: blocks.lqr.q='[1, 1, 1]', params.v_r=2"),
        ("--wire", "INPUT=OUTPUT", "wire an input: lqr.error=error.state"),
        ("--without", "NAME[,NAME]", "leave out blocks with their wires"),
        ("--bypass", "NAME[,NAME]", "wire the through-pair of blocks straight"),
    ):
        change.add_argument(flag, action=_Change, metavar=form, help=text, dest="changes")
    change.add_argument("--seed", type=int, help="the run's seed")
    change.add_argument("--until", type=float, metavar="S", help="length of the run in seconds")


def make_parser() -> argparse.ArgumentParser:
    """The whole command line."""
    parser = _Parser(
        prog="runtime",
        description="Simulate control diagrams that are written as YAML.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    run = commands.add_parser("run", help="simulate, record, draw the probes, print the metrics")
    _with_graph(run)
    run.add_argument("--out", default="runs", metavar="DIR", help="where run folders go (runs)")
    run.add_argument("--no-plots", action="store_true", help="draw nothing")
    run.add_argument("--animate", action="store_true", help="write plots/animation.gif, too")
    run.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    run.add_argument("-q", "--quiet", action="store_true", help="no progress, no notes")

    validate = commands.add_parser("validate", help="check graphs, run nothing")
    validate.add_argument("graphs", nargs="+", metavar="graph", help="YAML files or shipped names")
    _with_changes(validate)
    validate.add_argument("--json", action="store_true", help="print one JSON object")
    validate.add_argument("-q", "--quiet", action="store_true", help="print problems only")

    draw = commands.add_parser("draw", help="the block diagram: svg, png, dot, mermaid")
    _with_graph(draw)
    draw.add_argument(
        "-o", "--out", metavar="FILE", help="file to write (<graph>.svg); - is stdout"
    )
    draw.add_argument(
        "--format", choices=("svg", "png", "dot", "mermaid"), help="default: the file's"
    )

    explain = commands.add_parser("explain", help="order, rates, types and the function that runs")
    _with_graph(explain)
    explain.add_argument("--json", action="store_true", help="print one JSON object")

    blocks = commands.add_parser("blocks", help="the library, or one block's ports and parameters")
    blocks.add_argument("type", nargs="?", help="a block type")
    blocks.add_argument("--module", metavar="FILE", help="a Python file with blocks of your own")
    blocks.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code."""
    sys.exit(run(arguments))


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.version:
        from runtime.simulate import versions

        print(f"spikeblocks {versions()['spikeblocks']}")
        return 0
    if options.command is None:
        parser.print_help()
        return 2
    try:
        from runtime import commands

        code: int = getattr(commands, options.command)(options)
        sys.stdout.flush()
    except SpikeblocksError as error:
        print(str(error), file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output is gone (as in '| head'): nothing is left to say to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code
