"""Every block type of the library in a graph of its own, fed with random signals."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

import runtime
from blocks import Block, Output, SignalType
from runtime.checking.bench import random_value
from runtime.checking.check import context_for
from tests.runtime.engine.test_compiled_blocks import CASES, Case

TICKS = 40
NUMBERS = itertools.count()
WORLD = {"room": [[-3, -3], [3, -3], [3, 3], [-3, 3]]}


def feed(kind: SignalType, dt: float, make: Callable[[np.random.Generator], Any]) -> Block:
    """A source of random values of a type, the same in every run."""
    draw = np.random.default_rng(0)
    values = [make(draw) for _ in range(TICKS + 1)]
    if kind.form == "array":  # an output of a run is not NaN, a miss is infinite
        values = [np.where(np.isnan(value), np.inf, value) for value in values]

    def output(self: Block, state: Any, t: float) -> Any:
        """A value."""
        return values[round(t / dt) % len(values)]

    name = f"Feed{next(NUMBERS)}"  # types are known by name
    made: Block = type(name, (Block,), {"out": Output(kind, doc="value"), "output": output})()
    return made


def graph_of(case: Case) -> runtime.Graph:
    """A graph with the block of a case, named ``block``, and a source for each input."""
    context = context_for(case.block, case.types, case.dt, case.world)
    graph = runtime.Graph("one", dt=case.dt, until=TICKS * case.dt).set("world", WORLD)
    graph = graph.add("block", case.block)
    for port, declared in case.block.spec.inputs.items():
        if case.absent and declared.optional:
            continue
        kind = context.types[port]
        make = case.inputs.get(port, lambda draw, k=kind: random_value(k, draw, case.dt))
        for i in range(len(context.terms[port]) if declared.variadic else 1):
            name = f"{port}_{i}"
            graph = graph.add(name, feed(kind, case.dt, make)).connect(
                f"{name}.out", f"block.{port}"
            )
    return graph


def first_cases() -> dict[str, Case]:
    return {name: cases[0] for name, cases in CASES.items()}
