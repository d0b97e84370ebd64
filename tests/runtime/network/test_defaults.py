"""The section ``defaults``: what blocks take from it, and what it may not say."""

from __future__ import annotations

from typing import Any

import pytest

import runtime


def graph(**sections: Any) -> runtime.Graph:
    return runtime.load({"run": {"dt": 0.001, "until": 0.1}, **sections})


LOOP = {
    "u": {"type": "Sine"},
    "e": {"type": "Sum", "signs": [1, -1]},
    "c": {"type": "Clip", "high": 1.0, "dt": 0.02},
    "x": {"type": "Integrator"},
}
WIRES = {"e": {"terms": ["u.out", "x.out"]}, "c": {"input": "e.out"}, "x": {"input": "c.out"}}


def test_a_step_for_all_blocks_that_may_have_one() -> None:
    network = graph(defaults={"dt": 0.01}, blocks=LOOP, wires=WIRES).network
    assert {name: entry.every for name, entry in network.entries.items()} == {
        **{"u": 10, "e": 10, "c": 20},
        "x": 1,  # its states are continuous
    }


def test_by_type_and_by_key() -> None:
    blocks = {
        "a": {"type": "Ensemble", "neurons": 5},
        "b": {"type": "Ensemble", "neurons": 5, "neuron": {"type": "LIF", "tau_rc": 0.05}},
        "u": {"type": "Sine", "dt": 0.004},
    }
    wires = {name: {"input": "u.out"} for name in "ab"}
    defaults = {"dt": 0.002, "Ensemble": {"neuron": {"type": "LIFRate"}, "dt": 0.001}}
    network = graph(defaults=defaults, blocks=blocks, wires=wires).network
    kinds = {name: type(network.entries[name].block.value("neuron")).__name__ for name in "ab"}
    assert kinds == {"a": "LIFRate", "b": "LIF"}
    assert [network.entries[name].every for name in "abu"] == [1, 1, 4]


def test_what_is_nearer_counts_more() -> None:
    part = {
        "inputs": {"u": "Scalar"},
        "outputs": {"y": "b.out"},
        "defaults": {"Gain": {"gain": 3.0}},
        "blocks": {"a": {"type": "Gain"}, "b": {"type": "Gain", "gain": 4.0}},
        "wires": {"a": {"input": "inputs.u"}, "b": {"input": "a.out"}},
    }
    blocks = {"u": {"type": "Sine"}, "p": part, "g": {"type": "Gain"}}
    wires = {"p": {"u": "u.out"}, "g": {"input": "p.y"}}
    defaults = {"gain": 2.0, "dt": 0.01}
    network = graph(defaults=defaults, blocks=blocks, wires=wires).network
    gains = {n: float(network.entries[n].block.value("gain")) for n in ("p.a", "p.b", "g")}
    assert gains == {"p.a": 3.0, "p.b": 4.0, "g": 2.0}
    assert network.entries["p.a"].every == 10


def test_params_and_overrides_reach_defaults() -> None:
    made = graph(params={"h": 0.02}, defaults={"dt": "$h"}, blocks=LOOP, wires=WIRES)
    assert made.network.entries["e"].every == 20
    assert made.set("defaults.dt", 0.005).network.entries["e"].every == 5
    again = runtime.load(made.to_dict())
    assert again.network.entries["e"].every == 20


@pytest.mark.parametrize(
    ("defaults", "message"),
    [
        ({"dtt": 0.01}, "defaults.dtt: no block here has a parameter 'dtt', did you mean 'dt'?"),
        ({"Summ": {"dt": 0.1}}, "defaults.Summ: no block here is a Summ, did you mean 'Sum'?"),
        ({"Sum": {"sign": [1]}}, "defaults.Sum.sign: unknown parameter, did you mean 'signs'?"),
        ({"Sum": 3}, "defaults.Sum: expected values for parameters, as in {dt: 0.01}, got"),
        ({"dt": -1}, "dt: expected a number of seconds above 0, got -1"),
    ],
)
def test_defaults_that_are_wrong(defaults: dict[str, Any], message: str) -> None:
    with pytest.raises(runtime.GraphError) as caught:
        graph(defaults=defaults, blocks=LOOP, wires=WIRES).check()
    assert message in str(caught.value)
