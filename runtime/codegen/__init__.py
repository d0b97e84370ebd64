"""C99 from a restricted subset of Python: the types of a text are inferred, and it is printed.

``Writer`` takes a :class:`Source`, functions as syntax trees and the types of the entries that
they read, and writes one translation unit with the methods that other units call. What cannot be
typed is refused with file and line. Scalar arithmetic gives Python's bits; array expressions become
loops; local arrays come from an arena; there is no recursion.
"""

from runtime.codegen.interface import Entry
from runtime.codegen.source import Function, Source
from runtime.codegen.types import (
    BOOL,
    FLOAT,
    INT,
    Array,
    Draws,
    Known,
    Number,
    Tuple,
    Type,
    leaves,
)
from runtime.codegen.unit import RefusedError, Unit, Writer, support

__all__ = [
    "BOOL",
    "FLOAT",
    "INT",
    "Array",
    "Draws",
    "Entry",
    "Function",
    "Known",
    "Number",
    "RefusedError",
    "Source",
    "Tuple",
    "Type",
    "Unit",
    "Writer",
    "leaves",
    "support",
]
