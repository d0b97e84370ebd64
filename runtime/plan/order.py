"""The order of evaluation of a network, and its algebraic loops.

In go the calls that compute outputs, in any order; they come out with producers before consumers,
then by rate, then by name: of ``gain`` wired to ``clock``, ``clock.output`` before ``gain.output``.
A loop without a state is an error, or one operation that solves it: of ``sum`` and ``gain`` wired
to each other, one that looks for the value of ``sum.out`` that these two compute from itself.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import NamedTuple

from blocks.messages import InsertBlock, Message
from runtime.errors import NOWHERE, Problems, Where
from runtime.network import Wire
from runtime.plan.operations import Call, Solve

Wires = Mapping[tuple[str, str], Sequence[Wire]]


class Edge(NamedTuple):
    """What joins two calls: a wire, or a block that switches another."""

    source: str
    target: str
    where: Where


# Each producer with its consumers, by position, and the wire between them.
Edges = Sequence[Mapping[int, Edge]]


def ordered(calls: Sequence[Call], wires: Wires, solve: bool = False) -> list[Call | Solve]:
    """Producers before consumers; then by rate, by name, and as the block declares them.

    Parameters
    ----------
    calls : evaluations; those of one block in the order of their declaration.
    wires : the wires into each input.
    solve : whether algebraic loops become operations that solve them.

    Raises
    ------
    GraphError : naming every algebraic loop, or those that cannot be solved.
    """
    makes = {signal.key: i for i, call in enumerate(calls) for signal in call.outputs}
    edges: list[dict[int, Edge]] = [{} for _ in calls]
    for i, call in enumerate(calls):
        for switch in call.gate.switches:
            edges[makes[switch.key]][i] = Edge(str(switch), call.block, NOWHERE)
        for argument in call.arguments:
            # An output of the block itself has no wires: what it reads was there before.
            for wire in wires.get((call.block, argument.port), ()):
                producer = makes[wire.source.block, wire.source.port]
                edges[producer][i] = Edge(str(wire.source), wire.target, wire.where)
    ranks = [(call.gate.every, call.block, i) for i, call in enumerate(calls)]
    order = _sorted(edges, ranks)
    if len(order) == len(calls):
        return [calls[i] for i in order]
    loops = _loops(edges, ranks)
    _report(loops, calls, solve)
    # Each loop becomes one node, in the place of the first of its calls.
    place = {i: min(loop.calls) for loop in loops for i in loop.calls}
    joined: list[dict[int, Edge]] = [{} for _ in calls]
    for i, consumers in enumerate(edges):
        for j, edge in consumers.items():
            if (first := place.get(i, i)) != (second := place.get(j, j)):
                joined[first][second] = edge
    solved = {min(loop.calls): _solve(n, loop, edges, calls, ranks) for n, loop in enumerate(loops)}
    order = [i for i in _sorted(joined, ranks) if place.get(i, i) == i]
    return [solved.get(i, calls[i]) for i in order]


@dataclass(frozen=True)
class _Loop:
    """Calls that depend on each other, and one circle through them."""

    calls: frozenset[int]
    circle: Sequence[Edge]

    @property
    def path(self) -> str:
        return " ▸ ".join(f"{edge.source} ▸ {edge.target}" for edge in self.circle)


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


def _loops(edges: Edges, ranks: Sequence[tuple[int, str, int]]) -> list[_Loop]:
    """The algebraic loops, by the name of their first call."""
    import networkx as nx  # slow to load, so for loops only

    graph = nx.DiGraph()
    names = [rank[1:] for rank in ranks]
    for i, consumers in enumerate(edges):
        graph.add_edges_from((names[i], names[j], {"edge": e}) for j, e in consumers.items())
    loops = []
    for component in sorted(nx.strongly_connected_components(graph), key=min):
        inside = graph.subgraph(sorted(component))
        if len(component) > 1 or inside.number_of_edges():
            cycle = nx.find_cycle(inside, source=min(component))
            circle = [inside.edges[a, b]["edge"] for a, b in cycle]
            loops.append(_Loop(frozenset(i for _, i in component), circle))
    return loops


def _report(loops: Sequence[_Loop], calls: Sequence[Call], solve: bool) -> None:
    """Raise an error that names the loops, or those that cannot be solved."""
    problems = Problems()
    for loop in loops:
        gates = {calls[i].gate for i in loop.calls}
        if solve and len(gates) == 1:
            continue
        suggestion = "a UnitDelay on one of these wires breaks it"
        if not solve:
            suggestion += ", and run: {loops: solve} solves it at each tick"
        else:
            suggestion = f"its blocks are not all computed on the same ticks; {suggestion}"
        where = next((edge.where for edge in loop.circle if edge.where.file), NOWHERE)
        fixes = [InsertBlock("UnitDelay", edge.target) for edge in loop.circle if edge.where.line]
        message = f"algebraic loop: {loop.path}; {suggestion}"
        problems.add(where, "", Message(message, "algebraic-loop", fixes))
    problems.raise_any()


def _solve(
    number: int,
    loop: _Loop,
    edges: Edges,
    calls: Sequence[Call],
    ranks: Sequence[tuple[int, str, int]],
) -> Solve:
    """The operation that solves a loop, with few unknowns.

    Tearing (Elmqvist and Otter, Methods for tearing systems of equations in object-oriented
    modeling, 1994): the outputs of one call after the other count as known, of the call that most
    others in a loop read and are read by, until the rest has an order.
    """
    inner = sorted(loop.calls)
    index = {i: n for n, i in enumerate(inner)}
    left = [{index[j]: e for j, e in edges[i].items() if j in index} for i in inner]
    known: list[int] = []
    order: list[int] = []
    while len(order) < len(inner):
        # The numbers of a call's outputs count against it: each is an equation.
        awaited = Counter(consumer for consumers in left for consumer in consumers)
        waiting = [n for n in range(len(inner)) if n not in order and left[n]]
        best = max(
            waiting,
            key=lambda n: (len(left[n]) * awaited[n] / _width(calls[inner[n]]), -n),
        )
        known.append(best)
        left[best] = {}
        order = _sorted(left, [(1, ranks[i][1], index[i]) for i in inner])
    read = {signal.key for i in inner for signal in calls[i].reads}
    unknowns = [s for n in sorted(known) for s in calls[inner[n]].outputs if s.key in read]
    ordered_calls = tuple(calls[inner[n]] for n in order)
    return Solve(number, tuple(unknowns), ordered_calls, loop.path, ordered_calls[0].gate)


def _width(call: Call) -> int:
    """How many numbers a call computes."""
    return sum(math.prod(signal.kind.shape) for signal in call.outputs)
