"""Statements of the source as C text."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from functools import partial

from runtime.codegen import arrays, builtins, creation, library, scalars
from runtime.codegen.knowing import calls
from runtime.codegen.loops import Loops, in_parentheses
from runtime.codegen.types import (
    FLOAT,
    INT,
    NONE,
    Array,
    Maybe,
    NotTypedError,
    Number,
    Tuple,
    Type,
    join,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    none,
    number,
    parts_of,
    size_text,
)


class Statements(Loops, ast.NodeVisitor):
    """Writes the statements of one function."""

    returned: Type | None = None
    ends: list[str]

    def all(self, statements: Sequence[ast.stmt]) -> bool:
        """Write statements; returns whether the text after them can be reached."""
        return all(self.statement(statement) for statement in statements)

    def statement(self, node: ast.stmt) -> bool:
        """Write one statement; returns whether the text after it can be reached."""
        self.line = self.function.line + node.lineno if hasattr(node, "lineno") else self.line
        visit = getattr(self, f"visit_{type(node).__name__}", None)
        if visit is None:
            raise NotTypedError(f"holds a {type(node).__name__}, which is not compiled")
        return visit(node) is not False

    def visit_Pass(self, node: ast.Pass) -> None:
        pass

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.reached(self.stored(self.expr(node.value)))

    # Assignments

    def visit_Assign(self, node: ast.Assign) -> None:
        if len(node.targets) == 1:
            self.assigned(node.targets[0], node.value)
            return
        value = self.kept(self.stored(self.expr(node.value)))
        for target in node.targets:
            self.unpack(target, value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assigned(node.target, node.value)

    def assigned(self, target: ast.expr, node: ast.expr) -> None:
        """``target = value``; tuples of equal length pair by pair."""
        if isinstance(target, ast.Tuple) and isinstance(node, ast.Tuple):
            starred = any(isinstance(e, ast.Starred) for e in (*target.elts, *node.elts))
            if len(target.elts) == len(node.elts) and not starred:
                values = [self.stored(value) for value in self.each(node.elts)]
                self.pairwise(target.elts, values)
                return
        self.unpack(target, self.expr(node))

    def pairwise(self, targets: Sequence[ast.expr], values: Sequence[Value]) -> None:
        """Assign values to targets, as if all at once."""
        ready = list(values)
        for i, target in enumerate(targets):
            if any(_uses(value, target, self) for value in ready[i + 1 :]):
                ready = [self.kept(value) for value in ready]
                break
        for target, value in zip(targets, ready, strict=True):
            self.unpack(target, value)

    def unpack(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a target."""
        if isinstance(target, ast.Name):
            if target.id in self.function.loaded or value.each is not None:
                self.assign(target.id, value)
            else:
                self.reached(value)
        elif isinstance(target, (ast.Tuple, ast.List)):
            parts = self.unpacked(value, len(target.elts))
            self.pairwise(target.elts, parts)
        elif isinstance(target, ast.Subscript):
            self.write_to(target, value)
        else:
            raise NotTypedError(f"assigns to '{ast.unparse(target)}'")

    def unpacked(self, value: Value, wanted: int) -> list[Value]:
        """The parts of a tuple, or the rows of an array, that are assigned to so many targets."""
        if isinstance(value.type, Maybe):
            value = Value(value.type.part, value.texts[1:])
        if isinstance(value.type, Array):
            value = self.stored(value)
            size = size_text(value, 0)
            if size != str(wanted):
                message = f"expected {wanted} values to unpack, got {{index}}"
                failure = self.fail("ValueError", message)
                self.act(f"same_size(ctx, {size}, {wanted}, {failure});")
            return [arrays.subscript(self, value, [number(i)]) for i in range(wanted)]
        parts = parts_of(value)
        if len(parts) != wanted:
            raise NotTypedError(f"unpacks {len(parts)} values into {wanted}")
        return parts

    def write_to(self, target: ast.Subscript, value: Value) -> None:
        """``a[...] = value``."""
        array = self.expr(target.value)
        if not isinstance(array.type, Array) or array.each is not None:
            raise NotTypedError(f"assigns to a part of a {array.type}")
        value = self.stored(value)
        if calls(target.slice):
            value = self.kept(value)
        indices = self.indices(target.slice, array, stored=True)
        first = indices[0] if indices else None
        if isinstance(first, Value) and isinstance(first.type, Array):
            builtins.select_and_write(self, array, first, value)
            return
        place = arrays.subscript(self, array, indices)
        if isinstance(place.type, Array):
            if isinstance(value.type, Tuple):
                value = creation.as_array(self, value)
            arrays.write(self, place, value)
            return
        if array_type(array).frozen:
            raise NotTypedError("writes into an input or a stored output; write to a copy")
        if isinstance(value.type, Array):
            value = library.item(self, value)
        self.change()
        kind = arrays.elements(array)
        if kind == INT and value.type == FLOAT:
            value = scalars.whole(self, value)
        self.act(f"{place.text} = {converted(scalars.as_number(value), kind).text};")

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Name):
            name = ast.Name(target.id, ast.Load(), lineno=node.lineno)
            before, value = self.each([name, node.value])
            self.augmented(target, before, value, node)
        elif isinstance(target, ast.Subscript):
            self.augmented_part(target, node)
        else:
            raise NotTypedError(f"assigns to '{ast.unparse(target)}'")

    def augmented(self, target: ast.Name, before: Value, value: Value, node: ast.AugAssign) -> None:
        """``x += value`` of a variable; arrays change in place."""
        if isinstance(before.type, Array):
            arrays.write(self, before, self.operated(node.op, before, value))
            return
        if isinstance(before.type, Tuple):
            raise NotTypedError("extends a list or tuple in place; write x = x + y")
        made = self.operated(node.op, before, value)
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}.get(type(node.op))
        short = isinstance(before.type, Number) and made.type == before.type and made.is_known
        plain = made.type == FLOAT and before.type == FLOAT
        if sign and not short and plain and before.text.isidentifier():
            key = f"{target.id}@{self.versions.get(target.id, 0)}"
            if key in self.declared or target.id in self.function.parameters:
                self.put(f"{before.text} {sign} {converted(value, made.type).text};")
                return
        self.assign(target.id, made)

    def augmented_part(self, target: ast.Subscript, node: ast.AugAssign) -> None:
        """``a[i] += value``; the index is evaluated once."""
        array = self.expr(target.value)
        indices = [
            self.kept(i) if isinstance(i, Value) else i
            for i in self.indices(target.slice, array, stored=True)
        ]
        first = indices[0] if indices else None
        if isinstance(first, Value) and isinstance(first.type, Array):
            selected = partial(builtins.selected, self, array, first)
            before, value = self.in_order([selected, partial(self.expr, node.value)])
            made = self.operated(node.op, before, value)
            builtins.select_and_write(self, array, first, made)
            return
        # An element is read before the value is evaluated; of a part, Python takes a view.
        place = arrays.subscript(self, array, indices)
        before, value = self.in_order([lambda: place, partial(self.expr, node.value)])
        if array_type(array).frozen:
            raise NotTypedError("writes into an input or a stored output; write to a copy")
        made = self.operated(node.op, before, value)
        if isinstance(place.type, Array):
            arrays.write(self, place, made)
            return
        self.change()
        kind = arrays.elements(array)
        if kind == FLOAT and made.type == FLOAT and before.texts == place.texts:
            sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}.get(type(node.op))
            if sign:
                self.act(f"{place.text} {sign} {converted(value, kind).text};")
                return
        made = scalars.whole(self, made) if kind == INT and made.type == FLOAT else made
        self.act(f"{place.text} = {converted(made, kind).text};")

    # Branches and ends

    def visit_If(self, node: ast.If) -> bool:
        test = self.truth(self.expr(node.test))
        if test.const is not UNKNOWN:
            return self.all(node.body if test.const else node.orelse)
        text = test.text[1:-1] if in_parentheses(test.text) else test.text
        with self.block(f"if ({text})", "}" if not node.orelse else "} else {"):
            first = self.all(node.body)
        if not node.orelse:
            return True
        self.depth += 1
        self.nested += 1
        second = self.all(node.orelse)
        self.depth -= 1
        self.nested -= 1
        self.put("}")
        return first or second

    def visit_Break(self, node: ast.Break) -> bool:
        self.put("break;")
        return False

    def visit_Continue(self, node: ast.Continue) -> bool:
        self.put("continue;")
        return False

    def visit_Return(self, node: ast.Return) -> bool:
        value = none() if node.value is None else self.stored(self.expr(node.value))
        known = self.returned
        if known is None:
            self.returned = value.type
        elif known != value.type:
            self.returned = join(known, value.type)
            self.widened = self.widened or self.returned != known
        self.put(self.writer.returning(self.as_type(value, self.returned or NONE)))
        return False

    def visit_Raise(self, node: ast.Raise) -> bool:
        kind, message = _raised(node)
        self.act(f"fail(ctx, {self.fail(kind, message)});")
        self.put(self.writer.leaving)
        return False

    def visit_Assert(self, node: ast.Assert) -> None:
        raise NotTypedError("asserts; raise an exception")


def _uses(value: Value, target: ast.expr, body: Statements) -> bool:
    """Whether a value's text depends on a target that is assigned before it."""
    text = " ".join(value.texts)
    if isinstance(target, ast.Subscript):
        return "[" in text or isinstance(value.type, Array)
    if isinstance(target, (ast.Tuple, ast.List)):
        return any(_uses(value, part, body) for part in target.elts)
    if not isinstance(target, ast.Name):
        return True
    name = re.escape(body.c_name(target.id))
    return re.search(rf"\b{name}(_\w+)?\b", text) is not None


def _raised(node: ast.Raise) -> tuple[str, str]:
    """The exception and the message of a ``raise``; one that is computed as it is in the source."""
    call = node.exc
    if call is None:
        raise NotTypedError("raises an exception again")
    if not isinstance(call, ast.Call):
        return ast.unparse(call), ""
    message = call.args[0] if call.args else ast.Constant("")
    constant = isinstance(message, ast.Constant) and isinstance(message.value, str)
    text = message.value if constant else ast.unparse(message)  # type: ignore[attr-defined]
    return ast.unparse(call.func), str(text)
