"""Which rate of change depends on which continuous state, for a solver that needs the Jacobian.

In goes a set of columns for each row, out comes a :class:`Coupling`. Of a rod in three pieces with
x_0' = x_1 - 2 x_0, x_1' = x_0 - 2 x_1 + x_2, x_2' = x_1 - 2 x_2, the pattern and the colours are

    x x .     0 1 2
    x x x
    . x x

A fourth piece would have colour 0 again: no rate contains x_0 and x_3, so that one evaluation with
both moved gives two columns of the Jacobian (Curtis, Powell and Reid 1974). What depends on what
is read from wires and blocks (:func:`.passes.coupled`), never from numbers, which may be zero by
chance.

Two species that diffuse, in the order a_0, a_1, ..., b_0, b_1, ..., have entries a whole species
away from the diagonal. In the order a_0, b_0, a_1, b_1, ... the band has a width of 2. Such an
order is found by reverse Cuthill-McKee, and is taken for the linear algebra alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import or_

import numpy as np

from blocks.core import FloatArray

# A set of columns is an int with a bit for each: unions of large sets cost next to nothing.
Columns = int


@dataclass(frozen=True)
class Coupling:
    """The structure of a Jacobian.

    count : of the colours. colours : of each state, (n,), from 0.
    pattern : row and column of each entry that may differ from zero, (m, 2).
    places : of each state, (n,): its row and column in the matrix that is factored.
    """

    count: int
    colours: FloatArray = field(repr=False)
    pattern: FloatArray = field(repr=False)
    places: FloatArray = field(repr=False)

    @property
    def band(self) -> int:
        """How far from the diagonal the matrix that is factored has entries."""
        return int(np.abs(np.diff(self.places[self.pattern.astype(int)])).max(initial=0))

    @classmethod
    def of(cls, rows: Sequence[Columns]) -> Coupling:
        """The coupling of n rows, each with the columns of its entries."""
        columns = [0] * len(rows)
        pattern = []
        for r, row in enumerate(rows):
            for c in members(row):
                pattern.append((r, c))
                columns[c] |= 1 << r
        colours: list[int] = []
        taken: list[Columns] = []  # of each colour, the rows that have an entry of it
        for column in columns:
            free = (i for i, rows_of in enumerate(taken) if not rows_of & column)
            colour = next(free, len(taken))
            if colour == len(taken):
                taken.append(0)
            taken[colour] |= column
            colours.append(colour)
        # Floats, as all arrays of the solver are.
        entries = np.array(pattern, dtype=float).reshape(-1, 2)
        places = np.arange(len(rows), dtype=float)
        return cls(len(taken), np.array(colours, dtype=float), entries, places)._narrowed(
            [(row | columns[i]) & ~(1 << i) for i, row in enumerate(rows)]
        )

    def _narrowed(self, neighbours: Sequence[Columns]) -> Coupling:
        """In another order of the states, if its band is less than half as wide.

        Another order changes the rounding, which a little less work is not worth. Of a state and
        its k neighbours, two are at least k / 2 apart in any order: that settles full matrices.
        """
        if max((each.bit_count() for each in neighbours), default=0) >= self.band:
            return self
        places = np.empty(len(neighbours))
        places[cuthill_mckee(neighbours)] = np.arange(len(neighbours))
        other = replace(self, places=places)
        return other if 2 * other.band < self.band else self


def cuthill_mckee(neighbours: Sequence[Columns]) -> list[int]:
    """The states in an order in which neighbours are near each other (reverse Cuthill-McKee).

    Each state is followed by those of its neighbours that are left, of which those with few
    neighbours come first. Of equals the first one is taken, so that the order is the same on every
    machine.
    """
    degrees = [each.bit_count() for each in neighbours]
    order: list[int] = []
    left = (1 << len(neighbours)) - 1
    for state in sorted(range(len(neighbours)), key=degrees.__getitem__):
        if not left >> state & 1:
            continue
        # The order goes on at the end of what it has added.
        done = len(order)
        order.append(_outermost(state, neighbours, degrees))
        left &= ~(1 << order[done])
        while done < len(order):
            near = neighbours[order[done]] & left
            order += sorted(members(near), key=degrees.__getitem__)
            left &= ~near
            done += 1
    return order[::-1]


def _outermost(state: int, neighbours: Sequence[Columns], degrees: Sequence[int]) -> int:
    """A state at an end of what is connected to a state (George and Liu 1979)."""
    depth = -1
    while True:
        count, seen, level = 0, 1 << state, 1 << state
        while following := reduce(or_, (neighbours[i] for i in members(level))) & ~seen:
            count, seen, level = count + 1, seen | following, following
        if count <= depth:
            return state
        depth, state = count, min(members(level), key=degrees.__getitem__)


def members(columns: Columns) -> Iterator[int]:
    """The columns of a set, in order."""
    while columns:
        lowest = columns & -columns
        yield lowest.bit_length() - 1
        columns ^= lowest
