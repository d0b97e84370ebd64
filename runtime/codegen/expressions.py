"""Expressions of the source as C text."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.body import Body, Caller, Failures
from runtime.codegen.knowing import both, constant, identical, is_instance, is_module, lowest
from runtime.codegen.names import local_name
from runtime.codegen.source import Function
from runtime.codegen.types import (
    BOOL,
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
    unknown_call,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    converted,
    group,
    known,
    none,
    number,
    parts_of,
    size_of,
)

KINDS = {"float64", "int64", "bool_"}


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
        values: list[Value] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                values += parts_of(self.expr(node.value))
                continue
            before = self.effects
            with self.captured() as lines:
                value = self.expr(node)
            if self.effects > before and any("[" in t for v in values for t in v.texts):
                # What follows may change what was read.
                values = [self.kept(v) for v in values]
            self.lines += lines
            values.append(value)
        return values

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
                return size_of(arrays.flat(self, value), 0)
            if node.attr == "T":
                return arrays.transposed(self.stored(value))
            if node.attr == "flat":
                return arrays.flat(self, value)
        raise NotTypedError(f"reads '{ast.unparse(node)}'")

    def visit_Tuple(self, node: ast.Tuple | ast.List) -> Value:
        return group([self.stored(v) for v in self.each(node.elts)])

    def visit_List(self, node: ast.List) -> Value:
        return self.visit_Tuple(node)

    # Operators

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.expr(node.operand)
        if isinstance(node.op, ast.Not):
            return scalars.inverted(self.truth(value))
        if isinstance(node.op, ast.USub):
            return library.negated(self, value)
        if isinstance(node.op, ast.UAdd):
            return value
        if isinstance(value.type, (Array, Number)) and arrays.elements(value) == BOOL:
            return library.lifted(self, [value], scalars.inverted, BOOL)
        raise NotTypedError("inverts bits")

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        a, b = self.each([node.left, node.right])
        return self.operated(node.op, a, b)

    def operated(self, op: ast.operator, a: Value, b: Value) -> Value:
        """A binary operator."""
        if isinstance(a.type, Tuple) and isinstance(b.type, Tuple) and isinstance(op, ast.Add):
            return group([*parts_of(a), *parts_of(b)])
        if isinstance(a.type, Tuple) and isinstance(op, ast.Mult) and b.is_known:
            return group(parts_of(a) * int(b.const))
        if isinstance(op, ast.MatMult):
            return library.dot(self, [a, b], {})
        a, b = (creation.as_array(self, [v], {}) if self._mixed(v, a, b) else v for v in (a, b))
        return library.operator(self, op, [a, b])

    @staticmethod
    def _mixed(value: Value, a: Value, b: Value) -> bool:
        """Whether a tuple is combined with an array."""
        arrays_too = any(isinstance(v.type, Array) for v in (a, b))
        return arrays_too and isinstance(value.type, Tuple)

    def visit_Compare(self, node: ast.Compare) -> Value:
        values = self.each([node.left, *node.comparators])
        if len(node.ops) > 1:
            values[1:-1] = [self.kept(value) for value in values[1:-1]]
        found = [self.compared(op, *values[i : i + 2]) for i, op in enumerate(node.ops)]
        return found[0] if len(found) == 1 else both(found, "&&")

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
            value = library.method(self, value, "item", [], {})
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
        tested = self.truth(first)
        before = self.effects
        with self.captured() as lines:
            self.depth += 1
            self.nested += 1
            rest = self.chained(nodes[1:], sign)
            self.depth -= 1
            self.nested -= 1
        if first.type == BOOL and rest.type == BOOL and not lines:
            return both([tested, rest], sign)
        self.effects = max(self.effects, before)
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
        a, b = converted(yes[1], kind), converted(no[1], kind)
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
            return self.part(value, node.slice)
        if not isinstance(value.type, Array):
            raise NotTypedError(f"takes an element of a {value.type}")
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

    def indices(self, node: ast.expr, array: Value) -> list[arrays.Index]:
        """The indices of a subscript; ``...`` stands for whole axes."""
        nodes = node.elts if isinstance(node, ast.Tuple) else [node]
        found: list[arrays.Index] = []
        axes = len(array.type.dims) if isinstance(array.type, Array) else 0
        for part in nodes:
            if isinstance(part, ast.Constant) and part.value is Ellipsis:
                found += [arrays.Cut()] * (axes - len(nodes) + 1)
            elif isinstance(part, ast.Slice):
                found.append(self.cut(part))
            else:
                value = self.expr(part)
                found += parts_of(value) if isinstance(value.type, Tuple) else [value]
        return found

    def cut(self, node: ast.Slice) -> arrays.Cut:
        bounds = [self.expr(b) if b else None for b in (node.lower, node.upper)]
        bounds = [None if b is None or b.type == NONE else b for b in bounds]
        step = self.expr(node.step) if node.step else number(1)
        if step.const is UNKNOWN or not isinstance(step.const, int):
            raise NotTypedError("uses a slice with a step that is not a literal number")
        return arrays.Cut(bounds[0], bounds[1], step.const)

    # Calls

    def visit_Call(self, node: ast.Call) -> Value:
        function = node.func
        if isinstance(function, ast.Name):
            return self.called(node, function.id)
        if isinstance(function, ast.Attribute):
            owner = function.value
            if ast.unparse(owner).startswith(("np.", "math.")):
                name = ast.unparse(function)
                raise NotTypedError(f"calls {name}, which is not compiled; write the loop")
            given = [] if is_module(owner) else [self.expr(owner)]
            values = self.each(node.args)
            options = {k.arg or "**": self.expr(k.value) for k in node.keywords}
            if given:
                return library.method(self, given[0], function.attr, values, options)
            if isinstance(owner, ast.Name) and owner.id == "math":
                return scalars.function(self, function.attr, values)
            if function.attr in KINDS:
                return builtins.BUILTINS[function.attr.rstrip("_64")](self, values)
            return library.numpy(self, function.attr, values, options)
        raise NotTypedError(unknown_call(ast.unparse(function)))

    def called(self, node: ast.Call, name: str) -> Value:
        """A call of a function of the unit, or of one that Python has."""
        target = self.writer.source.functions.get(name)
        if target is not None and name not in self.function.counts:
            nodes = node.args[1:] if target.bound else node.args
            options = {k.arg or "**": self.expr(k.value) for k in node.keywords}
            return self.writer.call(self, target, self.each(nodes), options)
        if name == "isinstance" and len(node.args) == 2:
            return number(is_instance(self.expr(node.args[0]), node.args[1]))
        if name == "tuple" and len(node.args) == 1:
            return self.as_tuple(node.args[0])
        function = builtins.BUILTINS.get(name)
        if function is None or node.keywords:
            raise NotTypedError(unknown_call(ast.unparse(node)))
        return function(self, self.each(node.args))

    def as_tuple(self, node: ast.expr) -> Value:
        """``tuple(...)`` of a tuple, a comprehension over tuples, or an array of known length."""
        if isinstance(node, (ast.ListComp, ast.GeneratorExp)):
            return self.visit_ListComp(node)
        value = self.expr(node)
        if isinstance(value.type, Array) and len(value.type.dims) == 1:
            size = value.type.dims[0]
            if size is None:
                raise NotTypedError("makes a tuple of an array of unknown length")
            value = self.stored(value)
            return group([arrays.subscript(self, value, [number(i)]) for i in range(size)])
        parts_of(value)
        return value

    def visit_ListComp(self, node: ast.ListComp | ast.GeneratorExp) -> Value:
        """A comprehension over tuples, written out."""
        (loop,) = node.generators if len(node.generators) == 1 else (None,)
        if loop is None or loop.ifs:
            raise NotTypedError("uses a comprehension with a condition; write the loop")
        found = []
        for part in self.items(loop.iter):
            self.unpack(loop.target, part)
            found.append(self.kept(self.expr(node.elt)))
        return group(found)

    def visit_GeneratorExp(self, node: ast.GeneratorExp) -> Value:
        return self.visit_ListComp(node)

    def items(self, node: ast.expr) -> list[Value]:
        """The items of a tuple, of a zip of tuples, or of a range of known length."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            inside = [v for v in node.args if not isinstance(v, ast.Starred)]
            if node.func.id == "zip":
                columns = [self.items(part) for part in inside]
                return [group(list(row)) for row in zip(*columns, strict=False)]
            if node.func.id == "enumerate":
                items = self.items(inside[0])
                return [group([number(i), item]) for i, item in enumerate(items)]
            if node.func.id == "range":
                bounds = [self.expr(part) for part in inside]
                if all(b.const is not UNKNOWN for b in bounds):
                    return [number(i) for i in range(*[int(b.const) for b in bounds])]
        value = self.expr(node)
        if isinstance(value.type, Array) and value.type.dims[0] is not None:
            value = self.stored(value)
            rows = range(value.type.dims[0])  # type: ignore[union-attr,arg-type]
            return [arrays.subscript(self, value, [number(i)]) for i in rows]
        return parts_of(value)

    def unpack(self, target: ast.expr, value: Value) -> None:
        """Assign to a target; defined by :class:`Statements`."""
        raise NotImplementedError
