"""The C text of one function while it is written: lines, local variables, temporaries, failures."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Protocol

from runtime.codegen.names import local_name
from runtime.codegen.source import Function, Source
from runtime.codegen.types import (
    BOOL,
    EITHER,
    FLOAT,
    INT,
    Array,
    NotTypedError,
    Type,
    join,
    leaves,
)
from runtime.codegen.values import (
    ATOM,
    LOOSE,
    Value,
    array_type,
    converted,
    product_text,
    size_text,
)

C_SIZES = {"bool": 1, "int": 8, "float": 8}


class Failures:
    """The failures of a unit, by number: exception, message, file and line."""

    def __init__(self) -> None:
        self.listed: list[tuple[str, str, str, int]] = []
        self.numbers: dict[tuple[str, str, str, int], int] = {}

    def number(self, kind: str, message: str, file: str, line: int) -> int:
        """The number of a failure."""
        entry = (kind, message, file, line)
        if entry not in self.numbers:
            self.numbers[entry] = len(self.listed)
            self.listed.append(entry)
        return self.numbers[entry]


class Caller(Protocol):
    """What a function's text needs of its unit."""

    source: Source
    check: bool
    leaving: str

    def call(
        self, body: Body, target: Function, given: Sequence[Value], named: Mapping[str, Value]
    ) -> Value:
        """A call of a function of the source."""

    def returning(self, value: Value) -> str:
        """The statement that returns a value."""


class Body:
    """One function's C text, and what is known about its variables.

    Variables are C variables named after those of the source. A variable's type is the join of
    all values assigned to it; :attr:`widened` tells that a text used a type that was too narrow,
    and the function is written again with the types found.

    A :class:`Value` is a text that is evaluated where it is put, which may be after the values of
    later operands. So whoever evaluates several operands goes through :meth:`in_order`, which
    keeps those that read memory in temporaries where a later one changes memory or draws a number:

        state.h[0] + self.f(state)   ->   const double value_1_ = h[0];
                                          const double f_1_ = f(ctx, self);
                                          value_1_ + f_1_

    ``effects`` counts lines that must stay, as those that may fail; ``changes`` those after which
    memory or a generator is not what it was.

    Parameters
    ----------
    function : the source.
    failures : of the unit.
    types : of variables, from an earlier pass.
    check : the source is not ours: indexes and integers that may be too large are checked.
    """

    def __init__(
        self, function: Function, failures: Failures, types: dict[str, Type], check: bool
    ) -> None:
        self.function, self.failures, self.check = function, failures, check
        self.types = types
        self.values: dict[str, Value] = {}
        self.versions: dict[str, int] = {}
        self.declared: dict[str, Type] = {}
        self.lines: list[str] = []
        self.depth = 1
        self.nested = 0
        self.effects = 0
        self.changes = 0
        self.widened = False
        self.uses_entries = False
        self.stable: set[str] = set()
        self.tops: dict[str, Type] = {}
        self.temporaries: dict[str, int] = {}
        self.line = function.line

    # Text

    def expr(self, node: ast.expr) -> Value:
        """The value of an expression; defined by :class:`Expressions`."""
        raise NotImplementedError

    def put(self, text: str) -> None:
        """Add a line."""
        self.lines.append("    " * self.depth + text)

    def act(self, text: str) -> None:
        """Add a line that changes memory, draws a number, or may fail."""
        self.effects += 1
        self.put(text)

    def change(self) -> None:
        """What follows changes memory that others see, or draws a number."""
        self.effects += 1
        self.changes += 1

    @contextmanager
    def block(self, head: str, end: str = "}") -> Iterator[None]:
        """Lines in braces."""
        self.put(f"{head} {{")
        self.depth += 1
        self.nested += 1
        try:
            yield
        finally:
            self.depth -= 1
            self.nested -= 1
        self.put(end)

    @contextmanager
    def captured(self) -> Iterator[list[str]]:
        """Lines that are kept aside."""
        whole, self.lines = self.lines, []
        try:
            yield self.lines
        finally:
            self.lines = whole

    def fresh(self, stem: str) -> str:
        """A new name for a temporary."""
        self.temporaries[stem] = self.temporaries.get(stem, 0) + 1
        return f"{stem}_{self.temporaries[stem]}_"

    def fail(self, kind: str, message: str) -> int:
        """The number of a failure at the present line."""
        self.effects += 1
        return self.failures.number(kind, message, self.function.file, self.line)

    # Values

    def in_order(self, evaluations: Iterable[Callable[[], Value]]) -> list[Value]:
        """Values evaluated one after the other, each as it was at its turn."""
        values: list[Value] = []
        for evaluate in evaluations:
            before = self.changes
            with self.captured() as lines:
                value = evaluate()
            if self.changes > before:
                values = [self.kept(v) if _reads_memory(v) else v for v in values]
            self.lines += lines
            values.append(value)
        return values

    def reached(self, value: Value) -> Value:
        """A value whose failure comes now, even if nothing reads it."""
        return self.kept(value) if any("(ctx" in text for text in value.texts) else value

    def as_type(self, value: Value, kind: Type) -> Value:
        """A value as one of a wider type; an int that a float cannot hold fails."""
        return converted(self.exact(value) if kind == EITHER else value, kind)

    def exact(self, value: Value) -> Value:
        """An integer as a float of the same value, or a failure; other values as they are."""
        if value.type != INT or value.is_known or not self.check or _is_index(value):
            return value
        return Value(FLOAT, (f"exact(ctx, {value.text}, {self.too_large()})",))

    def too_large(self) -> str:
        """The number of the failure of an integer that Python holds and C does not."""
        return str(self.fail("OverflowError", "an integer has more digits than are compiled"))

    def kept(self, value: Value, stem: str = "value") -> Value:
        """The value in temporaries, so that it is computed once and here."""
        if value.each is not None:
            return self.stored(value)
        if value.is_known or not value.texts:
            return value
        name = self.fresh(stem)
        texts = []
        for text, (suffix, kind) in zip(value.texts, leaves(value.type), strict=True):
            if text.isidentifier() and text in self.stable:
                texts.append(text)
                continue
            self.put(f"{_constant(kind)}{name}{suffix} = {text};")
            self.stable.add(f"{name}{suffix}")
            texts.append(f"{name}{suffix}")
        return Value(value.type, tuple(texts), ATOM, value.const, value.low, value.high)

    def stored(self, value: Value) -> Value:
        """An array expression as a new array, or the array as it is."""
        if value.each is None:
            return value
        made = self.new(array_type(value).kind, list(value.sizes), array_type(value).dims)
        self.fill(made, value)
        return made

    def new(self, kind: str, sizes: Sequence[str], dims: tuple[int | None, ...]) -> Value:
        """A new array in the arena, not yet filled."""
        made = Array(kind, dims)
        name = self.fresh("array")
        texts = [name]
        held = []
        for axis, size in enumerate(sizes):
            if dims[axis] is None:
                self.put(f"const int64_t {name}n{axis} = {size};")
                texts.append(f"{name}n{axis}")
                held.append(f"{name}n{axis}")
            else:
                held.append(size)
        self.stable.update(texts)
        total = product_text([str(C_SIZES[kind]), *held]) if held else str(C_SIZES[kind])
        number = self.fail("MemoryError", "local arrays need more memory than the arena has")
        c_type = next(leaves(made))[1]
        self.act(f"{c_type}const {name} = take(ctx, {total}, {number});")
        return Value(made, tuple(texts))

    def fill(self, target: Value, value: Value) -> None:
        """Copy a number, an array or an array expression into an array, element by element."""
        axes = len(array_type(target).dims)
        indices = [self.fresh("i") for _ in range(axes)]
        opened = 0
        for axis, index in enumerate(indices):
            size = size_text(target, axis)
            self.put(f"for (int64_t {index} = 0; {index} < {size}; {index}++) {{")
            self.depth += 1
            opened += 1
        source = self.at(value, indices)
        wanted = converted(source, self.element_type(target))
        self.act(f"{self.place(target, indices)} = {wanted.text};")
        for _ in range(opened):
            self.depth -= 1
            self.put("}")

    def at(self, value: Value, indices: Sequence[str]) -> Value:
        """The element of an array, an array expression or a number at the indices of a result.

        Axes of size one, and missing first axes, are repeated.
        """
        if not isinstance(value.type, Array):
            return value
        dims = value.type.dims
        own = list(indices[len(indices) - len(dims) :])
        own = ["0" if size == 1 else index for size, index in zip(dims, own, strict=True)]
        if value.each is not None:
            return value.each(own)
        return Value(self.element_type(value), (self.place(value, own),))

    def element_type(self, value: Value) -> Type:
        """The type of an array's elements."""
        kind = array_type(value).kind
        return {"int": INT, "float": FLOAT}.get(kind, BOOL)

    def place(self, array: Value, indices: Sequence[str]) -> str:
        """The C text of an element's place."""
        return f"{array.text}[{offset(array, indices)}]"

    # Variables

    def assign(self, name: str, value: Value) -> None:
        """Assign to a local variable; its type becomes the join of all its values."""
        if value.each is not None:
            value = self.stored(value)
        version = self.versions.get(name, 0)
        key = f"{name}@{version}"
        known = self.types.get(key)
        if known is None:
            self.types[key] = value.type
        elif known != value.type and key in self.declared and not self.nested:
            # From here on the name stands for another variable.
            self.versions[name] = version + 1
            self.assign(name, value)
            return
        elif known != value.type:
            try:
                joined = join(known, value.type)
            except NotTypedError as error:
                if self.nested:
                    raise NotTypedError(f"'{name}' {error}") from None
                self.versions[name] = version + 1
                self.assign(name, value)
                return
            self.widened = self.widened or (joined != known and key in self.declared)
            self.types[key] = joined
        self.write(name, key, self.as_type(value, self.types[key]))

    def parameter(self, name: str, kind: Type) -> None:
        """A parameter of the function."""
        key = f"{name}@0"
        self.types.setdefault(key, kind)
        self.types[key] = join(self.types[key], kind)
        self.declared[key] = kind
        target = self.c_name(name)
        texts = tuple(f"{target}{suffix}" for suffix, _ in leaves(kind))
        if name in self.function.once:
            self.stable.update(texts)
        elif self.types[key] != kind:
            self.move(name, key, kind)

    def move(self, name: str, key: str, kind: Type) -> None:
        """Continue with a parameter of a narrow type in a variable of a wider one."""
        source = self.c_name(name)
        texts = tuple(f"{source}{suffix}" for suffix, _ in leaves(kind))
        wide = converted(Value(kind, texts), self.types[key])
        self.versions[name] = 1
        self.types.setdefault(f"{name}@1", self.types[key])
        self.types[key] = kind
        self.assign(name, wide)

    def write(self, name: str, key: str, value: Value) -> None:
        """Write the assignment of a value of the variable's own type."""
        target = self.c_name(name)
        is_new = key not in self.declared
        self.declared[key] = value.type
        here = is_new and not self.nested
        fixed = here and name in self.function.once
        if is_new and not here:
            self.tops[target] = value.type
        for text, (suffix, c_type) in zip(value.texts, leaves(value.type), strict=True):
            if here:
                self.put(f"{_constant(c_type, fixed)}{target}{suffix} = {text};")
            elif text != f"{target}{suffix}":
                self.put(f"{target}{suffix} = {text};")
        if name in self.function.uncertain:
            self.tops[f"{target}_set_"] = BOOL
            self.put(f"{target}_set_ = true;")
        if fixed:
            texts = tuple(f"{target}{suffix}" for suffix, _ in leaves(value.type))
            self.stable.update(texts)
            self.values[name] = Value(value.type, texts, ATOM, value.const, value.low, value.high)
        else:
            self.values.pop(name, None)

    def c_name(self, name: str) -> str:
        """The C name of a variable."""
        version = self.versions.get(name, 0)
        return local_name(name) + (f"_v{version}" if version else "")

    def read(self, name: str) -> Value:
        """A local variable's value."""
        if name in self.values:
            return self.values[name]
        kind = self.types.get(f"{name}@{self.versions.get(name, 0)}")
        if kind is None:
            raise NotTypedError(f"uses '{name}' before it is assigned")
        target = self.c_name(name)
        if name in self.function.uncertain:
            self.tops[f"{target}_set_"] = BOOL
            failure = self.fail("UnboundLocalError", f"'{name}' is used before it is assigned")
            self.put(f"if (!{target}_set_) fail(ctx, {failure});")
        return Value(kind, tuple(f"{target}{suffix}" for suffix, _ in leaves(kind)))


def _reads_memory(value: Value) -> bool:
    """Whether a value that is not evaluated yet depends on what memory holds."""
    return value.each is not None or any("[" in t or "(" in t for t in value.texts)


def _is_index(value: Value) -> bool:
    """Whether an integer is certainly exact as a float: a count, an index, or a small number."""
    if value.low is None or value.low < -(2**53) or value.high is None:
        return False
    return isinstance(value.high, str) or value.high <= 2**53


def offset(array: Value, indices: Sequence[str]) -> str:
    """The C text of an element's distance from an array's start."""
    kind = array_type(array)
    if kind.packed:
        text = indices[0] if indices else "0"
        for axis in range(1, len(indices)):
            size = size_text(array, axis)
            scaled = product_text([_operand(text), size])
            text = indices[axis] if scaled == "0" else _sum(scaled, indices[axis])
        return text
    at = 1 + sum(n is None for n in kind.dims)
    terms = [product_text([_operand(i), array.texts[at + k]]) for k, i in enumerate(indices)]
    terms = [term for term in terms if term != "0"]
    return " + ".join(terms) or "0"


def _sum(a: str, b: str) -> str:
    return a if b == "0" else f"{a} + {b}"


def _operand(text: str) -> str:
    plain = all(c.isalnum() or c in "_." for c in text)
    return text if plain else f"({text})"


def _constant(c_type: str, fixed: bool = True) -> str:
    """The start of a declaration of a variable that is never assigned again."""
    space = "" if c_type.endswith("*") else " "
    if not fixed:
        return f"{c_type}{space}"
    return f"{c_type}const " if c_type.endswith("*") else f"const {c_type} "


def line_of(node: ast.AST) -> int:
    """A node's line, 0 if it has none."""
    return int(getattr(node, "lineno", 0) or 0)


__all__ = ["ATOM", "LOOSE", "Body", "Failures", "line_of", "offset"]
