"""Attributes of blocks and states as compiled text takes them: their form, and their types.

In go values of Python, out come their types in C and the members of the struct:

    plain(np.float64(2.0), "self.gain")      2.0
    type_of(np.zeros(3))                     Array("float", (3,)): short sizes are part of the text
    type_of(np.zeros(100))                   Array("float", (None,)): its size is a member
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from types import FunctionType
from typing import Any

import numpy as np

from blocks.core import Block, BlockState
from runtime.codegen import FLOAT, INT, Array, Draws, Tuple, Type

KINDS: dict[Any, str] = {np.dtype(np.float64): "float", np.dtype(np.int64): "int"}
KINDS[np.dtype(np.bool_)] = "bool"
# Sizes up to this one are written into the text, so that loops over a pose are
# unrolled; larger ones are arguments, so that another number of neurons compiles nothing.
WRITTEN = ContextVar("WRITTEN", default=3)


Attribute = tuple[str, str]


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
        bits_of(value, name)
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


def bits_of(generator: np.random.Generator, name: str) -> np.ndarray[Any, Any]:
    """The state of a generator where NumPy has it, as the words of ``struct draws``.

    The array does not keep the generator alive.

    Raises
    ------
    NotCompilableError : it is no PCG64, or NumPy keeps it in another form than on usual machines.
    """
    made = generator.bit_generator
    if type(made) is not np.random.PCG64:
        raise NotCompilableError(f"{name} draws from {type(made).__name__}, not from PCG64")
    place = ctypes.c_void_p.from_address(made.ctypes.state_address).value
    words = np.ctypeslib.as_array((ctypes.c_uint64 * 4).from_address(int(place or 0)))
    numbers = made.state["state"]
    halves = [numbers[key] >> shift & 2**64 - 1 for key in ("state", "inc") for shift in (0, 64)]
    if words.tolist() != halves:
        raise NotCompilableError(f"{name} has its state in an unknown form on this machine")
    return words


def type_of(value: Any) -> Type:
    """The type in compiled text of a value that is :func:`plain`."""
    if isinstance(value, np.ndarray):
        return Array(KINDS[value.dtype], written(value.shape))
    if isinstance(value, tuple):
        return Tuple(tuple(map(type_of, value)))
    if isinstance(value, np.random.Generator):
        return Draws()
    return FLOAT if isinstance(value, float) else INT


@dataclass(frozen=True)
class Read:
    """What translation has read from code of the user's own: it may be another one at the next run.

    owner : a module's namespace, a class, or a function whose attribute it is.
    """

    owner: Any
    name: str
    value: Any

    @property
    def has_changed(self) -> bool:
        """Whether there is another value now: another number or text, or another object."""
        owner = self.owner
        now = owner.get(self.name) if isinstance(owner, dict) else getattr(owner, self.name, None)
        if now is self.value:
            return False
        is_plain = type(now) is type(self.value) and isinstance(now, (int, float, str))
        return not (is_plain and repr(now) == repr(self.value))  # -0.0 is not 0.0, nan is nan


@dataclass(frozen=True)
class Fields:
    """The attributes of a block and of its state that its compiled text depends on.

    attributes : those that it reads, in the order of its struct, as ("self" or "state", name).
    types : their types, as texts.
    constants : attributes whose values were written into the text.
    reads : globals, methods and functions of the user's own whose values and code are in the text.
    """

    attributes: tuple[Attribute, ...]
    types: tuple[str, ...]
    constants: Mapping[Attribute, Any]
    reads: tuple[Read, ...] = ()

    @property
    def are_current(self) -> bool:
        """Whether what was read of the user's own code is still the same."""
        return not any(read.has_changed for read in self.reads)

    @property
    def has_functions_of_others(self) -> bool:
        """Whether the text calls functions that are not the library's, as an expression's."""
        return any(
            isinstance(value, FunctionType) and not str(value.__module__).startswith("blocks.")
            for value in self.constants.values()
        )

    def values(self, made: Block, state: BlockState) -> tuple[Any, ...]:
        """The first argument of the functions, for a block and its state."""
        of = {"self": made, "state": state}
        return tuple(plain(getattr(of[o], name), f"{o}.{name}") for o, name in self.attributes)

    def fitting(self, made: Block, state: BlockState) -> tuple[Any, ...] | None:
        """The values; None if constants or shapes are not those of this block and state."""
        of = {"self": made, "state": state}
        if any(getattr(of[o], name) != value for (o, name), value in self.constants.items()):
            return None
        if not self.are_current:
            return None
        values = self.values(made, state)
        return values if type_texts(values) == self.types else None


def type_texts(values: Iterable[Any]) -> tuple[str, ...]:
    """The types of values that are :func:`plain`, as texts."""
    return tuple(_text(type_of(value)) for value in values)


_text = lru_cache(256)(repr)  # of few types, and asked for with each trial of an experiment


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
