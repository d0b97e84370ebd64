"""Checks of an experiment on its graph, before anything runs.

In: a factor, a design or the name of a metric, and a graph. Out: problems with their positions::

    vary: {draw.levl: [1]}
    ->  e.yaml:4:3: blocks.draw.levl: unknown parameter, did you mean 'level'?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from weakref import finalize

import numpy as np

from blocks.core import misspelt
from runtime.document import Node, full_path
from runtime.errors import GraphError, Problems, UsageError, Where
from runtime.experiments.design.factors import Factor
from runtime.experiments.design.sampling import Design
from runtime.graph import Graph

# Changed graphs in which nothing is wrong, by the id of the baseline: an editor asks again at each
# keystroke in the experiment's file, and each answer is a check of a whole graph. Graphs are
# compared by content and have no hash, so the id stands for a baseline as long as it exists.
_right: dict[int, dict[str, Node]] = {}


def check_change(baseline: Graph, name: str, changed: Graph) -> None:
    """Check a changed copy of a graph, once as long as both are the same.

    Raises
    ------
    GraphError, MissingExtraError : as :meth:`Graph.check`.
    """
    if id(baseline) not in _right:
        _right[id(baseline)] = {}
        finalize(baseline, _right.pop, id(baseline), None)
    right = _right[id(baseline)]
    if right.get(name) != changed.document:
        changed.check()
        if not changed.texts:  # a file that it names may change while the graph does not
            right[name] = changed.document


def check_factor(graph: Graph, factor: Factor, where: Where, problems: Problems) -> None:
    """Test a factor's values on a graph that has been checked itself."""
    if full_path(graph.document, factor.path) == "run.seed":
        problems.add(where, factor.path, "the seed is not a factor; seeds are varied by 'seeds'")
        return
    for value in factor.test_values():
        try:
            changed = graph.set(factor.path, value, origin=_ORIGIN)
            check_change(graph, f"vary {factor.path}={value!r}", changed)
        except GraphError as error:
            # a location that is only a string would not sort among the file's other locations.
            problems.items += [
                replace(problem, where=where) if problem.where.file == _ORIGIN else problem
                for problem in error.problems
            ]
            return


_ORIGIN = "a factor"  # not the position, which moves as the file is edited


def own_value(graph: Graph, path: str) -> object:
    """What a graph itself says at a path, or a block's default; None if it says nothing there."""
    network = graph.network
    names = full_path(graph.document, path).split(".")
    node: Node | None = network.document
    for name in names:
        if node is not None and node.is_list:
            node = (
                node.value[int(name)] if name.isdecimal() and int(name) < len(node.value) else None
            )
        elif node is not None:
            node = node.get(name) if node.is_map else None
    if node is not None:
        return node.plain()
    entry = network.entries.get(names[1]) if len(names) in (3, 4) else None
    if entry is None or names[0] != "blocks" or names[2] not in entry.cls.spec.params:
        return None
    value = np.asarray(entry.block.value(names[2]), dtype=object)
    if len(names) == 3:
        return value.tolist()
    index = int(names[3]) if names[3].isdecimal() else -1
    return value.tolist()[index] if value.ndim == 1 and 0 <= index < len(value) else None


def check_design(graph: Graph, design: Design) -> None:
    """Check that a design can be run.

    Raises
    ------
    UsageError : there is nothing to sample, a factor is duplicated, or a range has no steps.
    """
    if not design.factors and design.method != "grid":
        raise UsageError(f"there is nothing to sample for --{design.method}; add --vary PATH=RANGE")
    check_paths(graph, design.factors)
    for factor in design.factors:
        if design.method == "grid" and not factor.count:
            raise UsageError(
                f"{factor.path}={factor.written}: how many values? Write {factor.written}:5, "
                "or sample the ranges with --random N or --sobol N"
            )


def check_paths(graph: Graph, factors: Sequence[Factor]) -> None:
    """Check that no two factors are the same value, written as a full path and as a short one.

    Raises
    ------
    UsageError : two are.
    """
    paths = [full_path(graph.document, factor.path) for factor in factors]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise UsageError(f"'{factors[i].path}' is varied twice; keep one")


def check_metric(graph: Graph, name: str, where: Where, address: str, problems: Problems) -> None:
    """Check that a graph has a metric that an objective or a constraint names."""
    known = [metric.name for metric in graph.observation.metrics]
    if name not in known:
        has = ", ".join(known) or f"none; {graph.observation.metric_example(name)}"
        text = f"the graph has no metric '{name}'"
        message = misspelt("unknown-name", text, name, known, f"; it has {has}")
        problems.add(where, address, message)
