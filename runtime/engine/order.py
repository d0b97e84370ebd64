"""The order of evaluation of a network, and its algebraic loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from runtime.engine.steps import Step, drivers
from runtime.errors import NOWHERE, Problems
from runtime.network import Network


def ordered_steps(network: Network, enables: Mapping[str, Sequence[str]]) -> list[Step]:
    """Producers before consumers; then by rate, then by name.

    Parameters
    ----------
    enables : the blocks that switch each block; they come before what they switch.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """
    import networkx as nx

    wires = drivers(network)
    makes: dict[tuple[str, str], tuple[str, int]] = {}
    steps: dict[tuple[str, int], Step] = {}
    graph = nx.DiGraph()
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        for i, evaluation in enumerate(entry.evaluations):
            constant = spec.is_constant(evaluation)
            # What depends on states alone needs no switch: they hold.
            varies = bool(evaluation.needs) or evaluation.timed
            switched = tuple(enables.get(name, ())) if varies and not constant else ()
            steps[name, i] = Step(name, evaluation, entry.every, constant, switched)
            graph.add_node((name, i))
            makes.update({(name, port): (name, i) for port in evaluation.outputs})
    for (name, i), step in steps.items():
        for enable in step.enables:
            edge = (f"{enable}.on ▸ {name}", NOWHERE)
            graph.add_edge(makes[enable, "on"], (name, i), edge=edge)
        for port in step.evaluation.needs:
            for wire in wires.get((name, port), ()):
                source = makes[wire.source.block, wire.source.port]
                edge = (f"{wire.source} ▸ {wire.target}", wire.where)
                graph.add_edge(source, (name, i), edge=edge)
    if not nx.is_directed_acyclic_graph(graph):
        _report_loops(graph)
    ranked = {key: (step.every, *key) for key, step in steps.items()}
    order = nx.lexicographical_topological_sort(graph, key=ranked.__getitem__)
    return [steps[key] for key in order]


def _report_loops(graph: Any) -> None:
    import networkx as nx

    problems = Problems()
    for component in nx.strongly_connected_components(graph):
        inside = graph.subgraph(sorted(component))
        if len(component) > 1 or inside.number_of_edges():
            cycle = nx.find_cycle(inside, source=min(component))
            edges = [inside.edges[a, b]["edge"] for a, b in cycle]
            path = " ▸ ".join(text for text, _ in edges)
            message = f"algebraic loop: {path}; a UnitDelay on one of these wires breaks it"
            where = next((where for _, where in edges if where.file), NOWHERE)
            problems.add(where, "", message)
    problems.raise_any()
