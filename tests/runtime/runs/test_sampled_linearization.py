"""Linearization of loops with sampled blocks, against closed forms, scipy and python-control."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm
from scipy.special import lambertw

import blocks
import runtime
from runtime.errors import UsageError
from runtime.graph import Graph
from tests.runtime.engine.test_continuous import OSCILLATOR, graph_of

# x'' = 23.4 x + u: poles at +-4.84, as of a pendulum that stands on its joint.
A, B, C = np.array([[0.0, 1.0], [23.4, 0.0]]), np.array([[0.0], [1.0]]), np.eye(2)


def loop(controller: dict[str, Any], until: float = 1.0, dt: float = 0.001, **more: Any) -> Graph:
    """r - y into a controller, its output into the plant above, y = its position."""
    return runtime.load(
        {
            "run": {"dt": dt, "until": until},
            "blocks": {
                "r": {"type": "Constant", "value": 0.0},
                "error": {"type": "Sum", "signs": [1, -1]},
                "control": controller,
                "plant": {"type": "StateSpace", "A": A.tolist(), "B": [0, 1], "C": [1, 0.2]},
                **more.get("blocks", {}),
            },
            "wires": {
                "error": {"terms": ["r.value", "plant.out"]},
                "control": {next(iter(more.get("port", ["input"]))): "error.out"},
                "plant": {"input": "control.out"},
                **more.get("wires", {}),
            },
        }
    )


def held(time: float) -> tuple[np.ndarray, np.ndarray]:
    """The plant over a time with a held input, by scipy."""
    discrete = signal.cont2discrete((A, B, C, np.zeros((2, 1))), time)
    return discrete[0], discrete[1]


def test_a_sampled_gain_on_an_unstable_plant() -> None:
    found = loop({"type": "Gain", "gain": 60.0, "dt": 0.01}).linearize(["r.value"], ["plant.out"])
    ad, bd = held(0.01)
    gain = np.array([[60.0, 12.0]])
    np.testing.assert_allclose(found.a, ad - bd @ gain, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(found.b, 60.0 * bd, rtol=1e-9)
    assert found.period == 0.01
    assert found.sampled == ("control",)
    assert found.states == ("plant.x.0", "plant.x.1")
    assert found.is_stable
    np.testing.assert_allclose(np.exp(found.equivalent * 0.01), found.poles, rtol=1e-12)
    assert max(np.linalg.eigvals(A).real) == pytest.approx(4.84, abs=0.01)


def test_the_model_predicts_a_run() -> None:
    """The states of a run at its periods are powers of A: the plan's own integration agrees."""
    graph = loop({"type": "Gain", "gain": 60.0, "dt": 0.01}).set("blocks.plant.x0", [0.1, 0.0])
    found = graph.linearize(states={"plant.x": [0.0, 0.0]})
    ran = graph.set("run.dt", 0.0005).set("run.until", 0.2).probe("plant.x").run()["plant.x"]
    power = np.linalg.matrix_power(found.a, 15) @ [0.1, 0.0]
    np.testing.assert_allclose(ran[15 * 20], power, rtol=1e-8)


@pytest.mark.parametrize("bandwidth", [None, 50.0])
def test_a_discrete_pid_loop(bandwidth: float | None) -> None:
    kp, ki, kd, h = 80.0, 40.0, 6.0, 0.01
    pid = {"type": "DiscretePID", "kp": kp, "ki": ki, "kd": kd, "dt": h}
    pid |= {} if bandwidth is None else {"n": bandwidth}
    found = loop(pid, port=["error"]).linearize(["r.value"], ["plant.out"])
    # As polynomials in z: C(z) = kp + ki h z / (z - 1) + rise (z - 1) / (z - kept).
    n = math.inf if bandwidth is None else bandwidth
    kept, rise = 1.0 / (1.0 + n * h), kd / (1.0 / n + h)
    numerator = np.polyadd(
        np.polyadd(kp * np.poly([1.0, kept]), ki * h * np.poly([0.0, kept])),
        rise * np.poly([1.0, 1.0]),
    )
    discrete = signal.cont2discrete((A, B, np.array([[1.0, 0.2]]), np.zeros((1, 1))), h)
    plant, below = signal.ss2tf(*discrete[:4])
    expected = np.polyadd(np.polymul(np.poly([1.0, kept]), below), np.polymul(numerator, plant[0]))
    # With a filter, the block keeps one number more than it needs: its mode ends in one sample.
    roots = np.append(np.roots(expected), [0.0] * (bandwidth is not None))
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(roots), atol=1e-6)
    # The path through the sampled controller is not lost: the gain from r at rest is 1.
    assert np.abs(found.b).max() > 0.0
    at_rest = found.c @ np.linalg.solve(np.eye(len(found.a)) - found.a, found.b) + found.d
    np.testing.assert_allclose(at_rest, [[1.0]], atol=1e-6)


def test_two_rates() -> None:
    """A gain at 10 ms, and one at 4 ms behind it: the map over 20 ms, tick by tick."""
    graph = loop(
        {"type": "Gain", "gain": 60.0, "dt": 0.01},
        dt=0.002,
        blocks={"second": {"type": "Gain", "gain": 0.9, "dt": 0.004}},
        wires={"second": {"input": "control.out"}, "plant": {"input": "second.out"}},
    )
    found = graph.linearize(["r.value"], ["plant.out"])
    assert found.period == 0.02
    ad, bd = held(0.002)
    whole = np.eye(4)  # x, control, second
    for k in range(10):
        tick = np.eye(4)
        if k % 5 == 0:
            tick[2] = [-60.0, -12.0, 0.0, 0.0]
        if k % 2 == 0:
            tick[3] = 0.9 * tick[2]
        between = np.eye(4)
        between[:2, :2], between[:2, 3:] = ad, bd
        whole = between @ tick @ whole
    np.testing.assert_allclose(found.a, whole[:2, :2], rtol=1e-9, atol=1e-10)


def test_a_block_that_acts_later_in_its_period() -> None:
    """A gain at 10 ms, 4 ms after each multiple: what it held is a state at the multiples."""
    graph = loop({"type": "Gain", "gain": 60.0, "dt": 0.01, "offset": 0.004}, dt=0.002)
    found = graph.linearize(["r.value"], ["plant.out"])
    assert found.period == 0.01
    ad, bd = held(0.002)
    tick, between = np.eye(3), np.eye(3)
    tick[2] = [-60.0, -12.0, 0.0]
    between[:2, :2], between[:2, 2:] = ad, bd
    after = np.linalg.matrix_power(between, 3) @ tick @ np.linalg.matrix_power(between, 2)
    np.testing.assert_allclose(found.a, after, rtol=1e-9, atol=1e-10)


def test_rates_without_a_short_common_period_are_an_error() -> None:
    graph = loop(
        {"type": "Gain", "gain": 60.0, "dt": 0.010007},
        dt=1e-6,
        blocks={"second": {"type": "Gain", "gain": 1.0, "dt": 0.020011}},
        wires={"second": {"input": "control.out"}, "plant": {"input": "second.out"}},
    )
    with pytest.raises(UsageError, match="the sampled blocks act together every 200.25 s only"):
        graph.linearize()


@pytest.mark.parametrize("delay", ["UnitDelay", "Delay"])
def test_a_delay_of_whole_samples_is_poles_at_zero(delay: str) -> None:
    steps = 1 if delay == "UnitDelay" else 3
    late: dict[str, Any] = {"type": delay, "dt": 0.01}
    late |= {"delay": 0.03} if delay == "Delay" else {}
    graph = loop(
        {"type": "Gain", "gain": 2.0, "dt": 0.01},
        blocks={"late": late},
        wires={"late": {"input": "control.out"}, "plant": {"input": "late.out"}},
    )
    found = graph.linearize(["r.value"], ["plant.out"])
    ad, bd = held(0.01)
    size = 2 + steps
    chain = np.zeros((size, size))
    chain[:2, :2], chain[:2, 2:3] = ad, bd
    chain[2 : size - 1, 3:] = np.eye(steps - 1)
    chain[-1, :2] = [-2.0, -0.4]
    expected = np.linalg.eigvals(chain)
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(expected), atol=1e-6)
    # At another time, when the ring of the delay begins elsewhere, it is the same system.
    later = graph.set("blocks.plant.x0", [0.0, 0.0]).linearize(["r.value"], ["plant.out"], at=0.07)
    np.testing.assert_allclose(later.a, found.a, atol=1e-9)


@pytest.mark.parametrize("at", [0.0, 2.0])
def test_a_delay_in_a_continuous_loop_is_seen_before_it_has_a_past(at: float) -> None:
    """x' = -2 x(t - 0.105): s = W(-0.21) / 0.105, with half a tick more of delay for the hold."""
    graph = runtime.load(
        {
            "run": {"dt": 0.002, "until": 3.0},
            "blocks": {
                "x": {"type": "Integrator", "initial": 0.0},
                "late": {"type": "Delay", "delay": 0.105},
                "k": {"type": "Gain", "gain": -2.0, "signal": "Scalar"},
            },
            "wires": {
                "late": {"input": "x.out"},
                "k": {"input": "late.out"},
                "x": {"input": "k.out"},
            },
        }
    )
    found = graph.linearize(at=at)
    exact, held_longer = (lambertw(-2.0 * tau).real / tau for tau in (0.105, 0.106))
    slowest = found.equivalent[0]
    assert slowest == pytest.approx(held_longer, rel=1e-4)
    assert slowest == pytest.approx(exact, rel=1e-2)


def test_a_part_that_is_off_holds() -> None:
    part = {
        "inputs": {"e": "Scalar", "on": "Scalar"},
        "outputs": {"u": "gain.out"},
        "blocks": {
            "enable": {"type": "Enable"},
            "gain": {"type": "Gain", "gain": 60.0, "dt": 0.01},
        },
        "wires": {"enable": {"input": "inputs.on"}, "gain": {"input": "inputs.e"}},
    }
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 1.0},
            "blocks": {
                "on": {"type": "Step", "time": 0.5},
                "flip": {"type": "Gain", "gain": -1.0},
                "part": part,
                "plant": {"type": "StateSpace", "A": A.tolist(), "B": [0, 1], "C": [1, 0.2]},
            },
            "wires": {
                "flip": {"input": "plant.out"},
                "part": {"e": "flip.out", "on": "on.out"},
                "plant": {"input": "part.u"},
            },
        }
    )
    ad, bd = held(0.01)
    off, on = graph.linearize(at=0.1), graph.linearize(at=0.6)
    np.testing.assert_allclose(off.a, ad, rtol=1e-9)
    np.testing.assert_allclose(on.a, ad - bd @ [[60.0, 12.0]], rtol=1e-9, atol=1e-11)
    assert off.held == ("on", "part.enable")


def test_a_graph_in_discrete_time_alone() -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 1.0},
            "blocks": {
                "u": {"type": "Constant", "value": 0.0},
                "s": {
                    "type": "DiscreteStateSpace",
                    "A": [[0.5, 0.1], [0, 0.9]],
                    "B": [0, 1],
                    "C": [1, 0],
                },
            },
            "wires": {"s": {"input": "u.value"}},
        }
    )
    found = graph.linearize(["u.value"], ["s.out"])
    np.testing.assert_allclose(found.a, [[0.5, 0.1], [0.0, 0.9]], atol=1e-12)
    np.testing.assert_allclose(found.b, [[0.0], [1.0]], atol=1e-12)
    np.testing.assert_allclose(found.c, [[1.0, 0.0]], atol=1e-12)
    assert found.period == 0.1


def test_what_draws_random_numbers_is_refused_by_name() -> None:
    graph = loop(
        {"type": "Gain", "gain": 60.0, "dt": 0.01},
        blocks={"noise": {"type": "WhiteNoise", "density": 1e-6}},
        wires={"error": {"terms": ["r.value", "plant.out", "noise.out"]}},
    ).set("blocks.error.signs", [1, -1, 1])
    with pytest.raises(
        UsageError, match="'noise' draws random numbers.*--without or --bypass noise"
    ):
        graph.linearize(["r.value"], ["plant.out"])
    assert graph.without("noise").linearize(["r.value"], ["plant.out"]).is_stable


def test_a_source_that_is_held_is_named() -> None:
    graph = graph_of(OSCILLATOR)
    graph = graph.add("wind", blocks.Sine(frequency=1.0)).add("both", blocks.Sum(signs=[1, 1]))
    graph = graph.connect("wind.out", "both.terms").connect("spring.out", "both.terms")
    graph = graph.wire("speed.input", "both.out")
    found = graph.linearize(["spring.input"], ["position.out"])
    assert found.held == ("wind",)
    assert graph.linearize(["wind.out"], ["position.out"]).held == ()
    np.testing.assert_allclose(found.a, [[0.0, 1.0], [-1.0, 0.0]], atol=1e-12)


def test_the_exact_map_of_one_state() -> None:
    """x' = a x + w, w = k x every T: e^aT + k (e^aT - 1) / a, and the same by expm."""
    a, k, period = -0.7, -3.0, 0.2
    graph = runtime.load(
        {
            "run": {"dt": 0.05, "until": 1.0},
            "blocks": {
                "plant": {"type": "StateSpace", "A": [[a]], "B": [1], "C": [1]},
                "gain": {"type": "Gain", "gain": k, "dt": period},
            },
            "wires": {"plant": {"input": "gain.out"}, "gain": {"input": "plant.out"}},
        }
    )
    closed = math.exp(a * period) + k * (math.exp(a * period) - 1.0) / a
    found = graph.linearize().a
    np.testing.assert_allclose(found, [[closed]], rtol=1e-11)
    by_expm = expm(np.array([[a, 1.0], [0.0, 0.0]]) * period)[0] @ [1.0, k]
    np.testing.assert_allclose(found, [[by_expm]], rtol=1e-11)
