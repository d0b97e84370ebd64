"""Spikes made of rates, noise, amplitudes, and models that draw: against Nengo, by both engines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nengo
import numpy as np
import pytest
from scipy import stats

import blocks
import runtime
from blocks.core import ParameterError
from blocks.neural import NeuronModel
from blocks.neural.emission import emit_poisson
from tests.blocks.neural.models import DT, graph, simulated

N = 40
ENGINES = ("python", "compiled")


def numbers(model: NeuronModel) -> dict[str, np.ndarray]:
    """Gains, biases, encoders and voltages of neurons that see different currents."""
    rng = np.random.default_rng(1)
    size = 200.0 if "ReLU" in type(model).__name__ else 4.0
    return {
        "gain": size * rng.uniform(1.0, 2.0, N),
        "bias": size * rng.uniform(-0.6, 1.0, N),
        "encoders": np.ones((N, 1)),
        "voltage": rng.uniform(0, 1, N),
    }


def fired(neuron: Any, seconds: float, engine: str = "python", **more: Any) -> np.ndarray:
    """Spikes per step of neurons with a constant input."""
    model = NeuronModel.read(neuron)
    made = graph(seconds, seed=3).add("x", blocks.Constant(value=0.4))
    made = made.add("a", blocks.Ensemble(neurons=N, neuron=model, **{**numbers(model), **more}))
    return made.connect("x.value", "a.input").probe("a.fired").run(engine=engine)["a.fired"]


def nengos(neuron: Any, seconds: float, like: Any, **more: Any) -> np.ndarray:
    model = NeuronModel.read(like)
    own = numbers(model)
    with nengo.Network(seed=2) as network:
        population = nengo.Ensemble(
            N,
            1,
            gain=own["gain"],
            bias=own["bias"],
            encoders=own["encoders"],
            neuron_type=neuron,
            **more,
        )
        nengo.Connection(nengo.Node(0.4), population, synapse=None)
        probe = nengo.Probe(population.neurons)
    return np.asarray(simulated(network, seconds).data[probe])


PAIRS: list[tuple[Any, Any]] = [
    ("LIFRate", nengo.LIFRate()),
    ({"type": "LIFRate", "amplitude": 0.3}, nengo.LIFRate(amplitude=0.3)),
    ("Tanh", nengo.Tanh()),
    ("Sigmoid", nengo.Sigmoid()),
    ("ReLU", nengo.RectifiedLinear()),
    ("AdaptiveLIFRate", nengo.AdaptiveLIFRate()),
]


@pytest.mark.parametrize(("ours", "theirs"), PAIRS, ids=lambda each: str(each))
def test_regular_spikes_are_nengos(ours: Any, theirs: Any) -> None:
    plain = dict(ours) if isinstance(ours, dict) else {"type": ours}
    amplitude = plain.get("amplitude", 1.0)
    # Nengo has one amplitude of the rates and another of the spikes: ours is the latter.
    base = type(theirs)()
    start = {"voltage": nengo.dists.Samples(numbers(NeuronModel.read(ours))["voltage"])}
    like = nengo.RegularSpiking(base, amplitude=amplitude, initial_state=start)
    expected = nengos(like, 0.5, ours)
    assert expected.any()
    for engine in ENGINES:
        found = fired({**plain, "spikes": "regular"}, 0.5, engine)
        np.testing.assert_allclose(found, expected, rtol=1e-12)


RATE = ("LIFRate", nengo.LIFRate())
FAST = ({"type": "Tanh", "tau_ref": 0.0004}, nengo.Tanh(0.0004))


@pytest.mark.parametrize(
    ("kind", "theirs", "base"),
    [
        ("stochastic", nengo.StochasticSpiking, RATE),
        ("poisson", nengo.PoissonSpiking, FAST),
        pytest.param("stochastic", nengo.StochasticSpiking, FAST, marks=pytest.mark.slow),
        pytest.param("poisson", nengo.PoissonSpiking, RATE, marks=pytest.mark.slow),
    ],
)
def test_random_spikes_have_nengos_mean_and_variance(kind: str, theirs: Any, base: Any) -> None:
    plain = {"type": base[0]} if isinstance(base[0], str) else base[0]
    steps = 3000
    expected = nengos(theirs(base[1]), steps * DT, plain) * DT
    rates = fired(plain, 0.01)[-1] * DT
    for engine in ENGINES:
        found = fired({**plain, "spikes": kind}, steps * DT, engine) * DT
        assert np.array_equal(found, np.round(found))
        mean, deviation = found.mean(axis=0), np.maximum(found.std(axis=0), 1e-3)
        assert np.abs((mean - rates) / deviation).max() * np.sqrt(steps) < 4.5
        np.testing.assert_allclose(found.var(axis=0).mean(), expected.var(axis=0).mean(), rtol=0.05)


def test_both_engines_draw_the_same() -> None:
    for neuron in (
        {"type": "LIFRate", "spikes": "poisson"},
        {"type": "Sigmoid", "spikes": "stochastic"},
    ):
        one, other = (fired(neuron, 0.2, engine) for engine in ENGINES)
        assert one.any()
        assert np.array_equal(one, other)


def test_a_poisson_number_is_one_from_none_to_many() -> None:
    """Small and large means, by their distribution; many by mean and variance."""
    rng = np.random.default_rng(0)
    for mean in (0.02, 3.0, 60.0, 4000.0):
        spikes = np.full(4000, mean / DT)
        emit_poisson(DT, spikes, rng)
        counts = spikes * DT
        assert counts.mean() == pytest.approx(mean, abs=4.0 * np.sqrt(mean / 4000))
        assert counts.var() == pytest.approx(mean, rel=0.12)
        low = stats.poisson(mean).ppf(0.3)
        share = stats.poisson(mean).cdf(low)
        assert (np.round(counts) <= low).mean() == pytest.approx(share, abs=0.035)


@pytest.mark.parametrize(
    "name", ["LIF", "LIFRate", "ReLU", "SpikingReLU", "AdaptiveLIF", "AdaptiveLIFRate"]
)
def test_amplitudes_are_nengos(name: str) -> None:
    theirs = {"ReLU": nengo.RectifiedLinear, "SpikingReLU": nengo.SpikingRectifiedLinear}
    kind = theirs.get(name) or getattr(nengo, name)
    ours = {"type": name, "amplitude": 0.3}
    start = {"voltage": nengo.dists.Samples(numbers(NeuronModel.read(ours))["voltage"])}
    like = (
        kind(amplitude=0.3)
        if "Rate" in name or name == "ReLU"
        else kind(amplitude=0.3, initial_state=start)
    )
    expected = nengos(like, 0.4, ours)
    assert expected.any()
    for engine in ENGINES:
        np.testing.assert_allclose(fired(ours, 0.4, engine), expected, rtol=1e-12)


def test_decoders_follow_from_the_amplitude() -> None:
    made = graph(0.3).add("x", blocks.Constant(value=0.5))
    made = made.add("a", blocks.Ensemble(neurons=200, neuron={"type": "LIF", "amplitude": 0.01}))
    made = made.add("out", blocks.Decoder(synapse=0.03)).connect("x.value", "a.input")
    found = made.connect("a.spikes", "out.spikes").probe("out.value").run()["out.value"]
    assert found[200:].mean() == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("filtered", [False, True])
def test_noise_is_nengos_current(filtered: bool) -> None:
    """A distribution of one number is noise that can be compared tick by tick."""
    dist = nengo.dists.Choice(np.full((1, N), 0.02))
    process = nengo.processes.WhiteNoise(dist)
    if filtered:
        process = nengo.processes.FilteredNoise(nengo.Alpha(0.01), dist)
    expected = nengos(nengo.RectifiedLinear(), 0.1, "ReLU", noise=process)
    for engine in ENGINES:
        more = {"noise": 0.02, "noise_synapse": "alpha(0.01)" if filtered else "none"}
        np.testing.assert_allclose(fired("ReLU", 0.1, engine, **more), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("written", "theirs"),
    [
        ("normal(0.1, 0.5)", nengo.dists.Gaussian(0.1, 0.5)),
        ("uniform(-0.2, 0.6)", nengo.dists.Uniform(-0.2, 0.6)),
        ("exponential(0.3, 0.1, 0.9)", nengo.dists.Exponential(0.3, 0.1, 0.9)),
    ],
)
def test_noise_has_nengos_distribution(written: str, theirs: Any) -> None:
    level = {"gain": np.ones(N), "bias": np.full(N, 500.0)}
    expected = fired("ReLU", 0.01, **level)[-1, 0]
    one, other = (fired("ReLU", 0.4, e, noise=written, **level) - expected for e in ENGINES)
    assert np.array_equal(one, other)
    wanted = theirs.sample(one.size, rng=np.random.RandomState(0)) / np.sqrt(DT)
    # The largest number of a bounded distribution is drawn often: rounded, it is one on both sides.
    assert stats.ks_2samp(one.ravel().round(6), wanted.round(6)).pvalue > 0.01
    # Every neuron and every tick has its own.
    assert np.abs(np.corrcoef(one.T) - np.eye(N)).max() < 0.25


def test_noise_that_cannot_be_drawn_in_a_step_is_refused() -> None:
    with pytest.raises(ParameterError, match="noise: expected normal, uniform or exponential"):
        blocks.Ensemble(noise="choice([1, 2])")


OWN = '''
from blocks import NeuronModel, param

class Escape(NeuronModel):
    """A spike with the probability rate J dt."""

    initial_voltage = "0"
    rate: float = param(100.0, unit="Hz", above=0.0, doc="rate at J = 1")

    @staticmethod
    def step(dt, current, spikes, voltage, refractory, recovery, constants, rng):
        for i in range(len(current)):
            chance = dt * constants[0] * max(current[i], 0.0)
            spikes[i] = 1.0 / dt if rng.random() < chance else 0.0

    def rates(self, current):
        return self.rate * current.clip(0.0)
'''


def test_a_model_of_ones_own_draws_random_numbers(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "g.yaml").write_text(
        "graph: g\nrun: {dt: 0.001, until: 2.0, seed: 2}\nblocks:\n"
        "  x: {type: Constant, value: 0.5}\n  a: {type: Ensemble, neurons: 30, gain: 1, "
        "bias: 0.5, encoders: 1, neuron: {type: Escape, module: own.py}}\n"
        "wires: {a: {input: x.value}}\nprobes: {out: a.fired}\n"
    )
    made = runtime.load(tmp_path / "g.yaml")
    one, other = (made.run(engine=engine) for engine in ENGINES)
    assert other.manifest["engine_notes"] == []
    assert np.array_equal(one["out"], other["out"])
    assert one["out"].mean() == pytest.approx(100.0, rel=0.06)
    assert not np.array_equal(one["out"], made.run(seed=3)["out"])
