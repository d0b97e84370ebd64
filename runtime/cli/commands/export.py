"""``runtime export``: write a graph, or a part of it, as C, as a page or as an FMU."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from runtime.arguments import add_json, at_least, chosen, integer
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import UsageError
from runtime.terminal import show, show_json

HELP = "write a graph or some of its blocks as C, an FMU or a live page"
EXAMPLES = """
runtime export my.yaml c --block lqr
runtime export my.yaml c --except plant --float32
"""
MOST_TICKS = 10_000_000


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument("folder", metavar="DIR", help="folder for the files")
    targets = "c: C99; library: compiled, for Python and C; fmu: an FMU; html: a page"
    parser.add_argument("--to", default="c", metavar="TARGET", help=targets)
    for flag, place, text in (
        ("--block", "blocks", "a block or part to export"),
        ("--except", "others", "export all blocks but these"),
    ):
        parser.add_argument(
            flag, dest=place, action="append", default=[], metavar="NAME[,NAME]", help=text
        )
    parser.add_argument("--name", help="of files and functions (controller); of a page (its title)")
    parser.add_argument("--float32", action="store_true", help="compute in float, not in double")
    message = "of the test with --float32: a share of each output's range (0.001)"
    parser.add_argument("--tolerance", type=at_least(0.0, above=True), metavar="X", help=message)
    message = "an input that is not finite keeps its last value, instead of a failure"
    parser.add_argument("--hold-inputs", action="store_true", help=message)
    message = "replay only so many ticks (all; at most 50,000, or 200,000 numbers of inputs)"
    parser.add_argument("--ticks", type=integer(1, MOST_TICKS), metavar="N", help=message)
    message = "a value that the reader of a page may change, as fault.gain[1]=0..1"
    parser.add_argument("--slider", action="append", metavar="NAME=LOW..HIGH", help=message)
    message = "version of the interface of an FMU: 3 (default) or 2"
    parser.add_argument("--fmi", type=int, choices=(2, 3), help=message)
    add_json(parser)


def run(options: Namespace) -> int:
    """Write the files, and print the report."""
    from runtime.export import TARGETS

    target = chosen(TARGETS, options.to, "export target")
    own: dict[str, Any] = {"name": options.name} if options.name else {}
    for key, only in (("slider", "html"), ("fmi", "fmu"), ("tolerance", "c or library")):
        if value := getattr(options, key):
            if options.to not in only.split(" or "):
                raise UsageError(f"--{key}: this option is for --to {only}")
            own[key] = value
    made = target.write(
        changed_graph(options.graph, options),
        options.folder,
        blocks=_names(options.blocks),
        others=_names(options.others),
        float32=options.float32,
        ticks=options.ticks,
        hold=options.hold_inputs,
        **own,
    )
    if options.json:
        show_json(
            {
                "schema_version": 1,
                "folder": str(made.folder),
                "files": list(made.files),
                "inputs": list(made.inputs),
                "outputs": list(made.outputs),
            }
        )
        return 0
    show(made.report)
    show(f"written to {made.folder}: {', '.join(made.files)}")
    if made.note:
        show(made.note)
    return 0


def _names(given: list[str]) -> list[str]:
    return [name.strip() for text in given for name in text.split(",") if name.strip()]
