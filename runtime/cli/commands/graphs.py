"""``runtime graphs``: list what comes with the package."""

from __future__ import annotations

import shutil
import sys
import textwrap
from argparse import ArgumentParser, Namespace
from itertools import groupby

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table

HELP = "list the shipped graphs, starters, worlds, experiments"
EXAMPLES = """
runtime graphs worlds
runtime graphs --search pendulum
"""
BESIDE = 5  # columns of a row that its two cells do not take
UNLIMITED = 10_000


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("group", nargs="?", help="one group only, such as worlds")
    parser.add_argument(
        "--search", metavar="WORD", help="only what has the word in its name, text or blocks"
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Print every file that comes with the package, with one line each."""
    from blocks.core import hint
    from runtime.cli.shipped import USES, shipped

    found = shipped()
    groups = list(dict.fromkeys(each.group for each in found))
    if options.group is not None:
        if options.group not in groups:
            suggestion = hint(options.group, groups) or f"; there are {', '.join(groups)}"
            raise UsageError(f"no group '{options.group}'{suggestion}")
        found = [each for each in found if each.group == options.group]
    if options.search is not None:
        word = options.search.lower()
        # In its own text, so that a search for PID lists the graphs that have such a block.
        found = [e for e in found if word in f"{e.name} {e.path.read_text('utf-8')}".lower()]
        if not found:
            raise UsageError(f"nothing that is shipped has '{options.search}' in its text")
    if options.json:
        show_json(
            {
                group: {each.name: each.summary for each in members}
                for group, members in groupby(found, key=lambda each: each.group)
            }
        )
        return 0
    width = max(len(each.name) for each in found)
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else UNLIMITED
    room = max(30, columns - width - BESIDE)
    for i, (group, members) in enumerate(groupby(found, key=lambda each: each.group)):
        use = f" ({USES[group]})" if group in USES else ""
        show(f"{chr(10) if i else ''}{group}{use}")
        rows = [
            (name if i == 0 else "", line)
            for name, summary in ((each.name.ljust(width), each.summary) for each in members)
            for i, line in enumerate(textwrap.wrap(summary, room) or [""])
        ]
        show(table(rows))
    return 0
