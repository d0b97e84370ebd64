"""Constants, sums and gains of every signal type."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from blocks import Path, PointCloud, Pose, Scalar, Scan, SignalType, Spikes, Twist, Vector
from tests.blocks.direct import state_of

TYPES = [
    *(Scalar, Twist, Pose, blocks.WheelSpeeds, blocks.TrackingState),
    *(Vector(3), Vector(1), Spikes(4), Scan(5), PointCloud(2), Path(6)),
]
numbers = st.floats(-1e6, 1e6)


def add(kind: SignalType, values: list[Any], **parameters: Any) -> Any:
    block = blocks.Sum(**parameters)
    state = state_of(block, {"terms": kind, "out": kind}, terms={"terms": (True,) * len(values)})
    return block.output(state, 0.0, tuple(values))


def drawn(kind: SignalType, n: int) -> tuple[list[Any], np.ndarray]:
    """Signals, and the same numbers as one array with a row per signal."""
    table = np.random.default_rng(n).standard_normal((n, *kind.shape))
    return [kind.pack(row) for row in table], table


@pytest.mark.parametrize("kind", TYPES, ids=str)
@pytest.mark.parametrize("n", [1, 2, 5])
def test_sum(kind: SignalType, n: int) -> None:
    values, table = drawn(kind, n)
    out = add(kind, values)
    assert kind.holds(out)
    np.testing.assert_allclose(out, table.sum(axis=0), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("kind", TYPES, ids=str)
@pytest.mark.parametrize("signs", list(itertools.product([1, -1], repeat=3)))
def test_sum_with_signs(kind: SignalType, signs: tuple[int, ...]) -> None:
    values, table = drawn(kind, 3)
    out = add(kind, values, signs=list(signs))
    assert kind.holds(out)
    np.testing.assert_allclose(out, np.tensordot(signs, table, axes=1), atol=1e-15)


@pytest.mark.parametrize("kind", TYPES, ids=str)
def test_sum_of_nothing_is_zero(kind: SignalType) -> None:
    out = add(kind, [])
    assert kind.holds(out)
    np.testing.assert_array_equal(out, np.zeros(kind.shape))


@given(st.lists(numbers, min_size=1, max_size=6), st.randoms())
def test_terms_do_not_meet_in_place(values: list[float], random: Any) -> None:
    """The arrays that go in come out of a sum as they were."""
    arrays = [np.array([value, random.random()]) for value in values]
    before = [array.copy() for array in arrays]
    add(Vector(2), arrays)
    add(Vector(2), arrays, signs=[-1.0] * len(arrays))
    np.testing.assert_array_equal(arrays, before)


def total(*removed: str) -> float:
    """2 - 3 + 10 - 40, without some of the terms."""
    graph = runtime.Graph(dt=0.1, until=0.1).add("sum", blocks.Sum(signs=[1, -1, 1, -1]))
    for name, value in zip("abcd", (2, 3, 10, 40), strict=True):
        graph = graph.add(name, blocks.Constant(value=value)).connect(f"{name}.value", "sum.terms")
    graph = graph.probe("sum.out")
    return float((graph.without(*removed) if removed else graph).run()["sum.out"][0])


def test_a_removed_term_takes_its_sign_along() -> None:
    assert total() == -31.0
    assert total("a") == -33.0
    assert total("b") == -28.0
    assert total("a", "c") == -43.0
    assert total("b", "d") == 12.0


@pytest.mark.parametrize(
    ("signs", "message"),
    [
        ([1, 2], "signs: expected only 1 and -1, got [1.0, 2.0]"),
        ([0, 1], "signs: expected only 1 and -1"),
        ([[1, 1]], "signs: expected an array of n numbers"),
        ("+-", "signs: expected an array of n numbers, got the string '+-'"),
    ],
)
def test_bad_signs(signs: Any, message: str) -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.Sum(signs=signs)
    assert message in str(caught.value)


def test_one_sign_per_term() -> None:
    with pytest.raises(blocks.ParameterError, match="expected 3 signs, one per term, got 2"):
        add(Scalar, [1.0, 2.0, 3.0], signs=[1, -1])


@pytest.mark.parametrize("kind", TYPES, ids=str)
@pytest.mark.parametrize("gain", [2.5, -1.0, 0.0, 3])
def test_gain(kind: SignalType, gain: float) -> None:
    (value,), (row,) = drawn(kind, 1)
    block = blocks.Gain(gain=gain)
    out = block.output(state_of(block, {"input": kind, "out": kind}), 0.0, value)
    assert kind.holds(out)
    np.testing.assert_array_equal(out, gain * row)


@pytest.mark.parametrize("kind", TYPES, ids=str)
def test_constant_of_each_type(kind: SignalType) -> None:
    number = np.random.default_rng(1).standard_normal(kind.shape)
    block = blocks.Constant(value=number.tolist(), signal=str(kind))
    assert block.variables == {"T": kind}
    out = block.output(state_of(block, {"value": kind}), 0.0)
    assert kind.holds(out)
    np.testing.assert_array_equal(out, number)


@pytest.mark.parametrize(
    ("signal", "value", "kind"),
    [
        ("Vector", [1.0], Vector(1)),
        ("Vector", [1.0, 2.0, 3.0], Vector(3)),
        ("Scan", [1.0, 2.0], Scan(2)),
        ("PointCloud", [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], PointCloud(3)),
    ],
)
def test_an_open_length_is_the_values_own(signal: str, value: Any, kind: SignalType) -> None:
    assert blocks.Constant(value=value, signal=signal).kind == kind


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "value: missing; expected an array of numbers: a number, or one number per"),
        (
            {"value": [1.0, 2.0], "signal": "Scalar"},
            "value: expected a number for Scalar, got [1.0, 2.0]",
        ),
        ({"value": 1.0, "signal": "Vector"}, "value: expected a list of numbers for Vector, got 1"),
        ({"value": [], "signal": "Vector"}, "value: expected a list of numbers for Vector, got []"),
        ({"value": 1.0, "signal": "Pose"}, "value: expected 3 numbers for Pose, got 1.0"),
        ({"value": [1, 2], "signal": "PointCloud"}, "value: expected 2x2 numbers for PointCloud"),
        ({"value": 1, "signal": "Twits"}, "signal: no signal type 'Twits'; the types are Scalar"),
        ({"value": 1, "signal": "Pose(3)"}, "signal: Pose has no length; write 'Pose'"),
        ({"value": "1.0"}, "value: expected an array of numbers, got the string '1.0'"),
        ({"value": math.inf}, "value: expected finite numbers for a Scalar, got inf"),
    ],
)
def test_bad_constants(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.Constant(**parameters)
    assert message in str(caught.value)


def mux(*wired: str) -> list[float]:
    graph = runtime.Graph(dt=0.1, until=0.1).add("mux", blocks.Mux())
    for name, value in (("v", 0.7), ("omega", -0.3)):
        if name in wired:
            graph = graph.add(name, blocks.Constant(value=value)).connect(
                f"{name}.value", f"mux.{name}"
            )
    return list(graph.probe("mux.out").run()["mux.out"][0].tolist())


def test_absent_sides_of_a_mux_are_zero() -> None:
    assert mux("v", "omega") == [0.7, -0.3]
    assert mux("v") == [0.7, 0.0]
    assert mux("omega") == [0.0, -0.3]
    assert mux() == [0.0, 0.0]
