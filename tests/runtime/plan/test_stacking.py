"""Stacks of equal calls: the bits of the calls one by one, and the order of the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import blocks
import runtime
from blocks.neural.solving import decode, decode_each
from runtime.engine import Engine, Outcome, Profile, Program
from runtime.plan import Call, Stack, Stacking

TICKS = 40
MODELS = ["LIF", "LIFRate", "AdaptiveLIF", "ReLU", "SpikingReLU", "Sigmoid", "Tanh", "Izhikevich"]
# Sigmoid neurons fire at half of their largest rate at least.
FAST = {"tau_ref": 0.002, "max_rates": "uniform(300, 450)"}
Data = dict[str, Any]
Part = tuple[Data, Data]  # blocks, wires


def ensembles(draw: st.DrawFn) -> tuple[Part, int, int]:
    """Equal ensembles, their neurons, and the dimensions of each."""
    d, groups = draw(st.sampled_from([(1, 1), (2, 1), (5, 1), (2, 2), (3, 3)]))
    neurons = draw(st.sampled_from([1, 7, 30, 160, 310]))
    model = draw(st.sampled_from(MODELS))
    common: Data = {"type": "Ensemble", "neurons": neurons, "dimensions": d, "groups": groups}
    common["neuron"] = {"type": model}
    if model in ("Sigmoid", "Tanh"):
        common["neuron"]["tau_ref"] = FAST["tau_ref"]
        common["max_rates"] = FAST["max_rates"]
    made, wires = {}, {}
    for i in range(draw(st.integers(2, 5))):
        made[f"e{i}"] = {**common, "radius": draw(st.sampled_from([0.5, 1.0, 2.0]))}
        inputs = draw(st.lists(st.sampled_from(["drive.value", "wave"]), max_size=3))
        wires[f"e{i}"] = {"input": [w if w != "wave" else f"wave_{d}.out" for w in inputs]}
        if draw(st.booleans()):
            wires[f"e{i}"]["current"] = ["bias.value"] * draw(st.integers(1, 2))
        if not inputs:
            del wires[f"e{i}"]["input"]
    made["drive"] = {"type": "Constant", "value": [0.3 - 0.2 * i for i in range(d)]}
    made["bias"] = {"type": "Constant", "value": [0.1 * i % 1.3 for i in range(neurons * groups)]}
    made["wave_1"] = {"type": "Sine", "frequency": 20.0}
    for size in (2, 3, 5):
        made[f"wave_{size}"] = {"type": "Select", "indices": [0] * size}
        wires[f"wave_{size}"] = {"inputs": ["wave_1.out"]}
    return (made, wires), neurons, d


def decoders(draw: st.DrawFn, part: Part) -> None:
    """Equal decoders of some of the ensembles, which may feed ensembles in turn."""
    made, wires = part
    sources = [name for name in made if name[0] == "e"]
    groups, d = made["e0"]["groups"], made["e0"]["dimensions"]
    synapse = draw(st.sampled_from([0.005, "alpha(0.01)", "second_order(100, 0.7)", "none"]))
    learning = draw(st.sampled_from([None, None, {"rule": "pes", "tau": 0.01}]))
    filtered = draw(st.sampled_from(["value", "value", "spikes"]))
    function = draw(st.sampled_from([None, "x[0]**2"] if groups == 1 else [None]))
    common: Data = {"type": "Decoder", "synapse": 0.005 if filtered == "spikes" else synapse}
    common |= {"filter": filtered, "solver": {"type": "l2"}, "points": 50}
    common |= {"function": function} if function else {}
    width = 1 if function else d
    for i in range(draw(st.integers(2, 6))):
        made[f"d{i}"] = {**common, "transform": draw(st.sampled_from([1.0, -1.0, 0.0]))}
        wires[f"d{i}"] = {"spikes": f"{draw(st.sampled_from(sources))}.spikes"}
        if learning is not None:
            made[f"d{i}"]["learning"] = {**learning, "learning_rate": 1e-3 * i}
            wires[f"d{i}"]["error"] = [f"d{i}.value"] * draw(st.integers(1, 2))
        if width == d and draw(st.booleans()) and not (learning and synapse == "none"):
            fed = wires[draw(st.sampled_from(sources))]
            fed["input"] = [*fed.get("input", []), f"d{i}.value"]


def learners(draw: st.DrawFn) -> Part:
    made: Data = {"wave": {"type": "Sine", "frequency": 20.0}}
    wires: Data = {}
    kind = draw(st.sampled_from(["AdaptiveEnsemble", "RateEnsemble"]))
    d, k = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    common = {"type": kind, "neurons": draw(st.sampled_from([5, 40, 310]))}
    common |= {"normalised": draw(st.booleans())}
    made["x"] = {"type": "Select", "indices": [0] * d}
    made["e"] = {"type": "Select", "indices": [0] * k}
    made["none"] = {"type": "Constant", "value": [0.0] * k}
    wires |= {"x": {"inputs": ["wave.out"]}, "e": {"inputs": ["wave.out"]}}
    for i in range(draw(st.integers(2, 4))):
        options = {"learning_rate": 1e-3, "radius": 0.5 + i}
        options |= {"leak": 0.5} if draw(st.booleans()) else {}
        options |= {"e_leak": 0.5} if draw(st.booleans()) else {}
        options |= {"limit": 1e-3} if draw(st.booleans()) else {}
        made[f"a{i}"] = {**common, **options}
        wires[f"a{i}"] = {"input": "x.out", "error": draw(st.sampled_from(["e.out", "none.value"]))}
        if draw(st.booleans()):
            wires[f"a{i}"]["learn"] = "wave.out"
    return made, wires


@st.composite
def graphs(draw: st.DrawFn) -> runtime.Graph:
    """A graph with populations of which several are equal; some slow, some in parts."""
    if draw(st.booleans()):
        part = learners(draw)
    else:
        part, _, _ = ensembles(draw)
        decoders(draw, part)
    made, wires = part
    for name in made:
        if name[0] in "eda" and name[1:].isdigit() and draw(st.integers(0, 5)) == 0:
            made[name]["dt"] = 0.002
    for name in list(made):
        if name[0] in "ea" and name[1:].isdigit() and draw(st.integers(0, 3)) == 0:
            into_part(name, made, wires, draw(st.sampled_from(["hold", "reset"])))
    data = {"run": {"dt": 0.001, "until": TICKS * 0.001, "seed": 3}, "blocks": made, "wires": wires}
    graph = runtime.load(data)
    for port in ("output", "value", "spikes"):
        for name, entry in graph.network.entries.items():
            if port in entry.cls.spec.outputs and "wave" not in name:
                graph = graph.probe(f"{name}.{port}")
    return graph


def into_part(name: str, made: Data, wires: Data, while_off: str) -> None:
    """Move a block into a part that is off for half of the time."""
    inside = wires[name]
    if any(not isinstance(source, str) for source in inside.values()):
        return  # a part passes on one wire each
    output = "spikes" if made[name]["type"] == "Ensemble" else "output"
    made["on"] = {"type": "Pulse", "period": 0.02, "width": 0.01}
    made[name] = {
        "inputs": {p: "Scalar" if p == "learn" else "Vector" for p in inside}
        | {"enable": "Scalar"},
        "outputs": {output: f"inner.{output}"},
        "blocks": {"enable": {"type": "Enable", "while_off": while_off}, "inner": made[name]},
        "wires": {
            "enable": {"input": "inputs.enable"},
            "inner": {port: f"inputs.{port}" for port in inside},
        },
    }
    wires[name] = {**inside, "enable": "on.out"}


def run(graph: runtime.Graph, stacked: bool, rewind: int = 0) -> tuple[Outcome, Engine]:
    """A run in Python, with or without stacks; it goes back by some ticks in between."""
    program = Program(graph.network, graph.program().observation)
    if not stacked:
        program.__dict__["stacking"] = Stacking(program.plan, {})
    engine = Engine(program, 3, None)
    prepare = engine.prepare

    def prepared() -> Any:
        runner = prepare()
        plain = runner.run

        def again(first: int, last: int, held: Any) -> Any:
            engine.state.tick, engine.state.held = first, held
            saved = engine.state.snapshot()
            plain(first, min(last, first + rewind), held)
            engine.state.restore(saved)
            return plain(first, last, held)

        runner.run = again  # type: ignore[misc]
        return runner

    if rewind:
        engine.prepare = prepared  # type: ignore[method-assign]
    return engine.run(), engine


def assert_same_bits(graph: runtime.Graph, rewind: int = 0) -> Stacking:
    """Stacked or not, a graph records the same, and ends with the same states."""
    plain, alone = run(graph, stacked=False)
    stacked, together = run(graph, stacked=True, rewind=rewind)
    assert (plain.status, str(plain.error)) == (stacked.status, str(stacked.error))
    for name, values in plain.arrays.items():
        assert values.tobytes() == stacked.arrays[name].tobytes(), name
    for name, values in alone.state.arrays.items():
        assert values.tobytes() == together.state.arrays[name].tobytes(), name
    return together.program.stacking


@settings(max_examples=15, deadline=None)
@given(graphs(), st.integers(0, 5))
def test_stacks_have_the_bits_of_calls_one_by_one(graph: runtime.Graph, rewind: int) -> None:
    assert_same_bits(graph, rewind)


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(graphs(), st.integers(0, 5))
def test_many_graphs_have_the_same_bits(graph: runtime.Graph, rewind: int) -> None:
    assert_same_bits(graph, rewind)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_decoders_add_up_spikes_in_the_same_order(data: st.DataObject) -> None:
    members, rows, groups = (data.draw(st.integers(1, most)) for most in (6, 3, 3))
    each = data.draw(st.sampled_from([1, 2, 9, 50, 200]))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    weights = rng.standard_normal((members, rows, each * groups))
    weights[rng.random(weights.shape) < 0.1] = -0.0
    spikes = np.where(rng.random((members, each * groups)) < rng.random((members, 1)), 1e3, 0.0)
    spikes[0] = 0.0
    alone = [decode(w, s, groups) for w, s in zip(weights, spikes, strict=True)]
    assert decode_each(weights, spikes, groups).tobytes() == np.array(alone).tobytes()


def test_groups_that_are_few_neurons_each_are_stepped_as_alone() -> None:
    """Two groups of 160: 320 neurons are stepped as many, 160 would be as few."""
    given = {"type": "Ensemble", "neurons": 160, "dimensions": 2, "groups": 2}
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 0.04, "seed": 3},
            "blocks": {"a": given, "b": given, "drive": {"type": "Constant", "value": [0.3, 0.1]}},
            "wires": {"a": {"input": "drive.value"}},
            "probes": {"a": "a.spikes", "b": "b.spikes"},
        }
    )
    assert_same_bits(graph)


class Fire(blocks.Block):
    """A vector as spikes, too large from a time on: two decoders with it between are a path."""

    x = blocks.Input(blocks.Vector("n"))
    spikes = blocks.Output(blocks.Spikes("n"))
    late: float = blocks.param(1.0, doc="when numbers become too large")

    def output(self, state: Any, t: float, x: Any) -> Any:
        return np.full(len(x), 1e308) if t > self.late else 1.0 * x


def chain(late: float = 1.0) -> runtime.Graph:
    """Four equal decoders, of which two read what the first one has decoded."""
    graph = runtime.Graph("chain", dt=0.001, until=0.03)
    for name, model in (("a", "LIF"), ("b", "LIF"), ("c", "LIFRate")):
        graph = graph.add(name, blocks.Ensemble(neurons=20, dimensions=1, neuron=model))
    for name, when in (("fire", 1.0), ("high", late)):
        graph = graph.add(name, Fire(late=when)).connect("first.value", f"{name}.x")
    for name, source in (("first", "a"), ("second", "fire"), ("third", "b"), ("fourth", "high")):
        decoder = blocks.Decoder(weights=np.full((20, 20), 100.0).tolist(), synapse="none")
        graph = graph.add(name, decoder).connect(f"{source}.spikes", f"{name}.spikes")
        graph = graph.probe(name, f"{name}.value")
    return graph.connect("second.value", "c.current")


def methods(stacking: Stacking) -> list[tuple[str, ...]]:
    """The blocks that each call of an output is for, in order."""
    found = []
    for each in stacking.steps:
        calls = each.calls if isinstance(each, Stack) else [each] if isinstance(each, Call) else []
        found += [tuple(call.block for call in calls)] if calls and calls[0].outputs else []
    return found


def test_blocks_with_a_path_between_them_are_in_different_stacks() -> None:
    stacking = assert_same_bits(chain())
    assert methods(stacking) == [
        *(("c",), ("a", "b"), ("first", "third"), ("fire",), ("high",), ("fourth", "second"))
    ]
    assert stacking.members == [("a", "b"), ("first", "third"), ("fourth", "second")]


def test_a_graph_without_equal_blocks_keeps_its_order() -> None:
    graph = runtime.load("line_actuator_failure").without("adaptive.snn_v")
    program = graph.program()
    assert program.stacking.steps == program.plan.operations


def test_removing_one_of_several_leaves_the_others_as_they_were() -> None:
    graph = chain().without("third")
    stacking = assert_same_bits(graph)
    assert stacking.members == [("a", "b"), ("fourth", "second")]
    whole, _ = run(chain(), stacked=True)
    less, _ = run(graph, stacked=True)
    assert less.arrays["second"].tobytes() == whole.arrays["second"].tobytes()


def test_a_failure_in_a_stack_names_the_block() -> None:
    graph = chain(late=0.0095)
    with np.errstate(over="ignore"):
        (one, _), (other, _) = run(graph, stacked=True), run(graph, stacked=False)
    for outcome in (one, other):
        assert outcome.error is not None
        assert (outcome.error.block, outcome.ticks, outcome.status) == ("fourth", 10, "failed")
    assert str(one.error) == str(other.error)


def test_a_profile_has_every_block_of_a_stack() -> None:
    profile = Profile()
    Engine(chain().program(profiled=True), 3, profile=profile).run()
    # An output and an update on each tick but the first, on which nothing is stacked.
    assert profile.calls["a"] == profile.calls["b"] == profile.calls["third"] == 2 * 29
