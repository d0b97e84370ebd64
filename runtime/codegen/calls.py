"""Calls and comprehensions of the source as C text."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.expressions import Expressions
from runtime.codegen.knowing import is_instance, is_module, is_strict
from runtime.codegen.types import Array, NotTypedError, unknown_call
from runtime.codegen.values import UNKNOWN, Value, group, number, parts_of


class Calls(Expressions, ast.NodeVisitor):
    """Writes the calls and comprehensions of one function."""

    def visit_Call(self, node: ast.Call) -> Value:
        function = node.func
        if isinstance(function, ast.Name):
            return self.called(node, function.id)
        if isinstance(function, ast.Attribute):
            owner = function.value
            if ast.unparse(owner).startswith(("np.", "math.")):
                name = ast.unparse(function)
                raise NotTypedError(f"calls {name}, which is not compiled; write the loop")
            whole = not is_module(owner)
            values, options = self.arguments([*([owner] if whole else []), *node.args], node)
            if whole:
                return library.method(self, values[0], function.attr, values[1:], options)
            if isinstance(owner, ast.Name) and owner.id == "math" and not options:
                return scalars.function(self, function.attr, values)
            if function.attr in creation.KINDS and not any(
                isinstance(v.type, Array) for v in values
            ):
                convert = builtins.BUILTINS[function.attr.rstrip("_64")]
                return library.applied(f"np.{function.attr}", convert, self, values, options)
            return library.numpy(self, function.attr, values, options)
        raise NotTypedError(unknown_call(ast.unparse(function)))

    def arguments(
        self, nodes: Sequence[ast.expr], call: ast.Call
    ) -> tuple[list[Value], dict[str, Value]]:
        """The values of a call's arguments, and of its keywords, in order."""
        names = [keyword.arg for keyword in call.keywords]
        if None in names:
            raise NotTypedError("calls with '**'; write the keywords")
        values = self.each([*nodes, *(keyword.value for keyword in call.keywords)])
        first = len(values) - len(names)
        return values[:first], dict(zip(map(str, names), values[first:], strict=True))

    def called(self, node: ast.Call, name: str) -> Value:
        """A call of a function of the unit, or of one that Python has."""
        if name in self.function.counts:
            raise NotTypedError(f"calls the variable '{name}'")
        target = self.writer.source.functions.get(name)
        if target is not None:
            values, options = self.arguments(node.args[1:] if target.bound else node.args, node)
            return self.writer.call(self, target, values, options)
        if name == "isinstance" and len(node.args) == 2:
            return number(is_instance(self.expr(node.args[0]), node.args[1]))
        if name == "tuple" and len(node.args) == 1:
            return self.as_tuple(node.args[0])
        function = builtins.BUILTINS.get(name)
        if function is None:
            raise NotTypedError(unknown_call(ast.unparse(node)))
        return library.applied(name, function, self, *self.arguments(node.args, node))

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
            parts = [arrays.subscript(self, value, [number(i)]) for i in range(size)]
            return group([self.kept(part) for part in parts])
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
        before = self.changes
        made = self.visit_ListComp(node)
        if self.changes > before:
            # any(...) and all(...) would stop before some of them.
            raise NotTypedError("changes something in a generator expression; write the loop")
        return made

    def items(self, node: ast.expr) -> list[Value]:
        """The items of a tuple, of a zip of tuples, or of a range of known length."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            inside = node.args
            name = node.func.id if node.func.id not in self.function.counts else ""
            if name == "zip":
                columns = [self.items(part) for part in inside]
                if is_strict(node) and len({len(column) for column in columns}) > 1:
                    raise NotTypedError("zips tuples of different lengths with strict=True")
                return [group(list(row)) for row in zip(*columns, strict=False)]
            if name == "enumerate" and len(inside) == 1 and not node.keywords:
                items = self.items(inside[0])
                return [group([number(i), item]) for i, item in enumerate(items)]
            if name == "range":
                bounds = [self.expr(part) for part in inside]
                if all(b.const is not UNKNOWN for b in bounds):
                    return [number(i) for i in range(*[int(b.const) for b in bounds])]
        value = self.expr(node)
        if isinstance(value.type, Array) and value.type.dims[0] is not None:
            value = self.stored(value)
            rows = range(value.type.dims[0])  # type: ignore[union-attr,arg-type]
            return [arrays.subscript(self, value, [number(i)]) for i in rows]
        return [self.kept(part) for part in parts_of(value)]

    def unpack(self, target: ast.expr, value: Value) -> None:
        """Assign to a target; defined by :class:`Statements`."""
        raise NotImplementedError
