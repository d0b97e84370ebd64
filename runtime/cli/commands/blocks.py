"""``runtime blocks``: list the block types, or show one."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.cli.commands import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table

HELP = "list the block types, or show one block's ports and parameters"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("type", nargs="?", help="a block type")
    parser.add_argument("--module", metavar="FILE", help="a Python file that defines more blocks")
    add_json(parser)


def run(options: Namespace) -> int:
    """Print all block types, or one."""
    from runtime.cli.describe import describe_json, describe_text, library

    known = library(options.module)
    if options.type is not None and options.type not in known:
        from blocks.core import hint

        suggestion = hint(options.type, known) or f"; there are {', '.join(known)}"
        raise UsageError(f"no block type '{options.type}'{suggestion}")
    if options.json:
        chosen = known if options.type is None else {options.type: known[options.type]}
        show_json({name: describe_json(cls) for name, cls in chosen.items()})
    elif options.type is None:
        summaries = [(cls.__doc__ or "").strip().split("\n")[0] for cls in known.values()]
        show(table(list(zip(known, summaries, strict=True)), indent=""))
        show("\n'runtime blocks TYPE' shows a block's ports and parameters.")
    else:
        show(describe_text(known[options.type]))
    return 0
