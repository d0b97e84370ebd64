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
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from blocks.core import FloatArray

# A set of columns is an int with a bit for each: unions of large sets cost next to nothing.
Columns = int
# The solvers that use a Jacobian.
IMPLICIT = frozenset({"rodas4"})


@dataclass(frozen=True)
class Coupling:
    """The structure of a Jacobian.

    count : of the colours. colours : of each state, (n,), from 0.
    pattern : row and column of each entry that may differ from zero, (m, 2).
    """

    count: int
    colours: FloatArray = field(repr=False)
    pattern: FloatArray = field(repr=False)

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
        return cls(len(taken), np.array(colours, dtype=float), entries)


def members(columns: Columns) -> Iterator[int]:
    """The columns of a set, in order."""
    while columns:
        lowest = columns & -columns
        yield lowest.bit_length() - 1
        columns ^= lowest
