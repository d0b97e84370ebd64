"""Neuron models against Nengo's: steady rates, gains and biases, and step after step."""

from __future__ import annotations

import nengo
import numpy as np
import pytest

import blocks
import runtime
from blocks.core import SettingError, function_kernel
from blocks.neural import (
    LIF,
    AdaptiveLIF,
    AdaptiveLIFRate,
    Izhikevich,
    LIFRate,
    NeuronModel,
    ReLU,
    Sigmoid,
    SpikingReLU,
    Tanh,
)

DT, N = 0.001, 40
PAIRS = [
    (LIF(), nengo.LIF()),
    (LIF(tau_rc=0.05, tau_ref=0.001), nengo.LIF(tau_rc=0.05, tau_ref=0.001)),
    (LIFRate(tau_ref=0.0015), nengo.LIFRate(tau_ref=0.0015)),
    (AdaptiveLIF(tau_n=0.1, inc_n=0.05), nengo.AdaptiveLIF(tau_n=0.1, inc_n=0.05)),
    (LIF(min_voltage=-1.5), nengo.LIF(min_voltage=-1.5)),
    (AdaptiveLIFRate(tau_n=0.1, inc_n=0.05), nengo.AdaptiveLIFRate(tau_n=0.1, inc_n=0.05)),
    (SpikingReLU(), nengo.SpikingRectifiedLinear()),
    (ReLU(), nengo.RectifiedLinear()),
    (Sigmoid(), nengo.Sigmoid()),
    (Tanh(), nengo.Tanh()),
    (Izhikevich(), nengo.Izhikevich()),
    (
        Izhikevich(reset_voltage=-50.0, reset_recovery=2.0),
        nengo.Izhikevich(reset_voltage=-50, reset_recovery=2),
    ),
]
NAMES = [repr(ours) for ours, _ in PAIRS]


def scale(model: NeuronModel) -> float:
    """A current that makes a model fire fast."""
    return 400.0 if "ReLU" in type(model).__name__ else 10.0


@pytest.mark.parametrize(("ours", "theirs"), PAIRS, ids=NAMES)
def test_every_step_is_nengos(ours: NeuronModel, theirs: nengo.neurons.NeuronType) -> None:
    state = theirs.make_state(N, np.random.RandomState(0))
    voltage, refractory, recovery = (
        state.get("voltage", np.zeros(N)).copy(),
        np.zeros(N),
        np.zeros(N),
    )
    recovery[:] = state.get("recovery", 0.0)
    spikes, expected, total = np.zeros(N), np.zeros(N), 0.0
    base = np.random.default_rng(1).uniform(-0.2, 1.0, N)
    for k in range(1500):
        current = scale(ours) * (base + 0.3 * np.sin(0.01 * k))
        theirs.step(DT, current.copy(), output=expected, **state)
        type(ours).step(DT, current.copy(), spikes, voltage, refractory, recovery, ours.constants)
        np.testing.assert_allclose(spikes, expected, rtol=1e-12, atol=1e-9)
        total += np.abs(expected).sum()
    assert total > 0.0


@pytest.mark.parametrize(("ours", "theirs"), PAIRS[:-2], ids=NAMES[:-2])
def test_rates_gains_and_biases_are_nengos(
    ours: NeuronModel, theirs: nengo.neurons.NeuronType
) -> None:
    currents = scale(ours) * np.linspace(-0.3, 2.0, 60)
    expected = theirs.rates(currents[:, None], np.ones(1), np.zeros(1)).reshape(-1)
    np.testing.assert_allclose(ours.rates(currents), expected, rtol=1e-12, atol=1e-10)
    rng = np.random.default_rng(0)
    rates, intercepts = rng.uniform(200, 390, N), rng.uniform(-1, 0.9, N)
    for found, wanted in zip(
        ours.gain_and_bias(rates, intercepts), theirs.gain_bias(rates, intercepts), strict=True
    ):
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-10)


def test_gains_of_a_model_without_a_formula_follow_from_its_rates() -> None:
    rates, intercepts = np.array([20.0, 30.0]), np.array([0.0, 0.5])
    gain, bias = Izhikevich().gain_and_bias(rates, intercepts)
    np.testing.assert_allclose(Izhikevich().simulated_rates(gain + bias), rates, atol=2.0)
    below = Izhikevich().simulated_rates(gain * (intercepts - 0.1) + bias)
    np.testing.assert_array_equal(below, 0.0)
    formula = LIF().gain_and_bias(10.0 * rates, intercepts)
    searched = NeuronModel.gain_and_bias(LIF(), 10.0 * rates, intercepts)
    np.testing.assert_allclose(searched, formula, rtol=1e-9)


def test_rates_of_spikes_are_the_steady_rates() -> None:
    for model, current in ((LIF(), 3.0), (SpikingReLU(), 80.0)):
        currents = np.full(5, current)
        np.testing.assert_allclose(model.simulated_rates(currents), model.rates(currents), atol=1.0)


def test_a_model_is_a_name_or_a_mapping() -> None:
    assert NeuronModel.read("LIF") == LIF()
    assert NeuronModel.read({"type": "LIF", "tau_rc": 0.05}) == LIF(tau_rc=0.05) != LIF()
    assert LIF(tau_rc=0.05).written() == {"type": "LIF", "tau_rc": 0.05}
    for wrong, message in (
        ("Lif", "did you mean 'LIF'"),
        ({"type": "LIF", "tau": 1.0}, "tau: unknown"),
        ({"tau_rc": 0.02}, "type: expected a neuron model"),
        ({"type": "LIF", "tau_rc": -1.0}, "tau_rc: expected a number above 0 s"),
    ):
        with pytest.raises(SettingError, match=message):
            NeuronModel.read(wrong)


@pytest.mark.parametrize("ours", [ours for ours, _ in PAIRS[2:]], ids=NAMES[2:])
def test_the_kernel_of_a_step_computes_what_the_step_computes(ours: NeuronModel) -> None:
    step = type(ours).step
    kernel = function_kernel(step) or step
    rng = np.random.default_rng(0)
    states = [rng.uniform(0, 1, N), rng.uniform(-0.002, 0.003, N), rng.uniform(0, 1, N)]
    others = [array.copy() for array in states]
    for _ in range(200):
        current = scale(ours) * rng.uniform(-0.2, 1.0, N)
        spikes, expected = np.zeros(N), np.zeros(N)
        step(DT, current.copy(), expected, *states, ours.constants)
        kernel(DT, current.copy(), spikes, *others, ours.constants)
        for found, wanted in zip((spikes, *others), (expected, *states), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


EXTREME = np.array([0.0, 1e-300, np.nextafter(1.0, 2.0), 30.0, 709.0, 710.0, 1e5, 1e150])


@pytest.mark.parametrize("model", [ours for ours, _ in PAIRS], ids=NAMES)
def test_steps_and_rates_are_finite_at_every_current(model: NeuronModel) -> None:
    current = np.concatenate([EXTREME, -EXTREME])
    with np.errstate(all="raise", under="ignore"):
        if type(model) is not Izhikevich:  # simulated, at other currents
            assert np.isfinite(model.rates(current)).all()
        step = type(model).step
        for function in (step, function_kernel(step) or step):
            state = [np.zeros(len(current)) for _ in range(4)]
            for _ in range(20):
                function(DT, current.copy(), *state, model.constants)
                assert all(np.isfinite(array).all() for array in state)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_an_inhibited_sigmoid_is_silent(engine: str) -> None:
    graph = runtime.Graph(dt=DT, until=0.02).add("x", blocks.Constant(value=0.3))
    graph = graph.add("off", blocks.Constant(value=[-1e4] * N))
    graph = graph.add("a", blocks.Ensemble(neurons=N, neuron="Sigmoid"))
    graph = graph.connect("x.value", "a.input").connect("off.value", "a.current")
    result = graph.probe("a.fired").run(engine=engine)
    assert result.manifest["engine_notes"] == []
    assert result["a.fired"][1:].max() < 1e-9


@pytest.mark.parametrize("model", [Sigmoid(), Tanh(), Sigmoid(tau_ref=0.003)])
def test_gains_are_positive_up_to_the_largest_rate(model: NeuronModel) -> None:
    low, high = model.slowest, model.fastest
    rates = np.array([low + 1e-6, 0.5 * (low + high), np.nextafter(high, low)])
    gain, bias = model.gain_and_bias(rates, np.full(3, 0.25))
    assert np.isfinite(gain).all()
    assert (gain > 0.0).all()
    np.testing.assert_allclose(model.rates(gain + bias), rates, rtol=1e-9)
    np.testing.assert_allclose(model.rates(0.25 * gain + bias), low, rtol=1e-12)
