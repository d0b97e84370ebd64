"""Differences with several steps: where they agree, and where they are reported."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.core import jacobian


def slope(function: Callable[[float], float], x: float) -> tuple[float, bool]:
    """The slope of a function of a number, and whether it settles."""
    matrix, unsettled = jacobian(lambda v: np.array([function(float(v[0]))]), np.array([x]))
    return float(matrix[0, 0]), not unsettled


@pytest.mark.parametrize(
    ("function", "x", "exact"),
    [
        (math.sin, 0.3, math.cos(0.3)),
        (math.exp, 5.0, math.exp(5.0)),
        (lambda x: x * x, 0.0, 0.0),
        (lambda x: x * x, 1e5, 2e5),
        (lambda x: 1.0 / x, 1e-3, -1e6),
        (math.sqrt, 1e-4, 50.0),
        (lambda x: math.tanh(1000.0 * x), 0.0, 1000.0),
        (lambda x: 1e10 - 0.01 * x, 0.0, -0.01),
        (lambda x: min(max(x, -1.0), 1.0), 0.999, 1.0),
        (lambda x: min(max(x, -1.0), 1.0), 1.001, 0.0),
        (lambda x: abs(x) ** 3, 0.0, 0.0),
        (lambda x: 3.0, 2.0, 0.0),
    ],
)
def test_smooth_functions(function: Callable[[float], float], x: float, exact: float) -> None:
    value, settled = slope(function, x)
    assert settled
    assert value == pytest.approx(exact, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize(
    ("function", "x", "below", "above"),
    [
        (abs, 0.0, -1.0, 1.0),
        (lambda x: min(max(x, -1.0), 1.0), 1.0, 1.0, 0.0),
        (lambda x: 0.0 if x >= 1.0 else 2.0, 1.0, math.nan, 0.0),
        (lambda x: 1e6 * max(x, 0.0), 0.0, 0.0, 1e6),
        (math.sqrt, 0.0, math.nan, math.nan),
    ],
)
def test_kinks_and_jumps_are_reported(
    function: Callable[[float], float], x: float, below: float, above: float
) -> None:
    matrix, (found,) = jacobian(lambda v: np.array([function(float(v[0]))]), np.array([x]))
    assert [found.below, found.above] == pytest.approx([below, above], rel=1e-6, nan_ok=True)
    assert np.isfinite(matrix).all()
    if not math.isnan(above):
        assert matrix[0, 0] == pytest.approx(above, abs=1e-9)


@given(st.floats(-1e3, 1e3), st.floats(-5.0, 5.0), st.floats(-2.0, 2.0), st.floats(0.1, 3.0))
def test_a_smooth_function_is_never_reported(a: float, x: float, b: float, w: float) -> None:
    value, settled = slope(lambda x: a * x + b * math.sin(w * x) + x * x, x)
    assert settled
    assert value == pytest.approx(a + b * w * math.cos(w * x) + 2.0 * x, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("events", ["located", "ticks"])
def test_an_integrator_at_its_limit(events: str) -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.0, "events": events},
            "blocks": {
                "u": {"type": "Constant", "value": 10.0},
                "x": {"type": "Integrator", "upper": 1.0, "initial": 1.0},
            },
            "wires": {"x": {"input": "u.value"}},
        }
    )
    found = graph.linearize(["u.value"], ["x.out"], at=0.1)
    assert found.poles.tolist() == [0.0]
    assert found.b.tolist() == [[0.0]]
    # Located, the block knows that it is at its limit; else it decides by the number, which jumps.
    loose = [(each.of, each.by) for each in found.loose]
    assert loose == ([("x.integral'", "x.integral")] if events == "ticks" else [])


def test_a_slow_state_beside_a_large_input() -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.0},
            "blocks": {
                "u": {"type": "Constant", "value": 1e5},
                "x": {
                    "type": "DynamicSystem",
                    "initial": [0.0],
                    "derivative": ["-0.01*x[0] + u[0]**2"],
                },
            },
            "wires": {"x": {"u": "u.value"}},
        }
    )
    found = graph.linearize(["u.value"])
    assert found.poles.real.tolist() == pytest.approx([-0.01], rel=1e-4)
    assert found.b[0, 0] == pytest.approx(2e5, rel=1e-9)


def test_a_clip_at_its_limit_is_reported_with_both_slopes() -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.0},
            "blocks": {
                "u": {"type": "Constant", "value": 1.0},
                "limit": {"type": "Clip", "low": -1.0, "high": 1.0},
                "x": {"type": "Integrator"},
            },
            "wires": {"limit": {"input": "u.value"}, "x": {"input": "limit.out"}},
        }
    )
    (loose,) = graph.linearize(["u.value"]).loose
    assert (loose.of, loose.by) == ("x.integral'", "u.value")
    assert (loose.below, loose.above) == pytest.approx((1.0, 0.0))
