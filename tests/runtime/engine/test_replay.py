"""Checkpoints of a run's state, and compiled ticks that run again under Python."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from runtime.engine import Engine, Outcome
from runtime.engine.compiled import CompiledRunner
from runtime.engine.runners import CompiledError, RunContext
from runtime.errors import NotCopiedError
from tests.compilers import needs_compiler
from tests.examples import examples

FOLDER = Path(runtime.__file__).parents[1] / "graphs"
PATHS = sorted([*FOLDER.glob("*.yaml"), *(FOLDER / "gallery").rglob("*.yaml")])
NAMES = [str(p.relative_to(FOLDER).with_suffix("")) for p in PATHS if "mujoco" not in p.name]
# Noise, neurons, two rates, parts that are switched, steps that a solver chooses; the slow tests
# try all graphs.
QUICK = ["line_actuator_failure", "gallery/adaptive_arm", "gallery/noise_filter"]
QUICK += [f"gallery/{name}" for name in ("night_setback", "van_der_pol", "zero_order_hold")]
TICKS = 60
Change = Callable[[Engine], None]

pytestmark = needs_compiler


def ran(graph: runtime.Graph, runner: Any = None, change: Change = lambda _: None) -> Outcome:
    """Run a graph whose engine is changed before the second tick."""

    class Changed(Engine):
        def prepare(self) -> Any:
            made = super().prepare()
            change(self)
            return made

    return Changed(graph.program(), 3, runner).run()


def short(name: str, memory: bool = False) -> runtime.Graph:
    """A shipped graph of a few ticks; with little memory, so that it records to disk."""
    graph = runtime.load(FOLDER / f"{name}.yaml")
    graph = graph.set("run.until", TICKS * graph.network.dt)
    return graph.set("run.memory", 2000) if memory else graph


def rewound(at: int, span: int) -> Change:
    """Go on for some ticks after one, and back to it, once."""

    def change(engine: Engine) -> None:
        state, run = engine.state, engine.runner.run

        def again(first: int, last: int, held: Any) -> Any:
            if not first <= at < last:
                return run(first, last, held)
            if first < at:
                held = run(first, at, held)
            state.tick, state.held = at, held
            saved = state.snapshot()
            run(at, min(last, at + span), held)
            state.restore(saved)
            assert state.tick == at
            return run(at, last, state.held)

        engine.runner.run = again  # type: ignore[misc]

    return change


def assert_same(one: Outcome, other: Outcome) -> None:
    assert (one.status, one.ticks) == (other.status, other.ticks)
    for name, values in one.arrays.items():
        np.testing.assert_array_equal(other.arrays[name], values, err_msg=name)


def going_back_changes_nothing(name: str, at: int, span: int, memory: bool) -> None:
    graph = short(name, memory)
    for runner in (None, CompiledRunner):
        assert_same(ran(graph, runner), ran(graph, runner, rewound(at, span)))


@examples(5)
@given(st.sampled_from(QUICK), st.integers(1, TICKS - 1), st.integers(1, 30), st.booleans())
def test_a_run_that_goes_back_to_a_checkpoint_is_the_same(
    name: str, at: int, span: int, memory: bool
) -> None:
    going_back_changes_nothing(name, at, span, memory)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_graph_can_go_back(name: str) -> None:
    going_back_changes_nothing(name, 25, 20, False)


def failing_at(tick: int) -> Callable[[RunContext], CompiledRunner]:
    """A runner whose compiled code fails once it has done a tick, or a part of it."""

    class Failing(CompiledRunner):
        def _part(self, first: int, last: int, low: int, high: int) -> None:
            if first <= tick < last:
                super()._part(first, tick + 1, low, high)
                raise CompiledError("", tick, "a planted failure")
            super()._part(first, last, low, high)

    return Failing


def a_failure_goes_on_in_python(name: str, at: int, memory: bool) -> None:
    graph = short(name, memory)
    python, compiled = ran(graph), ran(graph, CompiledRunner)
    found = ran(graph, failing_at(at))
    if compiled.ticks <= at:
        assert_same(compiled, found)
        return
    assert found.python_from == at
    assert (found.status, found.ticks) == (python.status, python.ticks)
    probes = graph.program().observation.probes
    for key, values in found.arrays.items():
        rows = 1 if probes[key].constant else probes[key].rows(at)
        np.testing.assert_array_equal(values[:rows], compiled.arrays[key][:rows], err_msg=key)
        if np.array_equal(python.arrays[key], compiled.arrays[key]):
            np.testing.assert_array_equal(values, python.arrays[key], err_msg=key)
        np.testing.assert_allclose(values, python.arrays[key], 1e-7, 1e-7, err_msg=key)


@examples(5)
@given(st.sampled_from(QUICK), st.integers(1, TICKS - 1), st.booleans())
def test_a_failure_of_compiled_code_goes_on_with_pythons_numbers(
    name: str, at: int, memory: bool
) -> None:
    a_failure_goes_on_in_python(name, at, memory)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_graph_goes_on_after_a_failure(name: str) -> None:
    a_failure_goes_on_in_python(name, 25, False)


class Share(blocks.Block):
    """A NumPy number divided by one that becomes zero: infinite, and no error; at most 5."""

    out = blocks.Output(blocks.Scalar)
    left = blocks.State(2)
    noise = blocks.State()

    def start(self, state):
        state.left[:] = 1.0

    def output(self, state, t):
        with np.errstate(divide="ignore"):
            return float(min(np.sum(state.left) / (0.25 - t), 5.0)) + float(state.noise)

    def update(self, state, t):
        state.noise = state.rng.standard_normal()


class Ratio(blocks.Block):
    """The same in loops: Python's numbers, which raise; a kernel that fails earlier than it."""

    out = blocks.Output(blocks.Scalar)
    late = blocks.param(False, doc="whether Python goes on")
    late: bool
    noise = blocks.State()

    def output(self, state, t):
        left = 0.25 - t
        if left == 0.0 and self.late:
            return 5.0 + float(state.noise)
        return 1.0 / left + float(state.noise)

    @blocks.kernel_of(output)
    def _output_kernel(self, state, t):
        return 1.0 / (0.25 - t) + float(state.noise)

    def update(self, state, t):
        state.noise = state.rng.standard_normal()

    @blocks.kernel_of(update)
    def _update_kernel(self, state, t):
        state.noise[...] = state.rng.standard_normal()


class Keeper(blocks.Block):
    """Counts outside of its declared states, in what ``kind`` says; it is called from Python."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    total = blocks.State()
    kind = blocks.param("dict", choices=("dict", "array", "number", "lock"), doc="in what")
    kind: str

    def start(self, state):
        state.kept = {"count": [0.0], "run": state.context, "total": state.total}
        state.number = 0.0
        state.apart = np.zeros(2)
        if self.kind == "lock":
            state.lock = threading.Lock()

    def output(self, state, t, x):
        return x + state.kept["count"][0] + state.number + float(state.apart[1])

    def update(self, state, t, x):
        assert state.kept["run"] is state.context
        assert state.kept["total"] is state.total
        if self.kind == "dict":
            state.kept["count"][0] += 1.0
        elif self.kind == "array":
            state.apart = np.roll(state.apart, 1) + 1.0
        else:
            state.number += 1.0
        state.total += 1.0


def pair(first: blocks.Block, kind: str = "dict") -> runtime.Graph:
    graph = runtime.Graph("pair", dt=1 / 64, until=1.0)
    graph = graph.add("first", first).add("keeper", Keeper(kind=kind))
    return graph.connect("first.out", "keeper.x").probe("first.out").probe("keeper.out")


@pytest.mark.parametrize("kind", ["dict", "array", "number"])
def test_where_python_goes_on_the_run_goes_on_with_a_note(kind: str) -> None:
    graph = pair(Ratio(late=True), kind)
    python, compiled = graph.run(engine="python"), graph.run(engine="compiled")
    assert python.manifest["engine"] == "python"
    assert compiled.manifest["engine"] == "compiled, then python from tick 16"
    assert compiled.manifest["status"] == "complete"
    for name in ("first.out", "keeper.out"):
        np.testing.assert_array_equal(compiled[name], python[name])
    (note,) = [text for text in compiled.notes if "under the Python engine" in text]
    assert note.startswith("block 'first': compiled code ended with ZeroDivisionError: ")
    assert "test_replay.py:" in note and "t = 0.25 s (tick 16)" in note


def test_where_python_raises_the_error_is_pythons() -> None:
    graph = pair(Ratio())
    texts = []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            graph.run(engine=engine)
        texts.append(str(caught.value))
        assert len(caught.value.result["keeper.out"]) == 16
    assert texts[0] == texts[1]
    assert texts[0].startswith("block 'first' at tick 16 (t = 0.25 s): ZeroDivisionError: ")


def test_numpys_infinity_is_no_error_under_either_engine() -> None:
    graph = pair(Share())
    python, compiled = graph.run(engine="python"), graph.run(engine="compiled")
    np.testing.assert_array_equal(compiled["keeper.out"], python["keeper.out"])
    assert python["first.out"].shape == (64, 1) or python["first.out"].shape == (64,)


def test_what_cannot_be_copied_is_named_with_the_failure() -> None:
    with pytest.raises(runtime.SimulationError) as caught:
        pair(Ratio(late=True), "lock").run(engine="compiled")
    text = str(caught.value)
    assert text.startswith("block 'first' at tick 16 (t = 0.25 s): ZeroDivisionError: ")
    assert "since block 'keeper' keeps in state.lock what cannot be copied (lock: " in text


def test_a_checkpoint_says_what_cannot_be_copied() -> None:
    engine = Engine(pair(Ratio(), "lock").program(), 1)
    engine.prepare()
    with pytest.raises(NotCopiedError, match="block 'keeper' keeps in state.lock"):
        engine.state.snapshot()
