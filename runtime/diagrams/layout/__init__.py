"""A layered layout (Sugiyama's method) of cells and the links between them, left to right.

In: cells with pins, and links. Out: positions of the cells and corners of the wires. The steps, as
in K. Sugiyama, S. Tagawa, M. Toda (1981), "Methods for visual understanding of hierarchical system
structures", one module each::

    grid    1 break cycles, 2 assign columns (layers), 3 cut long wires with dummy cells
    order   4 order each column, so that few wires cross
    layers  5 assign heights, so that most wires are straight
    wires, tracks  6 route the wires at right angles between the columns
    folding 7 for the width of a page, break the layout into rows
"""

from runtime.diagrams.layout.folding import fold
from runtime.diagrams.layout.grid import Cell, Link, Pin, find_feedback
from runtime.diagrams.layout.layers import DiagramLayout, arrange
from runtime.diagrams.layout.wires import Point, simplify
