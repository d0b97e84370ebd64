"""The integrator in an ensemble's place: closed forms, and the ensemble that it stands in for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

import blocks
import runtime
from blocks import AdaptiveBias, AdaptiveEnsemble, Block, RateEnsemble
from blocks.neural.learner import mean_squared_rate

DT = 0.001


def learner_graph(learner: Block, seconds: float = 1.0, **inputs: float) -> runtime.Graph:
    """One learner with constant inputs: ``input``, ``error`` and perhaps ``learn``."""
    graph = runtime.Graph(dt=DT, until=seconds).add("learner", learner)
    for name, value in {"input": 0.0, "error": 1.0, **inputs}.items():
        graph = graph.add(name, blocks.Constant(value=value)).connect(
            f"{name}.value", f"learner.{name}"
        )
    return graph.probe("learner.output")


def output(learner: Block, **inputs: float) -> np.ndarray:
    return np.asarray(learner_graph(learner, **inputs).run()["learner.output"][:, 0])


T = DT * np.arange(1000)


def test_it_integrates() -> None:
    got = output(AdaptiveBias(learning_rate=0.7, power=1.0), error=-2.0)
    np.testing.assert_allclose(got, 1.4 * T, rtol=1e-12, atol=1e-15)


def test_the_leak_levels_it_off() -> None:
    """b' = -leak b - g e, held over steps: the sampled exponential approach to -g e / leak."""
    got = output(AdaptiveBias(learning_rate=0.7, power=1.0, leak=4.0), error=-2.0)
    level = 1.4 * DT / -math.expm1(-4.0 * DT)
    np.testing.assert_allclose(got, level * -np.expm1(-4.0 * T), rtol=1e-11, atol=1e-15)
    assert level == pytest.approx(1.4 / 4.0, rel=3e-3)


def test_learning_may_pause_while_the_leak_goes_on() -> None:
    bias = AdaptiveBias(learning_rate=0.7, power=1.0)
    np.testing.assert_allclose(output(bias, learn=0.5), 0.5 * output(bias), rtol=1e-12)
    assert not output(bias, learn=0.0).any()


def test_the_limit_cuts_what_comes_out_alone() -> None:
    """As an ensemble's: what is learnt beyond the limit has to be unlearnt."""
    graph = learner_graph(AdaptiveBias(learning_rate=1.0, power=1.0, limit=0.3))
    result = graph.probe("learner.bias").run()
    np.testing.assert_allclose(result["learner.output"][:, 0], -np.minimum(T, 0.3), atol=1e-12)
    np.testing.assert_allclose(result["learner.bias"][:, 0], -T, atol=1e-12)


def test_the_input_does_not_matter() -> None:
    assert np.array_equal(output(AdaptiveBias(), input=0.7), output(AdaptiveBias()))


def test_at_input_0_it_is_the_rate_ensemble() -> None:
    ensemble = RateEnsemble(neurons=50, learning_rate=1e-3, leak=0.5)
    result = learner_graph(ensemble).probe("learner.rates").run()
    power = float(np.mean(result["learner.rates"][-1] ** 2))
    bias = AdaptiveBias(learning_rate=1e-3, leak=0.5, power=power)
    # The synapse has settled after some tau_syn; what it held back leaks away as the rest does.
    late = output(bias) - result["learner.output"][:, 0]
    settled = late[200:]
    np.testing.assert_allclose(settled, settled[0] * np.exp(-0.5 * (T[200:] - T[200])), rtol=1e-6)
    assert abs(settled[-1]) < 0.05 * abs(output(bias)[-1])


@pytest.mark.parametrize("max_rates", [(200.0, 400.0), (100.0, 200.0), (250.0, 250.0)])
def test_the_power_is_the_mean_over_rates_and_intercepts(max_rates: tuple[float, float]) -> None:
    def squared(intercept: float, rate: float) -> float:
        z = 1.0 / (1.0 - math.exp((0.002 - 1.0 / rate) / 0.02))
        current = 1.0 - intercept * (1.0 - z) / (intercept - 1.0)
        return (0.002 + 0.02 * math.log(1.0 + 1.0 / (current - 1.0))) ** -2

    low, high = max_rates
    # Neurons that set in above 0 are silent there: of the intercepts, those from -1 to 0 count.
    if low == high:
        high = low + 1e-3
    mean = dblquad(squared, low, high, -1.0, -1e-12)[0] / (high - low) / 1.9
    got = mean_squared_rate(np.array(max_rates), np.array([-1.0, 0.9]), 0.02, 0.002)
    assert got == pytest.approx(mean, rel=1e-3)


def test_by_default_it_learns_as_fast_as_an_ensemble() -> None:
    many = RateEnsemble(neurons=4000, learning_rate=1e-3, max_rates=[100, 200])
    rates = learner_graph(many, seconds=0.01).probe("learner.rates").run()["learner.rates"][-1]
    power = -output(AdaptiveBias(learning_rate=1e-3, max_rates=[100, 200]))[-1] / T[-1] / 1e-3
    # A sample of neurons: within four standard errors of the mean.
    assert abs(np.mean(rates**2) - power) < 4.0 * np.std(rates**2) / math.sqrt(4000)


def test_what_replaces_an_ensemble_has_its_ports() -> None:
    for learner in (AdaptiveBias, RateEnsemble):
        for ports in ("inputs", "outputs"):
            mine, theirs = getattr(learner.spec, ports), getattr(AdaptiveEnsemble.spec, ports)
            assert {n: p.type for n, p in mine.items()} == {n: p.type for n, p in theirs.items()}


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"power": 0.0}, "power: expected a number above 0 Hz.2"),
        ({"max_rates": [200, 600]}, "max_rates: a refractory time of 0.002 s allows less than 500"),
        ({"intercepts": [0.5, -0.5]}, "intercepts: expected .low, high."),
    ],
)
def test_bad_parameters(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        AdaptiveBias(**parameters)
