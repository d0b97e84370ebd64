"""Blocks in discrete time against closed forms and scipy.signal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from tests.blocks.responses import problems, respond
from tests.examples import examples

U = np.random.default_rng(0).standard_normal(120)
PAIR = np.column_stack((U, np.cos(U)))


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_a_delay_of_whole_steps_is_exact(steps: int) -> None:
    found = respond({"type": "Delay", "delay": steps * 0.01, "initial": 5.0}, {"input": U})
    np.testing.assert_array_equal(found, np.concatenate((np.full(steps, 5.0), U[:-steps])))


def test_a_delay_between_two_steps_is_a_straight_line() -> None:
    found = respond({"type": "Delay", "delay": 0.0325}, {"input": PAIR})
    padded = np.vstack((np.zeros((4, 2)), PAIR))
    expected = 0.75 * padded[1:121] + 0.25 * padded[0:120]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_hold_samples_at_its_own_rate() -> None:
    found = respond({"type": "Hold", "dt": 0.05}, {"input": U})
    np.testing.assert_array_equal(np.repeat(U[::5], 1), found[: len(U[::5])])


@pytest.mark.parametrize("samples", [1, 4])
def test_a_moving_average(samples: int) -> None:
    found = respond({"type": "MovingAverage", "samples": samples}, {"input": PAIR})
    expected = signal.lfilter(np.full(samples, 1.0 / samples), [1.0], PAIR, axis=0)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@examples(25)
@given(
    st.lists(st.floats(-2, 2), min_size=1, max_size=4),
    st.lists(st.floats(-0.5, 0.5), min_size=0, max_size=3),
)
def test_a_transfer_function_is_scipys_filter(numerator: list[float], rest: list[float]) -> None:
    denominator = [2.0, *rest]
    entry = {
        "type": "DiscreteTransferFunction",
        "numerator": numerator,
        "denominator": denominator,
    }
    if len(np.trim_zeros(numerator, "f")) > len(denominator):
        assert "improper" in problems(entry, ["Scalar"])
        return
    b = np.zeros(len(denominator))
    kept = np.array(numerator)[-len(denominator) :]
    b[len(b) - len(kept) :] = kept
    expected = signal.lfilter(b, denominator, PAIR, axis=0)
    found = respond(entry, {"input": PAIR})
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_a_linear_system_is_scipys() -> None:
    a, b, c = [[0.9, 0.2], [-0.1, 0.7]], [[1.0, 0.0], [0.5, 2.0]], [[1.0, 1.0]]
    d = [[0.3, 0.0]]
    entry = {"type": "DiscreteStateSpace", "A": a, "B": b, "C": c, "D": d, "x0": [1.0, -1.0]}
    _, expected, _ = signal.dlsim((a, b, c, d, 0.01), PAIR, x0=[1.0, -1.0])
    np.testing.assert_allclose(respond(entry, {"input": PAIR}), expected[:, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("method", "b"),
    [("forward", [0.0, 1.0]), ("backward", [1.0, 0.0]), ("trapezoidal", [0.5, 0.5])],
)
def test_an_integrator_is_its_sum(method: str, b: list[float]) -> None:
    entry = {"type": "DiscreteIntegrator", "method": method, "gain": 3.0, "initial": 2.0}
    expected = 2.0 + 0.03 * signal.lfilter(b, [1.0, -1.0], U)
    np.testing.assert_allclose(respond(entry, {"input": U}), expected, atol=1e-12)


def test_an_integrator_has_limits_and_a_reset() -> None:
    ones, reset = np.ones(100), np.zeros(100)
    reset[50] = 1.0
    entry = {"type": "DiscreteIntegrator", "upper": 0.3, "initial": 0.1}
    k = np.arange(100)
    expected = np.minimum(0.3, 0.1 + 0.01 * np.where(k <= 50, k, k - 51))
    found = respond(entry, {"input": ones, "reset": reset})
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_loop_through_blocks_without_feedthrough_runs() -> None:
    """y(k+1) = y(k) + 0.1 (1 - y(k)), through a strictly proper filter and a sum."""
    import runtime

    graph = {
        "run": {"dt": 0.1, "until": 5.0},
        "blocks": {
            "one": {"type": "Constant", "value": 1.0},
            "error": {"type": "Sum", "signs": [1, -1]},
            "plant": {
                "type": "DiscreteTransferFunction",
                "numerator": [0.1],
                "denominator": [1, -1],
            },
        },
        "wires": {"error": {"terms": ["one.value", "plant.out"]}, "plant": {"input": "error.out"}},
        "probes": {"y": "plant.out"},
    }
    found = np.asarray(runtime.load(graph).run()["y"])
    np.testing.assert_allclose(found, 1.0 - 0.9 ** np.arange(50), atol=1e-12)


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"type": "Delay", "delay": 0.001}, "expected at least one step, 0.01 s, got 0.001 s"),
        ({"type": "Delay", "delay": 1e12}, "make it smaller"),
        (
            {"type": "DiscreteTransferFunction", "numerator": [1, 2], "denominator": [1]},
            "improper",
        ),
        (
            {"type": "DiscreteTransferFunction", "numerator": [1], "denominator": [0, 1]},
            "expected a highest coefficient other than 0",
        ),
        ({"type": "DiscreteStateSpace", "A": [[1, 2]], "B": [1], "C": [1]}, "as many columns"),
        ({"type": "DiscreteIntegrator", "lower": 1, "upper": 0}, "expected a limit above lower"),
        ({"type": "MovingAverage", "samples": 0}, "at least 1"),
        ({"type": "MovingAverage", "samples": 2, "initial": [1, 2]}, "expected a number"),
    ],
)
def test_a_wrong_block_is_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems(entry, ["Scalar"])


@pytest.mark.parametrize("n", [None, 20.0])
def test_a_discrete_pid_is_its_transfer_function(n: float | None) -> None:
    """kp + ki h / (1 - w) + kd (1 - w) / h, or kd n (1 - w) / (1 + n h - w) filtered; w = 1/z."""
    h, (kp, ki, kd) = 0.01, (1.5, 4.0, 0.2)
    entry = {"type": "DiscretePID", "kp": kp, "ki": ki, "kd": kd}
    error = np.random.default_rng(3).standard_normal((60, 3))
    found = respond(entry | ({} if n is None else {"n": n}), {"error": error})
    slope, lag = ([kd / h, -kd / h], [1.0]) if n is None else ([kd * n, -kd * n], [1 + n * h, -1.0])
    parts = [([kp], [1.0]), ([ki * h], [1.0, -1.0]), (slope, lag)]
    expected = sum(signal.lfilter(b, a, error, axis=0) for b, a in parts)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_a_discrete_pid_within_limits_leaves_them_at_once() -> None:
    """Back-calculation holds the integral at what the limits allow; reset begins anew."""
    error = np.concatenate([np.full(300, 2.0), np.full(50, -0.1)])
    base = {"type": "DiscretePID", "kp": 0.5, "ki": 2.0, "upper": 1.2}
    free = respond({**base, "tracking": 0.0}, {"error": error})
    held = respond({**base, "tracking": 100.0}, {"error": error})
    assert free[300:].min() == 1.2
    # with tracking = 1 / h, the integral returns to the limit within one tick
    np.testing.assert_allclose(
        held[300], 1.2 - 0.5 * 2.0 - 0.5 * 0.1 - 0.002 + 0.04 - 0.04, atol=1e-9
    )
    reset = (np.arange(350) == 200).astype(float)
    again = respond({**base, "tracking": 0.0}, {"error": error, "reset": reset})
    np.testing.assert_array_equal(again[201:250], free[:49])
