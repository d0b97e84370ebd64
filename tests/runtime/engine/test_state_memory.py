"""Memory of a block that others can read: right numbers or an error, under both engines."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Input, Output, State, Vector

TICKS = 8
ENGINES = ("python", "compiled")


class Counts(blocks.Block):
    """Counts its ticks in both components of a state; subclasses return the count."""

    out = Output(Vector(2))
    m = State(2)

    def output(self, state, t):
        return state.m

    def update(self, state, t):
        for i in range(2):
            state.m[i] += 1.0


class View(Counts):
    """Returns a part of its state instead of the whole."""

    wide = State(4)

    def output(self, state, t):
        return state.wide[1:3]

    def update(self, state, t):
        for i in range(4):
            state.wide[i] += 1.0


class Sometimes(Counts):
    """Returns the state itself, only from the fourth tick on."""

    def output(self, state, t):
        if t > 0.025:
            return state.m
        return state.m.copy()


class Undeclared(Counts):
    """Counts in an array that is not declared as a state."""

    def start(self, state):
        state.buffer = np.zeros(2)

    def output(self, state, t):
        return state.buffer

    def update(self, state, t):
        for i in range(2):
            state.buffer[i] += 1.0


class Rebinds(Counts):
    """Assigns a new array to its state."""

    def update(self, state, t):
        state.m = state.m + 1.0


class RebindsAtStart(Counts):
    """Assigns at the start, too, and a plain number."""

    def start(self, state):
        state.m = -5.0
        state.m, state.note = np.zeros(2), "counts"


class Striped(Counts):
    """Counts in every other cell of a table, by a view that is kept."""

    table = State(4)

    def start(self, state):
        state.stripe = state.table[::2]

    def output(self, state, t):
        return state.table[::2]

    def update(self, state, t):
        for i in range(2):
            state.stripe[i] += 1.0


def behind(block: blocks.Block, name: str = "count") -> runtime.Graph:
    """The block, then a delay that is updated after the block because of its name."""
    graph = runtime.Graph("memory", dt=0.01, until=0.01 * TICKS).add(name, block)
    graph = graph.add("zdelay", blocks.UnitDelay()).connect(f"{name}.out", "zdelay.input")
    return graph.probe("out", f"{name}.out").probe("delayed", "zdelay.out")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "block", [Counts(), View(), Sometimes(), Undeclared(), Rebinds(), RebindsAtStart(), Striped()]
)
def test_an_output_keeps_its_value_after_the_tick(block: Any, engine: str) -> None:
    result = behind(block).probe("kept", "count.m").run(engine=engine)
    count = np.arange(TICKS, dtype=float)
    np.testing.assert_array_equal(result["out"], np.column_stack((count, count)))
    delayed = np.maximum(count - 1.0, 0.0)
    np.testing.assert_array_equal(result["delayed"], np.column_stack((delayed, delayed)))
    if type(block).update in (Counts.update, Rebinds.update):
        np.testing.assert_array_equal(result["kept"], result["out"])


class InATable(Counts):
    """Keeps the array that it returns in a place that no engine checks."""

    def start(self, state):
        state.table = {"count": np.zeros(2)}

    def output(self, state, t):
        return state.table["count"]

    def update(self, state, t):
        state.table["count"] += 1.0


class Writes(blocks.Block):
    """Writes into its input, from the fourth tick on."""

    x = Input(Vector(2))
    out = Output(Vector(2))

    def output(self, state, t, x):
        if t > 0.025:
            x[0] = 7.0
        return 1.0 * x


class WritesByHelper(Writes):
    """Writes into a part of its input, in a helper."""

    def _spoil(self, row):
        row[0] = 7.0

    def output(self, state, t, x):
        if t > 0.025:
            self._spoil(x[1:])
        return 1.0 * x


def refused(graph: runtime.Graph) -> set[str]:
    message = set()
    for engine in ENGINES:
        with pytest.raises(runtime.SimulationError) as caught:
            graph.run(engine=engine)
        message.add(str(caught.value))
    return message


def test_a_hidden_array_is_refused_by_both_engines() -> None:
    (message,) = refused(behind(InATable()))
    assert message.startswith("block 'count' at tick 0 (t = 0 s): ValueError: ")
    assert "read-only: write to a copy" in message


@pytest.mark.parametrize("block", [Writes(), WritesByHelper()])
def test_a_block_that_writes_into_its_input_is_refused_by_both_engines(
    block: blocks.Block,
) -> None:
    graph = behind(Counts()).add("bad", block).connect("count.out", "bad.x").probe("bad.out")
    (message,) = refused(graph)
    assert message.startswith("block 'bad' at tick 3 (t = 0.03 s): ValueError: ")
    assert f"({os.path.relpath(__file__)}:" in message
    assert "read-only: write to a copy" in message


def test_a_state_of_another_shape_is_refused_with_both_shapes() -> None:
    class Grows(Counts):
        """Assigns three numbers to two."""

        def update(self, state, t):
            state.m = np.zeros(3)

    (message,) = refused(behind(Grows()))
    assert "block 'count' at tick 0" in message
    assert "shape (3,) into shape (2,)" in message


class Lettered(Counts):
    """Has an output called b, the name of its fields in compiled text."""

    b = Output(Vector(2))

    def output(self, state, t):
        return state.m, 2.0 * state.m


@pytest.mark.parametrize("name", ["own", "seen", "report", "at", "sealed", "overlap", "dt"])
def test_a_block_may_have_any_name(name: str) -> None:
    graph: Any = behind(Lettered(), name).probe("b", f"{name}.b")
    graph = (
        graph.add("table", InPython()).connect(f"{name}.b", "table.x").probe("seen", "table.out")
    )
    result = graph.run(engine="compiled")
    np.testing.assert_array_equal(result["b"][:, 0], 2.0 * np.arange(TICKS))
    np.testing.assert_array_equal(result["seen"], result["b"])


class InPython(blocks.Block):
    """Passes its input on, and does not compile."""

    x = Input(Vector(2))
    out = Output(Vector(2))

    def start(self, state):
        state.table = {}

    def output(self, state, t, x):
        return state.table.get("none", x)
