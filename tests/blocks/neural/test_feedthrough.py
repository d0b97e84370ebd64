"""Spikes of a step that are used in that step: against Nengo, tick by tick, in both engines."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest

import blocks
import runtime
from tests.blocks.neural.models import Wave, drawn, ensemble, graph, simulated, ticks, wave, weights

MATRIX = weights(1, 30, 5)
ENGINES = pytest.mark.parametrize("engine", ["python", "compiled"])


def chain(**decoder: Any) -> runtime.Graph:
    """Two populations, the first of which reaches the second in the tick of its input."""
    made = graph(0.3).add("x", Wave(size=1))
    made = made.add("a", blocks.FeedthroughEnsemble(neurons=30, **drawn(30, 1, 1)))
    made = made.add("b", blocks.Ensemble(neurons=20, **drawn(20, 1, 2)))
    made = made.add("a_b", blocks.Decoder(weights=MATRIX, synapse="none", **decoder))
    made = made.add("later", blocks.Decoder(weights=MATRIX, synapse=0.01))
    made = made.connect("x.out", "a.input").connect("a.now", "a_b.spikes")
    made = made.connect("a_b.value", "b.input").connect("a.spikes", "later.spikes")
    return made.probe("a_b.value").probe("b.fired").probe("later.value").probe("a_b.weights")


@ENGINES
@pytest.mark.parametrize("learns", [False, True])
def test_a_decoder_without_a_synapse_is_nengos_connection(engine: str, learns: bool) -> None:
    rule = nengo.PES(1e-4, pre_synapse=0.005) if learns else None
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 1)))
        a, b = ensemble(30, 1, drawn(30, 1, 1)), ensemble(20, 1, drawn(20, 1, 2))
        nengo.Connection(x, a, synapse=None)
        made = nengo.Connection(a.neurons, b, transform=MATRIX, synapse=None)
        if rule is not None:
            made.learning_rule_type = rule
            nengo.Connection(x, made.learning_rule, synapse=None)
        later = nengo.Node(size_in=1)
        nengo.Connection(a.neurons, later, transform=MATRIX, synapse=0.01)
        filtered, spikes = nengo.Probe(later), nengo.Probe(b.neurons)
        after = nengo.Probe(made, "weights")
    data = simulated(model, 0.3).data
    ours = chain()
    if learns:
        ours = chain(learning={"rule": "pes", "learning_rate": 1e-4, "tau": 0.005})
        ours = ours.connect("x.out", "a_b.error")
    result = ours.run(engine=engine)
    assert data[spikes].any()
    assert np.array_equal(result["b.fired"], data[spikes])
    np.testing.assert_allclose(result["later.value"], data[filtered], rtol=0, atol=1e-12)
    if learns:
        np.testing.assert_allclose(result["a_b.weights"], data[after], rtol=0, atol=1e-15)


@ENGINES
def test_decoders_are_solved_as_those_of_an_ensemble(engine: str) -> None:
    graphs = []
    for kind, port in ((blocks.Ensemble, "spikes"), (blocks.FeedthroughEnsemble, "now")):
        made = graph(0.05).add("x", Wave(size=1)).add("a", kind(neurons=30))
        made = made.add("out", blocks.Decoder(function="x**2", synapse="none"))
        made = made.connect("x.out", "a.input").connect(f"a.{port}", "out.spikes")
        graphs.append(made.probe("out.value"))
    late, now = (each.run(engine=engine)["out.value"] for each in graphs)
    assert late.any()
    assert np.array_equal(now[:-1], late[1:])


def test_random_neurons_and_loops_are_refused() -> None:
    for name, value in (
        ("noise", "normal(0, 1)"),
        ("neuron", {"type": "ReLU", "spikes": "poisson"}),
    ):
        made = chain().set(f"a.{name}", value)
        with pytest.raises(runtime.GraphError, match=rf"a\.{name}: draws random numbers"):
            made.check()
    with pytest.raises(runtime.GraphError, match="algebraic loop"):
        chain().connect("a_b.value", "a.input").check()
