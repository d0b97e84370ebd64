"""Function and the blocks of arithmetic, logic and routing, in graphs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime
from blocks import Function, Gain
from tests.blocks.responses import problems, respond

DRAW = np.random.default_rng(1)
A, B = DRAW.standard_normal((2, 50))
ROWS = DRAW.standard_normal((50, 3))
T = 0.01 * np.arange(50)


def test_a_function_of_signals_time_and_constants() -> None:
    entry = {"type": "Function", "expression": "a*u[0] - u[3]**2 + sin(t)", "constants": {"a": 2}}
    expected = 2 * ROWS[:, 0] - A**2 + np.sin(T)
    np.testing.assert_allclose(respond(entry, {"u": [ROWS, A]}), expected, atol=1e-14)


def test_several_expressions_make_a_vector_or_a_record() -> None:
    entry: dict[str, Any] = {"type": "Function", "names": ["x", "y"], "expression": ["x*y", "x-y"]}
    expected = np.column_stack((A * B, A - B))
    np.testing.assert_array_equal(respond(entry, {"u": [A, B]}), expected)
    found = respond({**entry, "signal": "Twist"}, {"u": [A, B]}, of="out.omega")
    np.testing.assert_array_equal(found, A - B)


@pytest.mark.parametrize("n", [1, 2])
def test_a_list_is_a_vector_of_any_length(n: int) -> None:
    listed = Function(expression=f"[2*i + 1 for i in range({n})]")
    assert str(listed.resolved) == f"Vector({n})"
    assert str(Function(expression="[3][0]").resolved) == "Scalar"


def test_one_to_many_components_without_inputs() -> None:
    entry = {"type": "Function", "expression": ["t", 2, "t if t > 0.1 else -1"]}
    expected = np.column_stack((T, np.full(50, 2.0), np.where(T > 0.1, T, -1.0)))
    np.testing.assert_array_equal(respond(entry, ticks=50), expected)


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"expression": "u[0] + sni(t)"}, "column 8 of 'u[0] + sni(t)': no function 'sni', did"),
        ({"expression": ["1", "u[7]"]}, "expression[1]: column 3 of 'u[7]': 'u' has 3"),
        ({"expression": "x", "names": ["x", "y"]}, "expected 3 names, one for each component of u"),
        (
            {"expression": "1", "names": ["sin", "y", "z"]},
            "'sin' is a function in every expression",
        ),
        ({"expression": "1", "names": ["x", "x", "z"]}, "the name 'x' is given twice"),
        ({"expression": "1", "constants": {"2a": 1}}, "'2a' is not a valid name"),
        ({"expression": "1", "constants": [1]}, "expected a mapping of names to numbers"),
        ({"expression": ["1", "2"], "signal": "Pose"}, "expected a type of 2 components"),
        ({"expression": []}, "expected a string or a list of strings"),
        ({"expression": {"a": 1}}, "expected a string or a list of strings"),
    ],
)
def test_a_wrong_function_is_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems({"type": "Function", **entry}, ["Vector"], "u")


def test_a_failing_expression_names_the_block_and_the_time() -> None:
    with pytest.raises(runtime.SimulationError, match="'it' at tick 5"):
        respond({"type": "Function", "expression": "1/(u[0] - 5)"}, {"u": np.arange(9.0)})


def test_arithmetic() -> None:
    product = respond({"type": "Product", "powers": [1, -1, 1]}, {"factors": [A, B, A]})
    np.testing.assert_allclose(product, A / B * A, rtol=1e-15)
    rows = respond({"type": "Product"}, {"factors": [ROWS, ROWS]})
    np.testing.assert_array_equal(rows, ROWS**2)
    np.testing.assert_array_equal(
        respond({"type": "Gain", "gain": [1, 2, -3]}, {"input": ROWS}), ROWS * [1, 2, -3]
    )
    matrix = [[1, 2, 3], [0, -1, 4]]
    found = respond({"type": "Gain", "gain": matrix}, {"input": ROWS})
    np.testing.assert_allclose(found, ROWS @ np.transpose(matrix), rtol=1e-12)


@pytest.mark.parametrize(
    ("gain", "message"),
    [
        ({"gain": [[1, 2], [3, 4]]}, r"input: expected Vector\(2\), got Vector\(3\)"),
        ({"gain": [1, 2]}, "gain: expected a number or 3 numbers"),
        ({"gain": [[1, 2, 3]], "signal": "Pose"}, "leave 'signal' out"),
    ],
)
def test_a_gain_that_does_not_fit_its_signal(gain: dict[str, Any], message: str) -> None:
    with pytest.raises(runtime.GraphError, match=message):
        respond({"type": "Gain", **gain}, {"input": ROWS})


def test_the_former_matrix_gain_is_a_gain() -> None:
    with pytest.raises(runtime.GraphError, match="no block type 'MatrixGain'; here: Gain"):
        respond({"type": "MatrixGain", "matrix": [[1.0]]}, {"input": ROWS})


@pytest.mark.parametrize("n", [2, 5, 8, 31])
def test_fourier_transforms_are_numpys(n: int) -> None:
    values = np.random.default_rng(n).standard_normal((6, n))
    expected = np.fft.rfft(values, axis=1)
    parts = {"re": expected.real, "im": expected.imag}
    for of, part in parts.items():
        found = respond({"type": "FourierTransform"}, {"input": values}, of=of)
        np.testing.assert_allclose(found, part, atol=1e-14 * n)
    back = respond({"type": "InverseFourierTransform", "odd": bool(n % 2)}, parts)
    np.testing.assert_allclose(back, values, atol=1e-14 * n)


@pytest.mark.parametrize(("order", "number"), [("1", 1), ("2", 2), ("max", np.inf)])
def test_a_norm(order: str, number: float) -> None:
    found = respond({"type": "Norm", "order": order}, {"inputs": [ROWS, A]})
    together = np.column_stack((ROWS, A))
    np.testing.assert_allclose(found, np.linalg.norm(together, number, axis=1), rtol=1e-14)


def test_angles_are_wrapped() -> None:
    angles = np.linspace(-20, 20, 50)
    wrapped = respond({"type": "Wrap"}, {"input": angles})
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-12)
    assert np.abs(wrapped).max() <= np.pi
    turn = respond({"type": "Wrap", "low": 0}, {"input": angles})
    np.testing.assert_allclose(turn, angles % (2 * np.pi), atol=1e-12)


def test_comparison_and_logic() -> None:
    above = respond({"type": "Compare", "operator": ">=", "value": 0.5}, {"input": A})
    np.testing.assert_array_equal(above, A >= 0.5)
    less = respond({"type": "Compare", "operator": "<"}, {"input": A, "other": B})
    np.testing.assert_array_equal(less, A < B)
    p, q = (A > 0) * 1.0, (B > 0) * 1.0
    for name, expected in {
        "and": p * q,
        "or": np.maximum(p, q),
        "xor": p != q,
        "nand": 1 - p * q,
        "nor": 1 - np.maximum(p, q),
    }.items():
        found = respond({"type": "Logic", "operator": name}, {"inputs": [p, q]})
        np.testing.assert_array_equal(found, expected)
    assert "'not' takes one input, got 2" in problems(
        {"type": "Logic", "operator": "not"}, ["Scalar", "Scalar"], "inputs"
    )


def test_routing() -> None:
    joined = np.column_stack((A, ROWS, B))
    found = respond({"type": "Concatenate"}, {"inputs": [A, ROWS, B]})
    np.testing.assert_array_equal(found, joined)
    chosen = respond({"type": "Select", "indices": [4, 0, 2]}, {"inputs": [A, ROWS, B]})
    np.testing.assert_array_equal(chosen, joined[:, [4, 0, 2]])
    others = respond({"type": "Select", "without": [4, 1, 4]}, {"inputs": [A, ROWS, B]})
    np.testing.assert_array_equal(others, np.delete(joined, [4, 1], axis=1))
    number = np.arange(50) % 4 - 0.6
    switched = respond({"type": "MultiportSwitch"}, {"select": number, "inputs": [A, B, -A]})
    expected = np.choose(np.clip(np.round(number), 0, 2).astype(int), [A, B, -A])
    np.testing.assert_array_equal(switched, expected)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"indices": [3]}, "expected numbers from 0 to 2"),
        ({"without": [3]}, "expected numbers from 0 to 2"),
        ({"without": [0, 1, 2]}, "leaves none of the 3 components"),
        ({}, "expected either indices or without, got neither"),
        ({"indices": [0], "without": [1]}, "expected either indices or without, got both"),
        ({"without": [0.5]}, "expected a list of integers"),
    ],
)
def test_what_cannot_be_selected_is_said(given: dict[str, Any], expected: str) -> None:
    assert expected in problems({"type": "Select", **given}, ["Vector"], "inputs")


GRAPH: dict[str, Any] = {
    "run": {"dt": 0.01, "until": 0.05},
    "blocks": {
        "pose": {"type": "Constant", "value": [1, 2, 3], "signal": "Pose"},
        "v": {"type": "Constant", "value": [4, 5, 6, 7], "signal": "Vector"},
        "joined": {"type": "Concatenate"},
        "first": {"type": "Gain", "gain": 2},
        "pair": {"type": "Gain", "gain": 2},
        "memory": {"type": "UnitDelay"},
    },
    "wires": {
        "joined": {"inputs": ["pose.value[1:]", "v.value[1:3]", "v.value.3", "pose.value"]},
        "first": {"input": "v.value[1]"},
        "pair": {"input": "joined.out[2:4]"},
        "memory": {"input": "v.value[:2]"},
    },
    "probes": {
        "first": "first.out",
        "pair": "pair.out",
        "part": "joined.out[4:]",
        "one": "joined.out[0]",
        "xy": "pose.value[0:2]",
        "memory": "memory.out",
        "state": "memory.memory[0:1]",
    },
}


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_components_and_ranges_of_wires_and_probes(engine: str) -> None:
    result = runtime.load(GRAPH).run(engine=engine)
    expected = {
        "first": 10.0,
        "pair": [10.0, 12.0],
        "part": [7.0, 1.0, 2.0, 3.0],
        "one": 2.0,
        "xy": [1.0, 2.0],
        "memory": [4.0, 5.0],
        "state": [4.0],
    }
    for name, value in expected.items():
        np.testing.assert_array_equal(np.asarray(result[name])[-1], value, err_msg=name)


@pytest.mark.parametrize(
    ("source", "part"),
    [
        ("v.value[4]", "has no component '4'; its components: 0 to 3"),
        ("v.value[2:9]", "has no component '2:9'"),
        ("v.value[2:2]", "has no component '2:2'"),
        ("v.value[x]", "expected a number or a range in brackets, as in"),
        ("v.value[0][0]", "has no output"),
    ],
)
def test_a_wrong_range_is_refused(source: str, part: str) -> None:
    graph = {**GRAPH, "wires": {**GRAPH["wires"], "first": {"input": source}}}
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load(graph).check()
    assert part in str(caught.value)


def test_a_removed_input_that_would_shift_the_others_is_an_error() -> None:
    with pytest.raises(runtime.GraphError, match="shift the components after it"):
        runtime.load(GRAPH).without("pose").check()


@pytest.mark.parametrize(
    ("expression", "values"),
    [
        ("1 if sqrt(x) < 1 else 2", [2.0, 1.0]),
        ("1 if log(x) < 0 else 2", [2.0, 1.0]),
        ("1 if x**0.5 > 0 else 2", [2.0, 1.0]),
        ("1 if asin(2*x) > 0 else 2", [2.0, 1.0]),
        ("1 if acosh(x) > 0 else 2", [2.0, 2.0]),
        ("1 if cosh(2000*x) > 0 else 2", [1.0, 1.0]),
        ("1 if pow(x + 1, -2000) > 5 else 2", [1.0, 2.0]),
        ("1 if gamma(4*x) > 0 else 2", [2.0, 1.0]),
        ("1 if sin(exp(2000*x)) < 2 else 2", [1.0, 2.0]),
    ],
)
def test_both_engines_compute_outside_of_a_domain_alike(
    expression: str, values: list[float]
) -> None:
    """At -0.5 and 0.5: NaN, for which no comparison holds, or infinity."""
    entry = {"type": "Function", "names": ["x"], "expression": expression}
    for engine in ("python", "compiled"):
        found = respond(entry, {"u": [[-0.5, 0.5]]}, engine=engine)
        np.testing.assert_array_equal(found, values, err_msg=engine)


def test_an_output_outside_of_a_domain_says_why() -> None:
    entry = {"type": "Function", "expression": "sqrt(u[0])"}
    for engine in ("python", "compiled"):
        with pytest.raises(Exception, match="not finite: nan; an expression leaves its domain"):
            respond(entry, {"u": [[1.0, -1.0]]}, engine=engine)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_what_is_computed_of_misses_may_be_infinite(engine: str) -> None:
    scan = [1.0, float("inf"), 0.5]
    blocks: dict[str, Any] = {
        name: {"type": "Function", "expression": expression}
        for name, expression in (("near", "min(u)"), ("far", "max(u)"), ("next", "u[0] + 1"))
    }
    blocks["scan"] = {"type": "Constant", "signal": "Scan(3)", "value": scan}
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 0.1},
            "blocks": blocks,
            "wires": {
                "near": {"u": "scan.value"},
                "far": {"u": "scan.value"},
                "next": {"u": "far.out"},
            },
            "probes": {name: f"{name}.out" for name in ("near", "far", "next")},
        }
    )
    if engine == "python":  # what is no expression of it has to be finite
        gain = graph.add("gain", Gain(gain=2.0)).connect("next.out", "gain.input")
        with pytest.raises(runtime.SimulationError, match="'gain' at tick 0"):
            gain.run(engine=engine)
    run = graph.run(engine=engine)
    assert [run[name].ravel()[0] for name in ("near", "far", "next")] == [0.5, np.inf, np.inf]
    with pytest.raises(runtime.SimulationError, match="'next' at tick 0.*nan"):
        graph.set("next.expression", "u[0] - u[0]").run(engine=engine)
