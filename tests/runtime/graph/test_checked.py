"""The checked graph as read-only data."""

from __future__ import annotations

from typing import Any

import pytest

import runtime
from blocks import Pose
from blocks.library.registry import BUILTIN
from runtime.errors import GraphError
from runtime.graph import WireInfo

PART: dict[str, Any] = {
    "inputs": {"u": "Scalar"},
    "outputs": {"y": "held.out"},
    "blocks": {"twice": {"type": "Gain", "gain": 2.0}, "held": {"type": "UnitDelay", "dt": 0.02}},
    "wires": {"twice": {"input": "inputs.u"}, "held": {"input": "twice.out"}},
}
GRAPH: dict[str, Any] = {
    "run": {"dt": 0.01, "until": 0.1},
    "blocks": {
        "one": {"type": "Constant", "value": 1.0},
        "inner": PART,
        "gone": {"type": "Gain", "gain": 3.0},
        "sum": {"type": "Sum"},
    },
    "wires": {
        "inner": {"u": "one.value"},
        "gone": {"input": "one.value"},
        "sum": {"terms": ["inner.y", "one.value", "gone.out"]},
    },
    "without": ["gone"],
}


def test_parts_are_expanded_and_what_is_left_out_is_gone() -> None:
    graph = runtime.load(GRAPH)
    assert {*graph.blocks} == {"one", "inner.twice", "inner.held", "sum"}
    held = graph.blocks["inner.held"]
    assert (held.type, held.dt) == ("UnitDelay", 0.02)
    assert (held.inputs, held.outputs) == (("input",), ("out",))
    assert graph.blocks["inner.twice"].parameters["gain"] == 2.0
    assert set(graph.wires) == {
        WireInfo("one.value", "inner.twice.input"),
        WireInfo("inner.twice.out", "inner.held.input"),
        WireInfo("inner.held.out", "sum.terms[0]"),
        WireInfo("one.value", "sum.terms[1]"),
    }
    assert {str(kind) for kind in graph.types.values()} == {"Scalar"}


def test_every_end_of_a_wire_is_a_port_of_a_block_and_has_a_type() -> None:
    graph = runtime.load("starters/adaptive")
    outputs = {f"{name}.{port}" for name, each in graph.blocks.items() for port in each.outputs}
    inputs = {f"{name}.{port}" for name, each in graph.blocks.items() for port in each.inputs}
    for wire in graph.wires:
        assert wire.source in outputs or wire.source.rpartition(".")[0] in outputs
        target = wire.target.partition("[")[0]
        assert target in inputs and target in graph.types
    assert graph.types["plant.pose"] is Pose
    assert all(each.type in BUILTIN for each in graph.blocks.values())


def test_the_data_cannot_be_changed() -> None:
    graph = runtime.load(GRAPH)
    with pytest.raises(TypeError):
        graph.blocks["one"] = graph.blocks["sum"]  # type: ignore[index]
    with pytest.raises(TypeError):
        graph.blocks["one"].parameters["value"] = 2.0  # type: ignore[index]
    with pytest.raises(AttributeError):
        graph.wires = ()  # type: ignore[misc]


def test_a_wrong_graph_says_what_is_wrong() -> None:
    wrong = runtime.load({**GRAPH, "wires": {"sum": {"terms": ["nothing.out"]}}})
    with pytest.raises(GraphError, match="nothing"):
        _ = wrong.blocks
