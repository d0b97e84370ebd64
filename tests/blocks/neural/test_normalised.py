"""Normalised steps and e-modification: what they are for every kind of learner."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blocks import MRAC, AdaptiveBias, AdaptiveEnsemble, RateEnsemble
from blocks.neural.learner import Learner
from tests.blocks.neural.test_bias import T, learner_graph, output

LEARNERS: tuple[type[Learner], ...] = (AdaptiveBias, MRAC, RateEnsemble, AdaptiveEnsemble)


@pytest.mark.parametrize("learner", LEARNERS)
def test_the_output_moves_by_the_rate_times_the_error(learner: type[Learner]) -> None:
    """Whatever the rates of the neurons: du/dt = -rate error, but for the floor under |s|^2."""
    # A synapse that smooths spikes: what the next spikes do not repeat is power, but not learnt.
    smooth = {} if learner is AdaptiveBias else {"tau_syn": 0.1}
    for more in ({}, {"max_rates": [100.0, 200.0]}):
        got = output(learner(learning_rate=0.8, normalised=True, **smooth, **more), error=-0.5)
        late = T > 0.5
        slope = np.polyfit(T[late], got[late], 1)[0]
        assert slope == pytest.approx(0.4, rel=0.05)


@pytest.mark.parametrize("neurons", [20, 400])
def test_the_number_of_neurons_does_not_matter(neurons: int) -> None:
    block = RateEnsemble(neurons=neurons, learning_rate=0.8, normalised=True)
    assert output(block, error=-0.5)[-1] == pytest.approx(0.4 * T[-1], rel=0.06)


@pytest.mark.parametrize("learner", LEARNERS)
def test_e_modification_forgets_while_there_is_an_error(learner: type[Learner]) -> None:
    """u' = -r e - nu |e| u has its equilibrium at -r sign(e) / nu, whatever the error's size."""
    for error in (-1.0, 2.0):
        block = learner(learning_rate=5.0, normalised=True, e_leak=20.0)
        assert output(block, error=error)[-1] == pytest.approx(
            -math.copysign(5.0 / 20.0, error), rel=0.05
        )


def test_without_an_error_nothing_is_forgotten() -> None:
    graph = learner_graph(AdaptiveBias(learning_rate=1.0, normalised=True, e_leak=9.0), error=0.0)
    result = graph.probe("learner.bias").run()
    assert not result["learner.bias"].any()
