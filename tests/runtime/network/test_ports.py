"""Inputs and outputs of a whole graph: declared as a part's, with a default, bounds and a unit."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from blocks import MassSpringDamper
from blocks.core import GraphInput, started
from runtime import Graph, GraphError, load
from runtime.checking.check import context_for
from runtime.runs import save
from tests.compilers import needs_compiler
from tests.runtime.engine.compiled_block import CompiledBlock

GRAPH = """\
graph: pushed
run: {dt: 0.01, until: 1.0, solver: rk4}
inputs:
  push: {type: Scalar, unit: N, min: -10, max: 10, default: 2.0, doc: a push}
  wish: {type: Pose, default: [1, 2, 3]}
outputs:
  place: {of: mass.out, unit: m, min: -5, max: 5, doc: how far}
  heading: inputs.wish.theta
blocks:
  mass: {type: Integrator}
  seen: {type: Gain, gain: 2.0}
wires:
  mass: {input: inputs.push}
  seen: {input: inputs.wish}
probes:
  place: place
  both: [heading, inputs.push]
  state: [inputs.push.value, inputs.push.out, inputs.wish.value.1]
  seen: seen.out
metrics:
  end: {kind: final, of: place}
"""
ENGINES = pytest.mark.parametrize("engine", ["python", "compiled"])


def graph(tmp_path: Path, *edits: tuple[str, str], text: str = GRAPH) -> Path:
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "g.yaml"
    path.write_text(text)
    return path


def problems(path: Path) -> list[str]:
    with pytest.raises(GraphError) as caught:
        load(path).check()
    return [str(each).rpartition("/")[2] for each in caught.value.problems]


@ENGINES
def test_a_graph_with_open_inputs_runs_with_the_defaults(tmp_path: Path, engine: str) -> None:
    result = load(graph(tmp_path)).set("run.engine", engine).run()
    t = 0.01 * np.arange(100)
    np.testing.assert_allclose(result["place"], 2.0 * t, atol=1e-12)
    assert (result["both"] == [3.0, 2.0]).all()
    assert (result["state"] == [2.0, 2.0, 2.0]).all()
    assert (result["seen"] == [2.0, 4.0, 6.0]).all()
    assert result.metrics["end"] == pytest.approx(1.98)


@ENGINES
def test_another_default_is_set_as_a_parameter(tmp_path: Path, engine: str) -> None:
    path = graph(tmp_path, ("default: 2.0", "default: -1.5"))
    result = load(path).set("run.engine", engine).set("inputs.push.default", 4.0).run()
    assert result["place"][-1] == pytest.approx(4.0 * 0.99)


@needs_compiler
@pytest.mark.parametrize("written", ["Scalar", "Pose", "Vector(12)", "Path(3)"])
def test_what_is_written_to_the_state_is_the_signal_from_then_on(written: str) -> None:
    block = GraphInput(type=written, default=2.0)
    context = context_for(block, {}, 0.01)
    state = started(block, context)
    compiled = CompiledBlock(block, state, {})
    for number in (2.0, 5.0, -1.0):
        state.value = number
        shape = context.types["out"].shape
        for out in (block.output(state, 0.0), compiled.call("output", 0.0)):
            assert np.array_equal(np.asarray(out), np.full(shape, number))


def test_a_graph_of_python_has_ports() -> None:
    ports = {"inputs": {"push": {"type": "Scalar", "default": 6.0}}, "outputs": {"x": "m.position"}}
    mass = MassSpringDamper(damping=30.0, stiffness=3.0)
    empty = Graph("mass", dt=0.01, until=100.0).add("m", mass).overlay(ports)
    result = empty.connect("inputs.push", "m.force").probe("x").run()
    assert result["x"][-1] == pytest.approx(2.0, abs=1e-3)


def test_ports_are_declared_once(tmp_path: Path) -> None:
    network = load(graph(tmp_path)).network
    push, wish = network.inputs.values()
    assert (push.name, str(push.type), push.unit, push.doc) == ("push", "Scalar", "N", "a push")
    assert (push.low, push.high, push.default) == (-10.0, 10.0, 2.0)
    assert (str(push.end), push.low.shape) == ("inputs.push.out", ())
    assert wish.unit == "m, m, rad"
    assert wish.default is not None and wish.default.tolist() == [1.0, 2.0, 3.0]
    assert np.isinf([wish.low, wish.high]).all() and wish.low.shape == (3,)
    place, heading = network.outputs.values()
    assert (str(place.end), place.unit, place.high, place.default) == ("mass.out", "m", 5.0, None)
    assert (str(heading.end), str(heading.type), heading.unit) == (
        *("inputs.wish.out.theta", "Scalar", "rad"),
    )


def test_a_value_is_checked_against_the_declaration(tmp_path: Path) -> None:
    path = graph(tmp_path, ("default: [1, 2, 3]", "default: 0, max: [5, 5, 1]"))
    inputs = load(path).network.inputs
    assert inputs["push"].value(3) == np.array(3.0)
    assert inputs["wish"].value(0.5).tolist() == [0.5, 0.5, 0.5]
    for name, value, message in [
        ("push", 11, "'push': expected at most 10 N, got 11"),
        ("push", -10.5, "'push': expected at least -10 N, got -10.5"),
        ("push", float("nan"), "'push': expected a finite number N, got nan"),
        ("push", [1, 2], "'push': expected a number for a Scalar, got [1, 2]"),
        ("push", "much", "'push': expected a number for a Scalar, got the string 'much'"),
        ("wish", [1, 2, 3], "'wish[2]': expected at most 1 m, m, rad, got 3"),
    ]:
        with pytest.raises(ValueError) as caught:
            inputs[name].value(value)
        assert str(caught.value) == message


@pytest.mark.parametrize(
    ("edit", "messages"),
    [
        (("default: 2.0", "defualt: 2.0"), ["inputs.push.defualt: unknown parameter, did you"]),
        (("default: 2.0", "default: 20"), ["inputs.push.default: expected at most the max, 10.0"]),
        (
            ("default: 2.0", "default: much"),
            ["inputs.push.default: expected a number or", "got the string"],
        ),
        (
            ("default: [1, 2, 3]", "default: [1, 2]"),
            ["inputs.wish.default: expected a number or 3"],
        ),
        (("min: -10", "min: 12"), ["inputs.push.min: expected at most the max", "the min, 12.0"]),
        (("type: Scalar", "type: Scalr"), ["inputs.push: no signal type 'Scalr'", "did you mean"]),
        (("type: Pose", "unit: m, type: Pose"), ["inputs.wish.unit: the components of a Pose"]),
        (("inputs.push}", "inputs.pus}"), ["'inputs.pus' is not an input of this graph, did you"]),
        (("inputs.push}", "inputs.wish.y, input: inputs.push}"), ["wires.mass.input"]),
        (("of: mass.out", "of: mas.out"), ["outputs.place: there is no block 'mas'"]),
        (("of: mass.out", "off: mass.out"), ["outputs.place.off: unknown key, did you mean 'of'?"]),
        (("max: 5,", "max: [5, 5],"), ["outputs.place.max: expected a number for Scalar, got"]),
        (("inputs.wish.theta", "{of: inputs.wish.theta, unit: m}"), ["expected rad", "got m"]),
        (("of: place", "of: plase"), ["there is no probe 'plase', did you mean 'place'?"]),
        (("inputs.wish.theta", "heading"), ["'heading' leads through parts in a circle"]),
        (("doc: a push", "to: mass.input"), ["inputs.push.to: unknown", "{port: inputs.NAME}"]),
        (("  wish:", "  a b:"), ["inputs: 'a b' is not a name for a port"]),
        (("  heading:", "  1st:"), ["outputs: '1st' is not a name for a port"]),
        (("default: 2.0, ", "optional: true, "), ["since 'inputs.push' has no default"]),
        (
            ("default: 2.0, ", ""),
            ["inputs: push has no default, which a graph that runs by itself"],
        ),
    ],
)
def test_mistakes_are_named_with_their_place(
    tmp_path: Path, edit: tuple[str, str], messages: list[str]
) -> None:
    text = "\n".join(problems(graph(tmp_path, edit)))
    assert all(message in text for message in messages), text
    assert text.startswith("g.yaml:")


def test_a_type_that_is_not_written_is_that_of_the_readers(tmp_path: Path) -> None:
    path = graph(
        tmp_path, ("wish: {type: Pose, ", "wish: {"), ("wish.theta", "wish"), ("[heading, ", "[")
    )
    assert "g.yaml:5:3: its signal type is open: write it" in problems(path)[0]
    saturator = ("{type: Gain, gain: 2.0}", "{type: Saturator, omega_max: 1.0}")
    text, ports = (
        path.read_text(),
        (("{input: inputs.wish", "{command: inputs.wish"), ("n.out", "n.limited")),
    )
    network = load(graph(tmp_path, saturator, *ports, ("[1, 2, 3]", "[1, 2]"), text=text)).network
    assert str(network.inputs["wish"].type) == str(network.outputs["heading"].type) == "Twist"


def test_a_wire_from_an_input_has_its_type(tmp_path: Path) -> None:
    path = graph(tmp_path, ("{type: Gain, gain: 2.0}", "{type: Saturator, omega_max: 1.0}"))
    path.write_text(path.read_text().replace("seen: {input:", "seen: {command:"))
    path.write_text(path.read_text().replace("seen.out", "seen.limited"))
    (problem,) = problems(path)
    assert "expected Twist, got Pose from 'inputs.wish'" in problem


def test_units_of_inputs_are_those_of_their_wires(tmp_path: Path) -> None:
    path = graph(
        tmp_path,
        ("  seen: {type: Gain, gain: 2.0}", "  seen: {type: Sum}"),
        ("seen: {input: inputs.wish}", "seen: {terms: [inputs.push, inputs.wish.x]}"),
    )
    (problem,) = problems(path)
    assert "expected N as 'inputs.push' has, got m from 'inputs.wish.x'" in problem


PART = """\
graph: part
inputs:
  a: Scalar
  factor: {type: Scalar, default: 3.0}
outputs:
  out: {of: product.out, doc: both}
blocks:
  product: {type: Product}
wires:
  product: {factors: [inputs.a, inputs.factor]}
"""
WHOLE = """\
run: {dt: 0.1, until: 0.5}
blocks:
  one: {type: Constant, value: 2.0}
  p: {graph: p.yaml}
wires:
  p: {a: one.value}
probes: {out: p.out}
"""


@ENGINES
def test_an_input_of_a_part_that_is_not_wired_has_its_default(tmp_path: Path, engine: str) -> None:
    (tmp_path / "p.yaml").write_text(PART)
    whole = load(graph(tmp_path, text=WHOLE)).set("run.engine", engine)
    assert (whole.run()["out"] == 6.0).all()
    assert not whole.network.inputs
    wired = whole.wire("p.factor", "one.value")
    assert (wired.run()["out"] == 4.0).all()


def test_a_part_run_by_itself_says_which_inputs_lack_a_default(tmp_path: Path) -> None:
    (problem,) = problems(graph(tmp_path, text=PART))
    assert problem.startswith("g.yaml:3:3: inputs: a has no default")
    text = PART.replace("a: Scalar", "a: {type: Scalar, default: 5}") + "probes: {out: out}\n"
    assert (load(graph(tmp_path, text=text)).run()["out"] == 15.0).all()


def test_an_input_can_be_removed_where_its_readers_allow_it(tmp_path: Path) -> None:
    path = graph(tmp_path, ("seen: {input: inputs.wish}", "seen: {input: inputs.push}"))
    without = load(path).without("inputs.wish")
    assert list(without.network.inputs) == ["push"]
    assert list(without.network.outputs) == ["place"]
    with pytest.raises(GraphError, match="'mass.input' is not connected without 'inputs.push'"):
        load(path).without("inputs.push").check()


def test_a_port_is_an_input_of_a_linearization(tmp_path: Path) -> None:
    linear = load(graph(tmp_path)).linearize(inputs=["push"], outputs=["place"])
    assert (linear.b.tolist(), linear.c.tolist()) == ([[1.0]], [[1.0]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda g: g.set("push", 5.0),
            "there is no 'push' in the graph, did you mean 'inputs.push",
        ),
        (lambda g: g.set("inputs.push.default", 50.0), "expected at most the max, 10.0, got 50.0"),
        (lambda g: g.without("push"), "there is no block 'push', did you mean 'inputs.push'?"),
        (lambda g: g.wire("mass.input", "push"), "no block 'push', did you mean 'inputs.push'?"),
        (lambda g: g.wire("mass.input", "inputs.wish.y"), ""),
        (lambda g: g.wire("mass.input", "inputs.wsh.y"), "did you mean 'wish'?"),
    ],
)
def test_changes_from_outside_name_inputs(
    tmp_path: Path, change: Callable[[Graph], Graph], message: str
) -> None:
    if not message:
        change(load(graph(tmp_path))).check()
        return
    with pytest.raises(GraphError, match=re.escape(message)):
        change(load(graph(tmp_path))).check()


def test_an_input_that_nothing_reads_is_noted(tmp_path: Path) -> None:
    assert not load(graph(tmp_path)).network.notes
    path = graph(tmp_path, ("seen: {input: inputs.wish}", "seen: {input: inputs.push}"))
    assert not load(path).network.notes
    path = graph(tmp_path, ("inputs.wish.theta", "mass.out"), text=path.read_text())
    path.write_text(path.read_text().replace(", inputs.wish.value.1", ""))
    assert load(path).network.notes == ("inputs.wish: nothing reads it",)


def test_a_run_that_goes_on_from_another_has_its_own_inputs(tmp_path: Path) -> None:
    save(load(graph(tmp_path)).run(), tmp_path / "first")
    back = load(graph(tmp_path)).begin_from(tmp_path / "first").set("inputs.push.default", -2.0)
    later = back.run()
    np.testing.assert_allclose(later["place"][[0, -1]], [2.0, 0.02], atol=1e-12)


def test_a_diagram_shows_the_inputs(tmp_path: Path) -> None:
    text = load(graph(tmp_path)).diagram("dot")
    assert isinstance(text, str)
    assert '"inputs.push":' in text
