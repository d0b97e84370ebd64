"""``runtime blocks``: list the block types, or show one."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table, tell

if TYPE_CHECKING:
    from blocks.core import Block, Variant

HELP = "list the block types, or show one block's ports and parameters"
EXAMPLES = """
runtime blocks LQR
runtime blocks --search delay
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "type", nargs="?", help="a block type, or a neuron model, solver, synapse or rule of one"
    )
    parser.add_argument(
        "--search", metavar="WORD", help="only types whose name or description contains the word"
    )
    parser.add_argument("--module", metavar="FILE", help="a Python file that defines more blocks")
    add_json(parser)


def run(options: Namespace) -> int:
    """Print all block types, or one."""
    from blocks.library.registry import BLOCKS
    from runtime.descriptions import (
        describe_json,
        describe_text,
        library,
        variants,
    )

    known = library(options.module)
    if options.type is not None and options.type not in known:
        member = variants(known).get(options.type)
        if member is not None:
            _show_setting(member, known, options.json)
            return 0
    if options.type is None:
        for line in BLOCKS.broken():
            tell(f"note: {line}")
    if options.type is not None and options.type not in known:
        from blocks.core import hint
        from blocks.library.extensions import BrokenPackageError
        from runtime.network import ours_for

        try:
            BLOCKS.find(options.type)
        except BrokenPackageError as error:
            raise UsageError(str(error)) from None
        every = [*known, *variants(known)]
        suggestion = (
            ours_for(options.type) or hint(options.type, every) or f"; there are {', '.join(known)}"
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


def _show_setting(member: type[Variant], known: dict[str, type[Block]], as_json: bool) -> None:
    """Print a neuron model, a solver, a synapse or a rule."""
    from runtime.descriptions import describe_variant, parameters_json, settings

    users = [
        user for each, here in settings(known).items() if issubclass(member, each) for user in here
    ]
    if as_json:
        found = {
            "doc": member.__doc__,
            "for": users,
            "parameters": parameters_json(member.declared),
        }
        show_json({member.label: found})
    else:
        show(describe_variant(member, ", ".join(users)))


def _list(known: dict[str, type[Block]], word: str | None) -> None:
    """Print block types by family with one line each; only those that a word matches, if given.

    With a word, also what parameters choose from: neuron models, solvers, distributions; first what
    is called so, then names that have the word in them.
    """
    from runtime.descriptions import families, matches, settings, summary

    word = "" if word is None else word.lower()
    chosen = {name: cls for name, cls in known.items() if word in f"{name} {cls.__doc__}".lower()}
    lists = {
        family: [(name, summary(chosen[name])) for name in names]
        for family, names in families(chosen).items()
    }
    for setting, users in settings(known).items() if word else ():
        rows = matches(setting, word)
        if rows:
            lists[f"for {', '.join(users)}"] = rows
    if word:

        def rank(row: tuple[str, str]) -> int:
            """0 for a name that is the word, 1 for one with it, 2 for a mention."""
            name = row[0].partition("(")[0].lower()
            return 0 if name == word else 1 if word in name else 2

        lists = {family: sorted(rows, key=rank) for family, rows in lists.items()}
        lists = dict(sorted(lists.items(), key=lambda each: rank(each[1][0])))
    if not lists:
        raise UsageError(f"nothing has '{word}' in its name or description")
    width = max(len(name) for rows in lists.values() for name, _ in rows)
    for family, rows in lists.items():
        show(family)
        show(table([(name.ljust(width), doc) for name, doc in rows]) + "\n")
    show("'runtime blocks TYPE' shows a block's ports and parameters; '--search WORD' filters.")
