"""The ensembles against nengo, spike for spike, and against closed forms."""

from __future__ import annotations

import math

import nengo
import numpy as np
import pytest

import blocks
import runtime
from blocks.neural.learner import gain_and_bias
from blocks.neural.lif import lif_rates

DT = 0.001


class Wave(blocks.Block):
    """Two sines, so that neurons are driven through their whole range."""

    out = blocks.Output(blocks.Vector("size"))
    size: int = blocks.param(1, doc="length")
    speed: float = blocks.param(3.0, doc="rad/s")

    def output(self, state, t):
        return wave(t, self.size, self.speed)


def wave(t: float, size: int, speed: float) -> np.ndarray:
    phase = np.arange(size)
    return np.sin(speed * t + phase) * 0.8 + 0.4 * np.cos(7.1 * t + phase)


def draw(n: int, d: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    gain, bias = gain_and_bias(rng.uniform(200, 400, n), rng.uniform(-1, 0.9, n), 0.02, 0.002)
    encoders = rng.standard_normal((n, d))
    encoders /= np.linalg.norm(encoders, axis=1, keepdims=True)
    return {"gain": gain, "bias": bias, "encoders": encoders, "voltage": rng.uniform(0, 1, n)}


def ours(n: int, d: int, k: int, seconds: float, fixed: dict[str, np.ndarray]) -> runtime.Result:
    graph = runtime.Graph("nengo", dt=DT, until=seconds)
    graph = graph.add("x", Wave(size=d)).add("e", Wave(size=k, speed=1.3))
    graph = graph.add(
        "snn",
        blocks.AdaptiveEnsemble(neurons=n, learning_rate=1e-3, tau_syn=0.02, radius=1.2, **fixed),
    )
    graph = graph.connect("x.out", "snn.input").connect("e.out", "snn.error")
    graph = graph.probe("snn.spikes").probe("snn.weights")
    return graph.run()


def theirs(
    n: int, d: int, k: int, seconds: float, fixed: dict[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The same ensemble in nengo; its node sees t one step later, hence t - dt."""
    with nengo.Network(seed=1) as model:
        x = nengo.Node(lambda t: wave(round((t - DT) / DT) * DT, d, 3.0))
        e = nengo.Node(lambda t: wave(round((t - DT) / DT) * DT, k, 1.3))
        ensemble = nengo.Ensemble(
            n,
            d,
            radius=1.2,
            gain=fixed["gain"],
            bias=fixed["bias"],
            encoders=fixed["encoders"],
            normalize_encoders=False,
            neuron_type=nengo.LIF(initial_state={"voltage": nengo.dists.Samples(fixed["voltage"])}),
        )
        nengo.Connection(x, ensemble, synapse=None)
        out = nengo.Node(size_in=k)
        learnt = nengo.Connection(
            ensemble,
            out,
            function=lambda _: np.zeros(k),
            synapse=None,
            solver=nengo.solvers.NoSolver(np.zeros((n, k))),
            learning_rule_type=nengo.PES(1e-3, pre_synapse=nengo.Lowpass(0.02)),
        )
        nengo.Connection(e, learnt.learning_rule, synapse=None)
        spikes = nengo.Probe(ensemble.neurons)
        weights = nengo.Probe(learnt, "weights", sample_every=0.1)
    with nengo.Simulator(model, dt=DT, progress_bar=False, optimize=False) as simulator:
        simulator.run(seconds)
        return simulator.data[spikes], simulator.data[weights]


@pytest.mark.parametrize(("n", "d", "k", "seconds"), [(100, 1, 1, 10.0), (60, 3, 2, 4.0)])
def test_spikes_and_weights_equal_nengo(n: int, d: int, k: int, seconds: float) -> None:
    fixed = draw(n, d, seed=n)
    result = ours(n, d, k, seconds, fixed)
    spikes, weights = theirs(n, d, k, seconds, fixed)
    assert result["snn.spikes"].shape == spikes.shape
    assert spikes.any()
    assert np.array_equal(result["snn.spikes"], spikes)
    # Nengo samples at the end of every 100th step: our row 99 and on.
    assert np.abs(weights).max() > 1e-5
    np.testing.assert_allclose(result["snn.weights"][99::100], weights, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("current", [1.05, 1.5, 3.0, 10.0])
def test_rate_is_the_closed_form(current: float) -> None:
    graph = runtime.Graph(dt=DT, until=5.0)
    graph = graph.add("x", blocks.Constant(value=1.0)).add("e", blocks.Constant(value=0.0))
    snn = blocks.AdaptiveEnsemble(
        neurons=1, gain=[0.0], bias=[current], encoders=[1.0], voltage=[0.0]
    )
    graph = graph.add("snn", snn).connect("x.value", "snn.input").connect("e.value", "snn.error")
    spikes = graph.probe("snn.spikes").run()["snn.spikes"]
    expected = float(lif_rates(np.array(current), 0.02, 0.002))
    assert expected == pytest.approx(1.0 / (0.002 + 0.02 * math.log1p(1.0 / (current - 1.0))))
    # Spike times are resolved inside a step, so counts over 5 s are off by one spike at most.
    assert abs(spikes.sum() * DT / 5.0 - expected) <= 1.0 / 5.0


def of_one_neuron(tau_rc: float) -> runtime.Graph:
    """A neuron at a constant current of 5, of which only the membrane's time constant changes."""
    graph = runtime.Graph(dt=DT, until=2.0)
    graph = graph.add("x", blocks.Constant(value=1.0)).add("e", blocks.Constant(value=0.0))
    fixed = {"gain": [0.0], "bias": [5.0], "encoders": [1.0], "voltage": [0.0]}
    snn = blocks.AdaptiveEnsemble(
        neurons=1, tau_rc=tau_rc, tau_ref=0.0025, max_rates=[396.0, 399.0], **fixed
    )
    graph = graph.add("snn", snn).connect("x.value", "snn.input").connect("e.value", "snn.error")
    return graph.probe("snn.spikes")


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_membrane_much_faster_than_the_step_keeps_its_rate(engine: str) -> None:
    tau_rc = DT / 29.0
    result = of_one_neuron(tau_rc).run(engine=engine)
    assert result.manifest["engine_notes"] == []
    rate = float(lif_rates(np.array(5.0), tau_rc, 0.0025))
    assert abs(result["snn.spikes"].sum() * DT / 2.0 - rate) <= 1.0 / 2.0


def test_a_membrane_too_fast_for_the_step_is_refused() -> None:
    message = "snn.tau_rc: a step of 0.001 s is longer than 30 times tau_rc = 1e-06 s.*smaller dt"
    with pytest.raises(runtime.GraphError, match=message):
        of_one_neuron(1e-6).check()


def test_gain_and_bias_give_rate_and_intercept() -> None:
    rates, intercepts = np.array([200.0, 310.0]), np.array([-0.7, 0.4])
    gain, bias = gain_and_bias(rates, intercepts, 0.02, 0.002)
    np.testing.assert_allclose(lif_rates(gain + bias, 0.02, 0.002), rates, rtol=1e-12)
    np.testing.assert_allclose(gain * intercepts + bias, 1.0, rtol=1e-12)


def ensemble_graph(seed: int = 0, **parameters: object) -> runtime.Graph:
    graph = runtime.Graph(dt=DT, until=0.5, seed=seed)
    graph = graph.add("x", blocks.Constant(value=0.5)).add("e", blocks.Constant(value=1.0))
    graph = graph.add("snn", blocks.AdaptiveEnsemble(neurons=20, **parameters))
    graph = graph.connect("x.value", "snn.input").connect("e.value", "snn.error")
    return graph.probe("snn.weights").probe("snn.activity").probe("snn.voltage").probe("snn.spikes")


def test_pes_sums_the_activity() -> None:
    result = ensemble_graph(learning_rate=1e-2).run()
    # Row k of the weights has learnt from the activity up to row k: from ticks 0 to k - 1.
    expected = -1e-2 * DT / 20 * np.cumsum(result["snn.activity"], axis=0)
    np.testing.assert_allclose(result["snn.weights"][:, 0, :], expected, rtol=1e-10, atol=1e-15)


def test_leak_forgets_exponentially() -> None:
    kept, leaky = (ensemble_graph(learning_rate=1e-2, leak=leak).run() for leak in (0.0, 4.0))
    weights = np.zeros(20)
    for row, activity in enumerate(kept["snn.activity"]):
        weights = math.exp(-4.0 * DT) * weights - 1e-2 * DT / 20 * activity
        np.testing.assert_allclose(leaky["snn.weights"][row, 0], weights, rtol=1e-9, atol=1e-15)


def test_drawn_quantities_hang_on_seed_and_name_alone() -> None:
    first, again, other = (ensemble_graph(seed).run()["snn.voltage"] for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_fixing_one_drawn_quantity_leaves_the_others() -> None:
    currents = [
        runtime.load(g.to_dict()).probe("snn.current").run()["snn.current"]
        for g in (ensemble_graph(), ensemble_graph(voltage=[0.0] * 20))
    ]
    assert np.array_equal(*currents)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"gain": [1.0] * 100}, "bias: gain and bias go together"),
        ({"max_rates": [200, 600]}, "max_rates: a refractory time of 0.002 s allows less than 500"),
        ({"max_rates": [1, 300]}, "max_rates: these time constants allow more than 1.38.* Hz"),
        ({"intercepts": [0.5, -0.5]}, "intercepts: expected .low, high."),
        ({"encoders": [1.0, 2.0]}, "encoders: expected an array of neurons or neurons x n numbers"),
        ({"neurons": 0}, "neurons: expected an integer at least 1, got 0"),
    ],
)
def test_bad_parameters(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        blocks.AdaptiveEnsemble(**parameters)


def test_a_step_longer_than_the_refractory_time_is_refused() -> None:
    graph = ensemble_graph().set("run.dt", 0.004)
    with pytest.raises(runtime.GraphError, match="longer than tau_ref = 0.002 s"):
        graph.check()


def test_the_output_is_weights_times_activity_row_by_row() -> None:
    result = ensemble_graph(learning_rate=1e-2).probe("snn.output").run()
    expected = np.einsum("tkn,tn->tk", result["snn.weights"], result["snn.activity"])
    np.testing.assert_allclose(result["snn.output"], expected, rtol=1e-12, atol=1e-15)
    assert result["snn.output"][-1, 0] < 0.0


def rates_of_nengo(fixed: dict[str, np.ndarray], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates and weights of nengo's LIFRate ensemble under PES, step by step."""
    n, d = fixed["encoders"].shape
    with nengo.Network(seed=1) as model:
        x = nengo.Node(lambda t: wave(round((t - DT) / DT) * DT, d, 3.0))
        e = nengo.Node(lambda t: wave(round((t - DT) / DT) * DT, 2, 1.3))
        ensemble = nengo.Ensemble(
            n,
            d,
            radius=1.2,
            gain=fixed["gain"],
            bias=fixed["bias"],
            encoders=fixed["encoders"],
            normalize_encoders=False,
            neuron_type=nengo.LIFRate(),
        )
        nengo.Connection(x, ensemble, synapse=None)
        out = nengo.Node(size_in=2)
        learnt = nengo.Connection(
            ensemble,
            out,
            function=lambda _: np.zeros(2),
            synapse=None,
            solver=nengo.solvers.NoSolver(np.zeros((n, 2))),
            learning_rule_type=nengo.PES(1e-3, pre_synapse=nengo.Lowpass(0.02)),
        )
        nengo.Connection(e, learnt.learning_rule, synapse=None)
        rates, weights = nengo.Probe(ensemble.neurons), nengo.Probe(learnt, "weights")
    with nengo.Simulator(model, dt=DT, progress_bar=False, optimize=False) as simulator:
        simulator.run(seconds)
        return simulator.data[rates], simulator.data[weights]


def test_rates_and_weights_equal_nengo() -> None:
    fixed = draw(40, 3, seed=5)
    voltage = fixed.pop("voltage")
    assert voltage.any()
    graph = runtime.Graph("nengo", dt=DT, until=2.0)
    graph = graph.add("x", Wave(size=3)).add("e", Wave(size=2, speed=1.3))
    ensemble = blocks.RateEnsemble(
        neurons=40, learning_rate=1e-3, tau_syn=0.02, radius=1.2, **fixed
    )
    graph = graph.add("snn", ensemble).connect("x.out", "snn.input").connect("e.out", "snn.error")
    result = graph.probe("snn.rates").probe("snn.weights").run()
    rates, weights = rates_of_nengo(fixed, 2.0)
    assert rates.max() > 100.0
    # Encoders and input are multiplied in another order than BLAS's, and a rounding of J moves the
    # rate by |dr/dJ| = tau_rc r^2 / (J (J - 1)); 1 / (J - 1) = expm1((1 / r - tau_ref) / tau_rc).
    fires = rates > 0.0
    off = np.abs(result["snn.rates"] - rates)
    r = rates[fires]
    slope = 0.02 * r**2 * np.expm1((1.0 / r - 0.002) / 0.02)
    assert (off[fires] <= 1e-12 * r + 1e-15 * slope).all()
    assert not off[~fires].any()
    assert np.abs(weights).max() > 1e-5
    np.testing.assert_allclose(result["snn.weights"], weights, rtol=0.0, atol=1e-12)


def test_a_rate_ensemble_in_the_place_of_a_spiking_one_is_the_same_network() -> None:
    spiking = ensemble_graph(learning_rate=1e-2)
    for name in ("current", "offset"):
        spiking = spiking.probe(f"snn.{name}")
    tree = spiking.to_dict()
    tree["blocks"]["snn"]["type"] = "RateEnsemble"
    tree["probes"] = {
        k: v for k, v in tree["probes"].items() if v not in ("snn.voltage", "snn.spikes")
    }
    rate = runtime.load(tree)
    ours, theirs = spiking.run(), rate.run()
    for name in ("snn.current", "snn.offset"):
        assert np.array_equal(ours[name], theirs[name])
    # At a constant current the spikes of a neuron are never more than one ahead of its rate or
    # behind it, nor are they after the synapse, and each adds kappa / neurons to what is learnt.
    difference = np.abs(theirs["snn.weights"] - ours["snn.weights"])
    assert 0.0 < difference.max() <= 1e-2 / 20
    assert np.abs(ours["snn.weights"]).max() > 50 * 1e-2 / 20


def test_rates_may_take_steps_longer_than_the_refractory_time() -> None:
    graph = runtime.Graph(dt=0.01, until=0.5)
    graph = graph.add("x", blocks.Constant(value=0.5)).add("e", blocks.Constant(value=1.0))
    graph = graph.add("snn", blocks.RateEnsemble(neurons=5))
    graph = graph.connect("x.value", "snn.input").connect("e.value", "snn.error")
    result = graph.probe("snn.rates").probe("snn.activity").probe("snn.current").run()
    # A constant rate through a lowpass: s(t) = r (1 - exp(-t / tau_syn)).
    rates = lif_rates(result["snn.current"][-1], 0.02, 0.002)
    t = result.time("snn.activity")[:, None]
    np.testing.assert_allclose(result["snn.activity"], rates * -np.expm1(-t / 0.01), rtol=1e-10)
