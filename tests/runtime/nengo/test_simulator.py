"""Nengo's interface on our engines, against Nengo's own simulator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from runtime.errors import UsageError

nengo = pytest.importorskip("nengo")

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
    with pytest.raises(UsageError, match="is closed"):
        simulator.step()
