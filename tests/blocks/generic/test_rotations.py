"""Blocks of vectors and quaternions against NumPy and SciPy; arrays that are computed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import runtime
from blocks.core import param
from tests.blocks.responses import problems, respond
from tests.examples import examples

DRAW = np.random.default_rng(4)
A, B = DRAW.standard_normal((2, 20, 3))
P, Q = DRAW.standard_normal((2, 20, 4))


def rotation(q: Any) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1, axis=-1))  # SciPy's scalar is the last


def test_cross_and_normalize() -> None:
    np.testing.assert_allclose(respond({"type": "Cross"}, {"left": A, "right": B}), np.cross(A, B))
    units = respond({"type": "Normalize"}, {"input": A * (np.arange(20) > 0)[:, None]})
    lengths = np.linalg.norm(A, axis=1, keepdims=True)
    np.testing.assert_allclose(units[1:], (A / lengths)[1:], rtol=1e-14)
    np.testing.assert_array_equal(units[0], [0, 0, 0])


def test_products_of_matrices() -> None:
    left, right = DRAW.standard_normal((20, 6)), DRAW.standard_normal((20, 12))
    entry = {"type": "MatrixMultiply", "rows": 2, "inner": 3}
    expected = np.einsum("tij,tj->ti", left.reshape(20, 2, 3), A)
    np.testing.assert_allclose(respond(entry, {"left": left, "right": A}), expected, rtol=1e-13)
    expected = np.einsum("tij,tjk->tik", left.reshape(20, 2, 3), right.reshape(20, 3, 4))
    found = respond({**entry, "columns": 4}, {"left": left, "right": right})
    np.testing.assert_allclose(found.reshape(20, 2, 4), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("inverse", [False, True])
def test_rotate_is_scipys(inverse: bool) -> None:
    found = respond({"type": "Rotate", "inverse": inverse}, {"vector": A, "attitude": Q})
    np.testing.assert_allclose(found, rotation(Q).apply(A, inverse=inverse), rtol=1e-12, atol=1e-13)


def test_a_quaternion_of_length_zero_is_said() -> None:
    with pytest.raises(runtime.SimulationError, match="the quaternion has the length 0"):
        respond({"type": "Rotate"}, {"vector": A, "attitude": 0 * Q})


def test_quaternion_products_are_one_rotation_after_another() -> None:
    unit = [x / np.linalg.norm(x, axis=1, keepdims=True) for x in (P, Q)]
    inputs = dict(zip(("left", "right"), unit, strict=True))
    both = respond({"type": "QuaternionMultiply"}, inputs)
    expected = (rotation(P) * rotation(Q)).as_matrix()
    np.testing.assert_allclose(rotation(both).as_matrix(), expected, atol=1e-13)
    error = respond({"type": "QuaternionMultiply", "inverse_left": True}, inputs)
    expected = (rotation(P).inv() * rotation(Q)).as_matrix()
    np.testing.assert_allclose(rotation(error).as_matrix(), expected, atol=1e-13)


@examples(12)
@given(st.tuples(*[st.floats(-3, 3)] * 3), st.sampled_from(["body", "world"]))
def test_a_constant_rate_is_a_rotation_about_one_axis(rate: tuple[float, ...], frame: str) -> None:
    first = [0.5, 0.5, -0.5, 0.5]
    entry = {"type": "QuaternionIntegrator", "frame": frame, "initial": first}
    loaded = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.0, "solver": "rk4"},
            "blocks": {"w": {"type": "Constant", "value": list(rate)}, "it": entry},
            "wires": {"it": {"rate": "w.value"}},
            "probes": {"q": "it.attitude"},
        }
    )
    found = loaded.run(engine="python").probes["q"]
    turn = Rotation.from_rotvec(np.array(rate) * found.t[-1])
    expected = rotation(first) * turn if frame == "body" else turn * rotation(first)
    np.testing.assert_allclose(
        rotation(found.values[-1]).as_matrix(), expected.as_matrix(), atol=1e-7
    )
    np.testing.assert_allclose(np.linalg.norm(found.values, axis=1), 1.0, rtol=1e-14)


def test_one_number_for_all_components() -> None:
    found = respond({"type": "Broadcast", "n": 4}, {"input": A[:, 0]})
    np.testing.assert_array_equal(found, np.repeat(A[:, :1], 4, axis=1))
    loaded = runtime.load(
        {
            "run": {"dt": 0.001, "until": 0.01},
            "blocks": {
                "one": {"type": "Constant", "value": -3.0},
                "all": {"type": "Broadcast"},
                "x": {"type": "Ensemble", "neurons": 7},
            },
            "wires": {
                "all": {"input": "one.value"},
                "x": {"current": "all.out", "input": "one.value"},
            },
            "probes": {"c": "all.out"},
        }
    )
    assert loaded.run(engine="python").probes["c"].values.shape == (10, 7)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("diag(1, 1, 0.1)", np.diag([1, 1, 0.1])),
        ("0.5*eye(2)", 0.5 * np.eye(2)),
        ("full(3, pi)", np.full(3, np.pi)),
        ("[i for i in range(5) if i != 3]", [0, 1, 2, 4]),
        ("inv([[2, 0], [0, 4]])", [[0.5, 0], [0, 0.25]]),
    ],
)
def test_arrays_in_parameters_are_computed(text: str, expected: Any) -> None:
    declared = param(doc="an array").bound("x", "array")
    np.testing.assert_allclose(declared.convert(text), expected)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("diag(1", "'(' was never closed"),
        ("diga(1, 2)", "no function 'diga', did you mean 'diag'?"),
        ("eye(1000)", "more than 20000 operations"),
        ("inv([[1, 1], [1, 1]])", "expected an array of numbers, got"),
        ("ones(2)/0", "division by zero"),
    ],
)
def test_arrays_that_cannot_be_computed_are_refused(text: str, part: str) -> None:
    declared = param(doc="an array").bound("x", "array")
    with pytest.raises(ValueError, match=".") as caught:
        declared.convert(text)
    assert part in str(caught.value)


def test_ranges_in_selections() -> None:
    inputs = {"inputs": np.column_stack((A, B))}
    found = respond({"type": "Select", "indices": "[i for i in range(6) if i % 2 == 0]"}, inputs)
    np.testing.assert_array_equal(found, np.column_stack((A, B))[:, ::2])
    assert "did you mean" in problems(
        {"type": "Select", "indices": "rnage(3)"}, ["Vector"], "inputs"
    )
