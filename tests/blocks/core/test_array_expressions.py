"""Vectors, matrices, indices and definitions in expressions: NumPy's values, engines alike."""

from __future__ import annotations

import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.core import (
    ExpressionError,
    expression_function,
    function_text,
    read_expressions,
    signed_distance,
)
from tests.examples import examples

S, V, W = 0.7, [0.3, -1.2, 2.0], [1.5, 0.4, -0.8]
A = [[2.0, -0.3, 0.5], [0.1, 1.7, -0.6], [-0.4, 0.2, 1.9]]
VALUES: dict[str, Any] = {"s": S, "v": np.array(V), "w": np.array(W), "a": np.array(A)}


def _sum(x: Any) -> Any:
    return sum(x) if isinstance(x, types.GeneratorType) else np.sum(x)


def _norm(*parts: Any) -> Any:
    flat = [np.ravel(list(p) if isinstance(p, types.GeneratorType) else p) for p in parts]
    return np.linalg.norm(np.concatenate(flat))


NUMPY: dict[str, Any] = {
    **{"sum": _sum, "norm": _norm, "mean": np.mean, "prod": np.prod, "min": np.min, "max": np.max},
    **{"sin": np.sin, "exp": np.exp, "abs": np.abs, "dot": np.dot, "cross": np.cross},
    **{"inv": np.linalg.inv, "solve": np.linalg.solve, "det": np.linalg.det, "trace": np.trace},
    **{
        "transpose": np.transpose,
        "outer": np.outer,
        "eye": np.eye,
        "zeros": lambda *n: np.zeros(n),
    },
    **{
        "ones": lambda *n: np.ones(n),
        "full": np.full,
        "diag": lambda *x: np.diag(x if len(x) > 1 else x[0]),
    },
    **{"concat": lambda *x: np.concatenate([np.ravel(part) for part in x]), "pi": np.pi},
}


def by_numpy(text: str) -> Any:
    return np.asarray(eval(text, {**NUMPY, **VALUES}), float)


def by_expression(text: str, **let: str) -> Any:
    constants = {"a": A, "w": W}
    return np.array(expression_function(text, {"s": None, "v": 3}, constants, let)(S, V))


@pytest.mark.parametrize(
    "text",
    [
        *(
            "2*v + w",
            "v*w - s",
            "-a",
            "a @ v",
            "v @ a",
            "v @ w",
            "a @ a",
            "a.T",
            "transpose(a) @ v",
        ),
        *("inv(a)", "solve(a, v)", "solve(a, a.T)", "det(a)", "trace(a)", "outer(v, w)", "a**2"),
        *("cross(v, w)", "dot(v, w)", "norm(v)", "norm(v[0], v[1], s)", "norm(v[1:3])", "norm(a)"),
        *("diag(v)", "diag(1, 1, 0.1)", "diag(a)", "eye(3) + a", "zeros(2, 3)", "full(3, s)"),
        *("sum(v[j] for j in range(3))", "sum(v[j]*w[2 - j] for j in range(3) if j != 1)"),
        *("[v[j]**2 for j in range(3)]", "[v[j]*w[k] for j in range(3) for k in range(j)]"),
        *(
            "sum(j*a[j] for j in range(3))",
            "[sum(a[j, k] for k in range(3)) for j in range(len(v))]",
        ),
        *("a[1]", "a[:, 2]", "a[0:2, 1:3]", "a[-1, -1]", "[v, w] @ a", "concat(v, s, w[0:2])"),
        *(
            "max(v)",
            "mean(a)",
            "prod(w)",
            "sin(v)",
            "[s, 2, sum(w)]",
            "norm(v[i] for i in range(2))",
        ),
        *("v if s > 0 else w", "v/s if det(a) > 0 and norm(inv(a)) > 0 else zeros(3)"),
    ],
)
def test_arrays_have_the_values_of_numpy(text: str) -> None:
    expected = by_numpy(text)
    found = by_expression(text)
    np.testing.assert_allclose(found.reshape(expected.shape), expected, rtol=1e-13, atol=1e-15)


def test_definitions_are_computed_once_and_in_order() -> None:
    let = {"c": "sin(s)", "r": "[[c, -s], [s, c]]", "unused": "1/0"}
    read = read_expressions(["r @ p", "c + 1"], {"s": "s", "p": ["p[0]", "p[1]"]}, let)
    assert function_text(read, ("s", "p")).count("sin") == 1
    c = np.sin(S)
    expected = np.array([[c, -S], [S, c]]) @ V[:2]
    np.testing.assert_allclose(by_expression("r @ v[0:2]", c="sin(s)", r=let["r"]), expected)


def test_a_value_that_is_not_chosen_is_not_computed() -> None:
    m = {"k": "[[s, 1], [1, 1]]"}
    g = expression_function("1/s if s > 0 and det(inv(k)) > 0 else 7", {"s": None}, {}, m)
    assert g(0.0) == 7.0
    h = expression_function("det(inv(k)) if s != 1 else 7", {"s": None}, {}, m)
    assert h(1.0) == 7.0
    assert h(3.0) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("text", "column", "part"),
    [
        ("v + w2", 5, "did you mean 'w'"),
        ("v + a", 1, "expected equal shapes, or a number and an array, got 3 components and a 3 x"),
        ("v[0:2] @ a", 1, "expected sides that agree, got 2 components @ a 3 x 3 matrix"),
        ("s @ v", 1, "'@' takes vectors and matrices, got a number"),
        ("cross(v, v[0:2])", 1, "'cross' takes vectors of 3 components, got 2"),
        ("inv(v)", 1, "'inv' takes a square matrix, got 3 components"),
        ("sum(v[j] for j in range(4))", 7, "'v' has 3 components, 'v[0]' to 'v[2]'"),
        ("sum(v[j] for j in v)", 19, "an index runs over 'range(n)'"),
        ("sum(v[j] for j in range(s))", 25, "an index is an integer"),
        ("sum(v[s] for s in range(2))", 14, "'s' is taken"),
        ("[v[0], a]", 1, "expected items of equal shape"),
        ("a[3, 0]", 3, "'a' is a 3 x 3 matrix; this index is 0 to 2"),
        ("v[0, 1]", 1, "expected 1 index"),
        ("1 if v else 2", 6, "'v' has 3 components; write one of them"),
        ("v if s else w[0:2]", 1, "expected both values of equal shape"),
        ("sum(1 for i in range(10**9))", 1, "more than 20000 operations"),
        ("zeros(200, 200)", 1, "more than 20000 operations"),
        ("eye(10**9)", 1, "more than 20000 operations"),
        (
            "sum(v[0] for i in range(99) for j in range(99) for k in range(99))",
            5,
            "more than 20000",
        ),
        ("[1 for i in range(0)]", 1, "the range is empty"),
        ("v for i in range(3)", 3, "invalid syntax"),
    ],
)
def test_wrong_arrays_are_refused_at_their_column(text: str, column: int, part: str) -> None:
    names = {"s": "s", "v": ["v[0]", "v[1]", "v[2]"], "w": ["w[0]", "w[1]", "w[2]"]}
    with pytest.raises(ExpressionError) as caught:
        read_expressions(
            ["1", text], {**names, "a": [[f"a[{i}][{j}]" for j in range(3)] for i in range(3)]}
        )
    assert part in caught.value.message
    assert (caught.value.column, caught.value.place) == (column, 1)


Draw = Callable[[st.SearchStrategy[Any]], Any]


def draw_text(draw: Draw, shape: str, depth: int) -> str:
    """A random expression of a number "n", a vector of three "v" or a 3 x 3 matrix "m"."""

    def of(inner: str) -> str:
        return draw_text(draw, inner, depth - 1)

    leaves = {"n": ["s", "v[1]", "2.5", "a[0, 2]"], "v": ["v", "w", "a[1]"], "m": ["a", "eye(3)"]}
    if depth == 0:
        return str(draw(st.sampled_from(leaves[shape])))
    safe = {"n": "sin", "v": "sin", "m": "sin"}[shape]
    common: list[Callable[[], str]] = [
        lambda: f"({of(shape)} {draw(st.sampled_from('+-*'))} {of(shape)})",
        lambda: f"({of('n')}*{of(shape)})",
        lambda: f"-{of(shape)}" if depth > 1 else f"{safe}({of(shape)})",
        lambda: f"({of(shape)} if {of('n')} < {of('n')} else {of(shape)})",
    ]
    own: dict[str, list[Callable[[], str]]] = {
        "n": [
            lambda: f"({of('v')} @ {of('v')})",
            lambda: f"norm({of('v')}, {of('n')})",
            lambda: f"sum({of('v')})",
            lambda: f"sum(v[j]*{of('n')} for j in range(3) if j != 1)",
            lambda: f"det({of('m')})",
        ],
        "v": [
            lambda: f"({of('m')} @ {of('v')})",
            lambda: f"cross({of('v')}, {of('v')})",
            lambda: f"concat([w[j] + j*{of('n')} for j in range(3)])",
            lambda: f"solve(9*eye(3) + sin({of('m')}), {of('v')})",
        ],
        "m": [
            lambda: f"({of('m')} @ {of('m')})",
            lambda: f"({of('m')}).T",
            lambda: f"outer({of('v')}, {of('v')})",
            lambda: f"inv(9*eye(3) + sin({of('m')}))",
            lambda: f"diag({of('v')})",
        ],
    }
    return str(draw(st.sampled_from(common + own[shape]))())


@st.composite
def texts(draw: Draw) -> list[str]:
    return [draw_text(draw, draw(st.sampled_from("nvm")), 2) for _ in range(8)]


@examples(40)
@given(texts())
def test_random_arrays_are_numpys(batch: list[str]) -> None:
    for text in batch:
        expected = by_numpy(text)
        found = by_expression(text)
        scale = 1e-10 * max(1.0, float(np.abs(expected).max()))
        np.testing.assert_allclose(found.reshape(expected.shape), expected, rtol=1e-9, atol=scale)


def block(**values: Any) -> dict[str, Any]:
    return {"type": "Function", "names": ["s", "v(3)"], "constants": {"a": A, "w": W}, **values}


@examples(12)
@given(texts())
def test_random_arrays_are_equal_in_both_engines(batch: list[str]) -> None:
    sources = {f"u{i}": {"type": "Sine", "frequency": 0.3 + i, "phase": 0.4 * i} for i in range(4)}
    expression = [f"norm({text})" for text in batch]
    graph = {
        "run": {"dt": 0.1, "until": 1.0},
        "blocks": {**sources, "f": block(expression=expression)},
        "wires": {"f": {"u": [f"u{i}.out" for i in range(4)]}},
        "probes": {"f": "f.out"},
    }
    loaded = runtime.load(graph)
    one, other = (loaded.run(engine=engine).probes["f"].values for engine in ("python", "compiled"))
    np.testing.assert_array_equal(one, other)


MANY = np.random.default_rng(0).normal(size=360)
TERMS = [f"u[{i}]" for i in range(300)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("min(u)", np.min(MANY)),
        ("max(u)", np.max(MANY)),
        ("sum(u)", np.sum(MANY)),
        ("prod(u)", np.prod(MANY)),
        ("norm(u)", np.linalg.norm(MANY)),
        ("mean(u)", np.mean(MANY)),
        (f"min({', '.join(TERMS[:200])})", np.min(MANY[:200])),
        (" + ".join(TERMS[:200]), np.sum(MANY[:200])),
        ("-".join(TERMS), MANY[0] - np.sum(MANY[1:300])),
        ("u[0]" + "*2/2" * 400, MANY[0]),
        ("u[1" + "+1" * 300 + "]", MANY[301]),
        (" and ".join(f"{term} < 9" for term in TERMS[:120]), 1.0),
        ("(" * 20 + "u[0]" + ("+u[0]" * 18 + ")") * 20, 361.0 * MANY[0]),
    ],
)
def test_long_expressions_are_read_without_recursion(text: str, expected: float) -> None:
    found = expression_function(text, {"u": len(MANY)})(MANY)
    np.testing.assert_allclose(found, expected, rtol=1e-11)
    again = expression_function("y - 1", {"u": len(MANY)}, let={"y": text})(MANY)
    np.testing.assert_allclose(again, expected - 1.0, rtol=1e-11, atol=1e-13)


def test_the_distance_of_a_long_condition_is_read_without_recursion() -> None:
    distance = signed_distance("+".join(TERMS[:200]) + " > 1")
    found = expression_function(distance, {"u": len(MANY)})(MANY)
    np.testing.assert_allclose(found, np.sum(MANY[:200]) - 1.0, rtol=1e-11)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_long_expressions_in_both_engines(tmp_path: Path, engine: str) -> None:
    functions = {"min": np.min, "max": np.max, "prod": np.prod, "norm": np.linalg.norm}
    blocks = "".join(f"  {n}: {{type: Function, expression: '{n}(u)'}}\n" for n in functions)
    wires = "".join(f"  {name}: {{u: many.value}}\n" for name in functions)
    probes = ", ".join(f"{name}: {name}.out" for name in functions)
    path = tmp_path / "g.yaml"
    path.write_text(
        f"graph: g\nrun: {{dt: 0.1, until: 0.1}}\nblocks:\n{blocks}"
        f"  many: {{type: Constant, value: {MANY.tolist()}}}\nwires:\n{wires}probes: {{{probes}}}\n"
    )
    run = runtime.load(path).run(engine=engine)
    for name, function in functions.items():
        np.testing.assert_allclose(run[name].ravel()[0], function(MANY), rtol=1e-12)
