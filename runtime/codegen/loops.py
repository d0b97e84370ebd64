"""Loops of the source as C text."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from runtime.codegen import arrays, scalars
from runtime.codegen.calls import Calls
from runtime.codegen.knowing import is_strict
from runtime.codegen.types import INT, Array, NotTypedError, Tuple, join, leaves
from runtime.codegen.values import (
    SUM,
    UNKNOWN,
    Value,
    converted,
    group,
    number,
    parts_of,
    size_text,
)


class Loops(Calls, ast.NodeVisitor):
    """Writes the loops of one function."""

    def all(self, statements: Sequence[ast.stmt]) -> bool:
        """Write statements; defined by :class:`Statements`."""
        raise NotImplementedError

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
        text = test.text[1:-1] if in_parentheses(test.text) else test.text
        with self.block(f"while ({text})"):
            self.all(node.body)

    def visit_For(self, node: ast.For) -> None:
        if node.orelse:
            raise NotTypedError("uses 'else' after a loop")
        source = node.iter
        if isinstance(source, ast.Call) and isinstance(source.func, ast.Name):
            name = source.func.id if source.func.id not in self.function.counts else ""
            if name == "range" and not source.keywords:
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
        if name == "enumerate" and isinstance(values[0].type, Tuple):
            return False
        if name != "enumerate" and not all(isinstance(v.type, Array) for v in values):
            if all(_length(v) is not None for v in values):
                return False
            raise NotTypedError("walks along arrays and tuples at once; write the loop")
        if name == "enumerate":
            if call.keywords or len(values) > 2:
                raise NotTypedError("calls enumerate with a keyword; write enumerate(x, start)")
            start = self.kept(values[1]) if len(values) > 1 else number(0)
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
        if is_strict(call):
            sizes = [size_text(value, 0) for value in values]
            for other in dict.fromkeys(sizes[1:]):
                if other != sizes[0]:
                    failure = self.fail("ValueError", "zip() arguments are of different lengths")
                    self.act(f"same_size(ctx, {sizes[0]}, {other}, {failure});")
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
        if name in self.function.loops_read_later:
            return ""
        plain = self.c_name(name)
        around = name in self.values and self.values[name].text == plain
        hides = around or name not in self.function.indices
        return self.fresh(plain) if hides else plain

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


def _length(value: Value) -> int | None:
    if isinstance(value.type, Tuple):
        return len(value.type.parts)
    return value.type.dims[0] if isinstance(value.type, Array) else None


def in_parentheses(text: str) -> bool:
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


def _is_fixed(value: Value, changed: set[str], body: Loops) -> bool:
    """Whether a loop's bound is a number or a variable that the loop does not change."""
    if value.const is not UNKNOWN or value.text in body.stable:
        return True
    return value.text.isidentifier() and value.text not in {body.c_name(n) for n in changed}
