"""Lists of seeds as users write them: ``0..9``, ``3``, ``0,4,7..9``.

In: an integer, a string or a list of those. Out: :class:`Seeds`, which holds ranges, not numbers::

    0,4,7..9  ->  ranges (0, 0), (4, 4), (7, 9); five seeds
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from runtime.document import Node
from runtime.errors import Problems

_PART = re.compile(r"\s*([0-9]{1,18})\s*(?:\.\.\s*([0-9]{1,18})\s*)?")
EXPECTED = "expected seeds such as 0..9, 3 or 0,4,7..9"


@dataclass(frozen=True)
class Seeds:
    """Seeds in the order written, as ranges (first, last)."""

    ranges: tuple[tuple[int, int], ...]

    def __iter__(self) -> Iterator[int]:
        for first, last in self.ranges:
            yield from range(first, last + 1)

    def __len__(self) -> int:
        return sum(last - first + 1 for first, last in self.ranges)

    def __str__(self) -> str:
        return ",".join(f"{a}..{b}" if b > a else str(a) for a, b in self.ranges)


def parse_seeds(node: Node, address: str, problems: Problems) -> Seeds | None:
    """The seeds that a value describes; None and a problem if it is invalid.

    Parameters
    ----------
    node : an integer, a string such as ``0..9,12``, or a list of those.
    """
    ranges: list[tuple[int, int]] = []
    for item in node.value if node.is_list else [node]:
        parsed = _ranges(item.value)
        if parsed is None:
            problems.add(item.where, address, f"{EXPECTED}, got {item.describe()}")
            return None
        ranges += parsed
    message = _wrong(ranges)
    if message:
        problems.add(node.where, address, f"{EXPECTED}; {message}")
        return None
    return Seeds(tuple(ranges))


def _ranges(value: object) -> list[tuple[int, int]] | None:
    if isinstance(value, bool) or not isinstance(value, (int, str)):
        return None
    ranges = []
    for part in str(value).split(","):
        match = _PART.fullmatch(part)
        if match is None:
            return None
        ranges.append((int(match[1]), int(match[2] or match[1])))
    return ranges


def _wrong(ranges: list[tuple[int, int]]) -> str:
    if not ranges:
        return "the list is empty"
    for first, last in ranges:
        if last < first:
            return f"{first}..{last} is empty"
    ordered = sorted(ranges)
    for (_, last), (first, _) in pairwise(ordered):
        if first <= last:
            return f"duplicate seed {first}"
    return ""
