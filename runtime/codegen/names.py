"""C names for names of the source.

In go names of Python, out come names that C accepts and that hide nothing of support.h:

    local_name("double")    double_v
    local_name("x_1")       x_1_v, since x_1 is the second leaf of a tuple ``x``
"""

from __future__ import annotations

import re
from functools import cache

from runtime.codegen.source import support
from runtime.codegen.ziggurat import template

WORD = re.compile(r"\w+")
C_WORDS = WORD.findall("""
    auto break case char const continue default do double else enum extern float for goto if
    inline int long register restrict return short signed sizeof static struct switch typedef
    union unsigned void volatile while bool true false NULL _Bool INFINITY NAN main ctx self
    draws context
""")
# Functions of the C library, which a variable or function of the source must not hide.
FUNCTIONS = WORD.findall("""
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1
    fabs floor fmod frexp gamma hypot isfinite isinf isnan j0 j1 jn ldexp lgamma tgamma log
    log10 log1p log2 logb modf nearbyint pow remainder rint round scalb sin sinh sqrt tan tanh
    trunc y0 y1 yn fma fmax fmin fdim signbit drem finite significand nan llrint lrint llround
    lround signgam nextafter remquo ilogb scalbn setjmp longjmp jmp_buf abs div
""")
SUFFIX = re.compile(r"_(?:[nsv]?[0-9]+|given|v)$")
# Those of support.h, whose macros REAL define one for each function of the math module.
DEFINED = re.compile(r"^(?:INLINE|static \w+)\b[^(;]*?(\w+)\(", re.MULTILINE)
REAL = re.compile(r"^REAL\w*\((\w+)\)$", re.MULTILINE)


@cache
def reserved() -> frozenset[str]:
    """Names that a variable or function of the source must not have in C."""
    helpers = [
        *DEFINED.findall(support() + template()),
        *(f"real_{name}" for name in REAL.findall(support())),
    ]
    return frozenset([*C_WORDS, *FUNCTIONS, *helpers])


def local_name(name: str) -> str:
    """The C name of a local variable."""
    plain = name if name.isascii() else name.encode("ascii", "backslashreplace").decode()
    plain = plain.replace("\\", "_")
    # Names that end with an underscore are those of temporaries, others with a suffix of leaves.
    taken = plain in reserved() or plain[-1] == "_" or SUFFIX.search(plain)
    return f"{plain.rstrip('_') or 'unused'}_v" if taken else plain


def function_name(name: str, taken: set[str]) -> str:
    """A new C name for a function; names at file scope must not begin with an underscore."""
    return unused(local_name(name.strip("_") or "function"), taken)


def unused(name: str, taken: set[str]) -> str:
    """A name that is not taken yet: the given one, if need be with a number. It is taken then."""
    made, number = name, 1
    while made in taken:
        number += 1
        made = f"{name}_{number}"
    taken.add(made)
    return made
