"""How many operations a step takes at most, counted in the typed form of the blocks' functions.

In: functions of the form, and the integers among a block's parameters. Out: :class:`Operations` of
one call of a function. Lengths are followed through arguments and results, so that loops over them
are counted::

    product(ctx, a, 4, 4, b, 4)   ->   for (i < a_n0) for (j < b_n1) for (k < a_n1): 64 passes

A length that depends on data is bounded by what it is a part of: at most as many neurons spike as
there are, whatever happened in a recorded run::

    flatnonzero(ctx, marks, 60)   ->   for (i < 60) found += marked;   found_n0: at most 60
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from runtime.codegen import form
from runtime.codegen.unit import CFunction

ALIGNED = 8  # bytes that local arrays are multiples of: ARENA_STEP of support.h
MATH = tuple(
    """
    sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 exp2 log log1p log2
    log10 sqrt cbrt floor ceil trunc rint round fabs hypot copysign fmod pow remainder frexp ldexp
    fmin fmax nearbyint erf erfc
""".split()
)
FUNCTIONS = (*MATH, "power", "length_of")
ONES = ("least", "greatest", "np_least", "np_greatest", "sign_of")
DIVISIONS = ("divide", "modulo", "floor_divide")  # and others that begin so
CHECKED = {"int_add": "+", "int_subtract": "-", "int_multiply": "*"}  # with a test of the size
INTEGERS = ("int64_t", "bool")


class AtMost(int):
    """The largest value of a length that depends on data; the smallest is 0."""


Length = int | None  # None: not known
Known = dict[form.Expr, int]


@dataclass
class Operations:
    """Operations of one call: of every branch as if it were taken, loops with their bounds.

    arithmetic : additions, subtractions, multiplications, minima and maxima. divisions : also
    remainders. functions : calls of math.h. open_loops : loops whose length depends on data, each
    counted as one pass. reserved : bytes of local arrays whose size is known. is_open : whether
    there are others, or some in a loop whose length depends on data.
    """

    arithmetic: int = 0
    divisions: int = 0
    functions: int = 0
    open_loops: int = 0
    reserved: int = 0
    is_open: bool = False

    def add(self, other: Operations, times: int = 1) -> None:
        """Add what is done a number of times."""
        self.arithmetic += times * other.arithmetic
        self.divisions += times * other.divisions
        self.functions += times * other.functions
        self.open_loops += other.open_loops
        self.reserved += times * other.reserved
        self.is_open |= other.is_open


@dataclass
class Counter:
    """Counts the operations of functions, which are given by name."""

    functions: Mapping[str, CFunction]
    counted: dict[Any, tuple[Operations, tuple[Length, ...]]] = field(default_factory=dict)

    def count(self, name: str, entries: Mapping[str, int] = MappingProxyType({})) -> Operations:
        """The operations of one call of a function; ``entries`` are integers of its block."""
        own: Known = {form.entry(word): value for word, value in entries.items()}
        return self.call(name, (), own)[0]

    def call(
        self, name: str, arguments: Sequence[Length], entries: Mapping[form.Expr, int]
    ) -> tuple[Operations, tuple[Length, ...]]:
        """The operations of one call, and the integers among what it returns."""
        exact = tuple(type(argument) for argument in arguments)
        key = (name, tuple(arguments), exact, tuple(entries.items()))
        if key not in self.counted:
            function = self.functions[name]
            pairs = zip(function.parameters, arguments, strict=False)  # "count" gives none
            known = dict(entries)
            known |= {form.Name(name): value for (_, name), value in pairs if value is not None}
            call = _Call(self, entries, known)
            call.count(function.statements, 1, False)
            self.counted[key] = call.total, call.returned or ()
        return self.counted[key]


class _Call:
    """Counts one call of a function.

    Parameters
    ----------
    entries : the integers of the block. known : these, and the integers among the arguments.
    """

    def __init__(self, counter: Counter, entries: Mapping[form.Expr, int], known: Known) -> None:
        self.counter, self.entries, self.known = counter, entries, known
        self.total = Operations()
        self.marks: set[form.Expr] = set()  # variables that are true or false
        self.returned: tuple[Length, ...] | None = None

    def count(self, statements: Iterable[form.Statement], times: int, is_open: bool) -> None:
        """Count statements that are reached a number of times, or in a loop of unknown length."""
        for each in statements:
            passes, is_endless = 1, isinstance(each, form.While)
            if isinstance(each, form.For):
                length = passes_of(each, self.known)
                passes, is_endless = (1, True) if length is None else (length, False)
            self.total.open_loops += is_endless
            done = self.done(each)
            done.is_open |= bool(done.reserved) and (is_open or is_endless)
            self.total.add(done, times * passes)
            self.learn(each, times, is_open)
            for inside in form.inner(each):
                self.count(inside, times * passes, is_open or is_endless)

    def learn(self, statement: form.Statement, times: int, is_open: bool) -> None:
        """Keep the integers that a statement gives to variables, or returns."""
        match statement:
            case form.Declare(c_type="bool", name=name):
                self.marks.add(form.Name(name))
            case form.Declare(c_type="int64_t", name=name, value=form.Expr() as value, const=True):
                if (length := length_of(value, self.known)) is not None:
                    self.known[form.Name(name)] = length
            case form.Set(place=place, value=value, sign="+=") if value in self.marks:
                if not is_open:  # what is found in an array
                    self.known[place] = AtMost(times)
            case form.Return(leaves=leaves) if len(leaves) > 1 and leaves[0] != form.NULL:
                values = tuple(length_of(each, self.known) for each in leaves)
                before = values if self.returned is None else self.returned
                self.returned = tuple(map(_either, values, before))

    def done(self, statement: form.Statement) -> Operations:
        """The operations of a statement without those inside it; integers are not counted."""
        found = Operations()
        if isinstance(statement, form.For):
            return found
        is_counted = getattr(statement, "c_type", "") not in INTEGERS
        found.arithmetic += isinstance(statement, form.Set) and statement.sign != "="
        for expr in form.expressions(statement):
            self.expression(expr, found, is_counted)
        if isinstance(statement, form.Declare) and isinstance(statement.value, form.Call):
            _, values = self.inside(statement.value)
            for i, value in enumerate(values):
                if value is not None:
                    self.known[form.Member(form.Name(statement.name), f".v{i}")] = value
        return found

    def expression(self, expr: form.Expr, found: Operations, is_counted: bool) -> None:
        """Add the operations of an expression; indices are integers, their calls are counted."""
        waiting = [(expr, is_counted)]
        while waiting:
            part, counted = waiting.pop()
            if isinstance(part, form.Operator) and counted:
                found.arithmetic += part.sign in ("+", "-", "*")
                found.divisions += part.sign == "/"
            elif isinstance(part, form.Call):
                self.called(part, found)
            if isinstance(part, form.Item):
                waiting += [(part.array, counted), (part.index, False)]
            else:
                waiting += [(each, counted) for each in part.operands]

    def called(self, call: form.Call, found: Operations) -> None:
        """Add the operations of a call, without those of its arguments."""
        name = call.function
        if name == "take":
            size = length_of(call.arguments[1], self.known)
            found.is_open |= size is None
            found.reserved += -(-(size or 0) // ALIGNED) * ALIGNED
        elif name in self.counter.functions:
            found.add(self.inside(call)[0])
        elif name in FUNCTIONS:
            found.functions += 1
        elif name in ONES:
            found.arithmetic += 1
        elif name.startswith(DIVISIONS):
            found.divisions += 1

    def inside(self, call: form.Call) -> tuple[Operations, tuple[Length, ...]]:
        """The operations of a function that is called, and the integers that it returns."""
        if call.function not in self.counter.functions:
            return Operations(), ()
        arguments = [length_of(each, self.known) for each in call.arguments]
        return self.counter.call(call.function, arguments, self.entries)


def length_of(expr: form.Expr, known: Mapping[form.Expr, int]) -> Length:
    """What an expression of integers is; None if that is not known."""
    match expr:
        case form.Literal(value=int() as value) if not isinstance(value, bool):
            return value
        case form.Prefix(sign="-", operand=operand):
            length = length_of(operand, known)
            return None if length is None or isinstance(length, AtMost) else -length
        case form.Operator(sign="+" | "-" | "*" as sign, left=left, right=right):
            return _sum(sign, length_of(left, known), length_of(right, known))
        case form.Call(function=name, arguments=arguments):
            arguments = arguments[1:] if arguments[:1] == (form.CTX,) else arguments
            return _limited(name, [length_of(each, known) for each in arguments])
    return known.get(expr)


def _sum(sign: str, one: Length, other: Length) -> Length:
    """A sum, difference or product."""
    if one is None or other is None:
        return None
    # From at most 5, at most 5 is left.
    less = 0 if isinstance(other, AtMost) else other
    found = {"+": one + other, "-": one - less, "*": one * other}[sign]
    return found if type(one) is type(other) is int else AtMost(found)


def _limited(function: str, arguments: list[Length]) -> Length:
    """What a function of support.h returns that tests or limits an integer."""
    first, last = arguments[0] if arguments else None, arguments[-1] if arguments else None
    if function in CHECKED:
        return _sum(CHECKED[function], *arguments[:2])
    if function in ("array_size", "same_size"):
        return first
    if function == "not_negative" and first is not None:
        return first if isinstance(first, AtMost) else max(0, first)
    if function == "clamped" and last is not None:  # a bound of a slice
        if first is None or isinstance(first, AtMost) or isinstance(last, AtMost):
            return AtMost(last if first is None or first < 0 else min(first, last))
        return min(max(0, first + last if first < 0 else first), last)
    return None


def _either(one: Length, other: Length) -> Length:
    """What is known of a value that is one of two."""
    if one is None or other is None or (one == other and type(one) is type(other)):
        return one if one == other else None
    return AtMost(max(one, other))


def passes_of(loop: form.For, known: Mapping[form.Expr, int]) -> Length:
    """How often a loop's body runs at most; None if that is unknown."""
    first, last = length_of(loop.start, known), length_of(loop.stop, known)
    if loop.step < 0:
        first, last = last, first  # counts down
    # A loop that begins at a variable has at most the passes of one that begins at 0.
    if last is None:
        return None
    first = None if isinstance(first, AtMost) else first
    return max(0, -(-(last - (first or 0)) // abs(loop.step)))
