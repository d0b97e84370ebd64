"""``runtime export``: write a graph, or a part of it, as C or for another target."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from runtime.arguments import add_json, chosen, integer
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import UsageError, one_line, raised_text
from runtime.export import TARGETS
from runtime.terminal import show, show_json, tell

HELP = "write a graph or some of its blocks as C or for another target"
EXAMPLES = """
runtime export my.yaml c --block lqr
runtime export my.yaml c --except plant --float32
"""
MOST_TICKS = 10_000_000


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument("folder", metavar="DIR", help="folder for the files")
    targets = "; ".join(f"{name}: {target.doc}" for name, target in TARGETS.usable().items())
    docs = targets.replace("%", "%%")
    parser.add_argument("--to", default="c", metavar="TARGET", help=docs)
    for flag, place, text in (
        ("--block", "blocks", "a block or part to export"),
        ("--except", "others", "export all blocks but these"),
    ):
        parser.add_argument(
            flag, dest=place, action="append", default=[], metavar="NAME[,NAME]", help=text
        )
    named = "of files and functions (controller, or the title of a whole graph)"
    parser.add_argument("--name", help=named)
    parser.add_argument("--float32", action="store_true", help="compute in float, not in double")
    message = "an input that is not finite keeps its last value, instead of a failure"
    parser.add_argument("--hold-inputs", action="store_true", help=message)
    message = "replay only so many ticks (all; at most 50,000, or 200,000 numbers of inputs)"
    parser.add_argument("--ticks", type=integer(1, MOST_TICKS), metavar="N", help=message)
    add_json(parser)
    _add_options_of_targets(parser)


def _add_options_of_targets(parser: ArgumentParser) -> None:
    """Declare what single targets take; an option that several have is declared by the first."""
    declared: list[str] = []
    for name, target in TARGETS.usable().items():
        for option in (each for each in target.options if each not in declared):
            text = str(target.options[option].get("help", "")).replace("%", "%%")
            try:
                parser.add_argument(f"--{option}", **{**target.options[option], "help": text})
            except Exception as error:  # noqa: BLE001 -- of a package
                tell(f"note: --{option} of export target '{name}': {one_line(raised_text(error))}")
            else:
                declared.append(option)
    parser.set_defaults(options_of_targets=declared)


def _options_of(target: str, options: Namespace) -> dict[str, Any]:
    """The options of the chosen target that are given.

    Raises
    ------
    UsageError : one is of other targets.
    """
    targets, found = TARGETS.usable(), {}
    for option in options.options_of_targets:
        value = getattr(options, option.replace("-", "_"), None)
        if value is None or value is False:
            continue
        takers = [name for name, each in targets.items() if option in each.options]
        if target not in takers:
            message = f"--{option}: this option is for --to {' or '.join(takers)}"
            raise UsageError(message)
        found[option.replace("-", "_")] = value
    return found


def run(options: Namespace) -> int:
    """Write the files, and print the report."""
    target = chosen(TARGETS, options.to, "export target")
    own: dict[str, Any] = {"name": options.name} if options.name else {}
    own |= _options_of(options.to, options)
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
