"""C names of a controller, its signals and its states."""

from __future__ import annotations

import re

from runtime.codegen import unused
from runtime.errors import UsageError

KEYWORDS = frozenset(
    """
        auto bool break case char const continue default do double else enum extern false float for
        goto if inline int long register restrict return short signed sizeof static struct switch
        true typedef union unsigned void volatile while main asm typeof linux unix i386
        math_errhandling signgam errno
    """.split()
)
# Names of structs and headers that are there already, and of files that Windows does not have.
TAKEN = frozenset(
    """
        context draws assert complex ctype errno fenv float inttypes iso646 limits locale math
        setjmp signal stdarg stdbool stddef stdint stdio stdlib string tgmath time wchar wctype con
        aux nul prn report
    """.split()
)
MACRO = re.compile("[A-Z0-9_]+")  # how macros are spelled, as NULL, M_PI and INT64_MAX are


def member_name(text: str) -> str:
    """The C name of a member of a struct."""
    plain = re.sub(r"\W", "_", text, flags=re.ASCII)
    plain = f"_{plain}" if plain[:1].isdigit() else plain
    return f"{plain}_" if plain in KEYWORDS or MACRO.fullmatch(plain) else plain


def check_name(name: str) -> None:
    """Check the name of a controller's files, struct and functions.

    Raises
    ------
    UsageError : C could not have it.
    """
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) or len(name) > 60:
        raise UsageError(f"--name: expected a name for C functions, got '{name}'")
    if name in KEYWORDS or name.lower() in TAKEN or MACRO.fullmatch(name):
        message = f"--name: '{name}' may be a word, a macro or a header of C"
        raise UsageError(f"{message}; choose another, such as '{name.lower()}_controller'")


__all__ = ["check_name", "member_name", "unused"]
