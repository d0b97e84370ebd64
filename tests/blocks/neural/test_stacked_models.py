"""Equal populations computed together have the bits of each alone, for every kind of neuron."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from tests.blocks.neural.models import Wave, graph


@pytest.mark.parametrize(
    ("neuron", "synapse", "more"),
    [
        ({"type": "LIF", "amplitude": 0.3, "min_voltage": -1.0}, "triangle(0.01)", {}),
        (
            {"type": "LIFRate", "spikes": "regular"},
            {"type": "linear", "num": [9], "den": [0.1, 1, 9]},
            {},
        ),
        ({"type": "LIFRate", "spikes": "poisson"}, 0.01, {}),
        ({"type": "AdaptiveLIFRate", "amplitude": 0.5}, "alpha(0.01)", {}),
        ("AdaptiveLIF", 0.01, {"noise": "normal(0, 0.02)"}),
        ("Direct", "alpha(0.02)", {}),
    ],
    ids=lambda each: str(each)[:40],
)
def test_three_populations_are_three_times_one(neuron: Any, synapse: Any, more: Any) -> None:
    def population(made: runtime.Graph, name: str) -> runtime.Graph:
        made = made.add(name, blocks.Ensemble(neurons=40, neuron=neuron, **more))
        made = made.add(f"of_{name}", blocks.Decoder(synapse=synapse))
        made = made.connect("x.out", f"{name}.input").connect(f"{name}.spikes", f"of_{name}.spikes")
        return made.probe(f"{name}.fired").probe(f"of_{name}.value")

    made = graph(0.2, seed=1).add("x", Wave())
    together = population(population(population(made, "a"), "b"), "c").run(engine="python")
    for name in "abc":
        alone = population(made, name).run(engine="python")
        assert alone[f"{name}.fired"].any()
        for probe in (f"{name}.fired", f"of_{name}.value"):
            assert np.array_equal(together[probe], alone[probe])
