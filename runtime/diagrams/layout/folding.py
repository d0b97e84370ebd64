"""A wide layout in rows, as a text is broken into lines: for the width of a page.

In: a layout that is one row, and a width. Out: the same in several rows. What crosses the border of
two rows goes on in a lane between them::

    a ─▶ b ─▶ c ─▶ d        a ─▶ b ─┐
                            ┌───────┘
                            └▶ c ─▶ d
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from runtime.diagrams.layout.grid import Cell, Pin
from runtime.diagrams.layout.layers import DiagramLayout
from runtime.diagrams.layout.wires import Point, simplify

PITCH = 6.0  # between lanes
ROW_GAP = 14.0  # between a lane and the row below it
EMPTY = 16.0  # of the height of a row, between wires and boxes
# Left of a column there are no tracks, only ends of wires with their arrows.
BEFORE = 9.0

Crossing = tuple[int, float]  # a link, and the height at which it crosses a border
Routes = Mapping[tuple[int, Pin], Sequence[Point]]


@dataclass
class _Row:
    """A part of the layout from one border to the next, and where it is in the folded one."""

    start: float
    end: float
    # Heights in the layout, and the same in the folded one, from which empty space is left out.
    heights: list[float] = field(default_factory=list)
    folded: list[float] = field(default_factory=list)
    # Wires that go on in the next row, from the lowest one upwards, and the y of the first lane.
    crossings: list[Crossing] = field(default_factory=list)
    lanes: float = 0.0

    def y(self, height: float) -> float:
        """A height of the layout in the folded one."""
        i = max(bisect_right(self.heights, height) - 1, 0)
        return self.folded[i] + height - self.heights[i]


def fold(layout: DiagramLayout, cells: Sequence[Cell], width: float) -> DiagramLayout:
    """Break a layout into rows that are as wide as given, as far as its cells allow.

    Parameters
    ----------
    layout : of these cells, in one row.
    width : of the rows with the lanes beside them (points). A cell that is wider stays whole.
    """
    side = PITCH
    # The lanes beside the rows take room, and with less room there may be more of them.
    for _ in range(4):
        rows = _rows(layout, cells, width - 2.0 * side)
        _find_crossings(rows, layout.routes)
        needed = PITCH * (1 + max((len(row.crossings) for row in rows), default=0))
        if needed <= side:
            break
        side = needed
    if len(rows) < 2:
        return layout
    _stack(rows, layout, cells)
    right = max(row.end - row.start for row in rows)
    positions = {}
    for name, (x, y) in layout.positions.items():
        row = _row_of(rows, x)
        positions[name] = (side + x - row.start, row.y(y))
    routes = {
        key: simplify(list(_fold(rows, key[0], points, side, right)))
        for key, points in layout.routes.items()
    }
    return DiagramLayout(
        right + 2.0 * side, rows[-1].folded[-1], positions, routes, layout.feedback
    )


def _rows(layout: DiagramLayout, cells: Sequence[Cell], width: float) -> list[_Row]:
    """The longest rows that fit into a width; borders are before columns that no cell crosses."""
    spans = [(layout.positions[c.name][0], layout.positions[c.name][0] + c.width) for c in cells]
    borders = sorted({left - BEFORE for left, _ in spans})
    borders = [x for x in borders if not any(low < x < high for low, high in spans)][1:]
    rows, start = [], 0.0
    while start + width < layout.width:
        later = [x for x in borders if x > start + BEFORE]
        if not later:
            break
        fits = [x for x in later if x <= start + width]
        end = fits[-1] if fits else later[0]
        rows.append(_Row(start, end))
        start = end
    return [*rows, _Row(start, layout.width)]


def _row_of(rows: Sequence[_Row], x: float) -> _Row:
    return next((row for row in rows if x < row.end), rows[-1])


def _find_crossings(rows: Sequence[_Row], routes: Routes) -> None:
    for row in rows[:-1]:
        found = {
            (link, y)
            for (link, _), points in routes.items()
            for (x, y), (to, _) in pairwise(points)
            if min(x, to) < row.end < max(x, to)
        }
        row.crossings = sorted(found, key=lambda crossing: (-crossing[1], crossing[0]))


def _stack(rows: Sequence[_Row], layout: DiagramLayout, cells: Sequence[Cell]) -> None:
    """Set the heights of the rows: each below the lanes of the one before."""
    y = 0.0
    for row in rows:
        spans = [
            (top, top + cell.height)
            for cell in cells
            for x, top in (layout.positions[cell.name],)
            if row.start <= x < row.end
        ]
        for points in layout.routes.values():
            for (x, top), (to, bottom) in pairwise(points):
                # Vertical lines become shorter with what is between their ends.
                if min(x, to) < row.end and max(x, to) > row.start:
                    spans += [(top, top), (bottom, bottom)]
        y = _close_up(row, spans, y)
        row.lanes = y + PITCH + 3.0
        y = row.lanes + PITCH * len(row.crossings) + ROW_GAP


def _close_up(row: _Row, spans: Sequence[tuple[float, float]], top: float) -> float:
    """Set the heights of a row that begins at ``top``, without large empty spaces; its bottom."""
    heights = sorted({y for span in spans for y in span})
    folded = [top]
    for above, below in pairwise(heights):
        is_within = any(low <= above and below <= high for low, high in spans)
        folded.append(folded[-1] + (below - above if is_within else min(below - above, EMPTY)))
    row.heights, row.folded = heights, folded
    return folded[-1]


def _fold(
    rows: Sequence[_Row], link: int, points: Sequence[Point], side: float, right: float
) -> Iterator[Point]:
    """A wire's corners, with those of the lanes wherever it crosses a border."""
    x, y = points[0]
    row = _row_of(rows, x)
    yield side + x - row.start, row.y(y)
    for to, below in points[1:]:
        forward = to > x
        between = rows[:-1] if forward else rows[-2::-1]
        for border in between:
            if min(x, to) < border.end < max(x, to):
                yield from _lane(rows, border, (link, y), side, right, forward)
        x, y = to, below
        # An end on a border cannot be: borders are before columns, where wires only pass.
        row = _row_of(rows, x)
        yield side + x - row.start, row.y(y)


def _lane(
    rows: Sequence[_Row], row: _Row, crossing: Crossing, side: float, right: float, forward: bool
) -> list[Point]:
    """The corners from the end of a row to the beginning of the next, or back."""
    i = row.crossings.index(crossing)
    count = len(row.crossings)
    after = rows[rows.index(row) + 1]
    y = row.lanes + PITCH * i
    # The lowest wire turns first and comes in last, so that lanes do not cross.
    outside, inside = side + right + PITCH * (i + 0.5), side - PITCH * (count - i - 0.5)
    corners = [
        (outside, row.y(crossing[1])),
        (outside, y),
        (inside, y),
        (inside, after.y(crossing[1])),
    ]
    return corners if forward else corners[::-1]
