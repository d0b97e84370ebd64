"""The form as C text: the only module that writes C's syntax.

In go expressions and statements, out come lines:

    Operator("*", Operator("+", Name("a"), Name("b")), Literal(2.0))      (a + b) * 2.0
    If(Name("found"), [Jump("break")])                                    if (found) {
                                                                              break;
                                                                          }
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from runtime.codegen import form

INDENT = "    "


def declared(c_type: str, name: str, const: bool = False) -> str:
    """A declaration without its value; of a pointer, ``const`` is what is never changed."""
    if c_type.endswith("*"):
        return f"{c_type}{'const ' * const}{name}"
    return f"{'const ' * const}{c_type} {name}"


def text(expr: form.Expr, rank: int = 0) -> str:
    """An expression as an operand of an operator of this rank."""
    made = _text(expr)
    return made if expr.rank >= rank else f"({made})"


def _text(expr: form.Expr) -> str:
    match expr:
        case form.Name(name=name):
            return name
        case form.Literal(value=value):
            return _literal(value)
        case form.Call(function=function, arguments=arguments):
            return f"{function}({', '.join(map(text, arguments))})"
        case form.Draw(generator=generator, kind=kind):
            return f"(double)draw_{kind}({text(generator)})"
        case form.Item(array=array, index=index):
            return f"{text(array, form.SIGN + 1)}[{text(index)}]"
        case form.Member(record=record, name=name):
            return f"{text(record)}{name}"
        case form.Operator():
            return _operator(expr)
        case form.Logic():
            return f"({condition(expr)})"
        case form.Prefix(sign=sign, operand=operand):
            return f"{sign}{text(operand, form.SIGN + 1)}"
        case form.Choice():
            return f"({condition(expr)})"
    raise TypeError(f"no C text for a {type(expr).__name__}")


def condition(expr: form.Expr) -> str:
    """An expression where parentheses around it stand already."""
    match expr:
        case form.Logic(sign=sign, parts=parts):
            return f" {sign} ".join(map(text, parts))
        case form.Choice(test=test, yes=yes, no=no):
            return f"{text(test, form.SIGN)} ? {text(yes, form.SUM)} : {text(no, form.SUM)}"
    return text(expr)


def _operator(expr: form.Operator) -> str:
    if expr.sign in form.BITS:
        return f"({text(expr.left, form.SIGN + 1)} {expr.sign} {text(expr.right, form.SIGN + 1)})"
    if expr.sign not in form.RANKS:
        return f"{text(expr.left, form.SUM)} {expr.sign} {text(expr.right, form.SUM)}"
    # a - (b + c) and a * (b * c) keep their parentheses: the order of rounding is the source's.
    # Downwards in a loop: a sum of 4,000 terms is as many nodes deep.
    found: list[str] = []
    part: form.Expr = expr
    rank = expr.rank
    while isinstance(part, form.Operator) and part.rank == rank:
        found += [text(part.right, rank + 1), part.sign]
        part = part.left
    return " ".join([text(part, rank), *reversed(found)])


def _literal(value: float) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return f"INT64_C({value})" if abs(value) >= 2**31 else str(value)
    if math.isnan(value):
        return "(double)NAN"
    if math.isinf(value):
        return f"{'-' * (value < 0.0)}(double)INFINITY"
    return repr(value)


class Printer:
    """Prints the statements of one function.

    Parameters
    ----------
    struct : the name of the struct that it returns, if it returns more than one number.
    zero : what it returns after a failure.
    """

    def __init__(self, struct: str, zero: tuple[form.Expr, ...]) -> None:
        self.struct, self.zero = struct, zero

    def lines(self, statements: Iterable[form.Statement], depth: int = 1) -> Iterator[str]:
        """The lines of statements."""
        for statement in statements:
            for line in self.statement(statement):
                yield f"{INDENT * depth}{line}"

    def statement(self, statement: form.Statement) -> Iterator[str]:
        """The lines of one statement."""
        match statement:
            case form.Declare(c_type=c_type, name=name, value=None):
                yield f"{declared(c_type, name)};"
            case form.Declare(c_type=c_type, name=name, value=form.Expr() as value, const=const):
                yield f"{declared(c_type, name, const)} = {condition(value)};"
            case form.Table(c_type=c_type, name=name, values=values):
                yield f"const {c_type} {name}[{len(values)}] = {{{', '.join(map(text, values))}}};"
            case form.Set(place=place, value=value, sign=sign):
                yield f"{text(place)} {sign} {condition(value)};"
            case form.Append(array=array, index=index, value=value):
                yield f"{text(array)}[{index.name}++] = {condition(value)};"
            case form.Do(call=call, void=void):
                yield f"{'(void)' * void}{text(call, form.SIGN if void else 0)};"
            case form.Return(leaves=leaves):
                yield f"return{self.returned(leaves)};"
            case form.Leave():
                yield f"LEAVE({self.returned(self.zero).strip()});"
            case form.Jump(word=word):
                yield f"{word};"
            case form.Fail():
                raise TypeError("a failure is printed after passes.leave")
            case form.If() | form.While() | form.For() | form.Block():
                yield from self.compound(statement)

    def compound(self, statement: form.Compound) -> Iterator[str]:
        """The lines of a statement that contains others."""
        match statement:
            case form.If(test=test, body=body, orelse=orelse):
                yield f"if ({condition(test)}) {{"
                yield from self.lines(body)
                if orelse:
                    yield "} else {"
                    yield from self.lines(orelse)
            case form.While(test=test, body=body):
                yield f"while ({'true' if test is None else condition(test)}) {{"
                yield from self.lines(body)
            case form.For(index=index, start=start, stop=stop, step=step, body=body):
                sign = "<" if step > 0 else ">"
                change = {1: f"{index}++", -1: f"{index}--"}.get(step, f"{index} += {step}")
                bounds = f"{index} = {text(start)}; {index} {sign} {text(stop, form.SUM)}"
                yield f"{'ANY_ORDER ' * statement.any_order}for (int64_t {bounds}; {change}) {{"
                yield from self.lines(body)
            case form.Block(body=body):
                yield "{"
                yield from self.lines(body)
        yield "}"

    def returned(self, leaves: tuple[form.Expr, ...]) -> str:
        """A value after ``return``."""
        if len(leaves) > 1:
            return f" (struct {self.struct}){{{', '.join(map(text, leaves))}}}"
        return f" {text(leaves[0])}" if leaves else ""
