"""The order of evaluation of a network, and its algebraic loops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from heapq import heapify, heappop, heappush

from runtime.engine.steps import Step, drivers
from runtime.errors import NOWHERE, Problems, Where
from runtime.network import Network

Key = tuple[str, int]  # a block and the number of its evaluation
Edges = Mapping[Key, Mapping[Key, tuple[str, Where]]]


def ordered_steps(network: Network, enables: Mapping[str, Sequence[str]]) -> list[Step]:
    """Producers before consumers; then by rate, then by name.

    Parameters
    ----------
    enables : the blocks that switch each block; they come before what they switch.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """
    wires = drivers(network)
    makes: dict[tuple[str, str], Key] = {}
    steps: dict[Key, Step] = {}
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        for i, evaluation in enumerate(entry.evaluations):
            constant = spec.is_constant(evaluation)
            # What depends on states alone needs no switch: they hold.
            varies = bool(evaluation.needs) or evaluation.timed
            switched = tuple(enables.get(name, ())) if varies and not constant else ()
            steps[name, i] = Step(name, evaluation, entry.every, constant, switched)
            makes.update({(name, port): (name, i) for port in evaluation.outputs})
    # Each producer with its consumers, and the wire between them in words, with its place.
    edges: dict[Key, dict[Key, tuple[str, Where]]] = {key: {} for key in steps}
    for (name, i), step in steps.items():
        for enable in step.enables:
            edges[makes[enable, "on"]][name, i] = (f"{enable}.on ▸ {name}", NOWHERE)
        for port in step.evaluation.needs:
            for wire in wires.get((name, port), ()):
                source = makes[wire.source.block, wire.source.port]
                edges[source][name, i] = (f"{wire.source} ▸ {wire.target}", wire.where)
    order = _sorted(edges, {key: (step.every, *key) for key, step in steps.items()})
    if len(order) < len(steps):
        _report_loops(edges)
    return [steps[key] for key in order]


def _sorted(edges: Edges, rank: Mapping[Key, tuple[int, str, int]]) -> list[Key]:
    """Producers before consumers, lowest rank first; what is in or behind a loop is left out."""
    awaited = Counter(consumer for consumers in edges.values() for consumer in consumers)
    ready = [(rank[key], key) for key in edges if not awaited[key]]
    heapify(ready)
    order = []
    while ready:
        _, key = heappop(ready)
        order.append(key)
        for consumer in edges[key]:
            awaited[consumer] -= 1
            if not awaited[consumer]:
                heappush(ready, (rank[consumer], consumer))
    return order


def _report_loops(edges: Edges) -> None:
    import networkx as nx  # slow to load, so for loops only

    graph = nx.DiGraph()
    for source, consumers in edges.items():
        graph.add_edges_from((source, key, {"edge": edge}) for key, edge in consumers.items())
    problems = Problems()
    for component in nx.strongly_connected_components(graph):
        inside = graph.subgraph(sorted(component))
        if len(component) > 1 or inside.number_of_edges():
            cycle = nx.find_cycle(inside, source=min(component))
            found = [inside.edges[a, b]["edge"] for a, b in cycle]
            path = " ▸ ".join(text for text, _ in found)
            message = f"algebraic loop: {path}; a UnitDelay on one of these wires breaks it"
            where = next((where for _, where in found if where.file), NOWHERE)
            problems.add(where, "", message)
    problems.raise_any()
