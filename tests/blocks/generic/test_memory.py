"""Delay and lowpass against closed forms and scipy.signal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

import blocks
import runtime
from blocks import Path, PointCloud, Pose, Scalar, Scan, SignalType, Spikes, Twist, Vector
from tests.blocks.direct import state_of

TYPES = [Scalar, Twist, Pose, Vector(3), Vector(1), Spikes(4), Scan(5), PointCloud(2), Path(6)]
DT = 0.01


def through(block: Any, kind: SignalType, signals: list[Any], dt: float = DT) -> list[Any]:
    """What comes out at each tick while the signals go in."""
    state = state_of(block, {"input": kind, "out": kind}, dt=dt)
    outs = []
    for k, signal in enumerate(signals):
        outs.append(block.output(state, k * dt))
        block.update(state, k * dt, signal)
    return outs


def drawn(kind: SignalType, n: int, seed: int = 0) -> list[Any]:
    draw = np.random.default_rng(seed)
    return [kind.pack(draw.standard_normal(kind.shape)) for _ in range(n)]


@pytest.mark.parametrize("kind", TYPES, ids=str)
def test_delay_is_one_tick(kind: SignalType) -> None:
    signals = drawn(kind, 6)
    outs = through(blocks.UnitDelay(), kind, signals)
    assert all(kind.holds(out) for out in outs)
    for out, expected in zip(outs, [kind.zero(), *signals[:-1]], strict=True):
        np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("kind", TYPES, ids=str)
def test_lowpass_is_scipys_filter(kind: SignalType) -> None:
    """y_k+1 = a y_k + (1 - a) u_k with a = exp(-dt / tau), as a transfer function."""
    signals = drawn(kind, 40)
    outs = through(blocks.Lowpass(tau=0.035), kind, signals)
    assert all(kind.holds(out) for out in outs)
    a = math.exp(-DT / 0.035)
    expected = lfilter([0.0, 1.0 - a], [1.0, -a], np.array(signals), axis=0)
    np.testing.assert_allclose(np.array(outs), expected, rtol=1e-12, atol=1e-14)


@given(st.floats(1e-3, 1e2), st.floats(1e-4, 1.0), st.floats(-5, 5), st.floats(-5, 5))
def test_step_response(tau: float, dt: float, initial: float, step: float) -> None:
    outs = through(blocks.Lowpass(tau=tau, initial=initial), Scalar, [step] * 30, dt)
    k = np.arange(30)
    expected = step + (initial - step) * np.exp(-k * dt / tau)
    np.testing.assert_allclose(outs, expected, rtol=1e-11, atol=1e-11)


def test_lowpass_has_unit_gain_and_the_steps_do_not_matter() -> None:
    """The response to a held input is exact, so a ten times coarser tick sees the same curve."""
    fine = through(blocks.Lowpass(tau=0.2), Scalar, [1.0] * 101, 0.01)
    coarse = through(blocks.Lowpass(tau=0.2), Scalar, [1.0] * 11, 0.1)
    np.testing.assert_allclose(fine[::10], coarse, rtol=1e-12)
    assert through(blocks.Lowpass(tau=0.2), Scalar, [1.0] * 1000)[-1] == pytest.approx(1.0)


def test_sharp_filters_neither_overshoot_nor_fail() -> None:
    assert through(blocks.Lowpass(tau=1e-9), Scalar, [2.0, 3.0, 3.0]) == [0.0, 2.0, 3.0]


@pytest.mark.parametrize("make", [blocks.UnitDelay, lambda **p: blocks.Lowpass(tau=1e9, **p)])
@pytest.mark.parametrize(
    ("kind", "initial", "expected"),
    [
        (Scalar, 2.5, 2.5),
        (Twist, 2.5, (2.5, 2.5)),
        (Twist, [1.0, -2.0], (1.0, -2.0)),
        (Vector(3), 1, [1.0, 1.0, 1.0]),
        (Vector(3), [1, 2, 3], [1.0, 2.0, 3.0]),
        (PointCloud(2), [[1, 2], [3, 4]], [[1.0, 2.0], [3.0, 4.0]]),
        (Pose, None, (0.0, 0.0, 0.0)),
    ],
)
def test_initial_value(make: Any, kind: SignalType, initial: Any, expected: Any) -> None:
    (first,) = through(make(initial=initial), kind, drawn(kind, 1))
    assert kind.holds(first)
    np.testing.assert_array_equal(first, expected)


@pytest.mark.parametrize(
    ("kind", "initial", "message"),
    [
        (Scalar, [1.0], r"initial: expected a number for Scalar, got \[1.0\]"),
        (Twist, [1, 2, 3], "initial: expected a number or 2 numbers for Twist, got"),
        (Vector(3), [1, 2], r"initial: expected a number or 3 numbers for Vector\(3\), got"),
        (PointCloud(2), [1, 2], r"a number or 2x2 numbers for PointCloud\(2\), got \[1.0, 2.0\]"),
    ],
)
def test_initial_value_of_another_shape(kind: SignalType, initial: Any, message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        through(blocks.UnitDelay(initial=initial), kind, [])


def test_outputs_are_copies() -> None:
    delay = blocks.UnitDelay()
    first, second = through(delay, Vector(2), [np.array([1.0, 2.0]), np.array([3.0, 4.0])])
    np.testing.assert_array_equal(first, [0.0, 0.0])
    np.testing.assert_array_equal(second, [1.0, 2.0])


@pytest.mark.parametrize("tau", [0.0, -1.0, math.nan, "1"])
def test_bad_time_constant(tau: Any) -> None:
    with pytest.raises(blocks.ParameterError, match="tau: expected a number above 0 s, got"):
        blocks.Lowpass(tau=tau)


def test_a_delay_breaks_a_loop_at_the_blocks_own_step() -> None:
    """x_k+1 = 2 x_k counts one doubling per tick of the delay, which ticks every third time."""
    graph = runtime.Graph(dt=0.1, until=1.2)
    graph = graph.add("hold", blocks.UnitDelay(initial=1.0), dt=0.3).add(
        "twice", blocks.Gain(gain=2)
    )
    graph = graph.connect("hold.out", "twice.input").connect("twice.out", "hold.input")
    graph = graph.add("typed", blocks.Mux()).connect("hold.out", "typed.v")
    held = graph.probe("hold.out").run()["hold.out"]
    np.testing.assert_array_equal(held, [1.0, 2.0, 4.0, 8.0])
