"""Reads one expression: from its text to a checked tree of scalar arithmetic."""

from __future__ import annotations

import ast
import math
import operator
import re
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import NoReturn

from blocks.core.hints import hint
from blocks.core.scalar_functions import ALIASES, CONSTANTS, FUNCTIONS, VECTORS

MAX_LENGTH, MAX_DEPTH, MAX_WRITTEN = 2000, 40, 5000
Names = Mapping[str, str | Sequence[str]]

# Python 3.11 counts the depth of a syntax tree for all threads together, and raises an error.
PARSING = threading.Lock()
_TEXT = re.compile(r"[A-Za-z0-9_ \t\n+\-*/%().,\[\]<>=!:&|^~@{}$'\"?;#]*")
_JUXTAPOSED = re.compile(
    r"(?<![\w.])(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![eE][+-]?\d)(?=[A-Za-z_(])"
)
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Add,
    ast.Sub: ast.Sub,
    ast.Mult: ast.Mult,
    ast.Div: ast.Div,
}
_SUGGESTED = {
    ast.BitXor: ("^", "a power is written '**'"),
    ast.BitAnd: ("&", "write 'and'"),
    ast.BitOr: ("|", "write 'or'"),
    ast.MatMult: ("@", "write out the products"),
}


class ExpressionError(ValueError):
    """An expression is not valid; ``column`` counts from 1."""

    def __init__(self, text: str, column: int, message: str) -> None:
        self.text, self.column, self.message = text, column, message
        super().__init__(f"column {column}: {message}")


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


_INTEGERS: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Mod: operator.mod,
    ast.FloorDiv: operator.floordiv,
    ast.Pow: operator.pow,
}
MAX_BITS = 4096  # of an integer on the way; floats end at 1024


class Reader:
    """Rewrites the nodes of one expression; each is a number or a truth value."""

    def __init__(self, text: str, names: Names) -> None:
        self.text, self.names = text, names
        self.used: set[str] = set()
        self.written = 0
        self._whole: dict[ast.expr, int | None] = {}

    def fail(self, node: ast.expr, message: str) -> NoReturn:
        raise ExpressionError(self.text, node.col_offset + 1 + _blanks(self.text), message)

    def count(self, node: ast.expr, depth: int) -> None:
        self.written += 1
        if depth > MAX_DEPTH or self.written > MAX_WRITTEN:
            self.fail(node, "too long or too deeply nested; use several blocks")

    def number(self, node: ast.expr, depth: int) -> ast.expr:
        """A node as an expression whose value is a float."""
        self.count(node, depth)
        # Integers first: as floats, 3**40 % 1000 would be 768 where Python says 801.
        if (whole := self.whole(node, depth)) is not None:
            return self.exact(node, whole)
        match node:
            case ast.Constant():
                return _literal(self.constant(node))
            case ast.Name(id=name):
                return self.named(node, name)
            case ast.Attribute(value=ast.Name(id=owner), attr=attribute):
                return self.attribute(node, owner, attribute)
            case ast.Subscript():
                return self.single(node, self.components(node), ast.unparse(node.value))
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign_, operand=operand):
                return ast.UnaryOp(sign_, self.number(operand, depth + 1))
            case ast.BinOp():
                return self.binary(node, depth)
            case ast.IfExp(test=test, body=body, orelse=other):
                parts = self.number(body, depth + 1), self.number(other, depth + 1)
                return ast.IfExp(self.truth(test, depth + 1), *parts)
            case ast.Call():
                return self.call(node, depth)
            # Python's `a and b` is one of the two values; here it is 1.0 or 0.0, as compiled.
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                truth = self.truth(node, depth)
                return ast.IfExp(truth, ast.Constant(1.0), ast.Constant(0.0))
        return self.refuse(node)

    def truth(self, node: ast.expr, depth: int) -> ast.expr:
        """A node as an expression whose value is true or false."""
        self.count(node, depth)
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rest):
                for op in ops:
                    if isinstance(op, (ast.Is, ast.IsNot, ast.In, ast.NotIn)):
                        self.fail(node, "expected <, <=, >, >=, == or !=")
                values = [self.number(value, depth + 1) for value in (left, *rest)]
                # Without chains: `a < b < c` is `a < b and b < c`.
                tests: list[ast.expr] = []
                for i, op in enumerate(ops):
                    # A chain writes its inner values twice, and nested chains double each time:
                    # what is repeated counts against the limit, too.
                    for repeated in ast.walk(values[i]) if i else ():
                        if isinstance(repeated, ast.expr):
                            self.count(node, depth)
                    tests.append(ast.Compare(values[i], [op], [values[i + 1]]))
                return tests[0] if len(tests) == 1 else ast.BoolOp(ast.And(), tests)
            case ast.BoolOp(op=op, values=parts):
                return ast.BoolOp(op, [self.truth(part, depth + 1) for part in parts])
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return ast.UnaryOp(ast.Not(), self.truth(operand, depth + 1))
        return ast.Compare(self.number(node, depth + 1), [ast.NotEq()], [ast.Constant(0.0)])

    def whole(self, node: ast.expr, depth: int) -> int | None:
        """The value of integers alone, which Python computes exactly: 3**40 % 1000 is 801."""
        # Remembered: asked of every node on the way down, it would take quadratic time.
        if node not in self._whole:
            self._whole[node] = None if depth > MAX_DEPTH else self._integer(node, depth + 1)
        return self._whole[node]

    def _integer(self, node: ast.expr, depth: int) -> int | None:
        match node:
            case ast.Constant(value=int() as value) if not isinstance(value, bool):
                return value
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                inner = self.whole(operand, depth)
                return -inner if inner is not None and isinstance(op, ast.USub) else inner
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _INTEGERS:
                a, b = self.whole(left, depth), self.whole(right, depth)
                if a is None or b is None or (b == 0 and isinstance(op, (ast.Mod, ast.FloorDiv))):
                    return None
                if isinstance(op, ast.Pow) and b < 0:
                    return None
                # Before it is computed: 9**9**9 would fill the memory.
                if isinstance(op, ast.Pow) and abs(a) > 1 and a.bit_length() * b > MAX_BITS:
                    self.fail(node, "the number is too large")
                return int(_INTEGERS[type(op)](a, b))
        return None

    def exact(self, node: ast.expr, whole: int) -> ast.expr:
        """An integer as the float of the same value."""
        try:
            number = float(whole)
        except OverflowError:
            self.fail(node, "the number is too large")
        if int(number) != whole:
            message = "no float has exactly this value, and all numbers here are floats; write a "
            self.fail(node, message + "float, as in '3.0**40', to have it rounded")
        return _literal(number)

    def constant(self, node: ast.Constant) -> float:
        value = node.value
        if not isinstance(value, (bool, int, float)):
            self.fail(node, f"expected a number, got {ast.unparse(node)[:40]}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail(node, "the number is too large")
        return number

    def named(self, node: ast.Name, name: str) -> ast.expr:
        if name in self.names:
            return self.single(node, self.components(node), name)
        if name in CONSTANTS:
            return _literal(CONSTANTS[name])
        if name in FUNCTIONS or name in VECTORS:
            self.fail(node, f"'{name}' is a function; call it, as in '{name}(...)'")
        self.unknown(node, name)

    def unknown(self, node: ast.expr, name: str) -> NoReturn:
        known = [*self.names, *CONSTANTS]
        near = hint(name, known) or hint(name, FUNCTIONS) or f"; known: {', '.join(known)}"
        self.fail(node, f"unknown name '{name}'{near}")

    def attribute(self, node: ast.Attribute, owner: str, attribute: str) -> ast.expr:
        dotted = f"{owner}.{attribute}"
        if dotted in self.names:
            self.used.add(dotted)
            return self.single(node, [str(self.names[dotted])], dotted)
        if owner in ("math", "np", "numpy"):
            self.fail(node, f"write '{attribute}' in place of '{dotted}'")
        parts = [name for name in self.names if name.startswith(f"{owner}.")]
        known = f"; known: {', '.join(parts)}" if parts else ""
        near = hint(dotted, self.names) or known
        self.fail(node, f"'{owner}' has no component '{attribute}'{near}")

    def components(self, node: ast.expr) -> list[str]:
        """The Python texts of a vector, of a part of one, or of a number."""
        if isinstance(node, ast.Name) and node.id in self.names:
            value = self.names[node.id]
            self.used.add(node.id)
            return [value] if isinstance(value, str) else list(value)
        if not isinstance(node, ast.Subscript) or not isinstance(node.value, ast.Name):
            self.refuse(node)
        name = node.value.id
        if name not in self.names:
            if name in FUNCTIONS:
                self.fail(node.value, f"a function is called with parentheses: '{name}(...)'")
            self.unknown(node.value, name)
        whole = self.components(node.value)
        if isinstance(self.names[name], str):
            self.fail(node, f"'{name}' is a number; write '{name}'")
        if isinstance(node.slice, ast.Slice):
            bounds = [self.index(p) for p in (node.slice.lower, node.slice.upper)]
            if node.slice.step is not None:
                self.fail(node, f"a range has no step, as in '{name}[0:2]'")
            components = whole[bounds[0] : bounds[1]]
            if not components:
                self.fail(node, f"the range is empty; '{name}' has {_counted(whole)}")
            return components
        index = self.index(node.slice)
        if not whole:
            self.fail(node, f"'{name}' has no components, since nothing is wired to it")
        if index is None or not -len(whole) <= index < len(whole):
            last = len(whole) - 1
            self.fail(
                node.slice, f"'{name}' has {_counted(whole)}, '{name}[0]' to '{name}[{last}]'"
            )
        return [whole[index]]

    def index(self, node: ast.expr | None) -> int | None:
        if node is None:
            return None
        try:
            value = ast.literal_eval(node)
        except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
            value = None
        if not isinstance(value, int) or isinstance(value, bool):
            self.fail(node, "an index is an integer, as in 'u[0]'")
        return value

    def single(self, node: ast.expr, components: list[str], name: str) -> ast.expr:
        if len(components) != 1:
            message = f"'{name}' has {_counted(components)}; write one of them, as in '{name}[0]'"
            self.fail(node, message)
        return _text(components[0])

    def binary(self, node: ast.BinOp, depth: int) -> ast.expr:
        kind = type(node.op)
        if kind in _SUGGESTED:
            written, instead = _SUGGESTED[kind]
            self.fail(node.right, f"there is no operator '{written}'; {instead}")
        if kind is ast.Pow:
            return self.power(node, depth)
        left, right = self.number(node.left, depth + 1), self.number(node.right, depth + 1)
        if kind in _OPERATORS:
            return ast.BinOp(left, node.op, right)
        if kind is ast.Mod:
            return _called("modulo", left, right)
        if kind is ast.FloorDiv:
            return _called("floor", ast.BinOp(left, ast.Div(), right))
        return self.refuse(node)

    def power(self, node: ast.BinOp, depth: int) -> ast.expr:
        """A power; small whole ones are products, which have the same bits everywhere."""
        base = self.number(node.left, depth + 1)
        exponent = node.right
        negative = isinstance(exponent, ast.UnaryOp) and isinstance(exponent.op, ast.USub)
        inner = exponent.operand if isinstance(exponent, ast.UnaryOp) and negative else exponent
        whole = self.constant(inner) if isinstance(inner, ast.Constant) else None
        product = {
            1.0: lambda: base,
            2.0: lambda: _called("square", base),
            3.0: lambda: _called("cube", base),
            4.0: lambda: _called("square", _called("square", base)),
        }.get(whole if whole is not None else 0.0)
        if product is None:
            return _called("real_pow", base, self.number(exponent, depth + 1))
        return ast.BinOp(ast.Constant(1.0), ast.Div(), product()) if negative else product()

    def call(self, node: ast.Call, depth: int) -> ast.expr:
        function = node.func
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            self.attribute(function, function.value.id, function.attr)
        if not isinstance(function, ast.Name):
            self.fail(function, "expected a function's name before '('; a product needs '*'")
        name = function.id
        if node.keywords or any(isinstance(part, ast.Starred) for part in node.args):
            self.fail(node, f"'{name}' takes plain arguments, as in '{name}(x)'")
        if name in VECTORS and len(node.args) == 1:
            components = self.components(node.args[0])
            parts = [_text(part) for part in components]
            return _over(name, parts)
        if name not in FUNCTIONS:
            self.unknown_function(function, name)
        target, count = FUNCTIONS[name]
        if len(node.args) != count and (count is not None or len(node.args) < 2):
            wanted = "two or more arguments" if count is None else f"{count} argument(s)"
            self.fail(node, f"'{name}' takes {wanted}, got {len(node.args)}")
        arguments = [self.number(argument, depth + 1) for argument in node.args]
        if count is None:
            return _nested(target, arguments)
        return _called(target, *arguments)

    def unknown_function(self, node: ast.expr, name: str) -> NoReturn:
        if name in self.names or name in CONSTANTS:
            self.fail(node, f"'{name}' is no function; a product needs '*', as in '{name}*(...)'")
        if name in VECTORS:
            self.fail(node, f"'{name}' takes one vector, as in '{name}(u)'")
        if name in ALIASES:
            self.fail(node, f"no function '{name}'; write '{ALIASES[name]}'")
        near = hint(name, [*FUNCTIONS, *VECTORS])
        known = f"; known: {', '.join([*FUNCTIONS, 'sum', 'mean', 'norm'])}"
        self.fail(node, f"no function '{name}'{near or known}")

    def refuse(self, node: ast.expr) -> NoReturn:
        what = {
            ast.Lambda: "a lambda",
            ast.Tuple: "a tuple",
            ast.List: "a list",
            ast.Dict: "a mapping",
            ast.Set: "a set",
            ast.Attribute: "an attribute",
            ast.NamedExpr: "an assignment",
            ast.JoinedStr: "a string",
        }.get(type(node), f"'{type(node).__name__}'")
        self.fail(node, f"{what} is not allowed; expected arithmetic with numbers and functions")


def _counted(parts: Sequence[str]) -> str:
    return "1 component" if len(parts) == 1 else f"{len(parts)} components"


def _text(python: str) -> ast.expr:
    """The tree of a text that the caller gave for a name."""
    value: ast.expr = parsed(python).body[0].value  # type: ignore[attr-defined]
    return value


def _literal(number: float) -> ast.expr:
    return ast.Constant(number)


def _called(name: str, *arguments: ast.expr) -> ast.expr:
    owner, _, function = name.rpartition(".")
    target: ast.expr = ast.Name(function, ast.Load())
    if owner:
        target = ast.Attribute(ast.Name(owner, ast.Load()), function, ast.Load())
    return ast.Call(target, list(arguments), [])


def _nested(function: str, parts: Sequence[ast.expr]) -> ast.expr:
    """A function of two numbers, applied from left to right."""
    total = parts[0]
    for part in parts[1:]:
        total = _called(function, total, part)
    return total


def _over(name: str, parts: Sequence[ast.expr]) -> ast.expr:
    """A function of a vector, written out for its components."""
    if name in ("min", "max"):
        return _nested("lesser" if name == "min" else "greater", parts)
    total = _called("square", parts[0]) if name == "norm" else parts[0]
    for part in parts[1:]:
        total = ast.BinOp(total, ast.Add(), _called("square", part) if name == "norm" else part)
    if name == "norm":
        return _called("math.sqrt", total)
    return total if name == "sum" else ast.BinOp(total, ast.Div(), ast.Constant(float(len(parts))))
