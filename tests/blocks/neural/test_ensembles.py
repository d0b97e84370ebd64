"""Ensembles and decoders against Nengo, tick by tick, under both engines; and their errors."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest

import blocks
import runtime
from blocks.neural import AdaptiveLIF, NeuronModel, SpikingReLU
from tests.blocks.neural.models import (
    Wave,
    drawn,
    ensemble,
    graph,
    simulated,
    ticks,
    wave,
    weights,
)

LENGTHS = [pytest.param(1.0, id="1s"), pytest.param(10.0, id="10s", marks=pytest.mark.slow)]


def feedforward(seconds: float, synapse: Any, fixed: dict[str, Any], **more: Any) -> runtime.Graph:
    made = (
        graph(seconds)
        .add("x", Wave(size=2))
        .add("snn", blocks.Ensemble(neurons=60, radius=1.2, **fixed, **more))
    )
    made = made.add("out", blocks.Decoder(weights=weights(3, 60, 5), synapse=synapse))
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")
    return made.probe("snn.fired").probe("out.value")


@pytest.mark.parametrize("seconds", LENGTHS)
def test_feedforward_is_nengo(seconds: float) -> None:
    fixed = drawn(60, 2, 1)
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 2)))
        theirs = ensemble(60, 2, fixed, radius=1.2)
        nengo.Connection(x, theirs, synapse=None)
        spikes = nengo.Probe(theirs.neurons)
        values = {}
        for written, synapse in ((0.01, nengo.Lowpass(0.01)), ("alpha(0.02)", nengo.Alpha(0.02))):
            out = nengo.Node(size_in=3)
            nengo.Connection(theirs.neurons, out, transform=weights(3, 60, 5), synapse=synapse)
            values[written] = nengo.Probe(out)
    data = simulated(model, seconds).data
    for written, probe in values.items():
        for engine in ("python", "compiled") if written == 0.01 else ("python",):
            ours = feedforward(seconds, written, fixed).run(engine=engine)
            assert data[spikes].any()
            assert np.array_equal(ours["snn.fired"], data[spikes])
            np.testing.assert_allclose(ours["out.value"], data[probe], rtol=0.0, atol=1e-10)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [(AdaptiveLIF(), nengo.AdaptiveLIF), (SpikingReLU(), nengo.SpikingRectifiedLinear)],
    ids=["AdaptiveLIF", "SpikingReLU"],
)
def test_other_models_are_nengos(ours: NeuronModel, theirs: Any) -> None:
    fixed = drawn(60, 2, 2, ours)
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 2)))
        population = ensemble(60, 2, fixed, theirs, radius=1.2)
        nengo.Connection(x, population, synapse=None)
        spikes = nengo.Probe(population.neurons)
    expected = simulated(model, 1.0).data[spikes]
    found = feedforward(1.0, "none", fixed, neuron=ours).run()
    assert np.array_equal(found["snn.fired"], expected)


@pytest.mark.parametrize("seconds", LENGTHS)
def test_an_oscillator_is_nengo(seconds: float) -> None:
    """A recurrent population: x' = A x by a transform of I + tau A."""
    n, tau = 100, 0.1
    fixed = drawn(n, 2, 3)
    turn = np.array([[1.1, 0.5], [-0.5, 1.1]])
    with nengo.Network(seed=1) as model:
        kick = nengo.Node(ticks(lambda t: [1.0, 0.0] if t < 0.1 else [0.0, 0.0]))
        theirs = ensemble(n, 2, fixed)
        nengo.Connection(kick, theirs, synapse=None)
        nengo.Connection(
            theirs,
            theirs,
            synapse=tau,
            transform=turn,
            solver=nengo.solvers.LstsqL2(reg=0.1),
            eval_points=nengo.dists.UniformHypersphere().sample(800, 2, rng=np.random),
        )
        weighted = nengo.Probe(theirs, synapse=tau)
        spikes = nengo.Probe(theirs.neurons)
    simulator = simulated(model, seconds)
    back = simulator.data[model.connections[1]].weights  # the transform is in them
    made = graph(seconds).add("kick", Kick()).add("osc", blocks.Ensemble(neurons=n, **fixed))
    made = made.add("back", blocks.Decoder(weights=back, synapse=tau))
    made = made.add("out", blocks.Decoder(weights=np.linalg.solve(turn, back), synapse=tau))
    made = made.connect("kick.out", "osc.input").connect("back.value", "osc.input")
    made = made.connect("osc.spikes", "back.spikes").connect("osc.spikes", "out.spikes")
    made = made.probe("osc.fired").probe("out.value")
    ours = made.run()
    assert np.array_equal(ours["osc.fired"], simulator.data[spikes])
    np.testing.assert_allclose(ours["out.value"], simulator.data[weighted], atol=0.02)


class Kick(blocks.Block):
    """One for the first 0.1 s."""

    out = blocks.Output(blocks.Vector(2))

    def output(self, state: Any, t: float) -> np.ndarray:
        return np.array([1.0 if t < 0.1 else 0.0, 0.0])


def test_solved_decoders_are_nengos() -> None:
    """The same tuning and the same evaluation points."""
    fixed = drawn(80, 2, 4)
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    made = graph(0.01).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=80, **fixed))
    made = made.add("out", blocks.Decoder(eval_points=points, solver={"type": "l2", "reg": 0.05}))
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")
    ours = made.probe("out.weights").run()["out.weights"][0]
    with nengo.Network(seed=1) as model:
        theirs = ensemble(80, 2, fixed)
        link = nengo.Connection(
            theirs,
            nengo.Node(size_in=2),
            solver=nengo.solvers.LstsqL2(reg=0.05),
            eval_points=points,
            scale_eval_points=False,
        )
    expected = simulated(model, 0.001).data[link].weights
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


def channel(**decoder: Any) -> runtime.Graph:
    made = graph(0.6).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=200))
    made = made.add("out", blocks.Decoder(**decoder))
    return made.connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")


def test_a_population_represents_its_input() -> None:
    """Decoded through a lowpass, the error is that of Nengo's default ensemble, a few per cent."""
    found = channel(synapse=0.01).probe("out.value").probe("x.out").run()
    delayed = found["x.out"][90:-10]
    assert np.sqrt(np.mean((found["out.value"][100:] - delayed) ** 2)) < 0.08


def test_groups_are_an_array_of_ensembles() -> None:
    """Each group of neurons sees its own dimensions, as separate blocks would."""
    fixed = drawn(40, 1, 6)
    parts = [{k: v[i * 20 : (i + 1) * 20] for k, v in fixed.items()} for i in range(2)]
    made = graph(0.3).add("x", Wave(size=2))
    made = made.add("both", blocks.Ensemble(neurons=20, groups=2, **fixed))
    made = made.add("out", blocks.Decoder(solver="l2")).connect("both.spikes", "out.spikes")
    made = made.connect("x.out", "both.input").probe("both.fired").probe("out.value")
    for i, part in enumerate(parts):
        made = made.add(f"one{i}", blocks.Ensemble(neurons=20, **part))
        made = made.connect(f"x.out.{i}", f"one{i}.input").probe(f"one{i}.fired")
    found = made.run()
    joined = np.hstack([found["one0.fired"], found["one1.fired"]])
    assert np.array_equal(found["both.fired"], joined)
    assert np.sqrt(np.mean((found["out.value"][50:] - wave_at(50, 300)) ** 2)) < 0.3


def wave_at(first: int, last: int) -> np.ndarray:
    return np.array([wave(k * 0.001, 2) for k in range(first, last)])


def test_draws_depend_on_seed_and_name_only() -> None:
    def first(seed: int, name: str) -> np.ndarray:
        made = graph(0.05, seed).add("x", Wave()).add(name, blocks.Ensemble(neurons=10))
        made = made.add("other", blocks.Ensemble(neurons=4)).connect("x.out", "other.input")
        return made.connect("x.out", f"{name}.input").probe(f"{name}.drive").run()[f"{name}.drive"]

    assert np.array_equal(first(1, "a"), first(1, "a"))
    assert not np.array_equal(first(1, "a"), first(2, "a"))
    assert not np.array_equal(first(1, "a"), first(1, "b"))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"max_rates": 600}, "max_rates: this neuron fires at less than 500 Hz, got 600"),
        ({"max_rates": 0.0}, "max_rates: expected rates above 1.38.* Hz and below 500 Hz.*got 0"),
        ({"max_rates": 0.5}, "max_rates: expected rates above 1.38.* Hz and below 500 Hz.*got 0.5"),
        (
            {"neuron": "Sigmoid", "max_rates": 100},
            "max_rates: expected rates above 200 Hz and below 400 Hz.*got 100",
        ),
        ({"neuron": "Tanh", "max_rates": 400}, "max_rates: this neuron fires at less than 400 Hz"),
        ({"intercepts": 1.0}, "intercepts: expected intercepts below 1, got 1"),
        ({"gain": 1.0}, "bias: gain and bias go together"),
        ({"gain": [1, 2], "bias": 0}, "gain: expected 200 numbers, got an array of shape"),
        ({"encoders": "choice([[1, 0, 0]])"}, "encoders: expected entries of 2 numbers, got 3"),
        ({"encoders": [0, 0]}, "encoders: an encoder of length 0"),
        ({"groups": 3}, "groups: 2 dimensions cannot be divided evenly among 3 groups"),
        (
            {"neuron": {"type": "LIF", "tau_ref": 0.0005}},
            "neuron: a step of 0.001 s is longer than",
        ),
        ({"neuron": {"type": "LIF", "tau": 1}}, "neuron.tau: unknown"),
    ],
)
def test_wrong_ensembles(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises((runtime.GraphError, blocks.ParameterError), match=message):
        made = graph(0.1).add("x", Wave(size=2))
        made = made.add("snn", blocks.Ensemble(neurons=200, **parameters))
        made.connect("x.out", "snn.input").check()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"transform": [[1.0, 0.0, 1.0]]}, r"transform: expected a matrix with 2 columns"),
        ({"eval_points": [[1, 2, 3], [1, 2, 3]]}, "eval_points: expected rows of 2 numbers, got 3"),
        ({"synapse": "alfa(1)"}, "synapse: expected a time constant in s, or .* did you mean"),
        ({"solver": {"type": "l2", "regg": 1}}, "solver.regg: unknown, did you mean 'reg'"),
    ],
)
def test_wrong_decoders(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises((runtime.GraphError, blocks.ParameterError), match=message):
        channel(**parameters).check()


def test_spikes_that_come_from_no_ensemble_have_no_tuning() -> None:
    made = graph(0.1).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=5))
    made = made.add("late", blocks.UnitDelay()).add("out", blocks.Decoder())
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "late.input")
    with pytest.raises(runtime.GraphError, match="blocks.out: the spikes come from no ensemble"):
        made.connect("late.out", "out.spikes").check()


def test_a_singular_system_is_reported_with_its_block() -> None:
    made = channel(solver={"type": "l2", "reg": 0.0}, eval_points=[[0.1, 0.1]] * 500)
    with pytest.raises(runtime.SimulationError, match=r"(?s)out.*the system is singular.*reg"):
        made.run()


def test_dimensions_that_do_not_fit() -> None:
    made = channel().add("next", blocks.Ensemble(neurons=5, dimensions=3))
    with pytest.raises(runtime.GraphError, match=r"out.*2.*3|expected Vector\(3\)"):
        made.connect("out.value", "next.input").check()


@pytest.mark.parametrize(
    "synapse",
    [0.01, "alpha(0.02)", "triangle(0.01)", {"type": "linear", "num": [9], "den": [0.1, 1, 9]}],
)
def test_a_synapse_behind_a_decoder_is_the_decoders(synapse: Any) -> None:
    """As for the arrays of ensembles whose output has no synapse and is filtered behind."""
    made = channel(synapse=synapse).add("plain", blocks.Decoder(synapse="none"))
    made = made.add("behind", blocks.SynapticFilter(synapse=synapse))
    made = made.connect("snn.spikes", "plain.spikes").connect("plain.value", "behind.input")
    made = made.set("plain.eval_points", [[1, 0], [0, 1], [-1, 0.5]])
    made = made.set("out.eval_points", [[1, 0], [0, 1], [-1, 0.5]])
    made = made.probe("out.value").probe("behind.out").set("run.until", 0.1)
    for engine in ("python", "compiled"):
        found = made.run(engine=engine)
        assert found.manifest["engine_notes"] == []
        assert found["out.value"].any()
        np.testing.assert_allclose(found["behind.out"], found["out.value"], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("number", ["off.out", "one.value", "passed.out"])
def test_a_number_into_all_neurons_is_a_broadcast(number: str) -> None:
    """A scalar, a vector of one number and what a generic block passes on, beside a vector."""
    made = graph(0.05).add("x", Wave()).add("snn", blocks.Ensemble(neurons=30))
    made = made.add("off", blocks.Function(expression="-3*t"))
    made = made.add("one", blocks.Constant(value=[-2.0], signal="Vector(1)"))
    made = made.add("passed", blocks.Gain(gain=2.0)).connect("off.out", "passed.input")
    made = made.add("each", blocks.Constant(value=[0.1] * 30, signal="Vector"))
    made = made.connect("x.out", "snn.input").probe("snn.drive")
    direct = made.wire("snn.current", [number, "each.value"])
    made = made.add("all", blocks.Broadcast()).wire("snn.current", "all.out")
    other = made.connect("each.value", "snn.current").connect(
        f"{number}[0]" if number == "one.value" else number, "all.input"
    )
    wanted = other.run(engine="python")["snn.drive"]
    assert wanted.any()
    for engine in ("python", "compiled"):
        found = direct.run(engine=engine)
        assert found.manifest["engine_notes"] == []
        np.testing.assert_array_equal(found["snn.drive"], wanted)


def test_another_length_into_the_neurons_is_refused() -> None:
    made = graph(0.05).add("x", Wave()).add("snn", blocks.Ensemble(neurons=30))
    made = made.add("two", blocks.Constant(value=[1.0, 2.0], signal="Vector(2)"))
    with pytest.raises(runtime.GraphError, match=r"expected Vector\(30\), got Vector\(2\)"):
        made.connect("x.out", "snn.input").connect("two.value", "snn.current").check()
