"""Step 4 of the layered layout: the order of cells within columns, so that few wires cross.

In: a :class:`Grid`. Out: its columns and pins, sorted in place. Sweeps from left to right and back
sort each column by the mean height (barycentre) of what its cells are wired to; then neighbours are
swapped while that helps. With a ─▶ y, b ─▶ x and the columns [a, b] [x, y], one sweep gives [y, x].
The fewest crossings are NP-hard to find, even for two columns (Garey and Johnson 1983).
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import defaultdict
from collections.abc import Iterable

from runtime.diagrams.layout.grid import Grid, Pin

# As many as Graphviz makes; PATIENCE ends earlier where nothing improves.
SWEEPS = 24
PATIENCE = 6
MAX_SWAP_WORK = 4000

Join = tuple[Pin | None, Pin | None]
Snapshot = tuple[list[list[str]], dict[str, tuple[list[str], list[str]]]]


def reduce_crossings(grid: Grid) -> None:
    """Order the cells of each column, and the pins of each cell, in place."""
    sorter = _Sorter(grid)
    best, fewest = sorter.snapshot(), sorter.total()
    # A second start from the mirrored order: sweeps end in a local minimum that depends on the
    # start.
    for upside_down in (False, True):
        if upside_down:
            for column in grid.columns:
                column.reverse()
        stale = 0
        for sweep in range(SWEEPS):
            sorter.sweep(rightwards=sweep % 2 == 0)
            sorter.swap()
            sorter.sort_all_pins()
            crossings = sorter.total()
            stale = 0 if crossings < fewest else stale + 1
            # Of equal ones the first sweeps' result: nearer to the order in which the author wrote
            # the blocks.
            if crossings < fewest or (crossings == fewest and sweep < 2 and not upside_down):
                best, fewest = sorter.snapshot(), crossings
            if fewest == 0 or stale > PATIENCE:
                break
    sorter.restore(best)


class _Sorter:
    """Counts crossings in a grid and moves its cells and pins."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.joins: list[list[Join]] = [list(grid.joins(c)) for c in range(len(grid.columns) + 1)]

    def snapshot(self) -> Snapshot:
        cells = self.grid.cells.values()
        pins = {cell.name: (list(cell.inputs), list(cell.outputs)) for cell in cells}
        return [list(column) for column in self.grid.columns], pins

    def restore(self, snapshot: Snapshot) -> None:
        columns, pins = snapshot
        for column, names in zip(self.grid.columns, columns, strict=True):
            column[:] = names
        for name, (inputs, outputs) in pins.items():
            self.grid.cells[name].inputs[:] = inputs
            self.grid.cells[name].outputs[:] = outputs

    def pin_heights(self, column: int, outputs: bool) -> dict[Pin | None, float]:
        """The height of each pin on one side of a column; None, below the column, is last."""
        if not 0 <= column < len(self.grid.columns):
            return {None: 0.0}
        names = self.grid.columns[column]
        heights: dict[Pin | None, float] = {None: float(len(names))}
        for i, name in enumerate(names):
            cell = self.grid.cells[name]
            pins = cell.outputs if outputs else cell.inputs
            for k, pin in enumerate(pins):
                heights[name, pin] = i + (k + 1) / (len(pins) + 1)
        return heights

    def crossings(self, channel: int) -> int:
        left, right = self.pin_heights(channel - 1, True), self.pin_heights(channel, False)
        # Wires sorted by their left end cross if their right ends are inverted: inversions are
        # counted by insertion into a sorted list, in n log n and not by comparing all pairs.
        ends: list[float] = []
        count = 0
        for _, end in sorted((left[a], right[b]) for a, b in self.joins[channel]):
            count += len(ends) - bisect_right(ends, end)
            insort(ends, end)
        return count

    def total(self) -> int:
        return sum(self.crossings(channel) for channel in range(len(self.joins)))

    def neighbours(self, column: int, leftwards: bool) -> dict[Pin, list[float]]:
        """For each pin on one side of a column, the heights of the pins that it is wired to."""
        partners: dict[Pin, list[float]] = defaultdict(list)
        if leftwards:
            heights = self.pin_heights(column - 1, True)
            for a, b in self.joins[column]:
                if b is not None:
                    partners[b].append(heights[a])
        else:
            heights = self.pin_heights(column + 1, False)
            for a, b in self.joins[column + 1]:
                if a is not None:
                    partners[a].append(heights[b])
        return partners

    def sweep(self, rightwards: bool) -> None:
        count = len(self.grid.columns)
        for column in range(count) if rightwards else range(count - 1, -1, -1):
            partners = self.neighbours(column, leftwards=rightwards)
            pulls: dict[str, list[float]] = defaultdict(list)
            for (name, _), heights in partners.items():
                pulls[name] += heights
            names = self.grid.columns[column]
            barycentre = {
                # A cell without wires on this side keeps its place.
                name: _mean(pulls[name]) if name in pulls else i + 0.5
                for i, name in enumerate(names)
            }
            names.sort(key=barycentre.__getitem__)
            self.sort_pins(column, leftwards=rightwards)
            beside = column - 1 if rightwards else column + 1
            if 0 <= beside < count:
                self.sort_pins(beside, leftwards=not rightwards)

    def sort_pins(self, column: int, leftwards: bool) -> None:
        partners = self.neighbours(column, leftwards)
        for name in self.grid.columns[column]:
            cell = self.grid.cells[name]
            pins = cell.inputs if leftwards else cell.outputs
            if len(pins) > 1 and not cell.fixed:
                barycentre = {pin: _mean(partners.get((name, pin), ())) for pin in pins}
                pins.sort(key=barycentre.__getitem__)

    def sort_all_pins(self) -> None:
        for column in range(len(self.grid.columns)):
            self.sort_pins(column, leftwards=True)
            self.sort_pins(column, leftwards=False)

    def swap(self) -> None:
        """Swap neighbours in a column if that reduces the crossings."""
        for column, names in enumerate(self.grid.columns):
            wires = len(self.joins[column]) + len(self.joins[column + 1])
            # Each swap counts the crossings of two channels; large columns keep what the sweeps
            # gave.
            if len(names) * wires > MAX_SWAP_WORK:
                continue
            before = self.crossings(column) + self.crossings(column + 1)
            for i in range(len(names) - 1):
                names[i], names[i + 1] = names[i + 1], names[i]
                after = self.crossings(column) + self.crossings(column + 1)
                if after < before:
                    before = after
                else:
                    names[i], names[i + 1] = names[i + 1], names[i]


def _mean(values: Iterable[float]) -> float:
    numbers = list(values)
    return sum(numbers) / len(numbers) if numbers else 0.0
