"""The order of evaluation of a network, and its algebraic loops.

In go the calls that compute outputs, in any order; they come out with producers before consumers,
then by rate, then by name: of ``gain`` wired to ``clock``, ``clock.output`` before ``gain.output``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from heapq import heapify, heappop, heappush

from runtime.errors import NOWHERE, Problems, Where
from runtime.network import Wire
from runtime.plan.operations import Call

Wires = Mapping[tuple[str, str], Sequence[Wire]]
# Each producer with its consumers, by position, and the wire between them in words, with its place.
Edges = Sequence[Mapping[int, tuple[str, Where]]]


def ordered(calls: Sequence[Call], wires: Wires) -> list[Call]:
    """Producers before consumers; then by rate, by name, and as the block declares them.

    Parameters
    ----------
    calls : evaluations; those of one block in the order of their declaration.
    wires : the wires into each input.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """
    makes = {signal.key: i for i, call in enumerate(calls) for signal in call.outputs}
    edges: list[dict[int, tuple[str, Where]]] = [{} for _ in calls]
    for i, call in enumerate(calls):
        for switch in call.gate.switches:
            edges[makes[switch.key]][i] = (f"{switch} ▸ {call.block}", NOWHERE)
        for argument in call.arguments:
            # An output of the block itself has no wires: what it reads was there before.
            for wire in wires.get((call.block, argument.port), ()):
                producer = makes[wire.source.block, wire.source.port]
                edges[producer][i] = (f"{wire.source} ▸ {wire.target}", wire.where)
    order = _sorted(edges, [(call.gate.every, call.block, i) for i, call in enumerate(calls)])
    if len(order) < len(calls):
        _report_loops(edges, calls)
    return [calls[i] for i in order]


def _sorted(edges: Edges, ranks: Sequence[tuple[int, str, int]]) -> list[int]:
    """Producers before consumers, lowest rank first; what is in or behind a loop is left out."""
    awaited = Counter(consumer for consumers in edges for consumer in consumers)
    ready = [rank for rank in ranks if not awaited[rank[-1]]]
    heapify(ready)
    order = []
    while ready:
        *_, i = heappop(ready)
        order.append(i)
        for consumer in edges[i]:
            awaited[consumer] -= 1
            if not awaited[consumer]:
                heappush(ready, ranks[consumer])
    return order


def _report_loops(edges: Edges, calls: Sequence[Call]) -> None:
    import networkx as nx  # slow to load, so for loops only

    graph = nx.DiGraph()
    names = [(call.block, i) for i, call in enumerate(calls)]
    for i, consumers in enumerate(edges):
        graph.add_edges_from((names[i], names[j], {"edge": e}) for j, e in consumers.items())
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
