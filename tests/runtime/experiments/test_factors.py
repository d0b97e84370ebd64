"""Factors and seeds as users write them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.document.node import from_python, parse_yaml
from runtime.document.writer import flow_yaml
from runtime.errors import Problems
from runtime.experiments.design.factors import Factor, parse_factor
from runtime.experiments.design.seeds import parse_seeds


def factor(text: str) -> Factor:
    problems = Problems()
    found = parse_factor("a.b", parse_yaml(text, "--vary"), "a.b", problems)
    assert not problems.items, problems.items
    assert found is not None
    return found


def grid(text: str) -> list[Any]:
    found = factor(text)
    return [found.value(i) for i in range(found.count)]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("[1, 2.5, x]", [1, 2.5, "x"]),
        ("[[0.01, 0.01], [1, 1]]", [[0.01, 0.01], [1, 1]]),
        ("[null, [adaptive]]", [None, ["adaptive"]]),
        ("0.1..0.9:5", [0.1, 0.3, 0.5, 0.7, 0.9]),
        ("-1..1:3", [-1.0, 0.0, 1.0]),
        ("1e-1..3e-1:3", [0.1, 0.2, 0.3]),
        ("log(1e-4..1e2):4", [1e-4, 1e-2, 1.0, 100.0]),
        ("int(50..200):4", [50, 100, 150, 200]),
        ("int(0..3):3", [0, 2, 3]),
        (" 0 .. 1:2 ", [0.0, 1.0]),
    ],
)
def test_grids(text: str, values: list[Any]) -> None:
    assert grid(text) == pytest.approx(values) if "log" in text else grid(text) == values
    assert [type(value) for value in grid(text)] == [type(value) for value in values]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("9..1:3", "the range is empty: 9 is not below 1"),
        ("1..1:3", "the range is empty: 1 is not below 1"),
        ("1..2:1", "expected at least two values, got :1"),
        ("1..2:0", "expected at least two values, got :0"),
        ("log(0..1):3", "expected ends above 0 in log(...), got 0"),
        ("int(1.5..3):2", "expected integers in int(...), got 1.5"),
        ("int(1..3):9", "there are only 3 integers from 1 to 3"),
        ("1..x:3", "expected numbers as the ends of a range, got the string 'x'"),
        ("1...inf:3", "expected numbers as the ends of a range, got inf"),
        ("[]", "an empty list"),
        ("[1, 2, 1]", "duplicate value 1"),
        ("5", "expected values such as [1, 2, 3]"),
        ("{a: 1}", "expected values such as [1, 2, 3]"),
        ("abc", "expected values such as [1, 2, 3]"),
        ("1..2:3:4", "expected values such as"),
    ],
)
def test_invalid_factors(text: str, message: str) -> None:
    problems = Problems()
    assert parse_factor("a.b", parse_yaml(text, "--vary"), "a.b", problems) is None
    [problem] = problems.items
    assert message in problem.text
    assert str(problem).startswith("--vary: a.b: ")


FINITE = st.floats(-1e6, 1e6).map(lambda x: float(f"{x:.6g}"))


@given(FINITE, FINITE, st.integers(2, 60))
def test_ranges_are_even_and_meet_their_ends(a: float, b: float, n: int) -> None:
    low, high = min(a, b), max(a, b)
    if low == high:
        return
    values = grid(f"{flow_yaml(low)}..{flow_yaml(high)}:{n}")
    assert len(values) == n
    assert values[0] == low and values[-1] == high
    assert values == sorted(values)
    scale = max(abs(low), abs(high))
    # Subnormal numbers are whole multiples of 5e-324: half a unit is all that they can be exact to.
    exact = max(1e-11 * scale, 5e-324)
    assert np.allclose(values, np.linspace(low, high, n), rtol=1e-11, atol=exact)


@given(st.floats(0.0, 1.0, exclude_max=True), st.sampled_from(["0.5..2", "log(0.5..2)", "[x, y]"]))
def test_samples_stay_inside(u: float, text: str) -> None:
    value = factor(text).at(u)
    assert value in ("x", "y") if text[0] == "[" else 0.5 <= value <= 2.0


def test_samples_are_uniform_in_the_scale_that_was_asked_for() -> None:
    us = (np.arange(1000) + 0.5) / 1000
    assert np.mean([factor("2..6").at(u) for u in us]) == pytest.approx(4.0)
    assert np.mean([math.log(factor("log(1..100)").at(u)) for u in us]) == pytest.approx(
        math.log(10.0)
    )
    counts = np.bincount([factor("int(1..4)").at(u) for u in us])
    assert counts.tolist() == [0, 250, 250, 250, 250]


SCALARS = st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats() | st.text()
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(VALUES)
def test_a_value_in_one_line_reads_back_equal(value: Any) -> None:
    text = flow_yaml(value)
    assert "\n" not in text
    back = parse_yaml(f"[{text}]", "x").plain()[0]
    assert repr(back) == repr(value)


@pytest.mark.parametrize(
    ("value", "seeds"),
    [
        ("0..3", [0, 1, 2, 3]),
        (7, [7]),
        ("3", [3]),
        ("0,4,7..9", [0, 4, 7, 8, 9]),
        ([5, "1..2"], [5, 1, 2]),
    ],
)
def test_seeds(value: Any, seeds: list[int]) -> None:
    problems = Problems()
    found = parse_seeds(from_python(value), "seeds", problems)
    assert found is not None and not problems.items
    assert list(found) == seeds
    assert len(found) == len(seeds)
    assert list(parse_seeds(from_python(str(found)), "seeds", problems) or ()) == seeds


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("x", "got the string 'x'"),
        ("1..x", "got the string '1..x'"),
        (-1, "got -1"),
        (1.5, "got 1.5"),
        (True, "got true"),
        ("3..1", "3..1 is empty"),
        ("0..3,2", "duplicate seed 2"),
        ([], "the list is empty"),
        ({"a": 1}, "got a mapping"),
    ],
)
def test_invalid_seeds(value: Any, message: str) -> None:
    problems = Problems()
    assert parse_seeds(from_python(value), "seeds", problems) is None
    [problem] = problems.items
    assert problem.text.startswith("expected seeds such as 0..9, 3 or 0,4,7..9")
    assert message in problem.text
