"""A layered layout (Sugiyama's method) of cells and the links between them, left to right."""

from runtime.diagrams.layout.grid import Cell, Link, Pin, find_feedback
from runtime.diagrams.layout.layers import DiagramLayout, arrange
from runtime.diagrams.layout.wires import Point, simplify

__all__ = ["Cell", "DiagramLayout", "Link", "Pin", "Point", "arrange", "find_feedback", "simplify"]
