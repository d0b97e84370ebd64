"""Passes over the statements of one function, before they are printed.

In go statements of the form, out come statements: :func:`tidy` removes what is never read, and
:func:`leave` ends the function after a failure, in C that is compiled without jumps:

    const double a = unused * 2.0;                       LEAVE is empty where a failure jumps:
    return divide(ctx, x, y, 3);                         see support.h
    if (checked(ctx, i, n, 0, 4) > 2) { ... }

    tidy     the first line goes
    leave    const bool held_1_ = checked(ctx, i, n, 0, 4) > 2;
             LEAVE(0.0);
             if (held_1_) { ... }

:func:`leave` comes last: what it adds must not be counted as a use.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from runtime.codegen import form


def tidy(statements: list[form.Statement]) -> list[form.Statement]:
    """Statements without variables that are never read; calls for their effects stay."""
    before: Counter[str] | None = None
    while (reads := Counter(form.used(statements))) != before:
        # Again, since removing one variable may leave another one without a reader.
        statements, before = _without(statements, reads), reads
    return statements


def _without(statements: list[form.Statement], reads: Counter[str]) -> list[form.Statement]:
    made: list[form.Statement] = []
    for statement in statements:
        match statement:
            case form.Declare(name=name, value=value) if not reads[name]:
                made += _effects(value)
            case form.Table(name=name) if not reads[name]:
                pass
            case form.Set(place=form.Name(name=name), value=value, sign="=") if not reads[name]:
                made += _effects(value)
            case form.If(body=body, orelse=orelse):
                body, orelse = _without(body, reads), _without(orelse, reads)
                made.append(replace(statement, body=body, orelse=orelse))
            case form.While(body=body) | form.For(body=body) | form.Block(body=body):
                made.append(replace(statement, body=_without(body, reads)))
            case _:
                made.append(statement)
    return made


def _effects(value: form.Expr | None) -> list[form.Statement]:
    return [form.Do(value, void=True)] if value is not None and form.has_call(value) else []


def leave(
    statements: Sequence[form.Statement], zero: tuple[form.Expr, ...], fresh: Callable[[str], str]
) -> list[form.Statement]:
    """Statements that leave the function after a failure.

    Parameters
    ----------
    zero : what the function then returns, without meaning; empty if it returns nothing.
    fresh : gives a new name for a temporary.
    """
    made: list[form.Statement] = []

    def held(c_type: str, value: form.Expr) -> form.Expr:
        """A value that is computed before a statement, or where it cannot fail, in it."""
        if not value.fails:
            return value
        name = fresh("held")
        made.extend([form.Declare(c_type, name, value), form.Leave()])
        return form.Name(name, True)

    for statement in statements:
        match statement:
            case form.If(test=test, body=body, orelse=orelse):
                test = held("bool", test)
                made.append(form.If(test, leave(body, zero, fresh), leave(orelse, zero, fresh)))
            case form.While(test=test, body=body):
                if test is not None and test.fails:
                    # Computed again before each round.
                    name = fresh("held")
                    ended = form.If(form.Prefix("!", form.Name(name, True)), [form.Jump("break")])
                    again: list[form.Statement] = [form.Declare("bool", name, test)]
                    again += [form.Leave(), ended]
                    made.append(form.While(None, again + leave(body, zero, fresh)))
                else:
                    made.append(form.While(test, leave(body, zero, fresh)))
            case form.For(start=start, stop=stop, body=body):
                start, stop = held("int64_t", start), held("int64_t", stop)
                body = leave(body, zero, fresh)
                made.append(replace(statement, start=start, stop=stop, body=body))
            case form.Block(body=body):
                made.append(form.Block(leave(body, zero, fresh)))
            case form.Fail(failure=failure):
                made += [form.Do(form.Call("fail", (form.CTX, failure))), form.Return(zero)]
            case form.Return():
                made.append(statement)
            case _:
                made.append(statement)
                if any(expr.fails for expr in form.expressions(statement)):
                    made.append(form.Leave())
    return made
