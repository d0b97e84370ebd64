"""``runtime blocks``: list the block types, or show one."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table, tell

if TYPE_CHECKING:
    from blocks.core import Block

HELP = "list the block types, or show one block's ports and parameters"
EXAMPLES = """
runtime blocks LQR
runtime blocks --search delay
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("type", nargs="?", help="a block type")
    parser.add_argument(
        "--search", metavar="WORD", help="only types whose name or description contains the word"
    )
    parser.add_argument("--module", metavar="FILE", help="a Python file that defines more blocks")
    add_json(parser)


def run(options: Namespace) -> int:
    """Print all block types, or one."""
    from blocks.registry import BLOCKS
    from runtime.descriptions import describe_json, describe_text, library

    known = library(options.module)
    if options.type is None:
        for line in BLOCKS.broken():
            tell(f"note: {line}")
    if options.type is not None and options.type not in known:
        from blocks.core import hint
        from blocks.extensions import BrokenPackageError
        from runtime.network import ours_for

        try:
            BLOCKS.find(options.type)
        except BrokenPackageError as error:
            raise UsageError(str(error)) from None
        suggestion = (
            ours_for(options.type) or hint(options.type, known) or f"; there are {', '.join(known)}"
        )
        raise UsageError(f"no block type '{options.type}'{suggestion}")
    if options.json:
        chosen = known if options.type is None else {options.type: known[options.type]}
        show_json({name: describe_json(cls) for name, cls in chosen.items()})
    elif options.type is None:
        _list(known, options.search)
    else:
        show(describe_text(known[options.type]))
    return 0


def _list(known: dict[str, type[Block]], word: str | None) -> None:
    """Print block types by family with one line each; only those that a word matches, if given."""
    from runtime.descriptions import families, summary

    chosen = known
    if word is not None:
        chosen = {
            name: cls
            for name, cls in known.items()
            if word.lower() in f"{name} {cls.__doc__}".lower()
        }
        if not chosen:
            raise UsageError(f"no block type has '{word}' in its name or description")
    width = max(map(len, chosen))
    for family, names in families(chosen).items():
        show(family)
        show(table([(name.ljust(width), summary(chosen[name])) for name in names]) + "\n")
    show("'runtime blocks TYPE' shows a block's ports and parameters; '--search WORD' filters.")
