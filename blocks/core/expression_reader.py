"""Reads one expression: every node of its syntax tree becomes numbers, or an error with its column.

In: a text and what its names stand for. Out: a :class:`Value`, whose components are trees of scalar
Python, and the statements that compute what these need, in a :class:`Writer`::

    names x: x[0], x[1]; a: c[0]
    a*x            Value((2,), (c[0]*x[0], c[0]*x[1]))
    norm(x)        Value((), (math.sqrt(square(x[0]) + square(x[1])),))

Shapes and indices are numbers while an expression is read; none is left in what is executed.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from itertools import product
from typing import NoReturn

from blocks.core.expression_arrays import (
    ARRAYS,
    CREATION,
    ShapeError,
    eye,
    map_pairs,
    matrix_product,
    stacked,
    transposed,
)
from blocks.core.expression_indices import MAX_DEPTH, Indices
from blocks.core.expression_values import (
    MAX_WRITTEN,
    TooLongError,
    Value,
    called,
    literal,
    not_zero,
    number,
    one_or_zero,
)
from blocks.core.hints import misspelt, similar
from blocks.core.scalar_functions import ALIASES, CONSTANTS, FUNCTIONS

_SUGGESTED = {
    ast.BitXor: ("^", "a power is written '**'"),
    ast.BitAnd: ("&", "write 'and'"),
    ast.BitOr: ("|", "write 'or'"),
}


class Reader(Indices):
    """Reads the nodes of one expression; each becomes a :class:`Value`."""

    def value(self, node: ast.expr, depth: int) -> Value:
        """What a node computes."""
        # a + b + c is (a + b) + c: a chain is as deep as it is long, and read without recursion.
        chain: list[ast.BinOp] = []
        while isinstance(node, ast.BinOp) and self.whole(node, depth) is None:
            chain.append(node)
            node = node.left
        value = self._checked(node, depth + bool(chain))
        for binary in reversed(chain):
            value = self.writer.low(self._checked(binary, depth, value))
        return value

    def _checked(self, node: ast.expr, depth: int, left: Value | None = None) -> Value:
        """The value of a node, given that of its left operand; reports what is wrong with it."""
        if depth > MAX_DEPTH:
            self.fail(node, "too deeply nested; use 'let', or several blocks")
        try:
            self.writer.charge(1)
            # Integers first: as floats, 3**40 % 1000 would be 768 where Python says 801.
            if (whole := self.whole(node, depth)) is not None:
                return number(self.exact(node, whole))
            if left is not None and isinstance(node, ast.BinOp):
                return self.binary(node, left, depth)
            return self.writer.low(self._value(node, depth))
        except ShapeError as error:
            self.fail(node, str(error))
        except TooLongError:
            message = f"more than {MAX_WRITTEN} operations, with all that indices run over"
            self.fail(node, f"{message}; use several blocks")

    def _value(self, node: ast.expr, depth: int) -> Value:
        match node:
            case ast.Constant():
                return number(literal(self.constant(node)))
            case ast.Name(id=name):
                return self.named(node, name)
            case ast.Attribute(value=of, attr="T"):
                return transposed(self.value(of, depth + 1))
            case ast.Attribute(value=ast.Name(id=owner), attr=attribute):
                return self.attribute(node, owner, attribute)
            case ast.Subscript():
                return self.subscript(node, depth)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner = self.value(operand, depth + 1)
                self.writer.charge(len(inner.parts))
                return Value(inner.shape, tuple(ast.UnaryOp(sign, part) for part in inner.parts))
            case ast.IfExp():
                return self.conditional(node, depth)
            case ast.Call():
                return self.call(node, depth)
            case ast.List(elts=items) if items:
                return stacked([self.value(item, depth + 1) for item in items])
            case ast.ListComp():
                return stacked(self.each(node, depth))
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                return number(one_or_zero(self.truth(node, depth)))
        return self.refuse(node)

    def scalar(self, node: ast.expr, depth: int) -> ast.expr:
        """A node whose value is a number."""
        value = self.value(node, depth)
        if len(value.parts) > 1:  # a vector of one component, as one wire to u, is a number, too
            name = ast.unparse(node) if isinstance(node, (ast.Name, ast.Subscript)) else ""
            if name:
                self.fail(node, f"'{name}' has {value}; write one of them, as in '{name}[0]'")
            self.fail(node, f"expected a number, got {value}")
        return value.parts[0]

    def truth(self, node: ast.expr, depth: int) -> ast.expr:
        """A node as an expression whose value is true or false."""
        self.writer.charge(1)
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rest):
                for op in ops:
                    if isinstance(op, (ast.Is, ast.IsNot, ast.In, ast.NotIn)):
                        self.fail(node, "expected <, <=, >, >=, == or !=")
                values = [self.scalar(value, depth + 1) for value in (left, *rest)]
                # Without chains: `a < b < c` is `a < b and b < c`.
                tests: list[ast.expr] = []
                for i, op in enumerate(ops):
                    # A chain writes its inner values twice, and nested chains double each time:
                    # what is repeated counts against the limit, too.
                    repeated = ast.walk(values[i]) if i else ()
                    self.writer.charge(sum(isinstance(part, ast.expr) for part in repeated))
                    tests.append(ast.Compare(values[i], [op], [values[i + 1]]))
                return tests[0] if len(tests) == 1 else ast.BoolOp(ast.And(), tests)
            case ast.BoolOp():
                return self.junction(node, depth)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return ast.UnaryOp(ast.Not(), self.truth(operand, depth + 1))
        return not_zero(self.scalar(node, depth + 1))

    def junction(self, node: ast.BoolOp, depth: int) -> ast.expr:
        """``and``, ``or``: statements of a later operand are executed only if it is reached."""
        tests, blocks = [], []
        for operand in node.values:
            with self.writer.block() as lines:
                tests.append(self.truth(operand, depth + 1))
            blocks.append(lines)
        self.writer.lines += blocks[0]
        if not any(blocks[1:]):
            return ast.BoolOp(node.op, tests)
        # a and b  ->  v = 0.0; if a: <lines of b>; if b: v = 1.0        or: with not, 1.0 and 0.0
        either = isinstance(node.op, ast.Or)
        name = self.writer.name()
        self.writer.lines.append(f"{name} = {float(either)}")
        inner = [f"{name} = {float(not either)}"]
        for test, lines in reversed(list(zip(tests, [[], *blocks[1:]], strict=True))):
            reached = ast.UnaryOp(ast.Not(), test) if either else test
            head = f"if {ast.unparse(reached)}"
            with self.writer.block() as wrapped:
                self.writer.branch(head, inner)
            inner = [*lines, *wrapped]
        self.writer.lines += inner
        return not_zero(ast.Name(name, ast.Load()))

    def conditional(self, node: ast.IfExp, depth: int) -> Value:
        test = self.truth(node.test, depth + 1)
        writer = self.writer
        with writer.block() as first:
            then = self.value(node.body, depth + 1)
        with writer.block() as second:
            other = self.value(node.orelse, depth + 1)
        if not first and not second and not then.shape and not other.shape:
            return number(ast.IfExp(test, then.parts[0], other.parts[0]))
        shape = then.shape or other.shape
        if {then.shape, other.shape} - {(), shape}:
            self.fail(node, f"expected both values of equal shape, got {then} and {other}")
        # Statements, so that only those of the value that counts are executed.
        size = max(len(then.parts), len(other.parts))
        names = [writer.name() for _ in range(size)]
        for lines, value in ((first, then), (second, other)):
            writer.charge(size)
            parts = value.parts if len(value.parts) == size else value.parts * size
            lines += [f"{n} = {ast.unparse(part)}" for n, part in zip(names, parts, strict=True)]
        writer.branch(f"if {ast.unparse(test)}", first)
        writer.branch("else", second)
        return Value(shape, tuple(ast.Name(name, ast.Load()) for name in names))

    def named(self, node: ast.Name, name: str) -> Value:
        if name in self.names:
            value = self.names[name]
            if not value.parts:
                self.fail(node, f"'{name}' has no components, since nothing is wired to it")
            return value
        if name in CONSTANTS:
            return number(literal(CONSTANTS[name]))
        if name in FUNCTIONS or name in ARRAYS or name in CREATION:
            self.fail(node, f"'{name}' is a function; call it, as in '{name}(...)'")
        self.unknown(node, name)

    def unknown(self, node: ast.expr, name: str) -> NoReturn:
        known = [*self.names, *self.indices, *CONSTANTS]
        similar_to = known if similar(name, known) else [*FUNCTIONS]
        text, other = f"unknown name '{name}'", f"; known: {', '.join(known)}"
        self.fail(node, misspelt("unknown-name", text, name, similar_to, other))

    def attribute(self, node: ast.Attribute, owner: str, attribute: str) -> Value:
        dotted = f"{owner}.{attribute}"
        if dotted in self.names:
            return self.names[dotted]
        if owner in ("math", "np", "numpy"):
            self.fail(node, f"write '{attribute}' in place of '{dotted}'")
        parts = [name for name in self.names if name.startswith(f"{owner}.")]
        known = f"; known: {', '.join(parts)}" if parts else ""
        text = f"'{owner}' has no component '{attribute}'"
        self.fail(node, misspelt("unknown-name", text, dotted, self.names, known))

    def subscript(self, node: ast.Subscript, depth: int) -> Value:
        """Components of a vector or a matrix: ``x[0]``, ``x[3*i:3*i + 3]``, ``a[:, 1]``."""
        of = node.value
        if (
            isinstance(of, ast.Name)
            and of.id not in self.names
            and of.id in {**FUNCTIONS, **ARRAYS}
        ):
            self.fail(of, f"a function is called with parentheses: '{of.id}(...)'")
        whole, name = self.value(of, depth + 1), ast.unparse(of)
        if not whole.shape:
            self.fail(node, f"'{name}' is a number; write '{name}'")
        keys = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(keys) > len(whole.shape):
            self.fail(node, f"'{name}' has {whole}; expected {len(whole.shape)} index(es)")
        chosen = [
            self.places(key, size, whole, name)
            for key, size in zip(keys, whole.shape, strict=False)
        ]
        chosen += [range(size) for size in whole.shape[len(keys) :]]
        shape = tuple(len(each) for each in chosen if isinstance(each, range))
        rows = [each if isinstance(each, range) else [each] for each in chosen]
        width = whole.shape[-1]
        self.writer.charge(math.prod(map(len, rows)))
        if len(rows) == 1:
            return Value(shape, tuple(whole.parts[i] for i in rows[0]))
        return Value(shape, tuple(whole.parts[i * width + j] for i, j in product(*rows)))

    def binary(self, node: ast.BinOp, left: Value, depth: int) -> Value:
        kind = type(node.op)
        if kind in _SUGGESTED:
            written, instead = _SUGGESTED[kind]
            self.fail(node.right, f"there is no operator '{written}'; {instead}")
        if kind is ast.Pow:
            return self.power(node, left, depth)
        right = self.value(node.right, depth + 1)
        if kind is ast.MatMult:
            return matrix_product(self.writer, left, right)
        if kind in (ast.Add, ast.Sub, ast.Mult, ast.Div):
            return map_pairs(self.writer, node.op, left, right)
        if kind is ast.Mod:
            return self.mapped(node, "modulo", left, right)
        if kind is ast.FloorDiv:
            quotient = map_pairs(self.writer, ast.Div(), left, right)
            return self.mapped(node, "floor", quotient)
        return self.refuse(node)

    def power(self, node: ast.BinOp, base: Value, depth: int) -> Value:
        """A power; small whole ones are products, which have the same bits everywhere."""
        exponent = node.right
        negative = isinstance(exponent, ast.UnaryOp) and isinstance(exponent.op, ast.USub)
        inner = exponent.operand if isinstance(exponent, ast.UnaryOp) and negative else exponent
        whole: float | None = None
        if isinstance(inner, ast.Constant):
            whole = self.constant(inner)
        elif isinstance(inner, ast.Name) and inner.id in self.indices:
            whole = float(self.indices[inner.id])
        power: dict[float, Callable[[ast.expr], ast.expr]] = {
            1.0: lambda part: part,
            2.0: lambda part: called("square", part),
            3.0: lambda part: called("cube", part),
            4.0: lambda part: called("square", called("square", part)),
        }
        f = power.get(whole) if whole is not None else None
        if f is None:
            return self.mapped(node, "real_pow", base, self.value(exponent, depth + 1))
        self.writer.charge(len(base.parts))
        parts = [f(part) for part in base.parts]
        if negative:
            parts = [ast.BinOp(literal(1.0), ast.Div(), part) for part in parts]
        return Value(base.shape, tuple(parts))

    def mapped(self, node: ast.expr, function: str, *values: Value) -> Value:
        """A function of numbers, of the components of values."""
        result = self.writer.each(lambda *parts: called(function, *parts), *values)
        if result is None:
            shapes = " and ".join(map(str, values))
            self.fail(node, f"expected equal shapes, or numbers and an array, got {shapes}")
        return result

    def each(self, node: ast.ListComp | ast.GeneratorExp, depth: int) -> list[Value]:
        """The values of ``... for i in range(n) if i != j``."""
        outside = dict(self.indices)
        values: list[Value] = []
        self._run(node, list(node.generators), depth, values)
        self.indices, self._whole = outside, {}
        if not values:
            self.fail(node, "there is no value: the range is empty")
        return values

    def _run(
        self,
        node: ast.ListComp | ast.GeneratorExp,
        loops: list[ast.comprehension],
        depth: int,
        values: list[Value],
    ) -> None:
        if not loops:
            values.append(self.value(node.elt, depth + 1))
            return
        loop, *inner = loops
        target, over = loop.target, loop.iter
        if not isinstance(target, ast.Name) or loop.is_async:
            self.fail(target, "expected one index, as in 'for i in range(3)'")
        if target.id in self.names or target.id in CONSTANTS:
            self.fail(target, f"'{target.id}' is taken; choose another name for the index")
        for place in self.range_of(over):
            self.writer.charge(1)
            self.indices[target.id], self._whole = place, {}
            if all(self.static(test) for test in loop.ifs):
                self._run(node, inner, depth, values)
        self.indices.pop(target.id, None)

    def call(self, node: ast.Call, depth: int) -> Value:
        function = node.func
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            self.attribute(function, function.value.id, function.attr)
        if not isinstance(function, ast.Name):
            self.fail(function, "expected a function's name before '('; a product needs '*'")
        name = function.id
        if node.keywords or any(isinstance(part, ast.Starred) for part in node.args):
            self.fail(node, f"'{name}' takes plain arguments, as in '{name}(x)'")
        if name in CREATION and name not in self.names:
            return self.created(node, name, depth)
        array = ARRAYS.get(name) if name not in self.names else None
        if array is not None and (name not in FUNCTIONS or len(node.args) == 1):
            return self.of_arrays(node, name, depth)
        if name not in FUNCTIONS:
            self.unknown_function(function, name)
        target, count = FUNCTIONS[name]
        if len(node.args) != count and (count is not None or len(node.args) < 2):
            wanted = "two or more arguments" if count is None else f"{count} argument(s)"
            self.fail(node, f"'{name}' takes {wanted}, got {len(node.args)}")
        arguments = [self.value(argument, depth + 1) for argument in node.args]
        if count is not None:
            return self.mapped(node, target, *arguments)
        total = arguments[0]
        for argument in arguments[1:]:
            total = self.writer.low(self.mapped(node, target, total, argument))
        return total

    def of_arrays(self, node: ast.Call, name: str, depth: int) -> Value:
        """A call of a function of :data:`ARRAYS`."""
        function = ARRAYS[name]
        if len(node.args) == 1 and isinstance(node.args[0], ast.GeneratorExp):
            values = self.each(node.args[0], depth + 1)
            if name == "sum" and values[0].shape:  # of vectors, as Python adds them
                total = values[0]
                for value in values[1:]:
                    total = self.writer.bound(map_pairs(self.writer, ast.Add(), total, value))
                return total
            return function.compute(self.writer, [stacked(values)])
        count = len(node.args)
        if count < function.least or (function.most is not None and count > function.most):
            wanted = f"{function.least}" if function.most else f"{function.least} or more"
            self.fail(node, f"'{name}' takes {wanted} argument(s), got {count}")
        return function.compute(self.writer, [self.value(part, depth + 1) for part in node.args])

    def created(self, node: ast.Call, name: str, depth: int) -> Value:
        """``eye(n)``, ``zeros(m, n)``, ``ones(n)``, ``full(n, x)``."""
        last = 1 if name == "full" else 0
        sides = [self.index(part) for part in node.args[: len(node.args) - last]]
        if not 1 <= len(sides) <= (1 if name == "eye" else 2) or min(sides) < 1:
            self.fail(node, f"expected {CREATION[name][0]}, with sizes of 1 and more")
        size = math.prod(sides) * (sides[0] if name == "eye" else 1)
        self.writer.charge(size)
        if name == "eye":
            return eye(sides[0])
        part = literal({"zeros": 0.0, "ones": 1.0}.get(name, 0.0))
        if name == "full":
            part = self.writer.bind(self.scalar(node.args[-1], depth + 1))
        return Value(tuple(sides), (part,) * size)

    def unknown_function(self, node: ast.expr, name: str) -> NoReturn:
        if name in self.names or name in CONSTANTS:
            message = f"'{name}' is not a function; a product needs '*', as in '{name}*(...)'"
            self.fail(node, message)
        if name in ALIASES:
            self.fail(node, f"no function '{name}'; write '{ALIASES[name]}'")
        known = [*FUNCTIONS, *(each for each in (*ARRAYS, *CREATION) if each not in FUNCTIONS)]
        text, other = f"no function '{name}'", f"; known: {', '.join(known)}"
        self.fail(node, misspelt("unknown-name", text, name, known, other))

    def refuse(self, node: ast.expr) -> NoReturn:
        what = {
            ast.Lambda: "a lambda",
            ast.Tuple: "a tuple",
            ast.List: "an empty list",
            ast.GeneratorExp: "'for' without brackets or a function",
            ast.Dict: "a mapping",
            ast.Set: "a set",
            ast.Attribute: "an attribute",
            ast.NamedExpr: "an assignment",
            ast.JoinedStr: "a string",
        }.get(type(node), f"'{type(node).__name__}'")
        self.fail(node, f"{what} is not allowed; expected arithmetic with numbers and functions")
