"""C99 from a restricted subset of Python: the types of a text are inferred, and it is printed.

``Writer`` takes a :class:`Source`, functions as syntax trees and the types of the entries that
they read, and writes one translation unit with the methods that other units call. A construct is
written only where its meaning is Python's and NumPy's, and refused with file and line otherwise;
what C cannot hold while it runs, as an integer beyond 64 bits, is a failure. Array expressions
become loops; local arrays come from an arena; there is no recursion. The functions of a unit are
kept in a typed form, of which ``Counter`` asks how many operations they take and ``stored`` what
they write to.

    def ratio(x):           static double ratio(struct context *ctx, double x)
        return x / (x - 1.0)    return divide(ctx, x, x - 1.0, 3);   /* failure 3: ... (own.py:7) */
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.codegen.names import unused
    from runtime.codegen.operations import MATH, Counter, Operations
    from runtime.codegen.source import (
        ANY_ORDER,
        Entry,
        Function,
        RefusedError,
        Source,
        apart,
        support,
    )
    from runtime.codegen.stores import stored
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
        unknown_call,
    )
    from runtime.codegen.unit import CFunction, Unit, Writer
    from runtime.codegen.ziggurat import draws_text
else:  # Imported where something is written, not at every start.
    __getattr__ = door(__name__)
