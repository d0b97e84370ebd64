"""Open inputs, stated signal types, and types of one's own: both engines and the messages."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks.library.index import TYPES
from blocks.library.registry import BUILTIN
from runtime.errors import GraphError
from tests.compilers import skip_without_compiler


class Offset(blocks.Block):
    """Adds an optional vector, writing into it: the next tick must not see that."""

    x = blocks.Input(blocks.Vector("n"))
    shift = blocks.Input(blocks.Vector("n"), default=0.5)
    pose = blocks.Input(blocks.Pose, default=2.0)
    bound = blocks.Input(blocks.Scalar, default=np.inf)
    out = blocks.Output(blocks.Vector("n"))

    def output(self, state, t, x, shift, pose, bound):
        for i in range(len(shift)):
            shift[i] += 1.0
        for i in range(len(shift)):
            shift[i] = min(x[i] + shift[i] + pose[2], bound)
        return shift


class Optional(blocks.Block):
    """Has an optional input whose length nothing else gives."""

    x = blocks.Input(blocks.Vector("n"), default=0.0)
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t, x):
        return float(x.sum())


def messages(graph: runtime.Graph) -> list[str]:
    with pytest.raises(GraphError) as caught:
        graph.check()
    return str(caught.value).splitlines()


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_an_open_input_has_the_form_of_its_type(engine: str) -> None:
    if engine == "compiled":
        skip_without_compiler()
    graph = runtime.Graph(dt=0.01, until=0.05)
    graph = graph.add("c", blocks.Constant(value=[1, 2, 3], signal="Vector"))
    graph = graph.add("offset", Offset()).connect("c.value", "offset.x").probe("offset.out")
    result = graph.run(engine=engine)
    np.testing.assert_array_equal(result["offset_out"], np.tile([4.5, 5.5, 6.5], (5, 1)))


def test_an_open_length_is_reported_with_what_gives_it() -> None:
    graph = runtime.Graph().add("o", Optional())
    message = "blocks.o: 'o.x' is not connected, and its length (Vector(n)) is open; "
    message += "wire a Vector to 'o.x'"
    assert messages(graph) == [message]


@pytest.mark.parametrize("probed", [False, True])
def test_an_ensemble_without_input_is_named_and_not_what_reads_it(probed: bool) -> None:
    # The rows of the Decoder's weights are as open as the Ensemble's length.
    graph = runtime.Graph(dt=0.001, until=0.1).add("e", blocks.Ensemble(neurons=10))
    graph = graph.add("d", blocks.Decoder()).add("g", blocks.Sum(signal="Vector(2)"))
    graph = graph.connect("e.spikes", "d.spikes").connect("d.value", "g.terms")
    graph = graph.probe("w", "d.weights") if probed else graph
    (message,) = messages(graph)
    assert "'e.input' is not connected" in message


LOOP: dict[str, Any] = {
    "run": {"dt": 0.1, "until": 0.5},
    "blocks": {
        "d": {"type": "UnitDelay", "initial": [1, 2, 4]},
        "g": {"type": "Gain", "gain": 0.5},
    },
    "wires": {"g": {"input": "d.out"}, "d": {"input": "g.out"}},
    "probes": {"y": "d.out"},
}


@pytest.mark.parametrize("owner", ["d", "g"])
@pytest.mark.parametrize("kind", ["Pose", "Vector(3)"])
def test_a_loop_of_generic_blocks_may_state_its_type(owner: str, kind: str) -> None:
    assert messages(runtime.load(LOOP))[0] == (
        "blocks.d: the signal type of 'd.input' is open; wire a typed signal to it, or write its "
        "type, as in 'signal: Scalar'"
    )
    graph = runtime.load(LOOP).set(f"blocks.{owner}.signal", kind)
    expected = np.outer(0.5 ** np.arange(5), [1.0, 2.0, 4.0])
    np.testing.assert_array_equal(graph.run()["y"], expected)
    assert runtime.load(graph.to_dict()) == graph


def test_a_stated_type_is_held_against_the_wires() -> None:
    plain = {
        "blocks": {
            "c": {"type": "Constant", "value": 1},
            "g": {"type": "Gain", "gain": 2, "signal": "Pose"},
        },
        "wires": {"g": {"input": "c.value"}},
    }
    [message] = messages(runtime.load(plain))
    assert message == "wires.g.input: expected Pose, got Scalar from 'c.value'"
    [message] = messages(runtime.load(plain).set("g.signal", "Vector"))
    assert (
        "blocks.g.signal: expected a type with its length, as in Vector(3), got Vector" in message
    )
    [message] = messages(runtime.load(plain).set("g.signal", "Poze"))
    assert message.endswith("did you mean 'Pose'?")


def test_every_generic_block_of_the_library_takes_a_signal() -> None:
    generic = {name for name in TYPES if BUILTIN[name].spec.generic}
    # Matrices settle the types of measurements and commands, and the phases that of trials.
    generic -= {"ExtendedKalmanFilter", "LinearQuadraticRegulator", "LinearMPC"}
    generic -= {"LinearDisturbanceObserver", "Trials"}
    assert {"Sum", "Gain", "UnitDelay", "Lowpass", "Switch", "Constant"} <= generic
    assert all("signal" in BUILTIN[name].spec.params for name in generic)


FORCES = '''"""A record type of one's own and a block that uses it."""
from blocks import Block, Input, Output, Scalar
from blocks.core.signals import SignalType

Wrench = SignalType("Wrench", "record", ("force", "torque"), ("N", "N m"))


class Push(Block):
    """The force of a wrench."""

    wrench = Input(Wrench)
    force = Output(Scalar, unit="N")

    def output(self, state, t, wrench):
        return wrench[0]
'''
PART = """inputs: {wrench: Wrench}
outputs: {force: push.force}
blocks: {push: {type: Push, module: forces.py}}
wires: {push: {wrench: inputs.wrench}}
"""
GRAPH = """run: {dt: 0.1, until: 0.3}
blocks:
  load: {type: Constant, signal: Wrench, module: forces.py, value: [3, 4]}
  memory: {type: UnitDelay, signal: Wrench, initial: [1, 2]}
  part: {graph: part.yaml}
wires: {memory: {input: load.value}, part: {wrench: memory.out}}
probes: {force: part.force}
"""


def test_a_record_of_a_module_is_named_in_yaml(tmp_path: Path) -> None:
    for name, text in (("forces.py", FORCES), ("part.yaml", PART), ("g.yaml", GRAPH)):
        (tmp_path / name).write_text(text)
    graph = runtime.load(tmp_path / "g.yaml")
    assert graph.run()["force"].tolist() == [1.0, 3.0, 3.0]
    folder = graph.run().save(tmp_path / "run")
    assert runtime.load(folder / "graph.resolved.yaml").run()["force"].tolist() == [1.0, 3.0, 3.0]
    [message, *_] = messages(graph.set("memory.signal", "Wrensh"))
    assert "no signal type 'Wrensh'" in message and message.endswith("did you mean 'Wrench'?")


def test_a_type_of_ones_own_in_python() -> None:
    wrench = blocks.SignalType("Wrench", "record", ("force", "torque"), ("N", "N m"))
    constant = blocks.Constant(signal=wrench, value=[3, 4])
    assert type(constant)(**constant.parameters()) == constant
    graph = runtime.Graph(dt=0.1, until=0.3).add("load", constant)
    graph = graph.add("memory", blocks.UnitDelay()).connect("load.value", "memory.input")
    np.testing.assert_array_equal(
        graph.probe("memory.out").run()["memory_out"], [[0, 0], [3, 4], [3, 4]]
    )


UNKNOWN = {
    "without": (lambda g: g.without("gian"), "without[0]: there is no block 'gian'"),
    "bypass": (lambda g: g.bypass("d", "gian"), "bypass[1]: there is no block 'gian'"),
    "replace": (lambda g: g.replace("gian", "Sum"), "there is no block 'gian'"),
    "input": (lambda g: g.wire("gain.inptu", "d.out"), "'gain' has no input 'inptu'"),
    "consumer": (lambda g: g.wire("gian.input", "d.out"), "there is no block 'gian'"),
    "output": (lambda g: g.wire("gain.input", "d.otu"), "'d' has no output 'otu'"),
    "parameter": (lambda g: g.set("gain.gian", 1), "blocks.gain.gian: unknown parameter"),
    "run": (lambda g: g.set("run.untli", 1), "run.untli: unknown key"),
}


@pytest.mark.parametrize(("change", "message"), UNKNOWN.values(), ids=UNKNOWN.keys())
def test_a_change_in_python_refuses_an_unknown_name_at_once(change: Any, message: str) -> None:
    blocks = {"d": LOOP["blocks"]["d"], "gain": LOOP["blocks"]["g"]}
    wires = {"gain": {"input": "d.out"}}
    graph = runtime.load({"run": {"until": 1}, "blocks": blocks, "wires": wires})
    with pytest.raises(GraphError) as caught:
        change(graph)
    [line] = str(caught.value).splitlines()
    assert message in line and ("did you mean" in line)


def test_changes_in_steps_are_not_refused_halfway() -> None:
    """What a later change puts right is no unknown name: a sign before its term, for one."""
    plain = {
        "blocks": {"c": {"type": "Constant", "value": 1}, "s": {"type": "Sum", "signs": [1]}},
        "wires": {"s": {"terms": ["c.value"]}},
        "probes": {"s": "s.out"},
        "run": {"until": 0.001},
    }
    graph = runtime.load(plain).set("s.signs", [1, -1])
    assert graph.wire("s.terms", ["c.value", "c.value"]).run()["s"].tolist() == [0.0]


def test_what_shows_a_graph_never_raises() -> None:
    for wrong in ({"blocks": {"g": {"type": "Nope"}}}, {"blocks": 3, "graph": [1]}, {}):
        graph = runtime.load(wrong)
        assert graph._repr_svg_() is None
        assert repr(graph).startswith("<Graph")


def test_hints_among_many_names_compare_few_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted, not timed: 300 misspelt wires among 300 blocks are no 90,000 comparisons."""
    from blocks.core import hints

    compared = []

    def counting(word: str, possibilities: Any, **options: Any) -> list[str]:
        listed = list(possibilities)
        compared.append(len(listed))
        return difflib.get_close_matches(word, listed, **options)

    class Counting:
        get_close_matches = staticmethod(counting)

    monkeypatch.setattr(hints, "difflib", Counting)
    names = [f"controller_{i:03d}" for i in range(300)]
    entry = {"type": "Gain", "gain": 1, "signal": "Scalar"}
    plain = {
        "blocks": dict.fromkeys(names, entry),
        "wires": {name: {"input": f"{name.replace('con', 'cno')}.out"} for name in names},
    }
    found = messages(runtime.load(plain))
    assert len(found) == 300 and all("did you mean 'controller_" in line for line in found)
    assert "'cnotroller_123'" in found[123] and "did you mean 'controller_123'?" in found[123]
    assert max(compared) <= hints.CANDIDATES


MUX = '''"""A block that takes as many wires as its parameter says."""
from blocks import Block, Input, Output, Scalar, Vector, param
import numpy as np


class Stack(Block):
    """Scalars as one vector."""

    parts = Input(Scalar, variadic="n")
    out = Output(Vector("n"))
    n: int = param(2, at_least=1, doc="how many")

    def output(self, state, t, parts):
        return np.array(parts)
'''


def test_as_many_wires_as_the_parameter_says(tmp_path: Path) -> None:
    (tmp_path / "stack.py").write_text(MUX)
    text = (
        "run: {dt: 0.01, until: 0.05}\n"
        "blocks: {a: {type: Constant, value: 1}, s: {type: Stack, module: stack.py, n: 3}}\n"
        "wires: {s: {parts: [a.value, a.value]}}\nprobes: {out: s.out}\n"
    )
    (tmp_path / "g.yaml").write_text(text)
    [message] = messages(runtime.load(tmp_path / "g.yaml"))
    assert "blocks.s: input 'parts' takes n = 3 wires, 2 are connected" in message
    (tmp_path / "g.yaml").write_text(text.replace("n: 3", "n: 2"))
    assert runtime.load(tmp_path / "g.yaml").run()["out"].tolist()[-1] == [1.0, 1.0]
    (tmp_path / "stack.py").write_text(MUX.replace('variadic="n"', 'variadic="m"'))
    [message] = messages(runtime.load(tmp_path / "g.yaml"))
    assert "variadic='m' is not an integer parameter" in message
