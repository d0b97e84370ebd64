"""Weights by a rule, with a probability of connection and delays, against NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime
from blocks.neural.connections import PerConnection
from runtime.errors import GraphError

N, M, TICKS = 12, 8, 60


def wired(**weights: Any) -> runtime.Graph:
    """Spikes of twelve neurons through weights to the currents of eight, without a synapse."""
    return runtime.load(
        {
            "run": {"dt": 0.001, "until": TICKS * 0.001, "seed": 4},
            "blocks": {
                "x": {"type": "Constant", "value": [0.5], "signal": "Vector"},
                "a": {"type": "Ensemble", "neurons": N},
                "w": {"type": "Weights", "synapse": "none", **weights},
                "b": {"type": "Ensemble", "neurons": M, "dimensions": 1},
            },
            "wires": {
                "a": {"input": "x.value"},
                "w": {
                    "spikes": "a.spikes",
                    **({"post": "b.spikes"} if "learning" in weights else {}),
                },
                "b": {"input": "x.value", "current": "w.current"},
            },
            "probes": {"spikes": "a.spikes", "current": "w.current", "weights": "w.weights"},
        }
    )


def ring(i: np.ndarray, j: np.ndarray) -> np.ndarray:
    return np.exp(np.cos(2.0 * np.pi * (i - j) / N)) / M


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_rule_gives_the_weight_of_each_pair(engine: str) -> None:
    run = wired(weights="exp(cos(2*pi*(i - j)/n))/m").run(engine=engine)
    expected = ring(*np.mgrid[0.0:M, 0.0:N])
    np.testing.assert_allclose(run["weights"][0], expected, rtol=1e-14)
    np.testing.assert_allclose(run["current"], run["spikes"] @ expected.T, rtol=1e-12)


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("delay", [0.003, "0.001*(1 + (i + j) % 4)", "uniform(0.001, 0.009)", 0.0])
def test_each_current_arrives_after_its_delay(delay: Any, engine: str) -> None:
    graph = wired(weights="0.01*(i + 1)*(j - 3)", delay=delay)
    run = graph.run(engine=engine)
    steps = run.states["w.steps"].astype(int)
    # A delay of nothing is one of a step: the loop of the ring is closed by it.
    assert steps.min() >= 1
    if delay == 0.003:
        assert (steps == 3).all()
    if delay == "uniform(0.001, 0.009)":
        assert len(np.unique(steps)) > 5
    i, j = np.mgrid[0:M, 0:N]
    if isinstance(delay, str) and "%" in delay:
        assert np.array_equal(steps, 1 + (i + j) % 4)
    weights, spikes, expected = 0.01 * (i + 1) * (j - 3), run["spikes"], np.zeros((TICKS, M))
    for t in range(TICKS):
        for row in range(M):
            for column in range(N):
                if t >= steps[row, column]:
                    past = spikes[t - steps[row, column], column]
                    expected[t, row] += weights[row, column] * past
    assert spikes.any()
    np.testing.assert_allclose(run["current"], expected, rtol=1e-10, atol=1e-12)


def test_a_share_of_the_connections_exists_and_others_do_not_learn() -> None:
    rule = {"rule": "oja", "learning_rate": 1e-4}
    run = wired(weights=0.1, probability=0.3, learning=rule).run()
    first, last = run["weights"][0], run["weights"][-1]
    assert 0.15 * M * N < np.count_nonzero(first) < 0.45 * M * N
    assert np.array_equal(first != 0.0, last != 0.0)
    assert (first[first != 0.0] != last[first != 0.0]).any()
    # The weights are drawn before: they do not depend on which of them exist.
    whole, some = wired(weights="normal(0, 1)"), wired(weights="normal(0, 1)", probability=0.5)
    all_weights, others = whole.run()["weights"][0], some.run()["weights"][0]
    assert np.array_equal(all_weights[others != 0.0], others[others != 0.0])


@pytest.mark.parametrize("rule", [{"rule": "bcm"}, {"rule": "oja", "learning_rate": 1e-4}])
def test_engines_agree_about_all_of_it(rule: dict[str, Any]) -> None:
    graph = wired(
        weights="normal(0, 0.1)", probability=0.4, delay="uniform(0, 0.01)", learning=rule
    )
    python, compiled = graph.run(engine="python"), graph.run(engine="compiled")
    assert np.array_equal(python["spikes"], compiled["spikes"])
    np.testing.assert_allclose(python["current"], compiled["current"], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(python["weights"], compiled["weights"], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"weights": "exp(cos(i - k))"}, "weights: .*'k'"),
        ({"weights": "1/(i - 3)"}, "fails at i = 3, j = 0"),
        ({"weights": "[i, j]"}, "weights"),
        ({"weights": "log(i)"}, "is -inf at i = 0, j = 0"),
        ({"weights": 1.0, "delay": "normal(0.01, 0.001)"}, "expected delays up to 100 s"),
        ({"weights": 1.0, "delay": "0.001*(i - 2)"}, "expected delays of 0 or more, got -0.002"),
        ({"weights": 1.0, "delay": "1/(i - 3)"}, "w.delay: '1/.i - 3.' fails at i = 3"),
        ({"weights": 1.0, "probability": 1.5}, "at most 1"),
    ],
)
def test_what_is_wrong_is_said_where(weights: dict[str, Any], message: str) -> None:
    with pytest.raises(GraphError, match=message):
        wired(**weights).check()


def test_a_rule_is_written_as_it_was_read() -> None:
    text = "exp(cos(2*pi*(i - j)/n))"
    assert PerConnection.read(text).written() == text
    assert PerConnection.read("uniform(0, 2)").largest(3, 3) == 2.0
    assert PerConnection.read("choice([1, 5, 2])").largest(3, 3) == 5.0
    assert PerConnection.read("exponential(1)").largest(3, 3) == np.inf
    assert PerConnection.read("0.5 + j/n").largest(2, 4) == 1.25
