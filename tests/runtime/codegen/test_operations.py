"""Operations of exported C: counted by hand, and followed through arguments and results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import runtime
from blocks import Block, Output, Scalar, State
from blocks.core import BlockState
from runtime.codegen import FLOAT, Array, Counter, Entry, Operations, Type, Writer, stored
from runtime.compiler import translate_functions
from runtime.engine import Engine
from runtime.engine.compiled import make_kernels

Numbers = Any  # arrays in C

MATRIX: dict[str, Type] = {"a": Array("float", (None, None)), "b": Array("float", (None,))}
VECTOR: dict[str, Type] = {"a": Array("float", (None,)), "b": Array("float", (None,))}


def functions(function: Callable[..., Any], kinds: dict[str, Type]) -> Any:
    entry = Entry("entry", function.__name__, list(kinds.items()), [FLOAT])
    return Writer(translate_functions([function])).unit([entry]).functions


def counted(function: Callable[..., Any], kinds: dict[str, Type], **sizes: int) -> Operations:
    """The operations of a function for arrays of these sizes."""
    made = functions(function, kinds)
    given = [sizes.get(name) for _, name in made[function.__name__].parameters]
    return Counter(made).call(function.__name__, given, {})[0]


def rows_by_vector(a: Numbers, b: Numbers) -> float:
    total = 0.0
    for i in range(a.shape[0]):
        for k in range(a.shape[1] - 1, -1, -1):
            total += a[i, k] * b[k]
    return total


def both(a: Numbers, b: Numbers) -> float:
    total = rows_by_vector(a, b) + rows_by_vector(a, b)
    while total > 1.0:
        total = total / 2.0
    return total


def test_loops_over_known_sizes_are_counted() -> None:
    found = counted(both, MATRIX, a_n0=4, a_n1=3, b_n0=3)
    # Twice a product and a sum in each of 4 x 3 passes, and the sum of both.
    assert found.arithmetic == 2 * 2 * 4 * 3 + 1
    assert (found.divisions, found.open_loops) == (1, 1)


def test_a_loop_of_unknown_length_is_one_pass() -> None:
    found = counted(both, MATRIX, a_n1=3, b_n0=3)
    assert found.arithmetic == 2 * 2 * 3 + 1
    assert found.open_loops == 1 + 1 + 1


def halves(a: Numbers, b: Numbers) -> float:
    few = np.flatnonzero(a)
    last = few[-2:]
    made = 2.0 * b[few]
    return float(made[0]) + float(len(last))


def test_what_depends_on_data_is_bounded_by_what_it_is_found_in() -> None:
    found = counted(halves, VECTOR, a_n0=5, b_n0=5)
    assert (found.is_open, found.open_loops) == (False, 0)
    # The places, the elements there, and their doubles.
    assert found.reserved == 3 * 5 * 8
    assert counted(halves, VECTOR).is_open


def small(x: float) -> float:
    return x * x + 1.0


def of_all(a: Numbers, b: Numbers) -> float:
    total = 0.0
    for i in range(len(a)):
        total += small(a[i])
    return total + b[0]


def test_functions_that_take_numbers_alone_are_counted() -> None:
    assert counted(of_all, VECTOR, a_n0=7).arithmetic == 7 * (2 + 1) + 1


def put(to: Numbers, source: Numbers) -> None:
    to[0] = source[0]


class Stores(Block):
    """Writes to two of its states."""

    out = Output(Scalar, doc="value")
    a = State(3, doc="written to by a function")
    b = State(3, doc="read")
    c = State(5, doc="written to by another name")

    def output(self, state: BlockState, t: float) -> float:
        """An element."""
        return float(state.b[1])

    def update(self, state: BlockState, t: float) -> None:
        """Write, through another name and in a function."""
        part = state.c[2:]
        put(state.a, state.b)
        part[1] += state.b[0] * 2.0


def test_a_store_is_followed_through_names_and_calls() -> None:
    engine = Engine(runtime.Graph("one", dt=0.1, until=1.0).add("one", Stores()).program(), 0)
    engine.prepare()
    kernels = make_kernels(engine.network, engine.state.blocks, typed=True)
    kernel = kernels.compiled["one"]
    assert stored(kernel.functions, kernel.symbols.values()) == {"state_a", "state_c"}
    assert stored(kernel.functions, [kernel.symbols["output"]]) == frozenset()
