"""Which arrays the functions of blocks never write to: these are constants of a controller.

In go functions of the typed form, out come for each the pointers that something may be stored
through: its parameters, and the members of its block's struct. Whatever is not plainly a read
counts as a store.

    static void flush(double *x) { x[0] = 0.0; }                        x
    static double first(double *x, double *y) { return x[0] + y[0]; }   none
    double *const cells = self->state_cells; flush(cells);              self->state_cells
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from runtime.codegen import form
from runtime.codegen.unit import CFunction

Roots = frozenset[form.Expr]  # what a pointer may point into: parameters, and members of the struct
NOTHING: Roots = frozenset()


@dataclass
class Unchanged:
    """Finds stores in functions, which are given by name."""

    functions: Mapping[str, CFunction]
    known: dict[str, Roots] = field(default_factory=dict)

    def written(self, name: str) -> Roots:
        """The parameters and members of the struct that a function may store through."""
        if name not in self.known:
            function = self.functions[name]
            pointers = _pointers(function)
            found = (self.stores(each, pointers) for each in form.walk(function.statements))
            self.known[name] = NOTHING.union(*found)
        return self.known[name]

    def stores(self, statement: form.Statement, pointers: Mapping[form.Expr, Roots]) -> Roots:
        """What a statement may store through, without statements inside it."""
        found, expressions = NOTHING, form.expressions(statement)
        match statement:
            case form.Set(place=form.Item(array=array, index=index), value=value):
                found, offsets = _roots(array, pointers)
                expressions = (index, value, *offsets)
            case (
                form.Declare(value=form.Expr() as value)
                | form.Set(place=form.Name(), value=value, sign="=")
            ):
                # Another name of a pointer, or a number of the struct, is no store.
                roots, offsets = _roots(value, pointers)
                expressions = offsets if roots else (value,)
        return found.union(*(self.uses(each, pointers) for each in expressions))

    def uses(self, expr: form.Expr, pointers: Mapping[form.Expr, Roots]) -> Iterator[form.Expr]:
        """What the uses of pointers in an expression may store through."""
        waiting = [expr]
        while waiting:
            part = waiting.pop()
            if isinstance(part, form.Item) and part.array in pointers:
                waiting.append(part.index)  # an element is read
            elif isinstance(part, form.Call) and part.function in self.functions:
                written = self.written(part.function)
                parameters = self.functions[part.function].parameters
                for (_, parameter), argument in zip(parameters, part.arguments, strict=True):
                    roots, offsets = _roots(argument, pointers)
                    waiting += offsets if roots or argument == form.SELF else (argument,)
                    if argument == form.SELF:
                        yield from (each for each in written if isinstance(each, form.Member))
                    elif form.Name(parameter) in written:
                        yield from roots
            elif part == form.SELF:
                raise ValueError("unknown use of a block's struct")
            elif roots := _roots(part, pointers)[0]:
                yield from roots
                waiting += _roots(part, pointers)[1]
            else:
                waiting += part.operands


def stored(functions: Mapping[str, CFunction], methods: Iterable[str]) -> frozenset[str]:
    """The members of a block's struct that its methods may store through."""
    found = NOTHING.union(*map(Unchanged(functions).written, methods))
    return frozenset(
        each.name.removeprefix("->") for each in found if isinstance(each, form.Member)
    )


def _roots(
    expr: form.Expr, pointers: Mapping[form.Expr, Roots]
) -> tuple[Roots, tuple[form.Expr, ...]]:
    """What an expression may point into, if it is a pointer, and what is added to it."""
    offsets: list[form.Expr] = []
    while isinstance(expr, form.Operator) and expr.sign == "+":
        offsets.append(expr.right)
        expr = expr.left
    if isinstance(expr, form.Member) and expr.record == form.SELF:
        return frozenset((expr,)), tuple(offsets)
    return pointers.get(expr, NOTHING), tuple(offsets)


def _pointers(function: CFunction) -> dict[form.Expr, Roots]:
    """What each pointer of a function may point into."""
    found: dict[form.Expr, Roots] = {}
    for c_type, name in function.parameters:
        if c_type.endswith("*") and name != form.SELF.name:
            found[form.Name(name)] = frozenset((form.Name(name),))
    statements = list(form.walk(function.statements))
    for statement in (*statements, *statements):  # in a loop, it is used before it is set
        match statement:
            case form.Declare(c_type=c_type, name=name, value=form.Expr() as value):
                is_pointer, place = c_type.endswith("*"), form.Name(name)
            case form.Set(place=form.Name() as place, value=value, sign="="):
                is_pointer = True
            case _:
                continue
        roots, _ = _roots(value, found)
        if is_pointer and roots:
            found[place] = found.get(place, NOTHING) | roots
    return found
