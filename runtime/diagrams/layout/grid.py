"""Steps 1 to 3 of the layered layout: feedback wires, columns, long wires cut into hops.

In: cells and links. Out: a :class:`Grid`. With a ─▶ b ─▶ c, a ─▶ c and the feedback c ─▶ a::

    columns: [a] [b, "1@1"] [c]      "1@1" is the gap where link 1, a ─▶ c, passes column 1
    feedback: c ─▶ a                 is routed below the boxes and does not count for the columns
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

Pin = tuple[str, str]
# Cuts that are tried per loop: each costs a search for components, and graphs have thousands of
# wires.
CANDIDATES = 40


@dataclass
class Cell:
    """A block, a part, an end of a wire at a frame, or the gap where a wire passes a column.

    ``inputs`` and ``outputs`` name the pins from top to bottom, ``input_ys`` and ``output_ys``
    their distances below the cell's top. Pins are reordered unless the cell is ``fixed``.
    ``edge`` keeps a cell in the first ("left") or last ("right") column; cells of ``stretch``
    get the width of the widest one in their column.
    """

    name: str
    width: float = 0.0
    height: float = 0.0
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    input_ys: list[float] = field(default_factory=list)
    output_ys: list[float] = field(default_factory=list)
    fixed: bool = False
    stretch: bool = False
    edge: str = ""
    passing: bool = False

    def input_y(self, pin: str) -> float:
        return self.input_ys[self.inputs.index(pin)]

    def output_y(self, pin: str) -> float:
        return self.output_ys[self.outputs.index(pin)]


@dataclass(frozen=True)
class Link:
    """One output and all inputs that it drives.

    ``breaks_loop`` is true for an output without direct feedthrough, where a loop is best opened;
    ``label`` is the width of the label at the start of the wire.
    """

    source: Pin
    targets: tuple[Pin, ...]
    weight: float = 1.0
    breaks_loop: bool = False
    label: float = 0.0


@dataclass
class Hop:
    """A link's step from one column to the next, which has the index ``channel``."""

    link: int
    channel: int
    left: Pin
    rights: list[Pin]


@dataclass
class FeedbackWire:
    """A link that runs back, from the column of its source to the columns of earlier targets."""

    link: int
    source: Pin
    column: int
    targets: dict[int, list[Pin]]

    @property
    def first(self) -> int:
        return min(self.targets)


@dataclass
class Grid:
    """Cells in columns, the hops between them, and the feedback wires that run below them."""

    cells: dict[str, Cell]
    links: Sequence[Link]
    columns: list[list[str]]
    hops: list[list[Hop]]
    feedback: list[FeedbackWire]
    column_of: dict[str, int]

    def joins(self, channel: int) -> Iterator[tuple[Pin | None, Pin | None]]:
        """The pins that a channel joins; None is the end of a feedback wire below the columns."""
        for hop in self.hops[channel]:
            for right in hop.rights:
                yield hop.left, right
        for wire in self.feedback:
            if wire.column + 1 == channel:
                yield wire.source, None
            for right in wire.targets.get(channel, ()):
                yield None, right


def find_feedback(names: Sequence[str], links: Sequence[Link]) -> set[tuple[int, str]]:
    """Choose the wires that run backwards, so that all others run from left to right.

    Loops are opened preferably at outputs without direct feedthrough, where one cut opens most of
    them, and where the wire leads to a block that was written earlier.

    Parameters
    ----------
    names : the cells, in the order in which they were written.
    links : the wires between them.

    Returns
    -------
    Pairs of a link's index and the cell that it leads back to.
    """
    import networkx as nx

    order = {name: i for i, name in enumerate(names)}
    graph = nx.MultiDiGraph()
    graph.add_nodes_from(names)
    for i, link in enumerate(links):
        graph.add_edges_from((link.source[0], name, i) for name in dict(link.targets))
    back = {(i, v) for u, v, i in graph.edges(keys=True) if u == v}
    graph.remove_edges_from([(v, v, i) for i, v in back])
    cuts: list[tuple[int, str]] = []
    # A greedy cut. The smallest set of feedback wires is NP-hard to find, and not even wanted:
    # engineers draw a loop as going back where a state breaks it, and not where the cut is
    # cheapest.
    while components := [k for k in nx.strongly_connected_components(graph) if len(k) > 1]:
        for component in sorted(components, key=lambda k: min(map(order.__getitem__, k))):
            inside = graph.subgraph(component).copy()
            best = _best_cut(inside, links, order)
            cut = [(u, v, i) for u, v, i in inside.edges(keys=True) if i == best]
            graph.remove_edges_from(cut)
            cuts += [(best, v) for _, v, _ in cut]
    # Sorted, since the edges of a subgraph are listed in no particular order.
    for i, name in sorted(cuts, key=lambda o: (o[0], order[o[1]])):
        source = links[i].source[0]
        # A wire whose loop was opened by a later cut runs forward again.
        if nx.has_path(graph, name, source):
            back.add((i, name))
        else:
            graph.add_edge(source, name, key=i)
    return back


def _best_cut(component: Any, links: Sequence[Link], order: dict[str, int]) -> int:
    """The link whose removal opens most of the loops in a strongly connected graph."""
    import networkx as nx

    wires: dict[int, list[tuple[str, str, int]]] = defaultdict(list)
    for u, v, i in component.edges(keys=True):
        wires[i].append((u, v, i))

    # Ties: an output without feedthrough, then the wire that leads furthest back in the author's
    # order.
    def forwardness(i: int) -> tuple[bool, int, int]:
        leap = min(order[v] for _, v, _ in wires[i]) - order[links[i].source[0]]
        return not links[i].breaks_loop, leap, i

    def left_over(i: int) -> tuple[bool, int, int, tuple[bool, int, int]]:
        component.remove_edges_from(wires[i])
        rest = sum(len(k) for k in nx.strongly_connected_components(component) if len(k) > 1)
        component.add_edges_from(wires[i])
        return not links[i].breaks_loop, rest, len(wires[i]), forwardness(i)

    return min(sorted(wires, key=forwardness)[:CANDIDATES], key=left_over)


# Each wire u ─▶ v demands column(v) >= column(u) + 1; the sum of the lengths is minimised. The
# longest path from a source, the usual shortcut, puts every source into the first column, far from
# what it drives.
def _ranks(names: Sequence[str], wires: Sequence[tuple[str, str]]) -> dict[str, int]:
    """The columns that minimise the total length of the wires; each leads to a later column.

    The vertices of the linear programme are integers, and the simplex method ends in one.
    """
    import numpy as np
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    index = {name: i for i, name in enumerate(names)}
    # A small cost per column moves cells to the left where the wires leave a choice.
    cost = np.full(len(names), 1e-3)
    rows, columns, values = [], [], []
    for row, (u, v) in enumerate(wires):
        cost[index[v]] += 1.0
        cost[index[u]] -= 1.0
        rows += [row, row]
        columns += [index[u], index[v]]
        values += [1.0, -1.0]
    if not wires:
        return dict.fromkeys(names, 0)
    matrix = csr_array((values, (rows, columns)), shape=(len(wires), len(names)))
    solution = linprog(cost, matrix, -np.ones(len(wires)), method="highs-ds")
    return {name: round(solution.x[i]) for name, i in index.items()}


def build_grid(cells: Sequence[Cell], links: Sequence[Link]) -> Grid:
    """Put cells into columns and cut the links into hops from column to column."""
    by_name = {cell.name: cell for cell in cells}
    inner = [cell.name for cell in cells if not cell.edge]
    back = find_feedback([cell.name for cell in cells], links)
    wires = dict.fromkeys(
        (link.source[0], name)
        for i, link in enumerate(links)
        for name, _ in link.targets
        if (i, name) not in back and not by_name[link.source[0]].edge and not by_name[name].edge
    )
    # Ends of wires at a frame are left out: they belong to the first and the last column in any
    # case.
    ranks = _ranks(inner, list(wires))
    first = 1 if any(cell.edge == "left" for cell in cells) else 0
    last = max(ranks.values(), default=-1) + 1 + first
    at_edge = {"left": 0, "right": last}
    column_of = {
        cell.name: at_edge[cell.edge] if cell.edge else ranks[cell.name] + first for cell in cells
    }
    columns: list[list[str]] = [[] for _ in range(max(column_of.values()) + 1)]
    for cell in cells:
        columns[column_of[cell.name]].append(cell.name)
    hops: list[list[Hop]] = [[] for _ in range(len(columns) + 1)]
    grid = Grid(by_name, links, columns, hops, [], column_of)
    for i, link in enumerate(links):
        _add_link(grid, i, link, back)
    return grid


def _add_link(grid: Grid, i: int, link: Link, back: set[tuple[int, str]]) -> None:
    """Cut a link into hops, with a cell of its own in each column that it passes."""
    column = grid.column_of[link.source[0]]
    forward: dict[int, list[Pin]] = defaultdict(list)
    backward: dict[int, list[Pin]] = defaultdict(list)
    for target in link.targets:
        side = backward if (i, target[0]) in back else forward
        side[grid.column_of[target[0]]].append(target)
    if backward:
        grid.feedback.append(FeedbackWire(i, link.source, column, dict(backward)))
    left = link.source
    for channel in range(column + 1, max(forward, default=column) + 1):
        hop = Hop(i, channel, left, forward[channel])
        grid.hops[channel].append(hop)
        if channel < max(forward):
            # A dummy cell, so that orders and heights treat a passing wire like a box of height 0.
            name = f"{i}@{channel}"
            grid.cells[name] = Cell(name, 0.0, 0.0, [""], [""], [0.0], [0.0], passing=True)
            grid.columns[channel].append(name)
            grid.column_of[name] = channel
            left = (name, "")
            hop.rights.append(left)
