"""``runtime explain``: show order, rates and types, and with --code the generated function."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import add_json
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import UsageError
from runtime.terminal import show, show_json

if TYPE_CHECKING:
    from runtime.graph import Graph

HELP = "show order, rates and types, and the generated function"
EXAMPLES = """
runtime explain my.yaml
runtime explain my.yaml --engine compiled --code
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument(
        "--plots",
        metavar="FOLDER",
        type=Path,
        help="write the plots that need no run, as tuning_curves, into this folder",
    )
    parser.add_argument("--code", action="store_true", help="also print the generated function")
    add_json(parser)


def run(options: Namespace) -> int:
    """Print order, rates and types, and the generated function if it is asked for."""
    from runtime.cli.explain import explain_json, explain_text

    graph = changed_graph(options.graph, options).check()
    paths = [] if options.plots is None else _plots(graph, options.plots)
    if options.json:
        show_json(explain_json(graph) | {"plots": [str(path) for path in paths]})
    else:
        show("\n".join(map(str, paths)) if options.plots else explain_text(graph, options.code))
    return 0


def _plots(graph: Graph, folder: Path) -> list[Path]:
    """Write the plots of a graph that need no run.

    Raises
    ------
    UsageError : it has none.
    """
    from runtime.observation import PLOT_KINDS
    from runtime.plots import save_plots
    from runtime.runs import at_start

    result = at_start(graph.prepared())
    if not result.plots:
        kinds = ", ".join(name for name, kind in PLOT_KINDS.items() if kind.of_tuning)
        raise UsageError(f"the graph has no plot that needs no run; such kinds are {kinds}")
    return save_plots(result, folder)
