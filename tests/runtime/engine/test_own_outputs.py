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
