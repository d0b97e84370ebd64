"""``runtime validate``: check files without running them, as the language service does."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from blocks.messages import plain_fix
from runtime.arguments import add_json
from runtime.cli.commands.changes import add_changes, changed, is_changed
from runtime.cli.problems import report
from runtime.errors import GraphError, MissingExtraError, Problem
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.language import Diagnostic, Model

HELP = "check graphs, parts, worlds and experiments without running them"
EXAMPLES = """
runtime validate my.yaml
runtime validate graphs/*.yaml --quiet
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "graphs", nargs="+", metavar="graph", help="YAML files, or names of shipped graphs"
    )
    add_changes(parser)
    add_json(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="print problems only")


def run(options: Namespace) -> int:
    """Check files, and report all problems of all of them."""
    from runtime.language import Model, Surroundings, diagnose

    surroundings = Surroundings(modules=not options.no_modules)
    change = (lambda graph: changed(graph, options)) if is_changed(options) else None
    problems: dict[str, list[str]] = {}
    diagnostics: dict[str, list[dict[str, Any]]] = {}
    missing: MissingExtraError | None = None
    for name in options.graphs:
        diagnostics[name] = []
        try:
            model = Model.of_file(name, surroundings, change)
            found = model.problems or _unsolvable(model)
        except GraphError as error:
            found = error.problems
        else:
            diagnostics[name] = [_plain(model, each) for each in diagnose(model)]
        problems[name] = [str(problem) for problem in found]
        if found:
            if not options.json:
                report(GraphError(found))
        elif model.checked_graph.missing is not None:
            missing = model.checked_graph.missing
            tell(missing)
        elif not (options.quiet or options.json):
            _show_fine(name, model, diagnose(model))
    if options.json:
        show_json({"schema_version": 1, "problems": problems, "diagnostics": diagnostics})
    if any(problems.values()):
        return 2
    return 0 if missing is None else missing.exit_code


def _unsolvable(model: Model) -> list[Problem]:
    """What is wrong with weights that are solved when a run begins: a system may be singular."""
    network = model.network
    if model.kind != "graph" or network is None or model.checked_graph.missing is not None:
        return []
    if not any(network.publications(name) for name in network.entries):
        return []
    from runtime.engine import Engine, Program
    from runtime.observation import Observation

    return Engine(Program(network, Observation()), network.seed).solve()


def _show_fine(name: str, model: Model, notes: list[Diagnostic]) -> None:
    """Say what a file without problems is, and what was noted about it."""
    for note in notes:
        tell(f"note: {note.address}: {note.message}" if note.address else f"note: {note.message}")
    network = model.network
    if network is None:
        show(f"{name}: fine ({model.kind})")
    elif model.kind == "graph":
        blocks, wires = len(network.entries), len(network.wires)
        show(f"{name}: fine ({blocks} blocks, {wires} wires, {network.ticks} ticks)")
    elif model.kind == "part":
        show(f"{name}: fine (part)")
    else:
        command = f"runtime validate GRAPH --with {name}"
        show(f"{name}: fine (overlay; check it on a graph with: {command})")


def _plain(model: Model, found: Diagnostic) -> dict[str, Any]:
    """A diagnostic with the lines and columns, from 1, where it begins and ends."""
    start, end = (model.text.where(offset, model.file) for offset in found.span)
    return {
        "file": model.file,
        "start": [start.line, start.column],
        "end": [end.line, end.column],
        "severity": found.severity,
        "address": found.address,
        "message": found.message,
        "kind": found.kind,
        "fixes": [plain_fix(fix) for fix in found.fixes],
        "related": [{"where": str(each.where), "message": each.message} for each in found.related],
    }
