"""``runtime help``: the help of a verb, or of the options that change a graph."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.errors import UsageError
from runtime.terminal import show

HELP = "show the help of a command, or of options that change a graph"
EXAMPLES = """
runtime help run
runtime help changes
"""
ABOUT = """
Options that change a graph, for the commands run, validate, draw, explain, linearize, ablate,
sweep, tune, fit and export. They are applied in the order written, before anything is checked or
run; the file itself stays as it is.
"""
OF_CHANGES = """
runtime run my.yaml --without adaptive --seed 3
runtime draw my.yaml --replace lqr=PathPID --set lqr.kp=2 -o pid.svg
runtime run my.yaml --with conditions/lag --wire snn.error=error.heading
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topic", nargs="?", help="a command, or changes")


def run(options: Namespace) -> int:
    """Print the help."""
    from blocks.core import hint
    from runtime.cli import make_parser
    from runtime.cli.commands import VERBS

    if options.topic == "changes":
        show(change_help())
        return 0
    if options.topic is None:
        show(make_parser().format_help().rstrip())
        return 0
    if VERBS.find(options.topic) is None:
        suggestion = hint(options.topic, [*VERBS.names(), "changes"])
        raise UsageError(f"no command '{options.topic}'{suggestion}")
    make_parser({options.topic: VERBS[options.topic]}).parse_args([options.topic, "--help"])
    return 0


def change_help() -> str:
    """The help of the options that change a graph."""
    from runtime.cli.commands.changes import add_changes
    from runtime.cli.parser import CHANGES, Parser, examples

    parser = Parser(
        prog="runtime VERB",
        usage="runtime VERB GRAPH [CHANGES]",
        description=ABOUT.strip().replace("\n", " "),
        epilog=examples(OF_CHANGES),
        add_help=False,
    )
    parser.explains = (CHANGES,)
    add_changes(parser)
    return parser.format_help().rstrip()
