"""The layered layout of boxes and wires, from left to right as control engineers draw it.

In: cells and links. Out: a :class:`DiagramLayout`; the cells' pins are sorted in place.
The steps are Sugiyama's: open the loops, assign the boxes to columns, order each column so that
few wires cross, choose heights so that most wires are straight, and route the wires through the
channels between the columns. Here is step 5, the heights, by a linear programme (as in Gansner et
al. 1993, "A technique for drawing directed graphs"): medians of neighbours, the usual heuristic,
leave kinks where a wire could be straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from runtime.diagrams.layout.grid import Cell, Grid, Link, Pin, build_grid
from runtime.diagrams.layout.order import reduce_crossings
from runtime.diagrams.layout.wires import Point, WireRouter

BOX_GAP = 24.0
WIRE_GAP = 14.0
PASSING_WEIGHT = 8.0


@dataclass
class DiagramLayout:
    """The positions of all cells (their left top corners) and the corners of all wires.

    ``routes`` maps a link's index and one of its targets to the points from its source;
    ``feedback`` are those of them that run backwards.
    """

    width: float
    height: float
    positions: dict[str, Point]
    routes: dict[tuple[int, Pin], list[Point]]
    feedback: set[tuple[int, Pin]]


def arrange(cells: Sequence[Cell], links: Sequence[Link]) -> DiagramLayout:
    """Lay out cells and the links between them.

    The pins of cells that are not ``fixed`` are sorted in place, and cells of ``stretch`` get the
    width of their column.

    Parameters
    ----------
    cells : in the order in which they were written.
    links : the wires between their pins.
    """
    if not cells:
        return DiagramLayout(0.0, 0.0, {}, {}, set())
    grid = build_grid(cells, links)
    reduce_crossings(grid)
    _stretch(grid)
    tops = _heights(grid)
    router = WireRouter(grid, tops)
    positions = {cell.name: (router.left_of(cell.name), tops[cell.name]) for cell in cells}
    routes = {
        (i, target): router.route(i, target)
        for i, link in enumerate(links)
        for target in dict.fromkeys(link.targets)
    }
    feedback = {
        (wire.link, target)
        for wire in grid.feedback
        for pins in wire.targets.values()
        for target in pins
    }
    return DiagramLayout(router.width, router.height, positions, routes, feedback)


# Before the heights and the wires, which both depend on the width of the columns.
def _stretch(grid: Grid) -> None:
    for column in grid.columns:
        elastic = [grid.cells[name] for name in column if grid.cells[name].stretch]
        for cell in elastic:
            cell.width = max(other.width for other in elastic)


def _gap(above: Cell, below: Cell) -> float:
    return BOX_GAP if above.height and below.height else WIRE_GAP


def _heights(grid: Grid) -> dict[str, float]:
    """The tops of all cells that bend the wires least.

    A linear programme: the cost of a hop is its change in height, with a higher weight where it
    only passes a column, so that long wires are straight; cells of a column keep their order and
    distance. Among equal solutions, boxes are centred on those that they are wired to.
    """
    import numpy as np
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    index = {name: i for i, name in enumerate(grid.cells)}
    pulls = _pulls(grid)
    count = len(index) + len(pulls)
    entries: list[tuple[int, int, float]] = []
    bounds: list[float] = []

    def at_most(bound: float, *terms: tuple[int, float]) -> None:
        entries.extend((len(bounds), column, value) for column, value in terms)
        bounds.append(bound)

    cost = np.zeros(count + 1)
    # The cost is |top[left] + rise - top[right]|, which is no linear function: a variable k of its
    # own is bounded below by both signs of it, and minimised.
    for k, (left, right, rise, weight) in enumerate(pulls, len(index)):
        cost[k] = weight
        at_most(-rise, (index[left], 1.0), (index[right], -1.0), (k, -1.0))
        at_most(rise, (index[left], -1.0), (index[right], 1.0), (k, -1.0))
    # The last variable is the bottom of all: among equal solutions, the one with the lowest
    # diagram.
    cost[count] = 1e-3
    for column in grid.columns:
        for above, below in pairwise(grid.cells[name] for name in column):
            distance = above.height + _gap(above, below)
            at_most(-distance, (index[above.name], 1.0), (index[below.name], -1.0))
        last = grid.cells[column[-1]]
        at_most(-last.height, (index[last.name], 1.0), (count, -1.0))
    rows, columns, values = zip(*entries, strict=True)
    matrix = csr_array((values, (rows, columns)), shape=(len(bounds), count + 1))
    solution = linprog(cost, matrix, bounds, method="highs-ds").x
    # All distances are multiples of a half, and so are the vertices of the linear programme.
    return {name: round(2.0 * float(solution[i])) / 2.0 for name, i in index.items()}


def _pulls(grid: Grid) -> list[tuple[str, str, float, float]]:
    """Pairs of cells to align: both names, the height between their pins, and the weight."""
    pulls = []
    for hop in (hop for hops in grid.hops for hop in hops):
        left = grid.cells[hop.left[0]]
        for name, pin in hop.rights:
            right = grid.cells[name]
            weight = grid.links[hop.link].weight
            # A bend in the middle of a long wire is the hardest to follow (Gansner et al. weigh it
            # by 8, too).
            if left.passing and right.passing:
                weight *= PASSING_WEIGHT
            rise = left.output_y(hop.left[1]) - right.input_y(pin)
            pulls.append((left.name, name, rise, weight))
            # A fiftieth of the weight: decides among equal solutions only.
            if left.height and right.height:
                pulls.append((left.name, name, (left.height - right.height) / 2, 0.02 * weight))
    return pulls
