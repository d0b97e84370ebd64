"""Limits and faults: what they conserve, and when they set in."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from tests.blocks.direct import state_of

twists = st.tuples(st.floats(-100, 100), st.floats(-100, 100))
limits = st.floats(1e-3, 50.0)


def limited(twist: tuple[float, float], omega_max: float) -> Any:
    block = blocks.Saturator(omega_max=omega_max)
    return block.output(state_of(block), 0.0, twist)[0]


@given(twists, limits)
def test_the_limit_holds(twist: tuple[float, float], omega_max: float) -> None:
    v, omega = limited(twist, omega_max)
    assert abs(omega) <= omega_max
    assert abs(v) <= abs(twist[0])


@given(twists, limits)
def test_curvature_is_conserved(twist: tuple[float, float], omega_max: float) -> None:
    """omega / v stays, as omega v' = omega' v, and both keep their sign."""
    (v, omega), (v2, omega2) = twist, limited(twist, omega_max)
    assert omega * v2 == pytest.approx(omega2 * v, rel=1e-12, abs=1e-300)
    assert v * v2 >= 0.0
    assert omega * omega2 >= 0.0


@given(twists, limits)
def test_the_command_passes_where_it_may(twist: tuple[float, float], omega_max: float) -> None:
    if abs(twist[1]) <= omega_max:
        assert limited(twist, omega_max) == twist
    else:
        assert abs(limited(twist, omega_max)[1]) == omega_max


@given(twists, limits)
def test_saturated_says_whether_the_command_was_changed(
    twist: tuple[float, float], omega_max: float
) -> None:
    block = blocks.Saturator(omega_max=omega_max)
    out, saturated = block.output(state_of(block), 0.0, twist)
    assert saturated == (1.0 if out != twist else 0.0)


def test_limiting_twice_is_limiting_once() -> None:
    once = limited((1.0, -3.0), 0.7)
    assert once == pytest.approx((0.7 / 3.0, -0.7))
    assert limited(once, 0.7) == once
    assert limited((1.0, 0.7), 0.7) == (1.0, 0.7)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.inf, True, None])
def test_bad_limit(bad: Any) -> None:
    with pytest.raises(blocks.ParameterError, match="omega_max: expected a number above 0 rad/s"):
        blocks.Saturator(omega_max=bad)


@given(twists, twists, twists)
def test_fault_is_gain_and_bias(
    twist: tuple[float, float], gain: tuple[float, float], bias: tuple[float, float]
) -> None:
    block = blocks.ActuatorFault(gain=list(gain), bias=list(bias))
    got = block.output(state_of(block), 0.0, twist)
    assert got == tuple(g * c + b for g, c, b in zip(gain, twist, bias, strict=True))


@pytest.mark.parametrize("dt", ["0.001", "0.01", "0.03", "0.009", "0.0003", "0.1", "0.7"])
@pytest.mark.parametrize(("first", "last"), [(0, 1), (1, 2), (3, 7), (6, 11), (5, 1000)])
def test_the_fault_is_on_from_start_to_before_stop(dt: str, first: int, last: int) -> None:
    """Times that people write, k * dt in decimals, though k * dt in doubles lies beside them."""
    start, stop = float(first * Decimal(dt)), float(last * Decimal(dt))
    block = blocks.ActuatorFault(bias=[1.0, 0.0], start=start, stop=stop)
    state = state_of(block, dt=float(dt))
    on = [block.output(state, k * float(dt), (0.0, 0.0))[0] for k in range(1005)]
    assert on == [1.0 if first <= k < last else 0.0 for k in range(1005)]


def test_between_ticks_the_fault_waits_for_the_next() -> None:
    block = blocks.ActuatorFault(bias=[1.0, 0.0], start=0.15, stop=0.25)
    state = state_of(block, dt=0.1)
    assert [block.output(state, k * 0.1, (0.0, 0.0))[0] for k in range(5)] == [0, 0, 1, 0, 0]


def test_by_default_the_fault_is_on_for_good_and_does_nothing() -> None:
    block = blocks.ActuatorFault()
    assert block.parameters() == {}
    assert block.output(state_of(block), 1e9, (0.3, -0.4)) == (0.3, -0.4)


def test_half_the_turn_rate_is_half_the_angle() -> None:
    """Case A: "reducing the robot's controlled rotational angle by 50 %", for 0.4 s of 1 s."""
    graph = runtime.Graph(dt=0.01, until=1.01)
    graph = graph.add("u", blocks.Constant(value=[0.0, 0.8], signal="Twist"))
    graph = graph.add("fault", blocks.ActuatorFault(gain=[1.0, 0.5], start=0.3, stop=0.7))
    graph = graph.add("plant", blocks.DifferentialDrive())
    graph = graph.connect("u.value", "fault.command").connect("fault.actual", "plant.command")
    angles = graph.probe("plant.pose").run()["plant.pose"][:, 2]
    np.testing.assert_allclose(angles[100], 0.8 * (0.6 + 0.5 * 0.4), rtol=1e-12)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"start": 2.0, "stop": 2.0}, "stop: must lie after start = 2 s, got 2"),
        ({"start": 2.0, "stop": 1.0}, "stop: must lie after start = 2 s, got 1"),
        ({"stop": math.nan}, "stop: expected a number in s, got nan"),
        ({"start": math.inf}, "start: expected a number in s, got inf"),
        ({"gain": 0.5}, "gain: expected an array of 2 numbers, got 0.5"),
        ({"gain": [1.0, math.inf]}, "gain: expected an array of 2 numbers, got [1.0, inf]"),
    ],
)
def test_bad_faults(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.ActuatorFault(**parameters)
    assert message in str(caught.value)
