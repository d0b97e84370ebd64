"""Arrays as single values of a graph: what its text names, or Python gives, and never writes out.

In: numbers of NumPy. Out: an immutable value that is compared and printed by its hash::

    StoredArray(np.eye(1000), "my.npz#w")        # <array 1000x1000 float64 5f70bf18a0860070>
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core.signals import FloatArray

# Arrays of up to so many numbers are lists in a graph, whose items a text shows and changes.
FEW = 100


class StoredArray:
    """An array of float64 that is one value of a graph, however many numbers it has.

    Parameters
    ----------
    values : numbers of any shape.
    origin : the file and the name that it was read from, ``/home/me/my.npz#w``; '' if Python gave
        it.
    """

    def __init__(self, values: Any, origin: str = "") -> None:
        self.values: FloatArray = np.array(values, dtype=np.float64)
        self.values.setflags(write=False)
        self.origin = origin

    @cached_property
    def digest(self) -> str:
        """A hash of shape and numbers: equal arrays have equal ones."""
        content = hashlib.sha256(repr(self.values.shape).encode())
        content.update(np.ascontiguousarray(self.values, dtype="<f8").data)
        return content.hexdigest()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self.values, dtype=dtype)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, list):
            return bool(self.values.tolist() == other)
        return isinstance(other, StoredArray) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        shape = "x".join(map(str, self.values.shape))
        return f"<array {shape} {self.values.dtype} {self.digest[:16]}>"


def as_written(array: FloatArray) -> Any:
    """An array as the value of a graph: a list where it has few numbers."""
    return array.tolist() if array.size <= FEW else StoredArray(array)
