"""The source of functions, without reading their file again and again.

In goes a code object, out comes its text without its indentation, decorators included:

    source_of(Gain.output.__code__)     "def output(self, state, t, input):\\n    return ..."
"""

from __future__ import annotations

import ast
import linecache
import textwrap
from functools import lru_cache
from types import CodeType

from blocks.core import parsed


def source_of(code: CodeType) -> str | None:
    """The text of a function that is defined with ``def``; None if it cannot be read."""
    lines = linecache.getlines(code.co_filename)
    if not lines:
        return None
    first = code.co_firstlineno
    last = _ends("".join(lines)).get(first)
    return None if last is None else textwrap.dedent("".join(lines[first - 1 : last]))


@lru_cache(maxsize=256)
def _ends(text: str) -> dict[int, int]:
    """The last line of each function by its first, which is that of its first decorator."""
    try:
        tree = parsed(text)
    except SyntaxError:
        return {}
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            found[first] = node.end_lineno or node.lineno
    return found
