"""``runtime graphs``: list what comes with the package."""

from __future__ import annotations

import shutil
import sys
from argparse import ArgumentParser, Namespace
from itertools import groupby

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import show, show_json, table

HELP = "list the shipped graphs, starters, worlds, conditions and experiments"
BESIDE = 5  # columns of a row that its two cells do not take
UNLIMITED = 10_000


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("group", nargs="?", help="one group only, such as worlds")
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
        show(table([(each.name.ljust(width), _cut(each.summary, room)) for each in members]))
    return 0


def _cut(text: str, room: int) -> str:
    return text if len(text) <= room else text[: room - 1].rstrip(" ,;:") + "…"
