"""``runtime explain``: show order, rates, types and the generated function."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.cli.commands import add_json
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.terminal import show, show_json

HELP = "show order, rates, types and the generated function"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Print order, rates, types and the generated function."""
    from runtime.cli.explain import explain_json, explain_text

    graph = changed_graph(options.graph, options).check()
    if options.json:
        show_json(explain_json(graph))
    else:
        show(explain_text(graph))
    return 0
