"""Types of the compiled subset, and how each is laid out in C.

In goes a type, out come its C variables; in go two types, out comes the one that holds both:

    leaves(Tuple((FLOAT, Array("float", (None,)))))    _0 double, _1 double *, _1_n0 int64_t
    join(INT, FLOAT)                                   EITHER

A value of any type is a list of *leaves*, each of one C type: a number is one leaf, an array its
pointer and the sizes and strides that are not known, a tuple the leaves of its parts. Variables,
parameters and members of structs are the leaves of their type, one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

C_NAMES = {"bool": "bool", "int": "int64_t", "either": "double", "float": "double"}


class NotTypedError(Exception):
    """Text that is outside the compiled subset: the reason, with a suggestion."""


def unknown_call(text: str) -> str:
    """The reason and the suggestion for a call of a function that has no form in C."""
    return f"calls '{text}', which is not compiled; write it with math, arrays and loops"


@dataclass(frozen=True)
class Number:
    """A bool, an int64, a float64, or either of the last two.

    ``either`` is a variable that holds an int at one time and a float at another, as ``total = 0``
    before ``total += x``, or ``max(0, x)``. It is a double in C. Python's int 0 has no sign and its
    ints are not rounded, so that ``-max(0, x)`` is 0 where ``-max(0.0, x)`` is -0.0; operators for
    which this matters refuse it or check their result.
    """

    kind: str

    def __str__(self) -> str:
        return "int or float" if self.kind == "either" else self.kind


@dataclass(frozen=True)
class Array:
    """An array; ``dims`` are its sizes, None where they are known only while running.

    ``packed`` arrays are contiguous in C order, the others have strides. ``frozen`` ones are not
    written to.
    """

    kind: str
    dims: tuple[int | None, ...]
    packed: bool = True
    frozen: bool = False

    def __str__(self) -> str:
        return f"array of {self.kind} with {len(self.dims)} axes"


@dataclass(frozen=True)
class Tuple:
    """A tuple of values of known types."""

    parts: tuple[Type, ...]

    def __str__(self) -> str:
        return f"tuple ({', '.join(map(str, self.parts))})"


@dataclass(frozen=True)
class Maybe:
    """A value or None."""

    part: Type

    def __str__(self) -> str:
        return f"{self.part} or None"


@dataclass(frozen=True)
class Known:
    """None or a string, which only decides branches."""

    value: Any

    def __str__(self) -> str:
        return repr(self.value)


@dataclass(frozen=True)
class Draws:
    """A generator of random numbers."""

    def __str__(self) -> str:
        return "random generator"


Type = Number | Array | Tuple | Maybe | Known | Draws
BOOL, INT, FLOAT = Number("bool"), Number("int"), Number("float")
EITHER = Number("either")
NONE = Known(None)
NUMBERS = {"bool": BOOL, "int": INT, "float": FLOAT}


def leaves(kind: Type) -> Iterator[tuple[str, str]]:
    """The leaves of a type: the suffix of each one's name, and its C type."""
    if isinstance(kind, Number):
        yield "", C_NAMES[kind.kind]
    elif isinstance(kind, Array):
        yield "", f"{'const ' if kind.frozen else ''}{C_NAMES[kind.kind]} *"
        for axis, size in enumerate(kind.dims):
            if size is None:
                yield f"_n{axis}", "int64_t"
        if not kind.packed:
            for axis in range(len(kind.dims)):
                yield f"_s{axis}", "int64_t"
    elif isinstance(kind, Tuple):
        for i, part in enumerate(kind.parts):
            for suffix, name in leaves(part):
                yield f"_{i}{suffix}", name
    elif isinstance(kind, Maybe):
        yield "_given", "bool"
        yield from leaves(kind.part)
    elif isinstance(kind, Draws):
        yield "", "struct draws *"


def count(kind: Type) -> int:
    """How many leaves a type has."""
    return sum(1 for _ in leaves(kind))


def join(a: Type, b: Type) -> Type:
    """The type that holds values of both.

    Raises
    ------
    NotTypedError : there is none.
    """
    if a == b:
        return a
    if isinstance(a, Number) and isinstance(b, Number):
        if BOOL in (a, b):
            reason = f"is sometimes a {a} and sometimes a {b}"
            raise NotTypedError(f"{reason}; use one type, as float(...)")
        return EITHER
    if isinstance(a, Array) and isinstance(b, Array) and _alike(a, b):
        dims = tuple(m if m == n else None for m, n in zip(a.dims, b.dims, strict=True))
        return Array(a.kind, dims, a.packed and b.packed, a.frozen or b.frozen)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.parts) == len(b.parts):
        return Tuple(tuple(join(m, n) for m, n in zip(a.parts, b.parts, strict=True)))
    if a == NONE or b == NONE:
        other = b if a == NONE else a
        return other if isinstance(other, Maybe) else Maybe(other)
    if isinstance(a, Maybe) or isinstance(b, Maybe):
        inner = [kind.part if isinstance(kind, Maybe) else kind for kind in (a, b)]
        return Maybe(join(*inner))
    raise NotTypedError(f"is sometimes a {a} and sometimes a {b}; use one type")


def _alike(a: Array, b: Array) -> bool:
    return a.kind == b.kind and len(a.dims) == len(b.dims)


def general(kind: Type) -> Type:
    """A type without the sizes of its arrays."""
    if isinstance(kind, Array):
        return replace(kind, dims=(None,) * len(kind.dims))
    if isinstance(kind, Tuple):
        return Tuple(tuple(map(general, kind.parts)))
    return Maybe(general(kind.part)) if isinstance(kind, Maybe) else kind
