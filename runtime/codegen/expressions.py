"""Expressions of the source as C text."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from functools import partial

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.body import Body, Caller, Failures
from runtime.codegen.knowing import (
    both,
    calls,
    constant,
    identical,
    lowest,
)
from runtime.codegen.names import local_name
from runtime.codegen.source import Function
from runtime.codegen.types import (
    BOOL,
    INT,
    NONE,
    Array,
    Known,
    Maybe,
    NotTypedError,
    Number,
    Tuple,
    Type,
    join,
    leaves,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    group,
    known,
    none,
    number,
    parts_of,
    size_of,
)


class Expressions(Body, ast.NodeVisitor):
    """Writes the expressions of one function.

    Parameters
    ----------
    writer : of the unit; it writes the functions that are called.
    """

    def __init__(
        self,
        writer: Caller,
        function: Function,
        failures: Failures,
        types: dict[str, Type],
    ) -> None:
        super().__init__(function, failures, types, writer.check)
        self.writer = writer
        self.heads: dict[str, str] = {}

    def expr(self, node: ast.expr) -> Value:
        """The value of an expression.

        Raises
        ------
        NotTypedError : it is outside the compiled subset.
        """
        line = getattr(node, "lineno", None)
        self.line = self.function.line + line if line else self.line
        visit = getattr(self, f"visit_{type(node).__name__}", None)
        if visit is None:
            raise NotTypedError(f"holds a {type(node).__name__}, which is not compiled")
        value: Value = visit(node)
        return value

    def each(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """The values of expressions that are evaluated from left to right."""
        inner = [node.value if isinstance(node, ast.Starred) else node for node in nodes]
        values = self.in_order(partial(self.expr, node) for node in inner)
        found: list[Value] = []
        for node, value in zip(nodes, values, strict=True):
            found += parts_of(value) if isinstance(node, ast.Starred) else [value]
        return found

    # Names and constants

    def visit_Constant(self, node: ast.Constant) -> Value:
        if node.value is None:
            return none()
        if isinstance(node.value, (bool, int, float)):
            return number(node.value)
        if isinstance(node.value, str):
            return known(node.value)
        raise NotTypedError(f"uses {node.value!r}")

    def visit_Name(self, node: ast.Name) -> Value:
        name = node.id
        if f"{name}@{self.versions.get(name, 0)}" in self.types or name in self.function.counts:
            return self.read(name)
        if self.function.bound and name in self.writer.source.entries:
            return self.entry(name)
        if name in ("float", "int", "bool"):
            return known(name)
        raise NotTypedError(f"uses '{name}'")

    def entry(self, name: str) -> Value:
        """An entry of the unit, read once at the top of the function."""
        kind = self.writer.source.entries[name]
        target = local_name(name)
        for suffix, c_type in leaves(kind):
            space = "" if c_type.endswith("*") else " "
            const = "const" if c_type.endswith("*") else ""
            head = f"{c_type}{const} " if const else f"const {c_type}{space}"
            self.heads[f"{target}{suffix}"] = f"{head}{target}{suffix} = self->{target}{suffix};"
        texts = tuple(f"{target}{suffix}" for suffix, _ in leaves(kind))
        self.stable.update(texts)
        return Value(kind, texts)

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and node.value.id in ("math", "np"):
            return constant(node.value.id, node.attr)
        value = self.expr(node.value)
        if isinstance(value.type, Array):
            axes = range(len(value.type.dims))
            if node.attr == "shape":
                return group([size_of(value, k) for k in axes])
            if node.attr == "ndim":
                return number(len(axes))
            if node.attr == "size":
                return library.size(value)
            if node.attr == "T":
                return arrays.transposed(self.stored(value))
            if node.attr == "flat":
                return library.ravel(self, value)
        raise NotTypedError(f"reads '{ast.unparse(node)}'")

    def visit_Tuple(self, node: ast.Tuple | ast.List) -> Value:
        return group([self.reached(self.stored(v)) for v in self.each(node.elts)])

    def visit_List(self, node: ast.List) -> Value:
        return self.visit_Tuple(node)

    # Operators

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.expr(node.operand)
        if isinstance(node.op, ast.Not):
            return scalars.inverted(self.truth(value))
        if isinstance(node.op, ast.USub):
            return library.negated(self, value)
        is_bool = arrays.elements(value) == BOOL
        if isinstance(node.op, ast.UAdd) and not is_bool:
            return value
        if isinstance(node.op, ast.Invert) and is_bool and isinstance(value.type, Array):
            return library.lifted(self, [value], scalars.inverted, BOOL)
        raise NotTypedError("inverts bits, or gives a bool a sign; use 'not' or int(...)")

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        a, b = self.each([node.left, node.right])
        return self.operated(node.op, a, b)

    def operated(self, op: ast.operator, a: Value, b: Value) -> Value:
        """A binary operator."""
        if isinstance(a.type, Tuple) and isinstance(b.type, Tuple) and isinstance(op, ast.Add):
            return group([*parts_of(a), *parts_of(b)])
        if isinstance(a.type, Tuple) and isinstance(op, ast.Mult) and b.type == INT and b.is_known:
            return group(parts_of(a) * int(b.const))
        if isinstance(op, ast.MatMult):
            return library.matmul(self, a, b)
        a, b = (creation.as_array(self, v) if self._mixed(v, a, b) else v for v in (a, b))
        return library.operator(self, op, [a, b])

    @staticmethod
    def _mixed(value: Value, a: Value, b: Value) -> bool:
        """Whether a tuple is combined with an array."""
        arrays_too = any(isinstance(v.type, Array) for v in (a, b))
        return arrays_too and isinstance(value.type, Tuple)

    def visit_Compare(self, node: ast.Compare) -> Value:
        a, b = self.each([node.left, node.comparators[0]])
        return self.compared_on(node.ops, a, b, node.comparators[1:])

    def compared_on(
        self, ops: Sequence[ast.cmpop], a: Value, b: Value, nodes: Sequence[ast.expr]
    ) -> Value:
        """``a < b < ...``: what follows is evaluated only if the first comparison holds."""
        if not nodes:
            return self.compared(ops[0], a, b)
        b = self.kept(b)
        first = self.compared(ops[0], a, b)

        def rest() -> Value:
            return self.compared_on(ops[1:], b, self.expr(nodes[0]), nodes[1:])

        return self.decided(first, rest, "&&")

    def compared(self, op: ast.cmpop, a: Value, b: Value) -> Value:
        """One comparison."""
        if isinstance(op, (ast.Is, ast.IsNot, ast.Eq, ast.NotEq)):
            same = identical(a, b)
            if same is not None:
                return scalars.inverted(same) if isinstance(op, (ast.IsNot, ast.NotEq)) else same
        if isinstance(op, (ast.In, ast.NotIn)):
            a = self.kept(a)
            found = both([self.compared(ast.Eq(), a, part) for part in parts_of(b)], "||")
            return scalars.inverted(found) if isinstance(op, ast.NotIn) else found
        if isinstance(a.type, Tuple) and isinstance(b.type, Tuple):
            pairs = zip(parts_of(a), parts_of(b), strict=False)
            if isinstance(op, (ast.Eq, ast.NotEq)) and len(a.type.parts) == len(b.type.parts):
                found = both([self.compared(ast.Eq(), x, y) for x, y in pairs], "&&")
                return scalars.inverted(found) if isinstance(op, ast.NotEq) else found
        return library.compared(self, op, [a, b])

    def truth(self, value: Value) -> Value:
        """Whether a value counts as true."""
        if isinstance(value.type, Known):
            return number(bool(value.type.value))
        if isinstance(value.type, Tuple):
            return number(bool(value.type.parts))
        if isinstance(value.type, Maybe):
            return Value(BOOL, value.texts[:1])
        if isinstance(value.type, Array):
            value = library.item(self, value)
        return scalars.truth(value)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        sign = "&&" if isinstance(node.op, ast.And) else "||"
        return self.chained(node.values, sign)

    def chained(self, nodes: Sequence[ast.expr], sign: str) -> Value:
        """``and`` and ``or``: the right side is evaluated only if the left does not decide."""
        first = self.expr(nodes[0])
        if len(nodes) == 1:
            return first
        tested = self.truth(first)
        if tested.const is not UNKNOWN:
            decides = bool(tested.const) == (sign == "||")
            return first if decides else self.chained(nodes[1:], sign)
        first = first if first.type == BOOL else self.kept(first)
        return self.decided(first, partial(self.chained, nodes[1:], sign), sign)

    def decided(self, first: Value, following: Callable[[], Value], sign: str) -> Value:
        """The first value if it decides, or else what follows, which is evaluated only then."""
        tested = self.truth(first)
        with self.captured() as lines:
            self.depth += 1
            self.nested += 1
            rest = following()
            self.depth -= 1
            self.nested -= 1
        if first.type == BOOL and rest.type == BOOL and not lines:
            return both([tested, rest], sign)
        return self.chosen(tested, (lines, rest), ([], first), sign == "||")

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        test = self.truth(self.expr(node.test))
        if test.const is not UNKNOWN:
            return self.expr(node.body if test.const else node.orelse)
        branches = []
        for part in (node.body, node.orelse):
            with self.captured() as lines:
                self.depth += 1
                self.nested += 1
                value = self.stored(self.expr(part))
                self.depth -= 1
                self.nested -= 1
            branches.append((lines, value))
        return self.chosen(test, branches[0], branches[1], False)

    def chosen(
        self,
        test: Value,
        yes: tuple[list[str], Value],
        no: tuple[list[str], Value],
        swapped: bool,
    ) -> Value:
        """One of two values, each with the lines that compute it."""
        if swapped:
            yes, no = no, yes
        kind = join(yes[1].type, no[1].type)
        a, b = self.as_type(yes[1], kind), self.as_type(no[1], kind)
        if not yes[0] and not no[0] and len(a.texts) == 1 and isinstance(kind, Number):
            text = f"{test.within(3)} ? {a.within(1)} : {b.within(1)}"
            return Value(kind, (f"({text})",), low=lowest(a, b))
        name = self.fresh("chosen")
        targets = [f"{name}{suffix}" for suffix, _ in leaves(kind)]
        for target, (_, c_type) in zip(targets, leaves(kind), strict=True):
            self.put(f"{c_type}{'' if c_type.endswith('*') else ' '}{target};")
        for head, lines, value in ((f"if ({test.text}) {{", yes[0], a), ("} else {", no[0], b)):
            self.put(head)
            self.lines += lines
            for target, text in zip(targets, value.texts, strict=True):
                self.put(f"    {target} = {text};")
        self.put("}")
        return Value(kind, tuple(targets))

    # Subscripts

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        value = self.expr(node.value)
        if isinstance(value.type, Maybe):
            value = Value(value.type.part, value.texts[1:])
        if isinstance(value.type, Tuple):
            return self.part(self.kept(value) if calls(node.slice) else value, node.slice)
        if not isinstance(value.type, Array):
            raise NotTypedError(f"takes an element of a {value.type}")
        whole = isinstance(node.slice, ast.Constant) and node.slice.value is Ellipsis
        if whole and not value.type.dims:
            return value
        indices = self.indices(node.slice, value)
        if len(indices) == 1 and isinstance(indices[0], Value):
            chosen = indices[0]
            if isinstance(chosen.type, Array):
                return builtins.selected(self, value, chosen)
        return arrays.subscript(self, value, indices)

    def part(self, value: Value, node: ast.expr) -> Value:
        """A part of a tuple, or some of them."""
        parts = parts_of(value)
        if isinstance(node, ast.Slice):
            bounds = [self.expr(b) if b else None for b in (node.lower, node.upper, node.step)]
            if any(b is not None and b.const is UNKNOWN for b in bounds):
                raise NotTypedError("slices a tuple with bounds that are not literal numbers")
            first, last, step = (None if b is None else int(b.const) for b in bounds)
            return group(parts[first:last:step])
        index = self.expr(node)
        if index.const is not UNKNOWN:
            if not -len(parts) <= int(index.const) < len(parts):
                raise NotTypedError(f"takes part {index.const} of {len(parts)}")
            return parts[int(index.const)]
        kind = parts[0].type if parts else NONE
        if not isinstance(kind, Number) or any(p.type != kind for p in parts):
            return builtins.picked(self, parts, index)
        name = self.fresh("array")
        entries = ", ".join(part.text for part in parts)
        self.put(f"const {next(leaves(kind))[1]} {name}[{len(parts)}] = {{{entries}}};")
        held = Value(Array(kind.kind, (len(parts),), frozen=True), (name,))
        return arrays.subscript(self, held, [index])

    def indices(self, node: ast.expr, array: Value, stored: bool = False) -> list[arrays.Index]:
        """The indices of a subscript, ``stored`` to or read; ``...`` stands for whole axes."""
        nodes = node.elts if isinstance(node, ast.Tuple) else [node]
        found: list[arrays.Index] = []
        before = self.changes
        axes = len(array.type.dims) if isinstance(array.type, Array) else 0
        for part in nodes:
            if isinstance(part, ast.Constant) and part.value is Ellipsis:
                found += [arrays.Cut()] * (axes - len(nodes) + 1)
                if axes < len(nodes) and axes and not stored:
                    raise NotTypedError("takes an element with '...', which is an array of one")
            elif isinstance(part, ast.Slice):
                found.append(self.cut(part))
            else:
                value = self.expr(part)
                found += parts_of(value) if isinstance(value.type, Tuple) else [value]
        if self.changes > before and len(nodes) > 1:
            raise NotTypedError("changes something in one of several indices; assign it before")
        return found

    def cut(self, node: ast.Slice) -> arrays.Cut:
        bounds = [self.expr(b) if b else None for b in (node.lower, node.upper)]
        bounds = [None if b is None or b.type == NONE else b for b in bounds]
        step = self.expr(node.step) if node.step else number(1)
        if step.const is UNKNOWN or not isinstance(step.const, int):
            raise NotTypedError("uses a slice with a step that is not a literal number")
        return arrays.Cut(bounds[0], bounds[1], step.const)
