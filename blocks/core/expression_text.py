"""Reads one expression: from its text to a syntax tree, or an error with its column.

In: a text of a graph. Out: Python's own syntax tree of it, of which no node is checked yet::

    tree_of("2*x")      # ast.BinOp
    tree_of("2x")       # ExpressionError: column 2: expected an operator after '2'
"""

from __future__ import annotations

import ast
import re
import threading

from blocks.limits import EXPRESSION_LENGTH
from blocks.messages import as_message

MAX_LENGTH = EXPRESSION_LENGTH
# Python 3.11 counts the depth of a syntax tree for all threads together, and raises an error.
PARSING = threading.Lock()
_TEXT = re.compile(r"[A-Za-z0-9_ \t\n+\-*/%().,\[\]<>=!:&|^~@{}$'\"?;#]*")
_JUXTAPOSED = re.compile(
    r"(?<![\w.])(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![eE][+-]?\d)(?=[A-Za-z_(])"
)


class ExpressionError(ValueError):
    """An expression is not valid; ``column`` counts from 1.

    ``place`` is its number among several, or its name in ``let``.
    """

    place: int | str = 0

    def __init__(self, text: str, column: int, message: str) -> None:
        self.text, self.column, self.message = text, column, message
        super().__init__(as_message(message).within(f"column {column}: "))


def parsed(source: str) -> ast.Module:
    """The syntax tree of a text; only one thread parses at a time."""
    with PARSING:
        return ast.parse(source)


def tree_of(text: str) -> ast.expr:
    """The syntax tree of one expression.

    Raises
    ------
    ExpressionError : it is too long, or not one expression of ASCII characters.
    """
    if not text.strip():
        raise ExpressionError(text[:1], 1, "expected an expression, as in 'u[0]*sin(t)'")
    if len(text) > MAX_LENGTH:
        message = f"expected at most {MAX_LENGTH} characters, got {len(text)}; use several blocks"
        raise ExpressionError(text, MAX_LENGTH, message)
    known = _TEXT.match(text)
    end = known.end() if known else 0
    if end < len(text):
        message = f"unexpected character {text[end]!r}; expected numbers, names and operators"
        raise ExpressionError(text, end + 1, message)
    assigned = re.search(r"(?<![=<>!:])=(?!=)", text)
    if assigned:
        message = "'=' assigns nothing here; an expression is a value, and '==' compares"
        raise ExpressionError(text, assigned.start() + 1, message)
    joined = _JUXTAPOSED.search(text)
    if joined:
        message = f"expected an operator after '{joined[0]}', as in '{joined[0]}*...'"
        raise ExpressionError(text, joined.end() + 1, message)
    try:
        # One line, so that columns of the tree are those of the text.
        flat = re.sub(r"\s", " ", text)
        body = parsed(flat.strip()).body
    except SyntaxError as error:
        column = min(max((error.offset or 1) + _blanks(text), 1), len(text))
        raise ExpressionError(text, column, _explained(text, str(error.msg))) from None
    except (ValueError, RecursionError, MemoryError, OverflowError):
        raise ExpressionError(text, 1, "too deeply nested; use several blocks") from None
    if len(body) != 1 or not isinstance(body[0], ast.Expr):
        raise ExpressionError(text, 1, _explained(text, "this is a statement"))
    return body[0].value


def _blanks(text: str) -> int:
    return len(text) - len(text.lstrip())


def _explained(text: str, message: str) -> str:
    if "&&" in text or "||" in text or re.search("!(?!=)", text):
        return "write 'and', 'or' and 'not'"
    return f"{message[:1].lower()}{message[1:]}; expected an expression, as in 'u[0]*sin(t)'"
