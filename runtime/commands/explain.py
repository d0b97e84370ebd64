"""``runtime explain``: order, rates, types and the function that runs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.commands.changes import add_graph, changed
from runtime.files import json_text

HELP = "order, rates, types and the function that runs"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(options: Namespace) -> int:
    """Print order, rates and types, and the function that is executed."""
    from runtime.explain import explain_json, explain_text
    from runtime.graph import load

    graph = changed(load(options.graph), options).check()
    if options.json:
        print(json_text(explain_json(graph)))
    else:
        print(explain_text(graph))
    return 0
