"""Rules of learning on the weights that a solver finds between two ensembles, beside nengo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

nengo = pytest.importorskip("nengo")

from spikeblocks.nengo import Simulator  # noqa: E402
from spikeblocks.nengo.importing import import_network, run_both  # noqa: E402


def _network(rule: Any) -> Any:
    with nengo.Network(seed=3) as network:
        signal = nengo.Node(lambda t: np.sin(8 * t))
        pre, post = nengo.Ensemble(20, 1), nengo.Ensemble(24, 1)
        nengo.Connection(signal, pre, synapse=None)
        solver = nengo.solvers.LstsqL2(weights=True)
        between = nengo.Connection(pre, post, solver=solver, learning_rule_type=rule)
        network.weights = nengo.Probe(between, "weights")
        nengo.Probe(post, synapse=0.01)
    return network


@pytest.mark.parametrize("rule", [nengo.BCM(1e-8), nengo.Oja(1e-6)])
def test_spikes_and_weights_are_those_of_nengo(rule: Any, tmp_path: Path) -> None:
    """Nengo's rules change weights times gains: with the weights alone, the spikes differ."""
    network = _network(rule)
    done = import_network(network, tmp_path / "my.yaml")
    ours, theirs = run_both(done, 0.3)
    spikes = [name for name in theirs if name.startswith("spikes")]
    assert len(spikes) == 2
    assert all((ours[name] == theirs[name]).all() and theirs[name].any() for name in spikes)
    with nengo.Simulator(network, progress_bar=False) as expected, Simulator(network) as found:
        expected.run(0.3)
        found.run(0.3)
    weights = expected.data[network.weights]
    assert np.abs(weights[-1] - weights[0]).max() > 1e-6
    np.testing.assert_allclose(found.data[network.weights], weights, atol=1e-15, rtol=1e-9)
