"""Signal types: how they are written, and how their values are held."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blocks import Path, PointCloud, Pose, Scalar, Scan, SignalType, Spikes, Twist, Vector
from blocks.core.signals import TYPES, signal_type

RECORDS = {"Pose": 3, "Twist": 2, "WheelSpeeds": 2, "TrackingState": 3}
TABLES = {"PointCloud": 2, "Path": 4}
sized = st.sampled_from([Vector, Spikes, Scan, PointCloud, Path])
types = st.one_of(
    st.sampled_from([TYPES[name] for name in ("Scalar", *RECORDS)]),
    st.builds(lambda family, n: family(n), sized, st.integers(1, 9)),
)


@given(types)
def test_a_type_reads_back_what_it_prints(kind: SignalType) -> None:
    assert signal_type(str(kind)) == kind
    assert signal_type(f"  {str(kind).replace('(', ' ( ').replace(')', ' )')} ") == kind


@given(types, st.integers(0, 2**32 - 1))
def test_a_value_holds_the_arrays_numbers(kind: SignalType, seed: int) -> None:
    array = np.random.default_rng(seed).standard_normal(kind.shape)
    value = kind.pack(array)
    assert kind.holds(value)
    np.testing.assert_array_equal(np.asarray(value), array)
    assert not isinstance(value, np.ndarray) or not np.shares_memory(value, array)
    assert kind.holds(kind.zero())
    np.testing.assert_array_equal(np.asarray(kind.zero()), np.zeros(kind.shape))


def test_shapes() -> None:
    assert Scalar.shape == ()
    for name, n in RECORDS.items():
        assert TYPES[name].shape == (n,)
        assert len(TYPES[name].units) == n
    for name, columns in TABLES.items():
        assert TYPES[name].sized(5).shape == (5, columns)
    assert Vector(4).shape == Spikes(4).shape == Scan(4).shape == (4,)


def test_only_a_ray_that_hits_nothing_may_be_infinite() -> None:
    assert [name for name, kind in TYPES.items() if not kind.finite] == ["Scan"]
    assert not Scan(3).finite
    assert Vector(3).finite


def test_an_open_length() -> None:
    kind = signal_type("Vector")
    assert (kind.symbol, str(kind), kind) == ("n", "Vector(n)", Vector("n"))
    assert signal_type("Vector", "d").symbol == "d"
    assert Vector(3).symbol is None
    with pytest.raises(TypeError, match=r"Vector\(n\) has no shape before its length is known"):
        _ = kind.shape


@pytest.mark.parametrize(
    "text", ["Vector(0)", "Vector(03)", "Vector(-1)", "Vector(n)", "Vector(3", "Vector(1.5)", ""]
)
def test_what_is_no_type(text: str) -> None:
    with pytest.raises(ValueError, match="no signal type '.*'; the types are Scalar, Pose, Twist"):
        signal_type(text)


@pytest.mark.parametrize("text", ["vector(3)", "Vector(\u0663)", "Vektor", "Vector(3) x", "Same"])
def test_what_is_no_types_name(text: str) -> None:
    with pytest.raises(ValueError, match="no signal type"):
        signal_type(text)


@pytest.mark.parametrize("name", ["Scalar", *RECORDS])
def test_only_arrays_have_a_length(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} has no length; write '{name}'"):
        signal_type(f"{name}(3)")


def test_equal_is_name_and_length() -> None:
    assert Vector(3) == Vector(3) != Vector(4)
    assert Vector(3) != Spikes(3)
    assert Pose != TYPES["TrackingState"]
    assert {Vector(3): 1}[Vector(3)] == 1


@pytest.mark.parametrize(
    ("kind", "component", "column"),
    [
        (Pose, "theta", 2),
        (Pose, "x", 0),
        (Pose, "z", None),
        (Pose, "0", None),
        (Scalar, "x", None),
        (Vector(3), "2", 2),
        (Vector(3), "3", None),
        (Vector("n"), "7", 7),
        (Vector(3), "-1", None),
        (Vector(3), "\u00b2", None),
        (Vector(3), "", None),
        (Path(3), "0", None),
        (Path(3), "x", None),
    ],
)
def test_components(kind: SignalType, component: str, column: int | None) -> None:
    assert kind.column(component) == column


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (Scalar, 1),
        (Scalar, True),
        (Scalar, "1"),
        (Scalar, (1.0,)),
        (Scalar, np.array(1.0)),
        (Scalar, np.float32(1.0)),
        (Scalar, None),
        (Twist, (1.0,)),
        (Twist, (1.0, 2)),
        (Twist, [1.0, 2.0]),
        (Twist, np.array([1.0, 2.0])),
        (Twist, (1.0, 2.0, 3.0)),
        (Vector(2), (1.0, 2.0)),
        (Vector(2), np.array([1, 2])),
        (Vector(2), np.array([1.0, 2.0], dtype=np.float32)),
        (Vector(2), np.array([[1.0, 2.0]])),
        (Vector(2), np.array([1.0])),
        (PointCloud(2), np.zeros((2, 3))),
    ],
)
def test_other_forms(kind: SignalType, value: Any) -> None:
    assert not kind.holds(value)


def test_numpys_double_is_a_float() -> None:
    assert Scalar.holds(np.float64(1.0))
    assert Scalar.holds(math.inf)


@pytest.mark.parametrize(
    ("kind", "written", "held"),
    [
        (Scalar, "a number", "a float"),
        (Twist, "2 numbers", "a tuple of 2 floats (v, omega)"),
        (Vector(3), "3 numbers", "a float64 array of shape (3,)"),
        (Path(7), "7x4 numbers", "a float64 array of shape (7, 4)"),
    ],
)
def test_words(kind: SignalType, written: str, held: str) -> None:
    assert (kind.numbers, kind.held_as) == (written, held)


def test_words_for_an_open_length() -> None:
    assert Vector("n").numbers == "a list of numbers"
    assert Path("n").numbers == "a table of numbers"


@pytest.mark.parametrize(
    ("kind", "value", "right"),
    [
        (Scalar, 1, True),
        (Scalar, True, False),
        (Scalar, np.int64(1), False),
        (Twist, (1.0, 2), True),
        (Twist, (1.0, True), False),
        (Vector(2), np.array([1, 2]), False),
    ],
)
def test_an_int_counts_as_a_float_where_that_is_enough(
    kind: SignalType, value: Any, right: bool
) -> None:
    assert kind.holds(value, exact=False) is right
    assert not kind.holds(value)
