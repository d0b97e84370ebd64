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

from runtime.commands import NAMES, command
from runtime.errors import SpikeblocksError
from runtime.terminal import printable, show, tell

EPILOG = """examples:
  runtime run line_actuator_failure                  a shipped graph, by name
  runtime run my.yaml --without adaptive --seed 3    an ablation
  runtime run my.yaml --set lqr.q='[1, 1, 1]'        another value
  runtime run my.yaml --wire lqr.error=error.state   another wire
"""


class _Parser(argparse.ArgumentParser):
    """Ends with exit code 2 and one line that says how to go on."""

    def error(self, message: str) -> NoReturn:
        said = f"{self.prog}: {message}; '{self.prog} --help' shows the usage\n"
        self.exit(2, printable(said))


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

    for name in NAMES:
        module = command(name)
        module.add(commands.add_parser(name, help=module.HELP))
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

        show(f"spikeblocks {versions()['spikeblocks']}")
        return 0
    if options.command is None:
        parser.print_help()
        return 2
    try:
        code = command(options.command).run(options)
        sys.stdout.flush()
    except SpikeblocksError as error:
        tell(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        tell("interrupted")
        return 130
    except BrokenPipeError:
        # The reader of our output is gone (as in '| head'): nothing is left to say to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code
