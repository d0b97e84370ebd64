"""Random networks of Nengo, imported: the same spikes, and what is probed to rounding."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

nengo = pytest.importorskip("nengo")

from spikeblocks.nengo.importing import import_network, run_both  # noqa: E402

FUNCTIONS = (
    None,
    lambda x: x**2,
    lambda x: 0.5 - 0.2 * x,
    lambda x: np.sin(3 * x),
    lambda x: [x[0] * x[-1]],
)
KINDS = (
    *(nengo.LIF(), nengo.LIFRate(), nengo.RectifiedLinear(), nengo.SpikingRectifiedLinear()),
    *(nengo.AdaptiveLIF(), nengo.Sigmoid(), nengo.RegularSpiking(nengo.LIFRate(), amplitude=0.5)),
)
SYNAPSES = (
    *(0.005, 0.03, nengo.Alpha(0.02), nengo.Triangle(0.006)),
    nengo.LinearFilter([1.0, 40.0], [0.02, 1.0, 40.0]),
)


@st.composite
def networks(draw: Any) -> Any:
    """A network of a few ensembles and arrays with random connections, slices and rules."""
    with nengo.Network(seed=draw(st.integers(0, 1000))) as network:
        stimulus = nengo.Node(lambda t: [np.sin(6 * t), np.cos(4 * t), 0.5])
        relay = nengo.Node(size_in=3)
        nengo.Connection(stimulus, relay, synapse=draw(st.sampled_from((None, *SYNAPSES))))
        places: list[tuple[Any, Any, int]] = []
        for _ in range(draw(st.integers(1, 3))):
            d = draw(st.integers(1, 3))
            if draw(st.integers(0, 3)) == 0:
                array = nengo.networks.EnsembleArray(12, max(2, d), radius=1.2)
                places.append((array.input, array.output, max(2, d)))
                continue
            kind = draw(st.sampled_from(KINDS))
            radius = draw(st.sampled_from((1.0, 1.7)))
            made = nengo.Ensemble(draw(st.integers(8, 30)), d, neuron_type=kind, radius=radius)
            places.append((made, made, d))
        for into, _, d in places:
            chosen = slice(0, d)
            nengo.Connection(relay[chosen], into, synapse=draw(st.sampled_from((None, 0.02))))
        for _ in range(draw(st.integers(0, 5))):
            i, j = (draw(st.integers(0, len(places) - 1)) for _ in range(2))
            # Only forward, since Nengo refuses a loop without a synapse.
            synapse = draw(st.sampled_from((None, *SYNAPSES) if i < j else SYNAPSES))
            (_, before, d), (into, _, k) = places[i], places[j]
            connect(draw, before, into, d, k, synapse)
        for _, before, _ in places:
            nengo.Probe(before, synapse=draw(st.sampled_from((None, *SYNAPSES))))
    return network


def connect(draw: Any, before: Any, into: Any, d: int, k: int, synapse: Any) -> None:
    function = draw(st.sampled_from(FUNCTIONS)) if isinstance(before, nengo.Ensemble) else None
    size = d if function is None else len(np.atleast_1d(function(np.ones(d))))
    first = draw(st.integers(0, k - 1))
    rows = draw(st.integers(1, k - first))
    transform = np.random.default_rng(draw(st.integers(0, 99))).uniform(-0.5, 0.5, (rows, size))
    learns = isinstance(before, nengo.Ensemble) and isinstance(into, nengo.Ensemble)
    learns = learns and draw(st.integers(0, 3)) == 0
    if learns and draw(st.booleans()):
        between_neurons(draw, before, into, synapse)
        return
    weights = learns and draw(st.booleans())
    made = nengo.Connection(
        before,
        into[first : first + rows],
        synapse=synapse,
        transform=transform,
        function=function,
        solver=nengo.solvers.LstsqL2(weights=weights),
        learning_rule_type=nengo.PES(1e-4, pre_synapse=0.01) if learns else None,
    )
    if learns and draw(st.booleans()):
        nengo.Connection(into[first : first + rows], made.learning_rule, synapse=0.02)


def between_neurons(draw: Any, before: Any, into: Any, synapse: Any) -> None:
    rules = (None, nengo.PES(1e-5), nengo.Oja(1e-7), nengo.BCM(1e-10))
    shape = (into.n_neurons, before.n_neurons)
    weights = np.random.default_rng(draw(st.integers(0, 99))).uniform(-1e-3, 1e-3, shape)
    nengo.Connection(
        before.neurons,
        into.neurons,
        synapse=synapse,
        transform=weights,
        learning_rule_type=draw(st.sampled_from(rules if synapse else rules[:2])),
    )


@pytest.mark.slow
@given(network=networks())
def test_an_imported_network_has_nengos_spikes(tmp_path_factory: Any, network: Any) -> None:
    path = Path(tmp_path_factory.mktemp("imported")) / "my.yaml"
    ours, theirs = run_both(import_network(network, path, until=0.06), 0.06, "python")
    assert any(name.startswith("spikes of ") for name in ours)
    for name, expected in theirs.items():
        scale = max(1.0, float(np.abs(expected).max(initial=0.0)))
        np.testing.assert_allclose(ours[name], expected, rtol=0, atol=1e-9 * scale, err_msg=name)
