"""Ensembles without neurons: exact, and Nengo's Direct tick by tick, under both engines."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest

import blocks
import runtime
from tests.blocks.neural.models import DT, Wave, graph, simulated, ticks, wave

ENGINES = ("python", "compiled")


def direct(**decoder: Any) -> runtime.Graph:
    made = graph(0.3).add("x", Wave(size=2))
    made = made.add(
        "a", blocks.Ensemble(neuron="Direct", radius=3.0, groups=decoder.pop("groups", 1))
    )
    made = made.add("out", blocks.Decoder(**decoder)).connect("x.out", "a.input")
    return made.connect("a.spikes", "out.spikes").probe("out.value")


@pytest.mark.parametrize(
    ("function", "theirs", "transform"),
    [
        (None, lambda x: x, None),
        ("x[0]*x[1]", lambda x: x[0] * x[1], -2.0),
        (
            ["sin(3*x[0])", "x[1]**2"],
            lambda x: [np.sin(3 * x[0]), x[1] ** 2],
            [[1, 2], [0, 1], [3, 0]],
        ),
    ],
)
@pytest.mark.parametrize("synapse", [0.01, "alpha(0.02)"])
def test_functions_are_exact_and_nengos(
    function: Any, theirs: Any, transform: Any, synapse: Any
) -> None:
    size = (
        len(np.atleast_1d(theirs(np.ones(2))))
        if transform is None
        else len(np.atleast_1d(transform))
    )
    with nengo.Network() as model:
        population = nengo.Ensemble(5, 2, neuron_type=nengo.Direct(), radius=3.0)
        nengo.Connection(nengo.Node(ticks(lambda t: wave(t, 2))), population, synapse=None)
        out = nengo.Node(size_in=size)
        filtered = nengo.Lowpass(0.01) if synapse == 0.01 else nengo.Alpha(0.02)
        more = {} if transform is None else {"transform": transform}
        nengo.Connection(population, out, function=theirs, synapse=filtered, **more)
        probe = nengo.Probe(out)
    expected = simulated(model, 0.3).data[probe]
    for engine in ENGINES:
        found = direct(function=function, transform=transform, synapse=synapse).run(engine=engine)
        assert found.manifest["engine_notes"] == []
        np.testing.assert_allclose(found["out.value"], expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_groups_without_neurons(engine: str) -> None:
    x = np.array([wave(k * DT, 2) for k in range(299)])
    found = direct(groups=0, function="x**2 + x", synapse="none").run(engine=engine)["out.value"]
    np.testing.assert_allclose(found[1:], x**2 + x, rtol=1e-12)
    mixed = direct(groups=0, function="x**2", transform=[[1, -1]], synapse="none")
    found = mixed.run(engine=engine)["out.value"]
    np.testing.assert_allclose(found[1:, 0], x[:, 0] ** 2 - x[:, 1] ** 2, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_whole_part_at_once(engine: str) -> None:
    plain = {
        "run": {"dt": 0.001, "until": 0.2},
        "blocks": {
            "a": {"type": "Constant", "value": [0.5, -0.8]},
            "b": {"type": "Constant", "value": [0.9, 0.5]},
            "it": {"graph": "graphs/parts/neural_product.yaml", "params": {"neuron": "Direct"}},
        },
        "wires": {"it": {"a": "a.value", "b": "b.value"}},
        "probes": {"y": "it.value"},
    }
    found = runtime.load(plain).run(engine=engine)["y"][-1]
    np.testing.assert_allclose(found, [0.45, -0.4], atol=1e-12)


@pytest.mark.parametrize(
    ("decoder", "message"),
    [
        ({"function": {"points": [[1, 2]], "targets": [1]}}, "out.function: without neurons"),
        ({"function": "x[2]"}, "out.function: .*x\\[2\\]|out.function: .*2"),
        ({"filter": "spikes"}, "out.filter: there are no spikes"),
    ],
)
def test_errors(decoder: Any, message: str) -> None:
    with pytest.raises(runtime.GraphError, match=message):
        direct(**decoder).check()


def test_what_acts_on_neurons_is_refused() -> None:
    for more in ({"noise": 1.0}, {"learning": "voja"}, {"gain": 1.0, "bias": 1.0}):
        with pytest.raises(blocks.ParameterError, match="Direct has no neurons"):
            blocks.Ensemble(neuron="Direct", **more)
    made = direct().add("off", blocks.Constant(value=[1.0, 1.0], signal="Vector"))
    with pytest.raises(runtime.GraphError, match="no neurons that a current could flow into"):
        made.connect("off.value", "a.current").check()
