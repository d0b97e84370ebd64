"""``runtime validate``: check graphs without running them."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.cli.commands import add_json
from runtime.cli.commands.changes import add_changes, changed_graph
from runtime.cli.problems import report
from runtime.errors import GraphError, MissingExtraError
from runtime.terminal import show, show_json, tell

HELP = "check graphs without running them"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "graphs", nargs="+", metavar="graph", help="YAML files, or names of shipped graphs"
    )
    add_changes(parser)
    add_json(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="print problems only")


def run(options: Namespace) -> int:
    """Check graphs, and report all problems of all of them."""
    problems: dict[str, list[str]] = {}
    missing: MissingExtraError | None = None
    for name in options.graphs:
        try:
            graph = changed_graph(name, options).check()
        except GraphError as error:
            problems[name] = [str(problem) for problem in error.problems]
            if not options.json:
                report(error)
            continue
        except MissingExtraError as error:
            missing = error
            tell(error)
            problems[name] = []
            continue
        problems[name] = []
        if not (options.quiet or options.json):
            network = graph.network
            blocks, wires = len(network.entries), len(network.wires)
            for note in network.notes:
                tell(f"note: {note}")
            show(f"{name}: fine ({blocks} blocks, {wires} wires, {network.ticks} ticks)")
    if options.json:
        show_json({"schema_version": 1, "problems": problems})
    if any(problems.values()):
        return 2
    return 0 if missing is None else missing.exit_code
