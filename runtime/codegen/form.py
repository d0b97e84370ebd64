"""The form between Python's syntax tree and C: expressions and statements that can be asked.

In go the parts of an expression or statement, out comes a frozen node that knows what it depends
on. Types are those of :class:`runtime.codegen.values.Value`, whose leaves are expressions of this
form. Whether something reads memory, may fail, or uses a variable is asked here, never of C text:

    Operator("+", Item(Name("h"), Literal(0)), Call("f", (CTX,)))
        .reads   True: h[0] is another value after a store
        .fails   True: f takes the context, through which a failure is reported
        names()  h, ctx
        text     h[0] + f(ctx)         (``printing``)

A node that may fail has the context as the first argument of a call. ``passes.leave`` relies on
it, and every function of support.h that calls ``fail`` takes the context first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

Part = TypeVar("Part")

# How tightly an expression binds: an operand of lower rank is printed in parentheses.
LOOSE, SUM, PRODUCT, SIGN, ATOM = range(5)
RANKS = {"+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT, "%": PRODUCT}
BITS = ("&", "|", "^")


def _of(node: Any, kind: type[Part]) -> tuple[Part, ...]:
    """What a node has of a kind, by itself or in tuples, in the order of its members."""
    found: list[Part] = []
    for name in node.__match_args__:
        value = getattr(node, name)
        values = value if isinstance(value, tuple) else (value,)
        found += [each for each in values if isinstance(each, kind)]
    return tuple(found)


@dataclass(frozen=True)
class Expr:
    """An expression.

    reads : whether its value may be another one later: it reads memory, or calls a function.
    fails : whether it contains a call that may fail.
    """

    reads: bool = field(default=False, init=False, compare=False, repr=False)
    fails: bool = field(default=False, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        # Computed here and not when asked: a sum of 4,000 terms is 4,000 nodes deep.
        reads = isinstance(self, (Call, Draw, Item)) or any(part.reads for part in self.operands)
        fails = isinstance(self, Call) and self.arguments[:1] == (CTX,)
        object.__setattr__(self, "reads", reads)
        object.__setattr__(self, "fails", fails or any(part.fails for part in self.operands))

    @property
    def operands(self) -> tuple[Expr, ...]:
        """The expressions that it is made of."""
        return _of(self, Expr)

    @property
    def rank(self) -> int:
        """How tightly it binds."""
        return ATOM

    @property
    def is_stable(self) -> bool:
        """Whether it is a variable that is never assigned again."""
        return False


@dataclass(frozen=True)
class Name(Expr):
    """A variable; ``stable`` ones keep the value that they are declared with.

    Names of temporaries end with an underscore, those of the source's variables do not.
    """

    name: str
    stable: bool = field(default=False, compare=False)

    @property
    def is_stable(self) -> bool:
        return self.stable

    @property
    def is_temporary(self) -> bool:
        return self.name.endswith("_")


@dataclass(frozen=True)
class Literal(Expr):
    """A number of Python: bool, int or float."""

    value: float

    @property
    def rank(self) -> int:
        # NaN and infinity are printed with a cast.
        plain = math.copysign(1.0, self.value) > 0.0 and math.isfinite(self.value)
        return ATOM if plain else SIGN


@dataclass(frozen=True)
class Call(Expr):
    """A call of a function of C, of support.h, or of the unit."""

    function: str
    arguments: tuple[Expr, ...] = ()


@dataclass(frozen=True)
class Draw(Expr):
    """A random number of a generator: ``uniform``, ``normal`` or ``exponential``."""

    generator: Expr
    kind: str


@dataclass(frozen=True)
class Item(Expr):
    """An element of an array, or of a pointer."""

    array: Expr
    index: Expr


@dataclass(frozen=True)
class Member(Expr):
    """A member of a struct, ``.v0``, or of one that is pointed to, ``->gain``."""

    record: Expr
    name: str

    @property
    def is_stable(self) -> bool:
        return self.record.is_stable


@dataclass(frozen=True)
class Operator(Expr):
    """A binary operator: arithmetic, a comparison, or bits."""

    sign: str
    left: Expr
    right: Expr

    @property
    def rank(self) -> int:
        return RANKS.get(self.sign, ATOM if self.sign in BITS else LOOSE)


@dataclass(frozen=True)
class Logic(Expr):
    """``&&`` or ``||`` of conditions: what follows is evaluated only if the first do not decide."""

    sign: str
    parts: tuple[Expr, ...]


@dataclass(frozen=True)
class Prefix(Expr):
    """``-x``, ``!x`` or a cast, ``(double)x``."""

    sign: str
    operand: Expr

    @property
    def rank(self) -> int:
        return SIGN


@dataclass(frozen=True)
class Choice(Expr):
    """``test ? yes : no``."""

    test: Expr
    yes: Expr
    no: Expr


CTX, SELF, NULL = Name("ctx", True), Name("self", True), Name("NULL", True)


def entry(name: str) -> Member:
    """A member of the block's struct."""
    return Member(SELF, f"->{name}")


def names(expr: Expr) -> Iterator[str]:
    """The variables that an expression uses, each as often as it does."""
    waiting: list[Expr] = [expr]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Name):
            yield part.name
        waiting += part.operands


def has_call(expr: Expr) -> bool:
    """Whether an expression calls a function, which may have effects."""
    waiting: list[Expr] = [expr]
    while waiting:
        part = waiting.pop()
        if isinstance(part, (Call, Draw)):
            return True
        waiting += part.operands
    return False


def operator(sign: str, parts: Sequence[Expr]) -> Expr:
    """An operator between several parts, from the left."""
    made = parts[0]
    for part in parts[1:]:
        made = Operator(sign, made, part)
    return made


def product(factors: Iterable[Expr]) -> Expr:
    """A product of integers; those that are known are multiplied while compiling."""
    constant, rest = 1, []
    for factor in factors:
        if isinstance(factor, Literal):
            constant *= int(factor.value)
        else:
            rest.append(factor)
    if not rest or constant == 0:
        return Literal(constant)
    return operator("*", [*([Literal(constant)] if constant != 1 else []), *rest])


def sum_of(terms: Iterable[Expr]) -> Expr:
    """A sum without the terms that are zero."""
    rest = [term for term in terms if term != Literal(0)]
    made = rest[0] if rest else Literal(0)
    for term in rest[1:]:
        made = Operator("+", made, term)
    return made


# Statements


@dataclass(frozen=True)
class Declare:
    """``const double x = value;``: a new variable; ``const`` ones are never assigned again."""

    c_type: str
    name: str
    value: Expr | None = None
    const: bool = True


@dataclass(frozen=True)
class Table:
    """``const double x[3] = {a, b, c};``."""

    c_type: str
    name: str
    values: tuple[Expr, ...]


@dataclass(frozen=True)
class Set:
    """``place = value;`` of a variable or an element; ``sign`` may be ``+=``, ``-=`` or ``*=``."""

    place: Expr
    value: Expr
    sign: str = "="


@dataclass(frozen=True)
class Append:
    """``array[index++] = value;``."""

    array: Expr
    index: Name
    value: Expr


@dataclass(frozen=True)
class Do:
    """A call for its effects; ``(void)`` before one whose result is not read."""

    call: Expr
    void: bool = False


@dataclass(frozen=True)
class If:
    """Two branches."""

    test: Expr
    body: list[Statement]
    orelse: list[Statement] = field(default_factory=list)


@dataclass(frozen=True)
class While:
    """A loop; without a test it ends by ``break``."""

    test: Expr | None
    body: list[Statement]


@dataclass(frozen=True)
class For:
    """``for (int64_t index = start; index < stop; index += step)``; down if the step is negative.

    Bounds that may fail are evaluated once, before the loop, as Python does. The rounds of a
    loop in ``any_order`` may be done at once.
    """

    index: str
    start: Expr
    stop: Expr
    step: int
    body: list[Statement]
    any_order: bool = False


@dataclass(frozen=True)
class Block:
    """Statements with variables of their own."""

    body: list[Statement]


@dataclass(frozen=True)
class Return:
    """The end of a function, with the leaves of its value."""

    leaves: tuple[Expr, ...]


@dataclass(frozen=True)
class Fail:
    """The end of a function by the failure of this number."""

    failure: Expr


@dataclass(frozen=True)
class Leave:
    """The end of a function if the statement before has failed; from ``passes.leave`` only."""


@dataclass(frozen=True)
class Jump:
    """``break`` or ``continue``."""

    word: str


Simple = Declare | Table | Set | Append | Do | Return | Fail | Leave | Jump
Compound = If | While | For | Block
Statement = Simple | Compound


def expressions(statement: Statement) -> tuple[Expr, ...]:
    """The expressions of a statement that are read, without those of statements inside it."""
    if isinstance(statement, Set) and isinstance(statement.place, Name) and statement.sign == "=":
        # The name that is assigned to is not read, but an element's array and index are.
        return (statement.value,)
    if isinstance(statement, Fail):
        return (CTX, statement.failure)
    return _of(statement, Expr)


def inner(statement: Statement) -> tuple[list[Statement], ...]:
    """The lists of statements inside a statement."""
    return _of(statement, list)


def walk(statements: Iterable[Statement]) -> Iterator[Statement]:
    """All statements, those inside of others included."""
    for statement in statements:
        yield statement
        for part in inner(statement):
            yield from walk(part)


def used(statements: Iterable[Statement]) -> Iterator[str]:
    """The variables that are read, each as often as they are."""
    for statement in walk(statements):
        for expr in expressions(statement):
            yield from names(expr)
