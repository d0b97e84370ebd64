"""Parameters: what converts to what, and what is refused in which words."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import blocks
from blocks.core.hints import hint
from blocks.core.params import (
    Param,
    ParamKind,
    as_matrix,
    in_radians,
    maybe_degrees,
    param,
    plain,
    show,
)
from blocks.core.signals import FloatArray

finite = st.floats(allow_nan=False, allow_infinity=False)
not_finite = st.sampled_from([math.nan, math.inf, -math.inf])
# 1e309 lies beyond the largest float.
integers = st.integers(-(10**300), 10**300)
not_numbers = st.one_of(
    st.booleans(),
    st.text(),
    st.floats().map(str),
    st.binary(),
    st.none(),
    st.complex_numbers(),
    st.dictionaries(st.text(), finite),
    st.lists(finite),
    st.sampled_from(
        [
            np.bool_(True),
            np.array(True),
            np.array("1.5"),
            np.array([1.0]),
            np.complex128(1.0),
            bytearray(b"1.5"),
            object(),
            float,
        ]
    ),
)


def declared(kind: ParamKind, **options: Any) -> Param:
    made: Param = param(**{"doc": "", **options})
    return made.bound("p", kind)


def refused(declaration: Param, value: Any) -> str:
    with pytest.raises(ValueError) as caught:
        declaration.convert(value)
    return str(caught.value)


@given(st.one_of(finite, integers))
def test_numbers_become_floats(value: float) -> None:
    converted = declared("float").convert(value)
    assert type(converted) is float
    assert converted == float(value)


@given(st.integers(-1000, 1000), st.sampled_from([np.int8, np.int64, np.uint8, np.float32]))
def test_numpy_numbers_become_floats(value: int, kind: Any) -> None:
    number = np.array(value).astype(kind)
    for form in (number, number[()]):
        converted = declared("float").convert(form)
        assert type(converted) is float
        assert converted == float(number)


def test_fractions_are_numbers_and_huge_integers_are_none() -> None:
    assert declared("float").convert(Fraction(1, 4)) == 0.25
    assert refused(declared("float"), 10**400) == f"expected a number, got {'1' + '0' * 36}..."
    refused(declared("float"), Decimal("0.5"))


@given(not_numbers)
def test_what_is_no_number_is_refused(value: Any) -> None:
    for kind in ("float", "int"):
        assert refused(declared(kind), value).startswith("expected a")


@given(not_finite)
def test_finite_unless_declared_otherwise(value: float) -> None:
    refused(declared("float"), value)
    refused(declared("array"), [0.0, value])
    endless = declared("float", finite=False)
    if math.isnan(value):
        refused(endless, value)
    else:
        assert endless.convert(value) == value


@given(st.integers())
def test_integers_stay(value: int) -> None:
    if abs(value) < 10**300:
        converted = declared("int").convert(value)
        assert type(converted) is int
        assert converted == value


@given(st.floats())
def test_a_float_is_no_integer(value: float) -> None:
    """Not even 3.0: a count that is written with a point is a mistake elsewhere."""
    refused(declared("int"), value)
    refused(declared("int"), np.float64(value))
    refused(declared("int"), np.float32(3.0))


@given(st.one_of(finite, st.integers(), st.text(), st.none()))
def test_only_booleans_are_booleans(value: Any) -> None:
    refused(declared("bool"), value)
    assert declared("bool").convert(np.bool_(True)) is True
    assert declared("bool").convert(False) is False


@given(st.one_of(finite, st.integers(), st.booleans(), st.none(), st.binary()))
def test_only_texts_are_texts(value: Any) -> None:
    refused(declared("str"), value)


@given(finite, finite, finite)
def test_bounds(value: float, low: float, high: float) -> None:
    for options, good in (
        ({"above": low}, value > low),
        ({"at_least": low}, value >= low),
        ({"below": high}, value < high),
        ({"at_most": high}, value <= high),
        ({"above": low, "at_most": high}, low < value <= high),
    ):
        for kind, given_value in (("float", value), ("array", [value]), ("array", [[value]])):
            declaration = declared(kind, **options)  # type: ignore[arg-type]
            if good:
                np.testing.assert_array_equal(declaration.convert(given_value), given_value)
            else:
                assert "expected a" in refused(declaration, given_value)


@given(st.lists(finite, min_size=2), st.data())
def test_every_element_has_to_keep_the_bounds(values: list[float], data: st.DataObject) -> None:
    bound = data.draw(st.one_of(st.sampled_from(values), finite))
    for options, good in (
        ({"at_most": bound}, max(values) <= bound),
        ({"below": bound}, max(values) < bound),
        ({"at_least": bound}, min(values) >= bound),
        ({"above": bound}, min(values) > bound),
    ):
        declaration = declared("array", **options)  # type: ignore[arg-type]
        if good:
            declaration.convert(values)
        else:
            refused(declaration, values)


@given(arrays.arrays(np.float64, arrays.array_shapes(max_dims=3, max_side=4), elements=finite))
def test_nested_lists_become_arrays(table: FloatArray) -> None:
    for form in (table, table.tolist(), tuple(table.tolist())):
        converted = declared("array").convert(form)
        assert converted.dtype == np.float64
        np.testing.assert_array_equal(converted, table)
        assert not converted.flags.writeable
    assert table.flags.writeable


@given(st.lists(st.lists(finite, max_size=4), min_size=2, max_size=4))
def test_ragged_lists_are_refused(rows: list[list[float]]) -> None:
    if len({len(row) for row in rows}) == 1:
        declared("array").convert(rows)
    else:
        assert refused(declared("array"), rows).startswith("expected an array of numbers, got")


@pytest.mark.parametrize(
    "value",
    [
        [1.0, True],
        [1.0, "2"],
        [1.0, None],
        [1.0, [2.0]],
        [[1.0], 2.0],
        {"a": 1.0},
        "1 2 3",
        np.array([True, False]),
        np.array(["1", "2"]),
        np.array([1j]),
        np.array([None, 1.0]),
    ],
)
def test_arrays_hold_numbers_alone(value: Any) -> None:
    refused(declared("array"), value)


@pytest.mark.parametrize(
    ("shape", "value", "fits"),
    [
        ((3,), [1, 2, 3], True),
        ((3,), [1, 2], False),
        ((3,), 1.0, False),
        ((3,), [[1, 2, 3]], False),
        ([(3,), (3, 3)], np.eye(3), True),
        ([(3,), (3, 3)], np.ones((3, 2)), False),
        ((None, 2), np.ones((7, 2)), True),
        ((None, 2), np.ones((2, 7)), False),
        (("n",), np.ones(5), True),
        (("n",), np.ones(4), False),
        (("n", None), np.ones((5, 9)), True),
        (("m",), np.ones(4), True),
        ((), np.ones((1, 2, 3)), True),
    ],
)
def test_shapes(shape: Any, value: Any, fits: bool) -> None:
    assert declared("array", shape=shape).fits(np.array(value), {"n": 5}) is fits


def test_null_is_legal_only_as_the_default() -> None:
    assert declared("float", default=None).convert(None) is None
    assert refused(declared("float", default=1.0), None) == "expected a number, got nothing (null)"


def test_choices() -> None:
    colour = declared("str", choices=("red", "green"))
    assert colour.convert("red") == "red"
    message = "expected one of red, green, got the string 'gren', did you mean 'green'?"
    assert refused(colour, "gren") == message
    assert refused(colour, 3) == "expected one of red, green, got 3"


@pytest.mark.parametrize(
    ("declaration", "words"),
    [
        (declared("float", above=0.0, unit="m"), "a number above 0 m"),
        (declared("int", at_least=1), "an integer at least 1"),
        (declared("float", at_least=0.0, below=1.0), "a number at least 0 and below 1"),
        (declared("bool"), "true or false"),
        (declared("str"), "a string"),
        (declared("array"), "an array of numbers"),
        (
            declared("array", shape=[(3,), (None, 2)], unit="m"),
            "an array of 3 or n x 2 numbers in m",
        ),
        (declared("str", choices=("a", "b")), "one of a, b"),
    ],
)
def test_descriptions(declaration: Param, words: str) -> None:
    assert declaration.describe() == words


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "nothing (null)"),
        (True, "true"),
        (1.5, "1.5"),
        ("x" * 50, f"the string '{'x' * 37}...'"),
        ({}, "a mapping"),
        (np.ones((2, 3)), "an array of shape (2, 3)"),
        ((1, 2), "[1, 2]"),
        (list(range(100)), "a list of 100 items"),
        ([1] * 20, str([1] * 20)),  # 60 characters
        ([1] * 19 + [10], "a list of 20 items"),  # 61
        ("x" * 40, f"the string '{'x' * 40}'"),
        ("x" * 41, f"the string '{'x' * 37}...'"),
        (10**39, "1" + "0" * 39),
        (10**40, "1" + "0" * 36 + "..."),
        (10**100, "1" + "0" * 36 + "..."),
    ],
)
def test_values_are_shown_shortly(value: Any, words: str) -> None:
    assert show(value) == words


@given(st.one_of(st.text(), st.integers(), st.lists(st.integers()), finite))
def test_no_value_fills_the_screen(value: Any) -> None:
    assert len(show(value)) < 80


def test_hints() -> None:
    assert hint("neurns", ["neurons", "radius"]) == ", did you mean 'neurons'?"
    assert hint("zzz", ["neurons"]) == ""
    assert hint(3, ["a"]) == ""
    # Comparing long names would take long: they are never suggested.
    for others in ([], [f"other{i}" for i in range(40)]):
        assert hint("n" * 101, ["n" * 101, *others]) == ""
        assert hint("n" * 99, ["n" * 100, *others]) == f", did you mean '{'n' * 100}'?"


@given(st.integers(0, 2**32 - 1), st.integers(0, 299), st.integers(0, 11))
def test_a_typing_error_is_found_among_many_names(seed: int, which: int, at: int) -> None:
    """Only the names that share most letters are compared."""
    letters = np.random.default_rng(seed).choice(list("abcdefghijklmnopqrstuvwxyz"), (300, 12))
    known = ["".join(row) for row in letters]
    wrong = f"{known[which][:at]}_{known[which][at + 1 :]}"
    assert hint(wrong, known) == f", did you mean '{known[which]}'?"


@pytest.mark.parametrize(
    ("value", "unit", "advice"),
    [
        ("2,5", "m", "; a decimal point is a dot: 2.5"),
        ("2.5 m", "m", "; write the number alone, in m"),
        ("30 degrees", "rad", "; in degrees, it is 30deg"),
        ("3 deg", "rad/s", "; in degrees, it is 3deg/s"),
        ("2.5 m", "", ""),
        ("a lot", "m", ""),
    ],
)
def test_a_number_with_its_unit_is_answered(value: str, unit: str, advice: str) -> None:
    message = refused(declared("float", unit=unit), value)
    expected = f"a number in {unit}" if unit else "a number"
    assert message == f"expected {expected}, got the string '{value}'{advice}"


def test_texts_are_one_or_several() -> None:
    texts = declared("texts")
    assert texts.convert("u[0]") == ("u[0]",)
    assert texts.convert(["a", 2]) == texts.convert(("a", 2)) == ("a", "2")
    for value in ([], None, [[]], True):
        assert refused(texts, value).startswith("expected a string or a list of strings, got ")


def test_signal_types_have_names() -> None:
    signals = declared("signal")
    assert signals.convert("Pose") is signals.convert(blocks.Pose) is blocks.Pose
    assert signals.convert("Vector(3)") == blocks.Vector(3)
    assert refused(signals, "Poze").endswith(", did you mean 'Pose'?")
    assert refused(signals, 3).startswith("expected a signal type such as Scalar")


def test_numbers_have_names() -> None:
    numbers = declared("numbers")
    assert numbers.convert({"a": 1, "b": 2.5}) == {"a": 1.0, "b": 2.5}
    for value in ({1: 2.0}, {"a": "x"}, [1.0], 1.0):
        assert refused(numbers, value).startswith("expected a mapping of names to numbers")


@pytest.mark.parametrize(
    ("value", "units", "expected"),
    [
        ("90deg", ("rad",), math.pi / 2),
        (" 180 deg/s ", ("rad/s",), math.pi),
        ("90deg", ("rad/s",), "90deg"),
        ("90deg", ("m",), "90deg"),
        ("north", ("rad",), "north"),
        (["90deg", 1.0], ("rad",), [math.pi / 2, 1.0]),
        ([1.0, "90deg"], ("m", "rad"), [1.0, math.pi / 2]),
        (["90deg", 1.0], ("m", "rad"), ["90deg", 1.0]),
        ([[1.0, "90deg"], [2.0, 0.5]], ("m", "rad"), [[1.0, math.pi / 2], [2.0, 0.5]]),
    ],
)
def test_degrees_become_radians_where_these_are_the_unit(
    value: Any, units: tuple[str, ...], expected: Any
) -> None:
    assert in_radians(value, units) == expected


@pytest.mark.parametrize(
    ("value", "units", "expected"),
    [
        (6.28, ("rad",), []),
        (-6.29, ("rad",), [(-6.29, "rad")]),
        (18.8, ("rad/s",), []),
        (18.9, ("rad/s",), [(18.9, "rad/s")]),
        (90, ("m",), []),
        (math.inf, ("rad",), []),
        (True, ("rad",), []),
        ([90, 90], ("m", "rad"), [(90.0, "rad")]),
        ([[0, 90], [0, 45]], ("m", "rad"), [(90.0, "rad"), (45.0, "rad")]),
        ([90, 1], ("rad",), [(90.0, "rad")]),
    ],
)
def test_large_angles_may_be_degrees(
    value: Any, units: tuple[str, ...], expected: list[tuple[float, str]]
) -> None:
    assert maybe_degrees(value, units) == expected


def test_a_row_of_a_matrix_is_written_as_one() -> None:
    vector, matrix = declared("array", shape=("n",)), declared("array", shape=("m", "n"))
    assert as_matrix(np.array([1.0, 2.0]), matrix) == "; one row is written [[1.0, 2.0]]"
    assert as_matrix(np.array(3.0), matrix) == "; one row is written [[3.0]]"
    assert as_matrix(np.array([1.0, 2.0]), vector) == ""
    assert as_matrix(np.ones((2, 2)), matrix) == ""


def test_a_plain_value_is_what_graphs_write() -> None:
    for value, expected in (
        (np.array([[1.0, 2.0]]), [[1.0, 2.0]]),
        ((1, "a"), [1, "a"]),
        (MappingProxyType({"a": 1.0}), {"a": 1.0}),
        (blocks.Ensemble(neurons=5, dimensions=1).neuron, "LIF"),
        (blocks.Pose, "Pose"),
        (blocks.Vector(3), "Vector(3)"),
        (1.5, 1.5),
        ("text", "text"),
    ):
        assert plain(value) == expected
        assert type(plain(value)) is type(expected)


def test_an_error_lists_every_problem() -> None:
    error = blocks.ParameterError([("a", "is bad"), ("b", "is worse")], "Thing")
    assert str(error) == "Thing.a: is bad\nThing.b: is worse"
    assert isinstance(error, ValueError)
