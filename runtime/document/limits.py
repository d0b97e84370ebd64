"""Limits on the work that a graph's text may cause, counted rather than timed.

In: trees, and steps of work as they are done. Out: nothing, or a GraphError that names the limit.
A few lines can expand to an enormous tree::

    a: {extends: [b, b]}    b: {extends: [c, c]}    c: ...    # n files merge 2^n times
    outer: {graph: part.yaml, params: {x: [$y, $y]}}          # so do parts within parts

Shared subtrees cost no memory until they are written out, so the expanded size of a tree is
measured before anything walks it. Counts, and not times: the same graph is refused everywhere.
"""

from __future__ import annotations

from typing import NoReturn

from blocks.core import StoredArray
from blocks.limits import GRAPH_ARRAYS, GRAPH_BLOCKS, GRAPH_LEVELS, GRAPH_WORK, size
from runtime.document.node import MAX_NODES, Node
from runtime.document.parse_errors import MAX_DEPTH
from runtime.errors import GraphError, Problem, Problems, Where

MAX_LEVELS, MAX_BLOCKS, MAX_WORK = GRAPH_LEVELS, GRAPH_BLOCKS, GRAPH_WORK
MAX_ARRAY_BYTES = GRAPH_ARRAYS
MAX_VALUE_DEPTH = 10  # of the value of a param; those of parts may hold those of parts around them
STEPS_OF_ITEM = 10  # a number in a list is checked, converted and copied wherever a param puts it


class Measure:
    """Expanded sizes and depths of trees; shared subtrees are visited once."""

    def __init__(self) -> None:
        # Holds the values as well, since an id is unique only while its object exists.
        self._known: dict[int, tuple[object, int, int]] = {}

    def of(self, node: Node) -> tuple[int, int]:
        """The number of values in a tree, and of levels below its root."""
        value = node.value
        if not isinstance(value, (dict, list)):
            return 1, 0
        entry = self._known.get(id(value))
        if entry is None:
            # Recursion is safe: no file is nested deeper than MAX_DEPTH, and files at most
            # MAX_LEVELS.
            items = value if isinstance(value, list) else value.values()
            inside = [
                self.of(item) if isinstance(item.value, (dict, list)) else (1, 0) for item in items
            ]
            size = 1 + sum(size for size, _ in inside)
            depth = 1 + max((depth for _, depth in inside), default=0)
            entry = self._known[id(value)] = (value, size, depth)
        return entry[1], entry[2]


class Work:
    """Counts the steps of reading and checking a graph; stops at a limit."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.measure = Measure()
        self.done = 0
        self.blocks = 0
        self.arrays: dict[StoredArray, int] = {}

    def check(self, node: Node, where: Where, address: str) -> None:
        """Refuse a tree that is too large or too deep to be written out and read again.

        Raises
        ------
        GraphError : with all problems found before.
        """
        size, depth = self.measure.of(node)
        if size > MAX_NODES:
            self.stop(where, address, f"expands to more than {MAX_NODES} values")
        if depth > MAX_DEPTH:
            self.stop(where, address, f"nested more than {MAX_DEPTH} deep")

    def charge(self, count: int, where: Where, address: str = "") -> None:
        """Count values to be read, merged or substituted.

        Raises
        ------
        GraphError : there are more than :data:`MAX_WORK`.
        """
        self.done += count
        if self.done > MAX_WORK:
            message = f"reading this graph takes more than {MAX_WORK} steps; extend, nest or repeat"
            self.stop(where, address, f"{message} less")

    def substitute(self, name: str, value: Node, where: Where, address: str) -> None:
        """Count the value of a param where it is used; a few lines can double it again and again.

        Raises
        ------
        GraphError : it is nested too deep, or too much was substituted before.
        """
        size, depth = self.measure.of(value)
        if depth > MAX_VALUE_DEPTH:
            self.stop(where, address, f"${name} is nested more than {MAX_VALUE_DEPTH} deep")
        self.charge(size * STEPS_OF_ITEM if depth else size, where, address)

    def block(self, where: Where, address: str) -> None:
        """Count a block.

        Raises
        ------
        GraphError : there are more than :data:`MAX_BLOCKS`.
        """
        self.blocks += 1
        if self.blocks > MAX_BLOCKS:
            self.stop(where, address, f"more than {MAX_BLOCKS} blocks, those of parts included")

    def array(self, array: StoredArray, where: Where, address: str) -> None:
        """Count an array that a graph holds in memory, however often it names it.

        Raises
        ------
        GraphError : all of them take more than :data:`MAX_ARRAY_BYTES`.
        """
        self.arrays[array] = array.values.nbytes
        if sum(self.arrays.values()) > MAX_ARRAY_BYTES:
            limit = size(MAX_ARRAY_BYTES)
            self.stop(where, address, f"the arrays of this graph take more than {limit}")

    @property
    def room(self) -> int:
        """How many bytes further arrays may take."""
        return MAX_ARRAY_BYTES - sum(self.arrays.values())

    def stop(self, where: Where, address: str, text: str) -> NoReturn:
        raise GraphError([*self.problems.items, Problem(where, address[:200], text, "too-large")])
