"""Nengo's interface on our engines, against Nengo's own simulator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

nengo = pytest.importorskip("nengo")

from nengo.exceptions import SimulatorClosed  # noqa: E402

from spikeblocks.nengo import Simulator  # noqa: E402


@pytest.fixture(scope="module")
def network() -> Any:
    with nengo.Network(seed=3) as made:
        stimulus = nengo.Node(lambda t: np.sin(20 * t))
        made.a, made.b = nengo.Ensemble(20, 1), nengo.Ensemble(15, 1)
        nengo.Connection(stimulus, made.a)
        learnt = nengo.Connection(made.a, made.b, learning_rule_type=nengo.PES())
        nengo.Connection(made.b, learnt.learning_rule)
        made.value, made.spikes = nengo.Probe(made.b, synapse=0.01), nengo.Probe(made.b.neurons)
        made.weights = nengo.Probe(learnt, "weights", synapse=None)
    return made


def test_probes_times_and_what_was_built_are_nengos(network: Any) -> None:
    with nengo.Simulator(network, progress_bar=False) as theirs:
        theirs.run(0.04, progress_bar=False)
    with Simulator(network, engine="python") as ours:
        ours.run(0.02)
        ours.step()
        ours.run_steps(19)
    assert ours.n_steps == theirs.n_steps == 40
    assert ours.time == pytest.approx(theirs.time)
    np.testing.assert_allclose(ours.trange(), theirs.trange())
    for probe in (network.value, network.spikes, network.weights):
        expected = np.asarray(theirs.data[probe])
        assert ours.data[probe].shape == expected.shape
        np.testing.assert_allclose(ours.data[probe], expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(ours.data[network.a].gain, theirs.data[network.a].gain)


def test_a_reset_begins_again_and_a_closed_one_does_not_run(network: Any) -> None:
    simulator = Simulator(network, engine="python")
    simulator.run(0.01)
    first = simulator.data[network.value].copy()
    simulator.reset()
    assert simulator.n_steps == 0
    assert len(simulator.data[network.value]) == 0
    simulator.run(0.01)
    np.testing.assert_array_equal(simulator.data[network.value], first)
    simulator.close()
    with pytest.raises(SimulatorClosed, match="is closed"):
        simulator.step()


def equal(network: Any, steps: int = 60, tolerance: float = 1e-10) -> None:
    """Whether all probes of a network are those of Nengo's own simulator."""
    with nengo.Simulator(network, progress_bar=False) as theirs:
        theirs.run_steps(steps, progress_bar=False)
    with Simulator(network, engine="python") as ours:
        ours.run_steps(steps)
    for probe in network.all_probes:
        expected = np.asarray(theirs.data[probe])
        assert ours.data[probe].shape == expected.shape
        np.testing.assert_allclose(ours.data[probe], expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    "synapse",
    [
        nengo.Alpha(0.01),
        nengo.Triangle(0.004),
        nengo.LinearFilter([1.0, 2.0], [1.0, 300.0]),
        nengo.LinearFilter([1e4], [1.0, 30.0, 1e4]),
        nengo.Lowpass(0),
    ],
    ids=str,
)
def test_synapses_after_nodes_and_ensembles_are_nengos(synapse: Any) -> None:
    with nengo.Network(seed=2) as network:
        stimulus = nengo.Node(lambda t: np.sin(40 * t))
        a, out = nengo.Ensemble(12, 1), nengo.Node(size_in=1)
        nengo.Connection(stimulus, a, synapse=synapse)
        nengo.Connection(stimulus, out, synapse=synapse)
        nengo.Probe(out)
        nengo.Probe(a, synapse=None if isinstance(synapse, nengo.Lowpass) else synapse)
        nengo.Probe(a.neurons)
        if isinstance(synapse, nengo.Lowpass):
            network.probes.remove(network.probes[1])
    equal(network)


@pytest.mark.parametrize("post", ["ensemble", "neurons", "some neurons"])
@pytest.mark.parametrize("before", ["ensemble", "neurons", "some neurons", "weights"])
@pytest.mark.parametrize("error", [True, False])
def test_pes_learns_the_same_weights_from_and_to_everything(
    before: str, post: str, error: bool
) -> None:
    with nengo.Network(seed=4) as network:
        a, b = nengo.Ensemble(8, 1), nengo.Ensemble(7, 1, radius=1.5)
        stimulus = nengo.Node(0.7)
        nengo.Connection(stimulus, a)
        source = {"neurons": a.neurons, "some neurons": a.neurons[2:6]}.get(before, a)
        target = {"neurons": b.neurons, "some neurons": b.neurons[:5]}.get(post, b)
        if before == "weights" and post != "ensemble":
            pytest.skip("a solver of weights leads to an ensemble")
        rule = nengo.PES(1e-3, pre_synapse=0.01)
        how: dict[str, Any] = {"learning_rule_type": {"pes": rule}}
        if before == "weights":
            how["solver"] = nengo.solvers.LstsqL2(weights=True)
        else:
            how["transform"] = 1e-3 * np.ones((target.size_in, source.size_out))
        learnt = nengo.Connection(source, target, **how)
        if error:
            nengo.Connection(stimulus, learnt.learning_rule["pes"], synapse=None)
        nengo.Probe(learnt, "weights")
        nengo.Probe(learnt.learning_rule["pes"], "activities")
        nengo.Probe(b.neurons)
    equal(network)


@pytest.mark.parametrize("base", [nengo.LIFRate(), nengo.Tanh(), nengo.RectifiedLinear()], ids=str)
def test_regular_spikes_are_nengos(base: Any) -> None:
    with nengo.Network(seed=5) as network:
        a = nengo.Ensemble(9, 2, neuron_type=nengo.RegularSpiking(base, amplitude=0.5))
        nengo.Connection(nengo.Node([0.4, -0.8]), a)
        for probe in ("output", "voltage"):
            nengo.Probe(a.neurons, probe, sample_every=0.003)
    equal(network)


def test_functions_with_a_memory_and_processes_run_as_they_are() -> None:
    def accumulate() -> Any:
        total = [0.0]

        def function(t: float, x: Any) -> float:
            total[0] += x[0] * t
            return total[0]

        return function

    with nengo.Network(seed=6) as network:
        noise = nengo.Node(nengo.processes.WhiteSignal(0.5, 20), size_out=1)
        filtered = nengo.Node(nengo.Lowpass(0.01), size_in=1, size_out=1)
        last = nengo.Node(size_in=1)
        nengo.Connection(noise, filtered, synapse=None)
        nengo.Connection(filtered, last, function=lambda x: str(x)[:0] or abs(x), synapse=None)
        for node in (noise, filtered, last):
            nengo.Probe(node)
    equal(network)
    network.probes.clear()
    with network:
        memory = nengo.Node(accumulate(), size_in=1)
        nengo.Connection(noise, memory, synapse=None)
        nengo.Probe(memory)
    with Simulator(network) as ours:
        ours.run_steps(1200)  # past the second of the graph, where its files are read again
    assert len(ours.data[network.probes[0]]) == 1200


def test_noise_has_nengos_distribution() -> None:
    with nengo.Network(seed=7) as network:
        noise = nengo.processes.WhiteNoise(nengo.dists.Gaussian(0.1, 0.02), scale=False)
        how = {"gain": np.ones(400), "bias": np.ones(400), "neuron_type": nengo.RectifiedLinear()}
        a = nengo.Ensemble(400, 1, noise=noise, **how)
        probe = nengo.Probe(a.neurons)
    with Simulator(network) as ours:
        ours.run_steps(20)
    drawn = ours.data[probe][1:]
    # 7,600 draws: five standard errors.
    assert abs(drawn.mean() - 1.1) < 5 * 0.02 / np.sqrt(drawn.size)
    assert abs(drawn.std() - 0.02) < 5 * 0.02 / np.sqrt(2 * drawn.size)


def test_an_error_of_a_function_reaches_its_author() -> None:
    with nengo.Network() as network:
        nengo.Node(lambda t: 1 / 0, size_out=1)
    with Simulator(network) as ours, pytest.raises(ZeroDivisionError):
        ours.step()


def test_a_solver_of_weights_is_left_aside_without_neurons() -> None:
    with nengo.Network(seed=8) as network:
        network.config[nengo.Ensemble].neuron_type = nengo.Direct()
        a, b = nengo.Ensemble(1, 2), nengo.Ensemble(1, 3)
        nengo.Connection(nengo.Node([0.4, -0.8]), a)
        solver = nengo.solvers.LstsqL2(weights=True)
        nengo.Connection(a[[1, 0]], b[::2], solver=solver)
        nengo.Probe(b, synapse=0.01)
    equal(network)


@pytest.mark.parametrize("synapse", [None, 0.005], ids=str)
@pytest.mark.parametrize("rule", [None, nengo.PES(1e-3), nengo.RLS(1e-3)], ids=str)
@pytest.mark.parametrize("full", [False, True], ids=["decoders", "weights"])
def test_what_a_connection_brings_and_learns_is_nengos(synapse: Any, rule: Any, full: bool) -> None:
    if full and isinstance(rule, nengo.RLS):
        pytest.skip("Nengo's RLS learns decoders")
    with nengo.Network(seed=1) as network:
        stimulus = nengo.Node(lambda t: np.sin(8 * t))
        a, b, error = nengo.Ensemble(12, 1), nengo.Ensemble(9, 1), nengo.Node(size_in=1)
        nengo.Probe(nengo.Connection(stimulus, a, synapse=synapse))
        solver = nengo.solvers.LstsqL2(weights=full)
        made = nengo.Connection(a, b, synapse=synapse, learning_rule_type=rule, solver=solver)
        nengo.Probe(made)
        nengo.Probe(made, synapse=0.02)
        for each in (a, b, b.neurons, error):
            nengo.Probe(each)
        if rule is not None:
            nengo.Connection(stimulus, error, transform=-1, synapse=None)
            nengo.Connection(b, error, synapse=0.01)
            nengo.Connection(error, made.learning_rule, synapse=None)
            nengo.Probe(made, "weights")
            nengo.Probe(made.learning_rule, "activities" if "PES" in str(rule) else "inv_gamma")
    equal(network, tolerance=1e-9)


@pytest.mark.parametrize(
    "kind",
    [
        nengo.LIF(),
        nengo.RegularSpiking(nengo.Tanh()),
        pytest.param(nengo.Izhikevich(), marks=pytest.mark.slow),
    ],
)
def test_a_chain_without_synapses_is_one_step_as_in_nengo(kind: Any) -> None:
    with nengo.Network(seed=1) as network:
        stimulus = nengo.Node(lambda t: [np.sin(8 * t), 0.3])
        a = nengo.Ensemble(10, 2, neuron_type=kind)
        array = nengo.networks.EnsembleArray(8, 2, neuron_type=kind)
        node = nengo.Node(lambda t, x: x**2, size_in=2)
        last = nengo.Ensemble(9, 2)
        nengo.Connection(stimulus, a, synapse=None)
        nengo.Connection(a, array.input, synapse=None, function=lambda x: [x[1], x[0] * x[1]])
        nengo.Connection(array.output, node, synapse=None)
        nengo.Connection(node, last, synapse=None)
        nengo.Connection(a.neurons[:4], last.neurons[:4], synapse=None, transform=1e-3)
        nengo.Connection(last, a, synapse=0.01)
        for each in (array.output, node, last.neurons, last):
            nengo.Probe(each)
    equal(network)


def test_loops_of_passthrough_nodes_and_direct_ensembles_are_nengos() -> None:
    with nengo.Network(seed=1) as network:
        u = nengo.Node(lambda t: [np.sin(40 * t), 0.4])
        p, q = nengo.Node(size_in=2), nengo.Node(size_in=2)
        direct = nengo.Ensemble(30, 2, neuron_type=nengo.Direct())
        silent = nengo.Node(size_in=1)
        nengo.Connection(u, p, synapse=0.01)
        nengo.Connection(p, q, synapse=None, transform=[[0, 1], [-1, 0]])
        nengo.Connection(q, p, synapse=nengo.Alpha(0.02), transform=0.5)
        nengo.Connection(u, direct, synapse=None)
        nengo.Connection(direct, direct, function=lambda x: [0.3 * x[1], x[0] ** 2], synapse=0.05)
        nengo.Connection(silent, silent, synapse=0.1)
        for each in (p, q, direct, silent):
            nengo.Probe(each)
            nengo.Probe(each, synapse=0.01)
    equal(network)


@pytest.mark.parametrize("seed", [None, 4])
def test_probes_resets_and_cleared_rows_are_nengos(seed: int | None) -> None:
    with nengo.Network(seed=seed) as network:
        noise = nengo.Node(nengo.processes.WhiteSignal(1.0, 20), size_out=1)
        a, b = nengo.Ensemble(20, 1), nengo.Ensemble(20, 1)
        nengo.Connection(noise, a)
        learnt = nengo.Connection(a, b, learning_rule_type=nengo.PES())
        nengo.Connection(b, learnt.learning_rule)
        probes = [nengo.Probe(noise), nengo.Probe(a, sample_every=0.0025, synapse=0.01)]
        probes += [nengo.Probe(learnt, "weights", sample_every=0.01)]
        probes += [
            nengo.Probe(a.neurons, each, sample_every=0.005) for each in ("output", "voltage")
        ]
    with Simulator(network, seed=3, engine="python") as ours:
        # Without a seed, each simulator of Nengo draws its own neurons: this one keeps ours.
        gain = ours.data[a].gain.copy()
        with nengo.Simulator(network, seed=3, progress_bar=False) as theirs:
            for turn in ("run", "more", "clear", "reset"):
                if turn == "clear":
                    ours.clear_probes()
                    theirs.clear_probes()
                if turn == "reset":
                    ours.reset(seed=8)
                    theirs.reset(seed=8)
                ours.run(0.033)
                theirs.run(0.033, progress_bar=False)
                for probe in probes if seed else probes[:1]:
                    np.testing.assert_allclose(ours.data[probe], theirs.data[probe], atol=1e-10)
        np.testing.assert_array_equal(ours.data[a].gain, gain)
