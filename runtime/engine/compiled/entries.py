"""Attributes of blocks and states as compiled text takes them: their form, and their types."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from runtime.codegen import FLOAT, INT, Array, Draws, Tuple, Type

KINDS: dict[Any, str] = {np.dtype(np.float64): "float", np.dtype(np.int64): "int"}
KINDS[np.dtype(np.bool_)] = "bool"
# Sizes up to this one are written into the text, so that loops over a pose are
# unrolled; larger ones are arguments, so that another number of neurons compiles nothing.
WRITTEN = ContextVar("WRITTEN", default=3)


class NotCompilableError(Exception):
    """A block cannot be compiled: the reason, then file and line."""


def plain(value: Any, name: str) -> Any:
    """A value in a form that compiled text accepts; arrays are shared if possible, else copied."""
    if isinstance(value, np.ndarray) and value.dtype in KINDS:
        if value.flags.c_contiguous and value.flags.writeable:
            return value
        if name.startswith("state.") and value.base is not None and _may_change(value):
            raise NotCompilableError(f"{name} is a part of an array, and not contiguous")
        return value.copy()
    if isinstance(value, np.random.Generator):
        return value
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, tuple):
        return tuple(plain(part, name) for part in value)
    kind = f"array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
    article = "an" if kind[0] in "aeio" else "a"
    raise NotCompilableError(f"{name} is {article} {kind}")


def type_of(value: Any) -> Type:
    """The type in compiled text of a value that is :func:`plain`."""
    if isinstance(value, np.ndarray):
        return Array(KINDS[value.dtype], written(value.shape))
    if isinstance(value, tuple):
        return Tuple(tuple(map(type_of, value)))
    if isinstance(value, np.random.Generator):
        return Draws()
    return FLOAT if isinstance(value, float) else INT


def written(shape: tuple[int, ...]) -> tuple[int | None, ...]:
    """The sizes of a shape that are part of a text."""
    most = WRITTEN.get()
    return tuple(size if size <= most else None for size in shape)


@contextmanager
def fixed_sizes() -> Iterator[None]:
    """Write all sizes into the texts that are made meanwhile."""
    token = WRITTEN.set(2**62)
    try:
        yield
    finally:
        WRITTEN.reset(token)


def _may_change(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array's data can be written to by anyone."""
    base: Any = array
    while base is not None:
        if not isinstance(base, np.ndarray) or base.flags.writeable:
            return True
        base = base.base
    return False
