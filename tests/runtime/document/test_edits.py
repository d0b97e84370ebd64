"""Changes to a graph: set, wire, without and bypass, on paper and in the numbers."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.document import parse_yaml
from runtime.errors import GraphError, UsageError

PLAIN: dict[str, Any] = {
    "graph": "g",
    "run": {"dt": 0.1, "until": 0.5},
    "blocks": {
        "one": {"type": "Constant", "value": 1},
        "ten": {"type": "Constant", "value": 10},
        "hundred": {"type": "Constant", "value": 100},
        "double": {"type": "Gain", "gain": 2},
        "triple": {"type": "Gain", "gain": 3},
        "sum": {"type": "Sum", "signs": [1, -1, 1]},
        "part": {
            "inputs": {"x": "Scalar"},
            "outputs": {"y": "half.out"},
            "params": {"k": 0.5},
            "blocks": {"half": {"type": "Gain", "gain": "$k"}},
            "wires": {"half": {"input": "inputs.x"}},
        },
    },
    "wires": {
        "double": {"input": "hundred.value"},
        "triple": {"input": "double.out"},
        "sum": {"terms": ["one.value", "ten.value", "triple.out"]},
        "part": {"x": "sum.out"},
    },
    "probes": {"out": "sum.out", "triple": "triple.out", "half": "part.y"},
}


@pytest.fixture
def graph() -> runtime.Graph:
    return runtime.load(PLAIN)


def last(graph: runtime.Graph, name: str = "out") -> float:
    return float(graph.run()[name][-1])


def test_the_graph_itself(graph: runtime.Graph) -> None:
    assert last(graph) == 1 - 10 + 600
    assert last(graph, "half") == 591 / 2


SETS = [
    ("blocks.double.gain", 5, 1 - 10 + 1500),
    ("double.gain", 5, 1 - 10 + 1500),
    (" double.gain ", 5, 1 - 10 + 1500),
    ("sum.signs", [1, 1, 1], 611),
    ("sum.signs.1", 1, 611),
    ("sum.signs", None, 611),
    ("wires.sum.terms.0", "ten.value", 10 - 10 + 600),
    ("one", {"type": "Constant", "value": 4}, 4 - 10 + 600),
]


@pytest.mark.parametrize(("path", "value", "result"), SETS, ids=[row[0] for row in SETS])
def test_set(graph: runtime.Graph, path: str, value: Any, result: float) -> None:
    assert last(graph.set(path, value)) == result


@pytest.mark.parametrize(
    "path",
    [
        "part.params.k",
        "blocks.part.params.k",
        "part.half.gain",
        "part.blocks.half.gain",
        "blocks.part.blocks.half.gain",
    ],
)
def test_set_inside_a_part(graph: runtime.Graph, path: str) -> None:
    changed = graph.set(path, 2)
    changed = changed if "params" in path else changed.set("part.params.k", None)
    assert last(changed, "half") == 591 * 2


def test_set_opens_sections_that_are_not_there(graph: runtime.Graph) -> None:
    changed = graph.set("metrics.m.kind", "final").set("metrics.m.of", "out")
    assert changed.run().metrics == {"m": 591.0}
    assert graph.set("run.until", 1.0).run().ticks == 10


def test_set_takes_out(graph: runtime.Graph) -> None:
    assert "probes" not in graph.set("probes", None).to_dict()
    assert "half" not in graph.set("probes.half", None).to_dict()["probes"]


REFUSED_SETS = {
    "dubble.gain": "there is no 'dubble' in the graph, did you mean 'double'?",
    "bloks.double.gain": "there is no 'bloks' in the graph, did you mean 'blocks'?",
    "double..gain": "'double..gain' is not a path; expected one such as blocks.lqr.q",
    "": "'' is not a path; expected one such as blocks.lqr.q",
    "blocks": "name an entry, as in blocks.NAME.KEY",
    "blocks.fresh.gain": (
        "there is no 'fresh'; there are one, ten, hundred, double, triple, sum, part"
    ),
    "sum.signs.3": "'3' is not an item of a list of 3; items count from 0",
    "sum.signs.7": "'7' is not an item of a list of 3; items count from 0",
    "sum.signs.x": "'x' is not an item of a list of 3; items count from 0",
    "sum.signs.-1": "'-1' is not an item of a list of 3; items count from 0",
    "double.gain.x": "'x' cannot be set inside 2",
    "one.initial.0": "'initial' is not written in the graph; set the whole list",
}


@pytest.mark.parametrize(("path", "message"), REFUSED_SETS.items(), ids=REFUSED_SETS.keys())
def test_set_that_leads_nowhere(graph: runtime.Graph, path: str, message: str) -> None:
    with pytest.raises(GraphError) as caught:
        graph.set(path, 1, origin=f"--set {path}=1")
    [problem] = caught.value.problems
    assert problem.where.file == f"--set {path}=1"
    assert problem.text == message


def test_a_wrong_value_is_told_where_it_was_given(graph: runtime.Graph) -> None:
    changed = graph.set("double.gain", "x", origin="--set double.gain=x")
    with pytest.raises(GraphError) as caught:
        changed.check()
    assert str(caught.value) == (
        "--set double.gain=x: blocks.double.gain: expected a number or an array of n or m x n "
        "numbers, got the string 'x'"
    )


WIRES = [
    ("triple.input", "one.value", 1 - 10 + 3),
    ("wires.triple.input", "one.value", 1 - 10 + 3),
    ("sum.terms", ["one.value", "one.value", "ten.value"], 1 - 1 + 10),
    ("sum.terms.2", "ten.value", 1 - 10 + 10),
    ("double.input", "part.y", None),
]


@pytest.mark.parametrize(("consumer", "source", "result"), WIRES, ids=[row[0] for row in WIRES])
def test_wire(graph: runtime.Graph, consumer: str, source: Any, result: float | None) -> None:
    changed = graph.wire(consumer, source)
    if result is None:
        with pytest.raises(GraphError, match="algebraic loop"):
            changed.check()
    else:
        assert last(changed) == result


def test_wire_inside_a_part(graph: runtime.Graph) -> None:
    changed = graph.set("part.inputs.z", "Scalar").wire("part.z", "ten.value")
    assert last(changed.wire("part.half.input", "inputs.z"), "half") == 5


@pytest.mark.parametrize("consumer", ["", "sum", ".terms", "sum.", "wires.sum"])
def test_wire_to_no_input(graph: runtime.Graph, consumer: str) -> None:
    with pytest.raises(UsageError, match=r"--wire: expected consumer\.input=producer\.output"):
        graph.wire(consumer, "one.value", origin="--wire")


TERMS = {"one": 1.0, "ten": -10.0, "triple": 600.0}


@pytest.mark.parametrize(
    "gone", [names for n in range(4) for names in combinations(TERMS, n)], ids=str
)
def test_a_removed_term_takes_its_sign_along(graph: runtime.Graph, gone: tuple[str, ...]) -> None:
    """Whatever is left of 1 - 10 + 600 keeps its sign."""
    expected = sum(value for name, value in TERMS.items() if name not in gone)
    changed = graph.without(*gone).set("probes.triple", None)
    assert last(changed) == expected


def test_without_a_part(graph: runtime.Graph) -> None:
    result = graph.without("part").run()
    assert "half" not in result
    assert result.notes == ["'part.y' is not recorded: block 'part' is removed"]
    assert set(graph.without("part").network.removed) == {"part.half"}


def test_without_leaves_no_required_input_open(graph: runtime.Graph) -> None:
    with pytest.raises(GraphError) as caught:
        graph.without("double").check()
    assert str(caught.value) == (
        "wires.triple.input: input 'triple.input' (Scalar) is not connected without 'double'; "
        "'bypass: [double]' would connect through it; outputs of that type: one.value, ten.value, "
        "hundred.value, sum.out, part.y"
    )


def test_bypass_connects_through_a_block(graph: runtime.Graph) -> None:
    assert last(graph.bypass("double")) == 1 - 10 + 300
    assert last(graph.bypass("triple")) == 1 - 10 + 200
    assert last(graph.bypass("double", "triple")) == 1 - 10 + 100
    assert last(graph.bypass("part.half"), "half") == 591


def test_bypass_moves_probes_to_what_takes_the_place(graph: runtime.Graph) -> None:
    both = graph.bypass("triple", "double").run()
    assert np.array_equal(both["triple"], [100.0])
    assert both.notes == []


def test_without_at_the_end_of_a_bypass_names_what_is_gone(graph: runtime.Graph) -> None:
    with pytest.raises(GraphError, match=r"'triple\.input' .* is not connected without 'hundred'"):
        graph.bypass("double").without("hundred").check()


def test_lists_are_added_to_those_of_the_graph(tmp_path: Path) -> None:
    graph = runtime.load({**PLAIN, "without": "one", "bypass": ["double"]})
    changed = graph.without("ten", "one").bypass("triple")
    assert changed.to_dict()["without"] == ["one", "ten"]
    assert changed.to_dict()["bypass"] == ["double", "triple"]
    assert last(changed) == 100


REFUSED_LISTS: dict[str, tuple[dict[str, Any], str]] = {
    "misspelt": ({"without": ["on"]}, "without[0]: there is no block 'on', did you mean 'one'?"),
    "a port": (
        {"bypass": "double.out"},
        "bypass: there is no block 'double.out', did you mean 'double'?",
    ),
    "inner block": (
        {"without": ["part.haf"]},
        "without[0]: there is no block 'part.haf', did you mean 'part.half'?",
    ),
    "mapping": ({"without": {"a": 1}}, "without: expected a block's name, got a mapping"),
    "no pair": (
        {"bypass": ["one"]},
        "bypass[0]: 'one' (Constant) has no pass-through; 'without: [one]' removes it",
    ),
    "part": (
        {"bypass": ["part"]},
        "bypass[0]: 'part' is a part; only a block with a pass-through can be bypassed",
    ),
}


@pytest.mark.parametrize("case", REFUSED_LISTS.values(), ids=REFUSED_LISTS.keys())
def test_lists_that_name_nothing(case: tuple[dict[str, Any], str]) -> None:
    with pytest.raises(GraphError) as caught:
        runtime.load({**PLAIN, **case[0]}).check()
    assert str(caught.value) == case[1]


def test_a_block_cannot_be_left_out_and_bypassed(graph: runtime.Graph) -> None:
    with pytest.raises(GraphError, match="'double' is in 'without' as well; keep one"):
        graph.without("double").bypass("double").check()


def test_bypasses_that_bite_their_tail() -> None:
    plain = {
        "blocks": {
            "a": {"type": "UnitDelay"},
            "b": {"type": "UnitDelay"},
            "c": {"type": "Gain", "gain": 1},
            "s": {"type": "Constant", "value": 1},
        },
        "wires": {"a": {"input": "b.out"}, "b": {"input": "a.out"}, "c": {"input": "a.out"}},
        "bypass": ["a", "b"],
    }
    with pytest.raises(GraphError, match=r"bypass\[0\]: bypassing 'a' would close a circle"):
        runtime.load(plain).check()


def test_a_bypass_of_an_open_input() -> None:
    plain = {"blocks": {"a": {"type": "Gain", "gain": 1}}, "bypass": ["a"]}
    with pytest.raises(GraphError, match=r"nothing is wired to 'a\.input', so there is nothing"):
        runtime.load(plain).check()


@pytest.mark.parametrize("change", ["without", "bypass"])
def test_a_command_line_names_a_block(graph: runtime.Graph, change: str) -> None:
    with pytest.raises(UsageError, match=f"--{change}: expected a block's name"):
        getattr(graph, change)(origin=f"--{change} ")
    assert getattr(graph, change)() == graph.set(change, [])


UNUSED = """
graph: g
run: {dt: 0.01, until: 0.02}
params: {rate: 2.0, other: 3.0, inner: 4.0}
blocks:
  a: {type: Constant, value: $rate}
  b: {type: Gain, gain: $other}
  p:
    part: p
    params: {gain: $inner, kept: 1.0}
    inputs: {in: Scalar}
    outputs: {out: c.out}
    blocks:
      c: {type: Gain, gain: $gain}
      d: {type: Constant, value: $kept}
    wires: {c: {input: inputs.in}}
wires: {b: {input: a.value}, p: {in: b.out}}
"""


def test_a_change_that_makes_a_param_unused_is_a_note_not_an_error() -> None:
    graph = runtime.load(parse_yaml(UNUSED, "g.yaml").plain())
    changed = graph.set("a.value", 1.0).check()
    assert changed.notes == ("params.rate is left out: nothing uses $rate after the change",)
    # What runs it again does not name it either.
    assert set(changed.to_dict()["params"]) == {"other", "inner"}
    inside = graph.set("p.c.gain", 1.0).check()
    assert [note.split()[0] for note in inside.notes] == ["p.params.gain", "params.inner"]
    assert graph.replace("b", "UnitDelay").check().notes[-1].startswith("params.other is left out")
    with pytest.raises(GraphError, match=r"\$nosuch is not used"):
        graph.set("params.nosuch", 1.0).check()
    with pytest.raises(GraphError, match=r"\$rate is not used"):
        graph.set("a.value", 1.0).set("params.rate", 3.0).check()
