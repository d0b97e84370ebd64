"""Integrators and linear systems against closed forms and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import signal

import blocks
import runtime
from blocks import ParameterError

RUN = {"dt": 0.01, "until": 5.0, "engine": "python"}


def recorded(blocks: dict[str, Any], wires: dict[str, Any], of: str, **run: Any) -> np.ndarray:
    """One probe of a graph."""
    graph = {"run": {**RUN, **run}, "blocks": blocks, "wires": wires, "probes": {"y": of}}
    return np.asarray(runtime.load(graph).run()["y"])


def test_the_integral_of_a_constant_is_a_ramp() -> None:
    made = {"one": {"type": "Constant", "value": 2.0}, "ramp": {"type": "Integrator"}}
    y = recorded(made, {"ramp": {"input": "one.value"}}, "ramp.out")
    np.testing.assert_allclose(y, 2.0 * 0.01 * np.arange(500), atol=1e-12)


def test_limits_hold_and_the_integral_leaves_them_at_once() -> None:
    """The input is a triangle through zero at t = 1 and 3: the integral leaves 0.3 at t = 1."""
    made = {
        "down": {"type": "Constant", "value": -1.0},
        "rate": {"type": "Integrator", "initial": 1.0},
        "level": {"type": "Integrator", "lower": -1.0, "upper": 0.3},
    }
    wires = {"rate": {"input": "down.value"}, "level": {"input": "rate.out"}}
    y = recorded(made, wires, "level.out")
    t = 0.01 * np.arange(500)
    assert y.max() == 0.3
    later = (t > 1.05) & (t < 2.5)
    # From t = 1 on: 0.3 - (t - 1)^2 / 2, until it reaches -1 at t = 1 + sqrt(2.6).
    np.testing.assert_allclose(y[later], 0.3 - 0.5 * (t[later] - 1.0) ** 2, atol=1e-9)
    assert y[t > 2.7].tolist() == [-1.0] * int((t > 2.7).sum())


def test_reset_holds_the_initial_value() -> None:
    made = {
        "one": {"type": "Constant", "value": 1.0},
        "reset": {"type": "UnitDelay", "dt": 1.0, "initial": 0.0},
        "x": {"type": "Integrator", "initial": 3.0, "edge": "level"},
    }
    wires = {"x": {"input": "one.value", "reset": "reset.out"}, "reset": {"input": "one.value"}}
    y = recorded(made, wires, "x.out")
    t = 0.01 * np.arange(500)
    # The tick at 1 s shows the integral; the reset of that tick comes after it.
    np.testing.assert_allclose(y[:101], 3.0 + t[:101], atol=1e-12)
    assert set(y[101:].tolist()) == {3.0}


def test_every_form_of_signal_is_integrated() -> None:
    for kind, value in (("Twist", [1.0, -2.0]), ("Vector", [1.0, 2.0, 3.0])):
        made = {
            "rate": {"type": "Constant", "value": value, "signal": kind},
            "x": {"type": "Integrator", "initial": value},
        }
        y = recorded(made, {"x": {"input": "rate.value"}}, "x.out", solver="euler")
        t = 0.01 * np.arange(500)
        np.testing.assert_allclose(y, np.outer(1.0 + t, value), atol=1e-12)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"lower": 1.0, "upper": 1.0}, "upper: expected a limit above lower = 1, got 1"),
        ({"lower": 0.0, "initial": -1.0}, "initial: expected values within the limits, 0 to inf"),
    ],
)
def test_wrong_limits(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        blocks.Integrator(**parameters)


def test_a_linear_system_steps_like_scipys() -> None:
    a, b = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-3.0, -4.0, -2.0]], [0.0, 0.0, 1.0]
    c, d = [3.0, 0.5, 0.0], 0.25
    made = {
        "one": {"type": "Constant", "value": 1.0},
        "plant": {"type": "StateSpace", "A": a, "B": b, "C": c, "D": d},
    }
    y = recorded(made, {"plant": {"input": "one.value"}}, "plant.out")
    t = 0.01 * np.arange(500)
    system = signal.StateSpace(np.array(a), np.array(b)[:, None], np.array(c)[None], [[d]])
    _, expected = signal.step(system, T=t)
    np.testing.assert_allclose(y, expected, atol=1e-7)


def test_many_inputs_and_outputs() -> None:
    """x' = -x + u_1 + 2 u_2 = 5 - x, y = [x, 2 x] + 0.5 u."""
    made = {
        "u": {"type": "Constant", "value": [1.0, 2.0], "signal": "Vector"},
        "plant": {
            **{"type": "StateSpace", "A": [[-1.0]], "B": [[1.0, 2.0]], "C": [[1.0], [2.0]]},
            **{"D": [[0.5, 0.0], [0.0, 0.5]], "x0": [1.0]},
        },
    }
    y = recorded(made, {"plant": {"input": "u.value"}}, "plant.out")
    x = 5.0 - 4.0 * np.exp(-0.01 * np.arange(500))
    np.testing.assert_allclose(y, np.column_stack((x + 0.5, 2.0 * x + 1.0)), atol=1e-8)


def test_without_direct_feedthrough_a_loop_has_no_algebraic_part() -> None:
    """The same loop with D = 1 is algebraic."""
    system = {"type": "StateSpace", "A": [[0.0]], "B": [1.0], "C": [1.0], "x0": [1.0]}
    made = {"plant": system, "back": {"type": "Gain", "gain": -2.0}}
    wires = {"plant": {"input": "back.out"}, "back": {"input": "plant.out"}}
    y = recorded(made, wires, "plant.out")
    np.testing.assert_allclose(y, np.exp(-0.02 * np.arange(500)), atol=1e-9)
    with pytest.raises(runtime.GraphError, match="algebraic loop: back.out"):
        recorded({**made, "plant": {**system, "D": 1.0}}, wires, "plant.out")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"A": [[0, 1]]}, "A: expected as many columns as rows, got 1 x 2"),
        ({"B": [1]}, "B: expected 2 rows, as A has, got 1"),
        ({"C": [1, 2, 3]}, "C: expected 2 columns, as A has, got 3"),
        ({"D": [[1, 2]]}, "D: expected 1 x 1 numbers, got 1 x 2"),
        ({"x0": [1]}, "x0: expected 2 numbers, one per state, got 1"),
    ],
)
def test_matrices_that_do_not_fit(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        blocks.StateSpace(**{"A": [[0, 1], [2, 3]], "B": [1, 1], "C": [1, 0], **changed})
