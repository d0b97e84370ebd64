"""Options that change a graph, applied in the order written."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace
from collections.abc import Iterable
from typing import TYPE_CHECKING

from runtime.arguments import add_no_modules
from runtime.cli.parser import CHANGES
from runtime.errors import UsageError

if TYPE_CHECKING:
    from runtime.graph import Graph


class _Change(Action):
    """Collects changes in the order written."""

    def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
        changes = [*(namespace.changes or []), (self.option_strings[0].lstrip("-"), values)]
        namespace.changes = changes


def add_graph(parser: ArgumentParser) -> None:
    """Declare the graph and the changes to it."""
    parser.add_argument("graph", help="a YAML file, or the name of a shipped graph")
    add_changes(parser)


def add_changes(parser: ArgumentParser, seed: bool = True, variants: bool = False) -> None:
    """Declare the changes alone; with ``variants``, also ``--variant``."""
    change = parser.add_argument_group(CHANGES)
    for flag, form, text in (
        ("--with", "GRAPH", "overlay a graph, or part of one, as 'extends' does"),
        ("--set", "PATH=YAML", "set an entry: blocks.lqr.q='[1, 1, 1]', params.v_r=2"),
        ("--wire", "INPUT=OUTPUT", "wire an input: lqr.error=error.state"),
        ("--without", "NAME[,NAME]", "remove blocks with their wires"),
        ("--bypass", "NAME[,NAME]", "wire what goes into blocks to where their output goes"),
        ("--replace", "NAME=TYPE[,...]", "replace a block by one of another type"),
        (
            "--discretize",
            "METHOD[,DT][:NAME,...]",
            "sample continuous blocks by tustin, zoh or matched: tustin,0.01:pid",
        ),
        (
            "--from",
            "RUN",
            "begin with the states that a run ended with, in blocks of the same name",
        ),
        (
            "--initial",
            "ADDRESS=RUN",
            "begin one block, or one of its states, as a run ended: snn.weights=runs/my/latest",
        ),
    ):
        change.add_argument(flag, action=_Change, metavar=form, help=text, dest="changes")
    if variants:
        message = "begin a variant with all changes up to the next --variant"
        parser.add_argument(
            "--variant", action=_Change, metavar="NAME", help=message, dest="changes"
        )
    if seed:
        change.add_argument("--seed", type=int, help="seed of the run")
    change.add_argument("--until", type=float, metavar="S", help="length of the run in seconds")
    add_no_modules(parser)
    change.add_argument(
        "--engine",
        help="python, compiled, checked (compiled, indices checked), or auto: compiled if faster",
    )


def is_changed(options: Namespace) -> bool:
    """Whether the command line changes the graph."""
    values = (options.changes, getattr(options, "seed", None), options.until, options.engine)
    return any(value is not None for value in values)


def changed_graph(name: str, options: Namespace) -> Graph:
    """The graph of a file or a shipped one, with the changes of the command line."""
    from runtime.graph import load

    return changed(load(name, modules=not options.no_modules), options)


def changed(graph: Graph, options: Namespace) -> Graph:
    """The graph with the changes of the command line, applied in the order written."""
    graph = with_changes(graph, options.changes or ())
    if getattr(options, "seed", None) is not None:
        graph = graph.set("run.seed", options.seed, origin="--seed")
    if options.until is not None:
        graph = graph.set("run.until", options.until, origin="--until")
    if options.engine is not None:
        graph = graph.set("run.engine", options.engine, origin="--engine")
    return graph


def with_changes(graph: Graph, changes: Iterable[tuple[str, str]]) -> Graph:
    """The graph with changes, each given as (kind, text)."""
    for kind, text in changes:
        graph = apply(graph, kind, text)
    return graph


def apply(graph: Graph, kind: str, text: str) -> Graph:
    """The graph with one change, as written after ``--kind``."""
    from runtime.document import parse_yaml

    origin = f"--{kind} {text}"
    if kind == "with":
        return graph.overlay(text)
    if kind in ("without", "bypass"):
        names = [name.strip() for name in text.split(",") if name.strip()]
        without: Graph = getattr(graph, kind)(*names, origin=origin)
        return without
    if kind == "replace":
        for item in text.split(","):
            name, equals, typed = item.partition("=")
            if not (equals and name.strip() and typed.strip()):
                raise UsageError(f"{origin}: expected NAME=TYPE, as in lqr=PathPID")
            graph = graph.replace(name.strip(), typed.strip(), origin=origin)
        return graph
    if kind == "discretize":
        head, _, rest = text.partition(":")
        method, _, step = (part.strip() for part in head.partition(","))
        try:
            dt = float(step) if step else None
        except ValueError:
            raise UsageError(f"{origin}: expected a step in s, as in tustin,0.01:pid") from None
        names = [name.strip() for name in rest.split(",") if name.strip()]
        return graph.discretized(method, dt, *names, origin=origin)
    if kind == "from":
        return graph.begin_from(text, origin=origin)
    path, equals, value = text.partition("=")
    if not equals:
        expected = "ADDRESS=RUN" if kind == "initial" else "PATH=VALUE"
        raise UsageError(f"{origin}: expected {expected}")
    if kind == "initial":
        return graph.begin_from(value, path.strip(), origin=origin)
    plain = parse_yaml(value, origin).plain()
    if kind == "set":
        return graph.set(path, plain, origin=origin)
    return graph.wire(path, plain, origin=origin)
