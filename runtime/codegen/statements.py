"""Statements of the source as C text."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence

from runtime.codegen import arrays, builtins, library, scalars
from runtime.codegen.expressions import Expressions
from runtime.codegen.types import (
    FLOAT,
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
    SUM,
    UNKNOWN,
    Value,
    array_type,
    converted,
    group,
    none,
    number,
    parts_of,
    size_text,
)


class Statements(Expressions, ast.NodeVisitor):
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
            self.expr(node.value)

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
        if any(isinstance(part, ast.Call) for part in ast.walk(target.slice)):
            value = self.kept(value)
        indices = self.indices(target.slice, array)
        first = indices[0] if indices else None
        if isinstance(first, Value) and isinstance(first.type, Array):
            builtins.select_and_write(self, array, first, value)
            return
        place = arrays.subscript(self, array, indices)
        if isinstance(place.type, Array):
            if isinstance(value.type, Tuple):
                value = library.as_array(self, [value], {})
            arrays.write(self, place, value)
            return
        if array_type(array).frozen:
            raise NotTypedError("writes into an input or a stored output; write to a copy")
        if isinstance(value.type, Array):
            value = library.method(self, value, "item", [], {})
        kind = arrays.elements(array)
        if kind != FLOAT and value.type == FLOAT:
            value = scalars.whole(self, value)
        self.act(f"{place.text} = {converted(scalars.as_number(value), kind).text};")

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Name):
            before = self.expr(ast.Name(target.id, ast.Load(), lineno=node.lineno))
            self.augmented(target, before, node)
        elif isinstance(target, ast.Subscript):
            self.augmented_part(target, node)
        else:
            raise NotTypedError(f"assigns to '{ast.unparse(target)}'")

    def augmented(self, target: ast.Name, before: Value, node: ast.AugAssign) -> None:
        """``x += value`` of a variable; arrays change in place."""
        if isinstance(before.type, Array):
            value = self.operated(node.op, before, self.expr(node.value))
            arrays.write(self, before, value)
            return
        value = self.expr(node.value)
        made = self.operated(node.op, before, value)
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}.get(type(node.op))
        short = isinstance(before.type, Number) and made.type == before.type and made.is_known
        if sign and not short and before.type == made.type and isinstance(made.type, Number):
            key = f"{target.id}@{self.versions.get(target.id, 0)}"
            if key in self.declared or target.id in self.function.parameters:
                self.put(f"{before.text} {sign} {converted(value, made.type).text};")
                return
        self.assign(target.id, made)

    def augmented_part(self, target: ast.Subscript, node: ast.AugAssign) -> None:
        """``a[i] += value``; the index is evaluated once."""
        array = self.expr(target.value)
        indices = [
            self.kept(i) if isinstance(i, Value) and not i.text.isidentifier() else i
            for i in self.indices(target.slice, array)
        ]
        first = indices[0] if indices else None
        if isinstance(first, Value) and isinstance(first.type, Array):
            before = builtins.selected(self, array, first)
            value = self.operated(node.op, before, self.expr(node.value))
            builtins.select_and_write(self, array, first, value)
            return
        value = self.expr(node.value)
        place = arrays.subscript(self, array, indices)
        if array_type(array).frozen:
            raise NotTypedError("writes into an input or a stored output; write to a copy")
        made = self.operated(node.op, place, value)
        if isinstance(place.type, Array):
            arrays.write(self, place, made)
            return
        kind = arrays.elements(array)
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}.get(type(node.op))
        if sign and made.type == kind:
            self.act(f"{place.text} {sign} {converted(value, kind).text};")
            return
        made = scalars.whole(self, made) if kind != FLOAT and made.type == FLOAT else made
        self.act(f"{place.text} = {converted(made, kind).text};")

    # Branches and loops

    def visit_If(self, node: ast.If) -> bool:
        test = self.truth(self.expr(node.test))
        if test.const is not UNKNOWN:
            return self.all(node.body if test.const else node.orelse)
        text = test.text[1:-1] if _in_parentheses(test.text) else test.text
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

    def visit_While(self, node: ast.While) -> None:
        if node.orelse:
            raise NotTypedError("uses 'else' after a loop")
        with self.captured() as lines:
            self.depth += 1
            self.nested += 1
            test = self.truth(self.expr(node.test))
            self.depth -= 1
            self.nested -= 1
        if test.const is not UNKNOWN and not test.const:
            return
        if lines:
            with self.block("while (true)"):
                self.lines += lines
                self.put(f"if (!({test.text})) break;")
                self.all(node.body)
            return
        text = test.text[1:-1] if _in_parentheses(test.text) else test.text
        with self.block(f"while ({text})"):
            self.all(node.body)

    def visit_For(self, node: ast.For) -> None:
        if node.orelse:
            raise NotTypedError("uses 'else' after a loop")
        source = node.iter
        if isinstance(source, ast.Call) and isinstance(source.func, ast.Name):
            name = source.func.id
            if name == "range":
                self.counted(node, self.each(source.args))
                return
            if name in ("enumerate", "zip", "reversed") and self.walks_arrays(node, name, source):
                return
        value = None
        if not isinstance(source, ast.Call) or not isinstance(source.func, ast.Name):
            value = self.expr(source)
        if value is not None and isinstance(value.type, Array):
            self.walked(node, [value], lambda items, i: items[0])
            return
        items = self.items(source) if value is None else parts_of(value)
        self.over(node, items)

    def walks_arrays(self, node: ast.For, name: str, call: ast.Call) -> bool:
        """Write ``for`` over ``enumerate``, ``zip`` or ``reversed`` of arrays, if they are."""
        if any(isinstance(a, ast.Call) and isinstance(a.func, ast.Name) for a in call.args):
            return False
        values = [self.stored(self.expr(a)) for a in call.args]
        if not values or not any(isinstance(v.type, Array) for v in values):
            return False
        if not all(isinstance(v.type, Array) for v in values):
            if all(_length(v) is not None for v in values):
                return False
            raise NotTypedError("walks along arrays and tuples at once; write the loop")
        if name == "enumerate":
            start = self.expr(call.args[1]) if len(call.args) > 1 else number(0)
            self.walked(
                node,
                values[:1],
                lambda items, i: group(
                    [i if start.const == 0 else scalars.binary(self, ast.Add(), i, start), items[0]]
                ),
            )
            return True
        if name == "reversed":
            raise NotTypedError("walks along an array from its end; write the loop over its index")
        self.walked(node, values, lambda items, i: group(items))
        return True

    def walked(self, node: ast.For, arrays_: Sequence[Value], make: object) -> None:
        """A loop along the first axis of arrays."""
        values = [self.kept(self.stored(v)) for v in arrays_]
        sizes = list(dict.fromkeys(size_text(v, 0) for v in values))
        size = sizes[0]
        for other in sizes[1:]:
            size = f"int_least({size}, {other})"
        index = self.fresh("i")
        with self.block(f"for (int64_t {index} = 0; {index} < {size}; {index}++)"):
            at = Value(INT, (index,), low=0, high=int(size) if size.isdigit() else size)
            items = [arrays.subscript(self, v, [at]) for v in values]
            self.unpack(node.target, make(items, at))  # type: ignore[operator]
            self.all(node.body)

    def counted(self, node: ast.For, bounds: Sequence[Value]) -> None:
        """``for i in range(...)``."""
        if any(b.type != INT for b in bounds):
            raise NotTypedError("counts with numbers that are no integers; use int(...)")
        start = bounds[0] if len(bounds) > 1 else number(0)
        stop = bounds[1] if len(bounds) > 1 else bounds[0]
        step = bounds[2] if len(bounds) > 2 else number(1)
        if step.const is UNKNOWN or step.const == 0:
            raise NotTypedError("counts with a step that is not a literal number")
        changed = _assigned(node.body)
        if not _is_fixed(stop, changed, self):
            stop = self.kept(stop, "stop")
        up = step.const > 0
        target = node.target
        own = isinstance(target, ast.Name) and target.id not in changed
        name = self.loop_name(target.id) if own and isinstance(target, ast.Name) else ""
        index = name or self.fresh("k")
        change = {1: f"{index}++", -1: f"{index}--"}.get(step.const, f"{index} += {step.const}")
        sign = "<" if up else ">"
        low = start.low if up else (stop.low + 1 if stop.low is not None else None)
        limit = stop if up else start
        high: int | str | None = (
            limit.high - (1 if up else 0)
            if isinstance(limit.high, int)
            else (limit.text if up and limit.text in self.stable else None)
        )
        head = f"for (int64_t {index} = {start.text}; {index} {sign} {stop.within(SUM)}; {change})"
        with self.block(head):
            value = Value(INT, (index,), low=low, high=high)
            if name and isinstance(target, ast.Name):
                self.loop(target.id, value, node)
            else:
                self.unpack(target, value)
                self.all(node.body)

    def loop_name(self, name: str) -> str:
        """A C variable for a loop's index, if the source does not use it after the loop."""
        return "" if name in self.function.loops_read_later else self.c_name(name)

    def loop(self, name: str, value: Value, node: ast.For) -> None:
        """A loop's body with its index as a C variable of the loop."""
        before = self.values.get(name)
        key = f"{name}@{self.versions.get(name, 0)}"
        known = self.types.get(key)
        self.types[key] = INT
        self.values[name] = value
        self.all(node.body)
        if before is None:
            self.values.pop(name, None)
        else:
            self.values[name] = before
        if known is None:
            self.types.pop(key, None)
        else:
            self.types[key] = known

    def over(self, node: ast.For, items: Sequence[Value]) -> None:
        """``for`` over a tuple: written out, or a loop that selects the item."""
        leaves_loop = any(
            isinstance(n, (ast.Break, ast.Continue)) for s in node.body for n in ast.walk(s)
        )
        small = len(node.body) <= 3 and not leaves_loop
        if not items:
            return
        if small or (len({item.type for item in items}) > 1 and not leaves_loop):
            for item in [self.kept(item) for item in items]:
                with self.block(""):
                    self.unpack(node.target, item)
                    self.all(node.body)
            return
        kind = items[0].type
        for item in items[1:]:
            kind = join(kind, item.type)
        ready = [self.kept(converted(item, kind)) for item in items]
        index, name = self.fresh("k"), self.fresh("item")
        with self.block(f"for (int {index} = 0; {index} < {len(items)}; {index}++)"):
            texts = []
            for at, (suffix, c_type) in enumerate(leaves(kind)):
                choice = ready[-1].texts[at]
                for k in range(len(ready) - 2, -1, -1):
                    choice = f"{index} == {k} ? {ready[k].texts[at]} : {choice}"
                space = "" if c_type.endswith("*") else " "
                self.put(f"{c_type}{space}{name}{suffix} = {choice};")
                texts.append(f"{name}{suffix}")
            self.unpack(node.target, Value(kind, tuple(texts)))
            self.all(node.body)

    def visit_Break(self, node: ast.Break) -> bool:
        self.put("break;")
        return False

    def visit_Continue(self, node: ast.Continue) -> bool:
        self.put("continue;")
        return False

    # Ends

    def visit_Return(self, node: ast.Return) -> bool:
        value = none() if node.value is None else self.stored(self.expr(node.value))
        known = self.returned
        if known is None:
            self.returned = value.type
        elif known != value.type:
            self.returned = join(known, value.type)
            self.widened = self.widened or self.returned != known
        self.put(self.writer.returning(converted(value, self.returned or NONE)))
        return False

    def visit_Raise(self, node: ast.Raise) -> bool:
        kind, message = _raised(node)
        self.act(f"fail(ctx, {self.fail(kind, message)});")
        self.put(self.writer.leaving)
        return False

    def visit_Assert(self, node: ast.Assert) -> None:
        raise NotTypedError("asserts; raise an exception")


def _length(value: Value) -> int | None:
    if isinstance(value.type, Tuple):
        return len(value.type.parts)
    return value.type.dims[0] if isinstance(value.type, Array) else None


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


def _in_parentheses(text: str) -> bool:
    """Whether one pair of parentheses encloses a text."""
    if not text.startswith("("):
        return False
    depth = 0
    for i, c in enumerate(text):
        depth += (c == "(") - (c == ")")
        if depth == 0:
            return i == len(text) - 1
    return False


def _assigned(statements: Sequence[ast.stmt]) -> set[str]:
    return {
        node.id
        for statement in statements
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }


def _is_fixed(value: Value, changed: set[str], body: Statements) -> bool:
    """Whether a loop's bound is a number or a variable that the loop does not change."""
    if value.const is not UNKNOWN or value.text in body.stable:
        return True
    return value.text.isidentifier() and value.text not in {body.c_name(n) for n in changed}


def _raised(node: ast.Raise) -> tuple[str, str]:
    """The exception and the message of a ``raise``."""
    call = node.exc
    if isinstance(call, ast.Name):
        return call.id, ""
    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
        arguments = call.args
        if not arguments:
            return call.func.id, ""
        if isinstance(arguments[0], ast.Constant) and isinstance(arguments[0].value, str):
            return call.func.id, arguments[0].value
    raise NotTypedError("raises an exception whose message is not a plain text")


__all__ = ["Known", "Statements"]
