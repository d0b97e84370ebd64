"""Random functions of the compiled subset give the same bits in Python and in C."""

from __future__ import annotations

import ast
import ctypes
import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from runtime.codegen import FLOAT, Array, Entry, Function, RefusedError, Source, Writer
from runtime.toolchain import TranslationUnit, build
from tests.compilers import needs_compiler

FUNCTIONS = 16
INPUTS = 40
Draw = random.Random
ENTRY = "int64_t entry_{name}(struct context *ctx, double *v, double *out)"


def scalar(draw: Draw, depth: int) -> str:
    """A random expression of the floats x, y, z."""
    if depth == 0:
        return draw.choice(["x", "y", "z", "n", repr(round(draw.uniform(-3.0, 3.0), 3)), "2", "-1"])
    a, b = scalar(draw, depth - 1), scalar(draw, depth - 1)
    forms = (
        f"({a} + {b})",
        f"({a} - {b})",
        f"({a} * {b})",
        f"({a}) / (1.5 + abs({b}))",
        f"({a}) // (0.75 + abs({b}))",
        f"({a}) % (0.25 + abs({b}))",
        f"min({a}, {b})",
        f"max({a}, {b}, x)",
        f"abs({a}) ** 1.7",
        f"(({a}) if ({b}) < x else ({b}))",
        f"math.hypot({a}, {b})",
        f"math.atan2({a}, {b})",
        f"math.copysign({a}, {b})",
        f"math.sin({a})",
        f"math.exp(-abs({a}))",
        f"math.expm1(min({a}, 3.0))",
        f"math.log1p(abs({a}))",
        f"math.sqrt(abs({a}))",
        f"math.remainder({a}, math.tau)",
        f"float(({a}) > y and not ({b}) <= z or n > 3)",
        f"round(math.tanh({a}) * 9.5)",
        f"int(math.atan({a}) * 7.0) // 2",
        f"int(math.atan({a}) * 7.0) % 3",
        f"math.floor(math.atan({b}) * 5.0)",
        f"(-({a}))",
    )
    return draw.choice(forms)


def method(draw: Draw, name: str) -> str:
    """A random function with branches, loops, arrays and tuples."""
    e = [scalar(draw, draw.randint(1, 3)) for _ in range(6)]
    return f"""
def {name}(x, y, z):
    n = {draw.randint(1, 7)}
    a = np.zeros(n + 2)
    first, second = {e[0]}, {e[1]}
    for i in range(len(a)):
        a[i] = first * i - second
        if a[i] > y:
            a[i], first = {e[2]}, second
            continue
        second += 0.5 * a[i - 1]
    count = 0
    while count < n and a[count] < z:
        count += 1
    pair = ({e[3]}, a[-1]) if count > 1 else (x, {e[4]})
    part = a[1:count + 1] * 0.5 + pair[0]
    total = {e[5]}
    for value in part:
        total += value * pair[1]
    return total + float(count) + a.min() - max(a.max(), y)
"""


def compiled(texts: dict[str, str], check: bool) -> Callable[..., float | None]:
    """All functions in one library; returns a caller by name, None where C leaves it to Python."""
    functions = {}
    for text in texts.values():
        for node in ast.parse(text).body:
            assert isinstance(node, ast.FunctionDef)
            names = tuple(argument.arg for argument in node.args.args)
            functions[node.name] = Function(node.name, names, node.body, {}, "random.py", 0)
    arguments = [("x", FLOAT), ("y", FLOAT), ("z", FLOAT)]
    entries = [Entry(f"entry_{name}", name, arguments, [FLOAT]) for name in texts]
    made = Writer(Source(functions), check).unit(entries, "Random functions.")
    library = build([TranslationUnit("random", f"#define WITHOUT_JUMPS\n{made.text}")]).functions
    arena = np.zeros(1 << 16, dtype=np.uint8)
    context = np.zeros(11, dtype=np.int64)
    context[5:7] = arena.ctypes.data, arena.size

    def call(name: str, *values: float) -> float | None:
        out = ctypes.c_double()
        given = [ctypes.c_double(value) for value in values]
        context[1] = -1
        address = ctypes.c_void_p(context.ctypes.data)
        getattr(library, f"entry_{name}")(address, None, *given, ctypes.byref(out))
        return out.value if context[1] < 0 else None

    call.arena = arena  # type: ignore[attr-defined]
    return call


@needs_compiler
@pytest.mark.parametrize("check", [False, True])
def test_random_functions_give_the_same_bits(check: bool) -> None:
    draw = random.Random(12)
    texts = {f"f{i}": method(draw, f"f{i}") for i in range(FUNCTIONS)}
    call = compiled(texts, check)
    scope: dict[str, Any] = {"math": math, "np": np}
    left = 0
    for name, text in texts.items():
        exec(compile(text, name, "exec"), scope)
        for _ in range(INPUTS):
            values = [draw.choice([draw.gauss(0.0, 2.0), 0.0, -1.0, 1e-9]) for _ in range(3)]
            expected, found = float(scope[name](*values)), call(name, *values)
            if found is None:
                left += 1
                continue
            same = found == expected or (math.isnan(found) and math.isnan(expected))
            assert same, (text, values, expected, found)
    # A product of ints and floats that is -0.0 is left to Python: many inputs here are zero.
    assert left < 0.2 * FUNCTIONS * INPUTS


REFUSED = {
    "x = np.linalg.norm(a)": "calls np.linalg.norm",
    "x = np.sum(a, axis=0)": "np.sum with the keyword axis= is not compiled; write the loop",
    "x = np.exp(a, out=a)": "np.exp with the keyword out= is not compiled; write the loop",
    "x = {1: 2.0}": "holds a Dict",
    "a[0] = 'text'": "computes with a 'text'",
    "x = a[0.5]": "uses a float as an index; use int",
    "x = 1 if a[0] > 0 else (1, 2)": "use one type",
}


@pytest.mark.parametrize("statement", REFUSED)
def test_what_is_not_compiled_is_refused_with_line_and_suggestion(statement: str) -> None:
    node = ast.parse(f"def f(a):\n    {statement}\n    return 1.0").body[0]
    assert isinstance(node, ast.FunctionDef)
    function = Function("f", ("a",), node.body, {}, "own.py", 10)
    entry = Entry("entry", "f", [("a", Array("float", (None,)))], [FLOAT])
    with pytest.raises(RefusedError, match=rf"({REFUSED[statement]}).*\(own.py:12\)"):
        Writer(Source({"f": function})).unit([entry])


ORDER = """
def first(a):
    return a[0]

def f(x, y, z):
    a = np.zeros(2)
    a[0], found = x, first(a)
    return found + 10.0 * a[0]
"""


@needs_compiler
def test_a_call_reads_memory_before_another_target_changes_it() -> None:
    scope: dict[str, Any] = {"np": np}
    exec(compile(ORDER, "order", "exec"), scope)
    assert compiled({"f": ORDER}, False)("f", 3.0, 0.0, 0.0) == scope["f"](3.0, 0.0, 0.0) == 30.0


@needs_compiler
@pytest.mark.parametrize("test", ["isinstance(math.fmod(x, y), float)", "math.fmod(x, y) is None"])
def test_an_operand_fails_although_the_test_is_decided_while_compiling(test: str) -> None:
    call = compiled({"f": f"def f(x, y, z):\n    return 1.0 if {test} else 2.0\n"}, False)
    # math.fmod(1.0, 0.0) raises ValueError, so that C leaves the call to Python.
    assert call("f", 1.0, 0.0, 0.0) is None
    assert call("f", 1.0, 2.0, 0.0) == (1.0 if "isinstance" in test else 2.0)
