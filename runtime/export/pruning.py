"""Leaves out of a C file what nothing in it uses, as a linker does.

In goes a whole source, out comes the same without the static functions and tables that are named
nowhere else. Most of it is support.h, which is written by hand and has no typed form: a controller
uses a small part of it.

    static double twice(double x) { ... }      goes, if nothing calls it
    static const double table_a[3] = {...};    goes, if nothing reads it
"""

from __future__ import annotations

import re
from collections import Counter

COMMENT = r"(?:^/\*(?:[^*]|\*(?!/))*\*/\n)?"
HEAD = r"^(?:static|INLINE|LANE)\b[^;{}=()]*?\b(\w+)"
FUNCTION = re.compile(rf"{COMMENT}{HEAD}\([^;{{}}]*\)\n\{{\n.*?^\}}\n\n?", re.MULTILINE | re.DOTALL)
TABLE = re.compile(rf"{COMMENT}{HEAD}\[\d+\] = \{{\n[^}}]*\}};\n\n?", re.MULTILINE)
REAL = re.compile(r"^REAL(?:_TWO)?\((\w+)\)\n", re.MULTILINE)
WORD = re.compile(r"[A-Za-z_]\w*")


def prune(text: str) -> str:
    """The text without unused functions and tables, again until there are none."""
    # A function of the math module is written by a macro; its name has a prefix where it is called.
    text = REAL.sub(lambda one: one[0] if f"real_{one[1]}(" in text else "", text)
    while True:
        counts = Counter(WORD.findall(text))

        def kept(found: re.Match[str], counts: Counter[str] = counts) -> str:
            own = WORD.findall(found[0]).count(found[1])
            return found[0] if counts[found[1]] > own else ""

        shorter = TABLE.sub(kept, FUNCTION.sub(kept, text))
        if shorter == text:
            return text
        text = shorter
