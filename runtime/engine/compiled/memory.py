"""Memory that compiled code and Python share: words of eight bytes in NumPy arrays.

In go values in the order of a struct's members, out comes the address of a struct that has them::

    words.fill((2.0, np.zeros((3, 100))))     2.0, the address of the array, 100

A size up to 3 is part of the text, and so no word.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from runtime.compiler import bits_of, written

ARENA = 1 << 28  # bytes of address space for a tick's local arrays; memory is used when touched
# The members of struct context, see support.h.
CONTEXT: tuple[str, ...] = (
    "resume",
    "failure",
    "index",
    "size",
    "axis",
    "arena",
    "arena_size",
    "arena_used",
)
CONTEXT += ("arena_most", "tick", "at")


class Words:
    """Numbers and addresses, one after the other, and the objects that the addresses belong to."""

    def __init__(self, size: int) -> None:
        self.ints = np.zeros(max(1, size), dtype=np.int64)
        self.floats = self.ints.view(np.float64)
        self.kept: list[Any] = []

    @property
    def address(self) -> int:
        return int(self.ints.ctypes.data)

    def point(self, at: int, target: np.ndarray[Any, Any]) -> None:
        """Store the address of an array's data."""
        self.ints[at] = target.ctypes.data
        self.kept.append(target)

    def fill(self, values: tuple[Any, ...]) -> None:
        """Store a block's fields in the order of its struct."""
        self.kept.clear()
        for at, value in enumerate(flattened(values)):
            if isinstance(value, float):
                self.floats[at] = value
            elif isinstance(value, int):
                self.ints[at] = value
            elif isinstance(value, np.random.Generator):
                self.point(at, bits_of(value, "a generator"))
                self.kept.append(value)
            else:
                self.point(at, value)


def flattened(values: tuple[Any, ...]) -> Iterator[Any]:
    """The values in nested tuples; an array is followed by the sizes that no text tells."""
    for value in values:
        if isinstance(value, tuple):
            yield from flattened(value)
            continue
        yield value
        if isinstance(value, np.ndarray):
            sizes = zip(value.shape, written(value.shape), strict=True)
            yield from (size for size, known in sizes if known is None)


class Context(Words):
    """The struct context of one run."""

    def __init__(self) -> None:
        super().__init__(len(CONTEXT))
        self.arena = np.empty(ARENA, dtype=np.uint8)
        self.begin()

    def begin(self) -> None:
        """What it is before the first tick."""
        self.ints[:] = 0
        self.kept.clear()
        self.point(CONTEXT.index("arena"), self.arena)
        self.ints[CONTEXT.index("arena_size")] = ARENA
        self.ints[CONTEXT.index("failure")] = -1

    def __getattr__(self, name: str) -> int:
        if name not in CONTEXT:
            raise AttributeError(name)
        return int(self.ints[CONTEXT.index(name)])
