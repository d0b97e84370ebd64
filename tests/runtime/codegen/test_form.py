"""The form between Python and C: what it says of itself, its passes, and how it is printed."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from runtime.codegen.form import (
    CTX,
    Append,
    Call,
    Choice,
    Declare,
    Do,
    Draw,
    Expr,
    Fail,
    If,
    Item,
    Leave,
    Literal,
    Logic,
    Name,
    Operator,
    Prefix,
    Return,
    Set,
    Statement,
    While,
    names,
)
from runtime.codegen.passes import leave, tidy
from runtime.codegen.printing import Printer, text

SIGNS = {"+": ast.Add, "-": ast.Sub, "*": ast.Mult, "/": ast.Div, "%": ast.Mod}
BITS = {"&": ast.BitAnd, "|": ast.BitOr, "^": ast.BitXor}
leaf = st.one_of(st.sampled_from("abc").map(Name), st.integers(0, 9).map(Literal))
expressions = st.recursive(
    leaf,
    lambda part: st.one_of(
        st.builds(Operator, st.sampled_from([*SIGNS, *BITS, "<", "=="]), part, part),
        st.builds(Prefix, st.just("-"), part),
        st.builds(Item, leaf.filter(lambda each: isinstance(each, Name)), part),
        st.builds(lambda *given: Call("f", given), part, part),
    ),
)


def same(node: ast.expr, expr: Expr) -> bool:
    """Whether Python reads a text as the expression that was printed."""
    match node, expr:
        case ast.Name(id=name), Name():
            return name == expr.name
        case ast.Constant(value=value), Literal():
            return bool(value == expr.value)
        case ast.BinOp(left=left, op=op, right=right), Operator():
            there = isinstance(op, (SIGNS | BITS)[expr.sign])
            return there and same(left, expr.left) and same(right, expr.right)
        case ast.Compare(left=left, comparators=[right]), Operator(sign="<" | "=="):
            return same(left, expr.left) and same(right, expr.right)
        case ast.UnaryOp(operand=operand), Prefix():
            return same(operand, expr.operand)
        case ast.Subscript(value=array, slice=index), Item():
            return same(array, expr.array) and same(index, expr.index)
        case ast.Call(args=arguments), Call():
            return all(map(same, arguments, expr.arguments))
    return False


# Python and C agree on the precedence of all operators here but for comparisons and bits, which
# are printed in parentheses.
@given(expressions)
def test_a_text_means_the_expression(expr: Expr) -> None:
    assert same(ast.parse(text(expr), mode="eval").body, expr)


@given(expressions)
def test_what_an_expression_uses_are_the_names_in_its_text(expr: Expr) -> None:
    tree = ast.walk(ast.parse(text(expr)))
    found = sorted(n.id for n in tree if isinstance(n, ast.Name) and n.id != "f")
    assert sorted(names(expr)) == found


def test_what_reads_memory_and_what_may_fail_is_asked_of_the_form() -> None:
    item, failing = Item(Name("a"), Literal(0)), Call("divide", (CTX, Name("x"), Literal(3)))
    whole = Choice(Logic("&&", (Name("p"), Name("q"))), Operator("+", item, Name("x")), failing)
    assert (item.reads, item.fails) == (True, False)
    assert (failing.reads, failing.fails) == (True, True)
    assert (whole.reads, whole.fails) == (True, True)
    assert not Operator("*", Name("x"), Literal(2.0)).reads
    assert Draw(Name("rng"), "normal").reads


def test_a_sum_of_many_terms_is_printed_without_deep_recursion() -> None:
    expr: Expr = Name("x")
    for _ in range(5000):
        expr = Operator("+", expr, Name("x"))
    assert text(expr) == " + ".join(["x"] * 5001)
    assert len(list(names(expr))) == 5001


def printed(statements: list[Statement]) -> list[str]:
    def fresh() -> Iterator[str]:
        for number in range(9):
            yield f"held_{number}_"

    new = fresh()
    zero = (Literal(0.0),)
    left = leave(tidy(statements), zero, lambda stem: next(new))
    return list(Printer("", zero).lines(left, 0))


def test_what_is_never_read_goes_with_what_only_it_reads() -> None:
    x = Name("x")
    statements: list[Statement] = [
        Declare("double", "a", Operator("+", x, Literal(1.0))),
        Declare("double", "b", Operator("*", Name("a"), Literal(2.0))),
        Declare("double", "c", Draw(Name("rng"), "uniform")),
        If(x, [Set(Name("b"), x)]),
        Return((x,)),
    ]
    # A draw moves the generator, whether its number is read or not.
    lines = ["(void)(double)draw_uniform(rng);", "if (x) {", "}", "return x;"]
    assert printed(statements) == lines


def test_a_failure_in_a_condition_leaves_before_the_branch() -> None:
    failing = Call("checked", (CTX, Name("i")))
    statements: list[Statement] = [
        While(Operator("<", failing, Literal(3)), [Append(Name("a"), Name("k"), Literal(0))]),
        If(Prefix("!", Name("ok")), [Fail(Literal(7))]),
        Do(failing),
        Return((failing,)),
    ]
    assert printed(statements) == [
        "while (true) {",
        "    const bool held_0_ = checked(ctx, i) < 3;",
        "    LEAVE(0.0);",
        "    if (!held_0_) {",
        "        break;",
        "    }",
        "    a[k++] = 0;",
        "}",
        "if (!ok) {",
        "    fail(ctx, 7);",
        "    return 0.0;",
        "}",
        "checked(ctx, i);",
        "LEAVE(0.0);",
        "return checked(ctx, i);",
    ]
    assert Leave() in leave([Do(failing)], (), str)
