"""One function while its form is built: statements, local variables, temporaries, failures.

In go values, in Python's order; out come statements of the form, and the type of each variable.

    body.assign("y", x + 1.0)             Declare("double", "y", x + 1.0)
    body.read("y")                        Value(FLOAT, (Name("y"),))
    body.kept(value)                      Declare("double", "value_1_", ...), then its name
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

from runtime.codegen.form import (
    CTX,
    Call,
    Declare,
    Do,
    Expr,
    Fail,
    For,
    If,
    Item,
    Literal,
    Name,
    Prefix,
    Set,
    Statement,
    entry,
    names,
    product,
)
from runtime.codegen.names import local_name
from runtime.codegen.source import Failures, Function, Source
from runtime.codegen.types import (
    BOOL,
    EITHER,
    FLOAT,
    INT,
    NONE,
    NUMBERS,
    Array,
    NotTypedError,
    Type,
    join,
    leaves,
)
from runtime.codegen.values import (
    Value,
    array_type,
    axes_of,
    converted,
    offset,
    size_expr,
    zero,
)

C_SIZES = {"bool": 1, "int": 8, "float": 8}


class Caller(Protocol):
    """What a function's form needs of its unit."""

    source: Source
    check: bool
    failures: Failures

    def call(
        self, body: Body, target: Function, given: Sequence[Value], named: Mapping[str, Value]
    ) -> Value:
        """A call of a function of the source."""


class Body:
    """One function's form, and what is known about its variables.

    Variables are C variables named after those of the source. A variable's type is the join of
    all values assigned to it; :attr:`widened` tells that something was built with a type that was
    too narrow, and the function is built again with the types found.

    A :class:`Value` is computed where it is put, which may be after the values of later operands.
    So whoever evaluates several operands goes through :meth:`in_order`, which keeps those that
    read memory in temporaries where a later one changes memory or draws a number:

        state.h[0] + self.f(state)   ->   const double value_1_ = h[0];
                                          const double f_1_ = f(ctx, self);
                                          value_1_ + f_1_

    ``effects`` counts statements that must stay, as those that may fail; ``changes`` those after
    which memory or a generator is not what it was.

    Parameters
    ----------
    caller : the unit.
    function : the source.
    types : of variables, from an earlier pass.
    returned : the type of what it returns, from an earlier pass.
    """

    def __init__(
        self,
        caller: Caller,
        function: Function,
        types: dict[str, Type],
        returned: Type | None = None,
    ) -> None:
        self.caller, self.function, self.types = caller, function, types
        self.returned = returned
        # The source is not ours: indexes, and integers that may be too large, are checked.
        self.check = caller.check
        self.values: dict[str, Value] = {}
        self.versions: dict[str, int] = {}
        self.declared: dict[str, Type] = {}
        self.statements: list[Statement] = []
        # Entries of the struct, and variables that are first assigned inside of a branch or loop.
        self.heads: dict[str, Declare] = {}
        self.tops: dict[str, Type] = {}
        self.temporaries: dict[str, int] = {}
        self.nested = 0
        self.effects = 0
        self.changes = 0
        self.widened = False
        self.line = function.line

    # Statements

    def add(self, statement: Statement) -> None:
        """Add a statement."""
        self.statements.append(statement)

    def act(self, statement: Statement) -> None:
        """Add a statement that changes memory, draws a number, or may fail."""
        self.effects += 1
        self.add(statement)

    def do(self, function: str, *arguments: Expr) -> None:
        """Add a call of a function that may fail."""
        self.act(Do(Call(function, (CTX, *arguments))))

    def change(self) -> None:
        """What follows changes memory that others see, or draws a number."""
        self.effects += 1
        self.changes += 1

    @contextmanager
    def captured(self) -> Iterator[list[Statement]]:
        """Statements that are kept aside."""
        whole, self.statements = self.statements, []
        try:
            yield self.statements
        finally:
            self.statements = whole

    @contextmanager
    def branch(self) -> Iterator[list[Statement]]:
        """Statements of a branch or a loop, which may be reached never or again."""
        self.nested += 1
        try:
            with self.captured() as statements:
                yield statements
        finally:
            self.nested -= 1

    @contextmanager
    def loops(self, sizes: Sequence[Expr]) -> Iterator[list[Expr]]:
        """One loop per axis around the statements that are added meanwhile, with their indices."""
        names = [self.fresh("i") for _ in sizes]
        # What is first declared in them is theirs: such loops assign to no variable of the source.
        with self.captured() as statements:
            yield [Name(name) for name in names]
        for name, size in zip(reversed(names), reversed(sizes), strict=True):
            statements = [For(name, Literal(0), size, 1, statements)]
        self.statements += statements

    def fresh(self, stem: str) -> str:
        """A new name for a temporary."""
        self.temporaries[stem] = self.temporaries.get(stem, 0) + 1
        return f"{stem}_{self.temporaries[stem]}_"

    def fail(self, kind: str, message: str) -> Expr:
        """The number of a failure at the present line."""
        self.effects += 1
        function = self.function
        return Literal(self.caller.failures.number(kind, message, function.file, self.line))

    def same_size(self, a: Expr, b: Expr, kind: str, message: str) -> None:
        """Fail while running where two sizes differ that are not known to be equal."""
        if a != b:
            self.do("same_size", a, b, self.fail(kind, message))

    # Values

    def in_order(self, evaluations: Iterable[Callable[[], Value]]) -> list[Value]:
        """Values evaluated one after the other, each as it was at its turn."""
        values: list[Value] = []
        for evaluate in evaluations:
            before = self.changes
            with self.captured() as statements:
                value = evaluate()
            if self.changes > before:
                values = [self.kept(v) if v.reads else v for v in values]
            self.statements += statements
            values.append(value)
        return values

    def reached(self, value: Value) -> Value:
        """A value whose failure comes now, even if nothing reads it."""
        return self.kept(value) if value.fails else value

    def as_type(self, value: Value, kind: Type) -> Value:
        """A value as one of a wider type; an int that a float cannot hold fails."""
        return converted(self.exact(value) if kind == EITHER else value, kind)

    def exact(self, value: Value) -> Value:
        """An integer as a float of the same value, or a failure; other values as they are."""
        if value.type != INT or value.is_known or not self.check or _is_index(value):
            return value
        return Value(FLOAT, (Call("exact", (CTX, value.expr, self.too_large())),))

    def too_large(self) -> Expr:
        """The number of the failure of an integer that Python holds and C does not."""
        return self.fail("OverflowError", "an integer has more digits than are compiled")

    def held(self, stem: str, c_type: str, expr: Expr) -> Name:
        """An expression in a temporary, computed once and here."""
        name = self.fresh(stem)
        self.add(Declare(c_type, name, expr))
        return Name(name, True)

    def kept(self, value: Value, stem: str = "value") -> Value:
        """The value in temporaries, so that it is computed once and here."""
        if value.each is not None:
            return self.stored(value)
        if value.is_known or not value.leaves:
            return value
        name = self.fresh(stem)
        found: list[Expr] = []
        for leaf, (suffix, c_type) in zip(value.leaves, leaves(value.type), strict=True):
            if leaf.is_stable:
                found.append(leaf)
                continue
            self.add(Declare(c_type, f"{name}{suffix}", leaf))
            found.append(Name(f"{name}{suffix}", True))
        return replace(value, leaves=tuple(found))

    def stored(self, value: Value) -> Value:
        """An array expression as a new array, or the array as it is."""
        if value.each is None:
            return value
        made = self.new(array_type(value).kind, list(value.sizes), array_type(value).dims)
        self.fill(made, value)
        return made

    def new(self, kind: str, sizes: Sequence[Expr], dims: tuple[int | None, ...]) -> Value:
        """A new array in the arena, not yet filled."""
        made = Array(kind, dims)
        name = self.fresh("array")
        held: list[Expr] = []
        for axis, size in enumerate(sizes):
            if dims[axis] is None:
                self.add(Declare("int64_t", f"{name}n{axis}", size))
                held.append(Name(f"{name}n{axis}", True))
            else:
                held.append(size)
        total = product([Literal(C_SIZES[kind]), *held])
        number = self.fail("MemoryError", "local arrays need more memory than the arena has")
        c_type = next(leaves(made))[1]
        self.act(Declare(c_type, name, Call("take", (CTX, total, number))))
        dynamic = [size for size, dim in zip(held, dims, strict=True) if dim is None]
        return Value(made, (Name(name, True), *dynamic))

    def fill(self, target: Value, value: Value) -> None:
        """Copy a number, an array or an array expression into an array, element by element."""
        with self.loops([size_expr(target, axis) for axis in range(axes_of(target))]) as indices:
            wanted = converted(self.at(value, indices), NUMBERS[array_type(target).kind])
            self.act(Set(self.place(target, indices), wanted.expr))

    def at(self, value: Value, indices: Sequence[Expr]) -> Value:
        """The element of an array, an array expression or a number at the indices of a result.

        Axes of size one, and missing first axes, are repeated.
        """
        if not isinstance(value.type, Array):
            return value
        dims = value.type.dims
        own = list(indices[len(indices) - len(dims) :])
        own = [Literal(0) if size == 1 else index for size, index in zip(dims, own, strict=True)]
        if value.each is not None:
            return value.each(own)
        return Value(NUMBERS[value.type.kind], (self.place(value, own),))

    def place(self, array: Value, indices: Sequence[Expr]) -> Item:
        """An element."""
        return Item(array.expr, offset(array, indices))

    # Variables

    def entry(self, name: str) -> Value:
        """An entry of the unit, read once at the top of the function."""
        kind = self.caller.source.entries[name]
        target = local_name(name)
        found: list[Expr] = []
        for suffix, c_type in leaves(kind):
            own = f"{target}{suffix}"
            self.heads[own] = Declare(c_type, own, entry(own))
            found.append(Name(own, True))
        return Value(kind, tuple(found))

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
        if name in self.function.once:
            self.values[name] = self.variable(name, kind, stable=True)
        elif self.types[key] != kind:
            # Continue with a parameter of a narrow type in a variable of a wider one.
            wide = converted(self.variable(name, kind), self.types[key])
            self.versions[name] = 1
            self.types.setdefault(f"{name}@1", self.types[key])
            self.types[key] = kind
            self.assign(name, wide)

    def write(self, name: str, key: str, value: Value) -> None:
        """Assign a value of the variable's own type."""
        target = self.c_name(name)
        is_new = key not in self.declared
        self.declared[key] = value.type
        here = is_new and not self.nested
        fixed = here and name in self.function.once
        if is_new and not here:
            self.tops[target] = value.type
        for leaf, (suffix, c_type) in zip(value.leaves, leaves(value.type), strict=True):
            place = Name(f"{target}{suffix}")
            if here:
                self.add(Declare(c_type, place.name, leaf, const=fixed))
            elif leaf != place:
                self.add(Set(place, leaf))
        if name in self.function.uncertain:
            self.tops[f"{target}_set_"] = BOOL
            self.add(Set(Name(f"{target}_set_"), Literal(True)))
        if fixed:
            found = self.variable(name, value.type, stable=True).leaves
            self.values[name] = replace(value, leaves=found)
        else:
            self.values.pop(name, None)

    def c_name(self, name: str) -> str:
        """The C name of a variable."""
        version = self.versions.get(name, 0)
        return local_name(name) + (f"_v{version}" if version else "")

    def variable(self, name: str, kind: Type, stable: bool = False) -> Value:
        """A variable of this type."""
        target = self.c_name(name)
        return Value(kind, tuple(Name(f"{target}{suffix}", stable) for suffix, _ in leaves(kind)))

    def places_of(self, name: str) -> tuple[Expr, ...]:
        """The leaves of a variable as they are assigned to; none before it is assigned."""
        key = f"{name}@{self.versions.get(name, 0)}"
        declared = key in self.declared or name in self.function.parameters
        return self.variable(name, self.types[key]).leaves if declared else ()

    def names_of(self, name: str) -> set[str]:
        """The C variables that a value of a variable reads."""
        key = f"{name}@{self.versions.get(name, 0)}"
        known = self.values.get(name)
        kind = self.types.get(key)
        found = known or (None if kind is None else self.variable(name, kind))
        return set() if found is None else {n for leaf in found.leaves for n in names(leaf)}

    def is_local(self, name: str) -> bool:
        """Whether a name is a variable or a parameter of the function."""
        return f"{name}@{self.versions.get(name, 0)}" in self.types or name in self.function.counts

    def read(self, name: str) -> Value:
        """A local variable's value."""
        if name in self.values:
            return self.values[name]
        kind = self.types.get(f"{name}@{self.versions.get(name, 0)}")
        if kind is None:
            raise NotTypedError(f"uses '{name}' before it is assigned")
        if name in self.function.uncertain:
            is_set = f"{self.c_name(name)}_set_"
            self.tops[is_set] = BOOL
            failure = self.fail("UnboundLocalError", f"'{name}' is used before it is assigned")
            self.add(If(Prefix("!", Name(is_set)), [Fail(failure)]))
        return self.variable(name, kind)

    def returns(self, value: Value) -> Value:
        """A value as the function returns it; the type becomes the join of all such values."""
        known = self.returned
        if known is None:
            self.returned = value.type
        elif known != value.type:
            self.returned = join(known, value.type)
            self.widened = self.widened or self.returned != known
        return self.as_type(value, self.returned or NONE)

    def whole(self) -> list[Statement]:
        """All statements, after the declarations that come first."""
        tops = [
            Declare(c_type, name + suffix, leaf, const=False)
            for name, kind in self.tops.items()
            for (suffix, c_type), leaf in zip(leaves(kind), zero(kind), strict=True)
        ]
        return [*self.heads.values(), *tops, *self.statements]


def _is_index(value: Value) -> bool:
    """Whether an integer is certainly exact as a float: a count, an index, or a small number."""
    if value.low is None or value.low < -(2**53) or value.high is None:
        return False
    return isinstance(value.high, Expr) or value.high <= 2**53
