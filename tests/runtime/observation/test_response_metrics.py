"""Metrics of responses against closed forms of first- and second-order systems."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.core import FloatArray
from runtime.errors import GraphError
from runtime.observation.metrics import METRIC_KINDS, Metric, ProbeInfo, Series

T = np.linspace(0.0, 20.0, 200_001)
TAU, ZETA, OMEGA = 1.5, 0.3, 2.0
FIRST = 2.0 * (1.0 - np.exp(-T / TAU))  # a step to 2
DAMPED = OMEGA * math.sqrt(1.0 - ZETA**2)
DECAY = np.exp(-ZETA * OMEGA * T)
SECOND = 1.0 - DECAY * (np.cos(DAMPED * T) + ZETA * OMEGA / DAMPED * np.sin(DAMPED * T))
VECTOR = np.column_stack((3.0 * np.exp(-T), 4.0 * np.exp(-T)))


def value(kind: str, values: Any, reference: Any = None, t: FloatArray = T, **options: Any) -> Any:
    series = {"p": Series(t, np.asarray(values, dtype=float))}
    inputs: dict[str, str | None] = {"of": "p"}
    if reference is not None:
        wanted = np.asarray(reference, dtype=float)
        series["r"] = Series(t if len(wanted) > 1 else t[:1], wanted)
        inputs["reference"] = "r"
    return Metric("m", kind, inputs, options).value(series)


def test_rise_times() -> None:
    assert value("rise_time", FIRST, target=2.0) == pytest.approx(TAU * math.log(9.0), rel=1e-7)
    shares = {"low": 0.0, "high": 0.5}
    assert value("rise_time", -FIRST, target=-2.0, **shares) == pytest.approx(TAU * math.log(2.0))
    assert value("rise_time", FIRST, target=2.5) is None
    assert Metric("m", "rise_time", {"of": "p"}).never == "never reached"


def test_the_overshoot_of_a_second_order_system() -> None:
    expected = math.exp(-math.pi * ZETA / math.sqrt(1.0 - ZETA**2))
    assert value("overshoot", SECOND, target=1.0) == pytest.approx(expected, rel=1e-6)
    assert value("overshoot", 5.0 - 3.0 * SECOND, target=2.0) == pytest.approx(expected, rel=1e-6)
    assert value("overshoot", FIRST, reference=[2.0]) == 0.0
    assert value("overshoot", np.ones_like(T), target=1.0) is None


def test_integrals_of_the_deviation() -> None:
    # The deviation is 2 exp(-t / tau); the tail beyond 20 s is 2e-6 of it.
    assert value("iae", FIRST, target=2.0) == pytest.approx(2.0 * TAU, rel=1e-5)
    assert value("ise", FIRST, target=2.0) == pytest.approx(2.0 * TAU, rel=1e-5)  # 4 tau / 2
    assert value("itae", FIRST, reference=np.full_like(T, 2.0)) == pytest.approx(
        2.0 * TAU**2, rel=1e-4
    )
    assert value("energy", VECTOR) == pytest.approx(25.0 / 2.0, rel=1e-6)
    # The length of (3, 4) exp(-t) is 5 exp(-t).
    assert value("iae", VECTOR, length=True) == pytest.approx(5.0, rel=1e-6)
    assert value("iae", VECTOR + 1.0, reference=np.ones_like(VECTOR), length=True) == pytest.approx(
        5.0, rel=1e-6
    )


def test_a_steady_state_error() -> None:
    # A first-order system with gain k in a loop keeps 1 / (1 + k) of a step.
    left = 1.0 / (1.0 + 9.0)
    response = (1.0 - left) * (1.0 - np.exp(-T * 10.0))
    assert value("steady_state_error", response, reference=[1.0]) == pytest.approx(left)
    assert value("steady_state_error", response, target=1.0, window=30.0) is None


def test_settling_to_a_reference() -> None:
    expected = TAU * math.log(2.0 / 0.1)
    for how in ({"target": 2.0}, {"reference": [2.0]}, {"reference": np.full_like(T, 2.0)}):
        found = value("settling_time", FIRST, band=0.1, **how)
        assert found == pytest.approx(expected, abs=1.01e-4)
    ramp = np.sin(T)
    assert value("settling_time", ramp + np.exp(-T), reference=ramp, band=0.1) == pytest.approx(
        math.log(10.0), abs=1.01e-4
    )


@given(st.floats(0.0, 9.0), st.floats(0.1, 9.0))
def test_windows_have_two_ends(after: float, length: float) -> None:
    """A mean over [a, b) of t is (a + b) / 2 within a row, and windows that meet share no row."""
    until = after + length
    t = T[::20]
    window = {"after": after, "until": until}
    assert value("mean", t, t=t, **window) == pytest.approx((after + until) / 2, abs=2.1e-3)
    assert value("max", t, t=t, **window) < until
    middle = after + length / 2
    halves = [Series(t, t).between(after, middle), Series(t, t).between(middle, until)]
    whole = Series(t, t).between(after, until)
    assert np.array_equal(np.concatenate([half.t for half in halves]), whole.t)


@pytest.mark.parametrize("kind", sorted(METRIC_KINDS))
def test_every_metric_of_signals_has_a_window(kind: str) -> None:
    declared = METRIC_KINDS[kind]
    if declared.inputs:
        assert {"after", "until"} <= set(declared.options.declared)


def test_vectors_are_measured_by_their_length() -> None:
    assert value("max", VECTOR, length=True) == pytest.approx(5.0)
    assert value("final", VECTOR, length=True) == pytest.approx(5.0 * math.exp(-20.0))
    assert value("rms", VECTOR, length=True, until=1.0) == pytest.approx(
        5.0 * math.sqrt((1.0 - math.exp(-2.0)) / 2.0), rel=1e-3
    )
    pose = {"of": ProbeInfo((3,), ("m", "m", "rad"))}
    [(key, message)] = METRIC_KINDS["mean"].check({}, pose)
    assert key == "of" and message.endswith("name one, as in plant.pose.theta")
    plane = {"of": ProbeInfo((2,), ("m", "m"))}
    [(key, message)] = METRIC_KINDS["mean"].check({}, plane)
    assert key == "of" and message.endswith("or write length: true")
    [(_, message)] = METRIC_KINDS["mean"].check({"length": True}, pose)
    assert "no common length" in message
    assert not list(METRIC_KINDS["mean"].check({"length": True}, plane))


def test_units_of_integrals() -> None:
    units = {"p": ("m/s",), "q": ("m",), "none": ("",)}
    for name, kind, expected in (
        *(("p", "iae", "m/s s"), ("p", "ise", "(m/s)² s"), ("q", "ise", "m² s")),
        *(("none", "energy", "s"), ("q", "itae", "m s²")),
    ):
        assert Metric("m", kind, {"of": name}).unit(units, "s") == expected


def test_errors_say_what_is_wrong() -> None:
    text = {
        "graph": "g",
        "run": {"dt": 0.01, "until": 1.0},
        "blocks": {
            "one": {"type": "Constant", "value": 1.0},
            "lag": {"type": "Lowpass", "tau": 0.1},
        },
        "wires": {"lag": {"input": "one.value"}},
        "metrics": {
            "rise": {"kind": "rise_time", "of": "lag.out", "reference": "one.value", "high": 0.05},
            "mean": {"kind": "mean", "of": "lag.out", "after": 0.5, "until": 0.2},
        },
    }
    with pytest.raises(GraphError) as caught:
        runtime.load(text).check()
    assert "must be above low = 0.1, got 0.05" in str(caught.value)
    assert "must lie after after = 0.5, got 0.2" in str(caught.value)
    text["metrics"] = {"rise": {"kind": "rise_time", "of": "lag.out", "reference": "one.value"}}
    found = runtime.load(text).run().metrics["rise"]
    assert found == pytest.approx(0.1 * math.log(9.0), rel=5e-3)
