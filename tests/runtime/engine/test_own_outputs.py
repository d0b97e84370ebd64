"""What own blocks return is a signal of floats; the taught ways of keeping state compile."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from runtime.engine import Engine
from runtime.engine.compiled import make_kernels
from tests.compilers import needs_compiler

RETURNED: dict[str, Any] = {
    "bool": lambda x: x > 0.0,
    "int": lambda x: int(x),
    "numpy bool": lambda x: np.float64(x) > 0.0,
    "numpy int": lambda x: np.int64(x),
    "numpy float": lambda x: np.float64(x),
}


class Returns(blocks.Block):
    """Returns a float at first, and then something else."""

    out = blocks.Output(blocks.Scalar)
    pair = blocks.Output(blocks.Twist)
    row = blocks.Output(blocks.Vector(2))
    kind: str = blocks.param("bool", choices=tuple(RETURNED), doc="what it returns")

    def output(self, state, t):
        value = RETURNED[self.kind](1.0) if t > 0.0 else 1.0
        return value, (value, 0.5), np.array([value, value])


class Types(blocks.Block):
    """Whether an input is a plain float, as a number."""

    x = blocks.Input(blocks.Scalar)
    pair = blocks.Input(blocks.Twist)
    row = blocks.Input(blocks.Vector(2))
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t, x, pair, row):
        plain = type(x) is float and type(pair[0]) is float and row.dtype == np.float64
        return 1.0 if plain else 0.0


@pytest.mark.parametrize("kind", RETURNED)
@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=needs_compiler)])
def test_signals_are_floats_whatever_an_own_block_returns(kind: str, engine: str) -> None:
    graph = runtime.Graph("own", dt=0.01, until=0.05).add("own", Returns(kind=kind))
    graph = graph.add("types", Types()).add("sum", blocks.Sum())
    for end, port in (("own.out", "x"), ("own.pair", "pair"), ("own.row", "row")):
        graph = graph.connect(end, f"types.{port}")
    graph = graph.connect("own.out", "sum.terms").connect("own.out", "sum.terms")
    result = graph.probe("sum.out").probe("types.out").run(engine=engine)
    np.testing.assert_array_equal(result["sum.out"], np.full(5, 2.0))
    np.testing.assert_array_equal(result["types.out"], np.ones(5))


class Keeps(blocks.Block):
    """Keeps its input and counts, in the ways that the how-to shows."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    count = blocks.Output(blocks.Scalar)
    held = blocks.State()
    n = blocks.State()
    row = blocks.State(2)

    def output(self, state, t):
        return float(state.held), float(state.n)

    def update(self, state, t, x):
        state.held = x if x > 0.5 else -x
        state.n += 1
        state.row[0], state.row[1] = state.row[1], x


@needs_compiler
def test_assigning_to_states_compiles() -> None:
    graph = runtime.Graph("keeps", dt=0.01, until=1.0).add("wave", blocks.Sine(frequency=3.0))
    graph = graph.add("keeps", Keeps()).connect("wave.out", "keeps.x")
    graph = graph.probe("keeps.out").probe("keeps.count").probe("keeps.row")
    python, compiled = graph.run(engine="python"), graph.run(engine="compiled")
    for name in ("keeps.out", "keeps.count", "keeps.row"):
        np.testing.assert_array_equal(compiled[name], python[name])
    assert python["keeps.count"][-1] == 99.0
    network = graph.network
    engine = Engine(graph.program(), 1)
    engine.prepare()
    assert make_kernels(network, engine.state.blocks).refused == {}


LATER: dict[str, Any] = {
    "one number": lambda row: row[:1],
    "a row": lambda row: row.reshape(1, 4),
    "three": lambda row: row[:3],
    "seven": lambda row: np.zeros(7),
    "a float": lambda row: 1.0,
    "texts": lambda row: np.array(["1.0", "2.0", "3.0", "4.0"]),
    "complex": lambda row: row + 0.0j,
}


class Later(blocks.Block):
    """Returns four numbers, and from 0.03 s on something else."""

    x = blocks.Input(blocks.Scalar)
    row = blocks.Output(blocks.Vector(4))
    kind: str = blocks.param("three", doc="what it returns then")

    def output(self, state, t, x):
        row = np.array([x, 1.0, 2.0, 3.0])
        return LATER[self.kind](row) if t > 0.025 else row


class Shorter(blocks.Block):
    """The same, compiled."""

    x = blocks.Input(blocks.Scalar)
    row = blocks.Output(blocks.Vector(4))

    def output(self, state, t, x):
        size = 4
        if t > 0.025:
            size = 1
        return np.zeros(size) + x


ENGINES = ["python", pytest.param("compiled", marks=needs_compiler)]
EXPECTED = "output 'row' must be a float64 array of shape (4,), got "


def later(block: blocks.Block) -> runtime.Graph:
    graph = runtime.Graph("later", dt=0.01, until=0.1).add("s", blocks.Sine()).add("b", block)
    graph = graph.add("n", blocks.Norm()).connect("s.out", "b.x").connect("b.row", "n.inputs")
    return graph.probe("n.out").probe("b.row")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("block", [*(Later(kind=kind) for kind in LATER), Shorter()], ids=str)
def test_the_form_of_an_output_is_checked_at_each_tick(block: blocks.Block, engine: str) -> None:
    place = "block 'b' at tick 3 (t = 0.03 s): "
    with pytest.raises(runtime.SimulationError) as caught:
        later(block).run(engine=engine)
    assert str(caught.value).startswith(place + EXPECTED)
    session = later(block).session(engine=engine).step(3)
    with pytest.raises(runtime.SimulationError) as caught:
        session.step()
    assert str(caught.value).startswith(place + EXPECTED)


class Several(blocks.Block):
    """Two outputs at first, of other forms later."""

    x = blocks.Output(blocks.Scalar)
    twist = blocks.Output(blocks.Twist)
    kind: int = blocks.param(0, doc="what is wrong")

    def output(self, state, t):
        wrong = [1.0, (1.0, 2.0, 3.0)], [1.0], ("1.0", (1.0, 2.0)), (1.0, [1.0, 2.0])
        return (*wrong, np.ones(2))[self.kind] if t > 0.0 else (1.0, (1.0, 2.0))


@pytest.mark.parametrize("kind", range(5))
@pytest.mark.parametrize("engine", ENGINES)
def test_numbers_and_records_are_checked_too(kind: int, engine: str) -> None:
    graph = runtime.Graph("several", dt=0.01, until=0.1).add("b", Several(kind=kind))
    what = "output 'x' must be a float|output 'twist' must be a tuple|a tuple of its outputs"
    with pytest.raises(runtime.SimulationError, match=rf"block 'b' at tick 1 \(.*({what})"):
        graph.probe("b.x").probe("b.twist").run(engine=engine)


class Rates(blocks.Block):
    """Three continuous states, whose rate of change is later one number for all."""

    out = blocks.Output(blocks.Vector(3))
    h = blocks.State(3, continuous=True)

    def output(self, state, t):
        return state.h.copy()

    def derivative(self, state, t):
        return np.ones(1 if t > 0.025 else 3)


@pytest.mark.parametrize("engine", ENGINES)
def test_rates_of_change_are_not_repeated_to_fit(engine: str) -> None:
    graph = runtime.Graph("rates", dt=0.01, until=0.1).add("b", Rates()).probe("b.out")
    with pytest.raises(runtime.SimulationError, match=r"block 'b' .*'h' must be numbers of shape"):
        graph.run(engine=engine)
