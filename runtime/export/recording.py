"""A recorded run to compare a controller with, and the C text run natively against it."""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine import Engine
from runtime.errors import UsageError
from runtime.export.files import Replay
from runtime.export.layout import Layout
from runtime.export.selection import Selection
from runtime.graph import Graph
from runtime.plan import Port, numbers_in
from runtime.toolchain import TranslationUnit, build

AnyArray = np.ndarray[Any, Any]
TOLERANCE = 1e-9  # of double, where only the last bits may differ
FLOAT_TOLERANCE = 1e-3  # of float32, a share of an output's range
MOST_NUMBERS = 200_000  # of inputs and of outputs in the tables of a test
MOST_TICKS = 50_000  # of a run that is recorded whole: seconds in Python
USUAL_ROWS = 1000  # of outputs that a test compares after its first ticks
FILL = 0xA5


def usual_ticks(selection: Selection) -> int:
    """The whole run, or as much of it as fits into tables of a moderate size."""
    network = selection.network
    given = sum(numbers_in(network.types[p]) / selection.every(p) for p in selection.inputs)
    return max(1, min(network.ticks, MOST_TICKS, int(MOST_NUMBERS / max(given, 1e-9))))


def thinned(selection: Selection, ticks: int) -> int:
    """On each so many of the ticks a test compares: spread over all of them, in every phase of
    slower outputs, in tables of a moderate size.
    """
    numbers = sum(numbers_in(selection.network.types[port]) for port in selection.outputs)
    rows = min(USUAL_ROWS, max(1, MOST_NUMBERS // max(1, numbers)))
    rates = math.lcm(*(selection.every(port) for port in selection.outputs))
    return next(n for n in itertools.count(-(-ticks // rows)) if math.gcd(n, rates) == 1)


def record(graph: Graph, selection: Selection, ticks: int) -> Replay:
    """Run the graph under the Python engine, and record what goes in and out.

    Raises
    ------
    SimulationError : the run fails.
    """
    for section in ("plots", "metrics", "probes"):
        graph = graph.set(section, {})
    graph = graph.set("run.until", ticks * selection.network.dt).set("run.engine", "python")
    names: dict[Port, str] = {}
    for i, port in enumerate((*selection.inputs, *selection.outputs)):
        names[port] = f"port_{i}"
        graph = graph.probe(names[port], ".".join(port), every=selection.every(port))
    outcome = Engine(graph.program(), graph.network.seed).run()
    if outcome.error is not None:
        raise outcome.error
    values = {
        port: np.asarray(outcome.arrays[name], dtype=np.float64).reshape(
            -1, numbers_in(selection.network.types[port])
        )
        for port, name in names.items()
    }
    ran = outcome.ticks
    run = selection.network.ticks if ran == ticks else ran  # shorter where the run ends itself
    return Replay(ran, values, run, thinned(selection, ran))


def still(replay: Replay, outputs: Sequence[Port]) -> list[str]:
    """The outputs that have one value in the whole recording, by name."""
    return [".".join(p) for p in outputs if not np.ptp(replay.values[p], axis=0).any()]


@dataclass(frozen=True)
class Native:
    """What a native run of the C text showed.

    largest : for each output, the largest difference, divided by 1 + |recorded value|, or of
        float32 by its range.
    equal : ticks before the first such difference above TOLERANCE.
    arena : bytes of the arena that were used. size : bytes of the struct.
    """

    largest: dict[Port, float]
    equal: int
    arena: int
    size: int

    @property
    def worst(self) -> float:
        return max(self.largest.values())


def run_natively(layout: Layout, header: str, source: str, replay: Replay, float32: bool) -> Native:
    """Compile the C text for this machine, replay the recording, and compare.

    Raises
    ------
    MissingCompilerError, BuildError : it cannot be compiled.
    UsageError : a step fails.
    """
    name = layout.name
    text = source.replace(f'#include "{name}.h"', header)
    text += f"\nint64_t {name}_size(void);\nint64_t {name}_size(void)\n"
    text += f"{{\n    return (int64_t)sizeof(struct {name});\n}}\n"
    most = "c->arena_most" if layout.units.open else f"(void)c, {layout.units.reserved}"
    text += f"\nint64_t {name}_used(const struct {name} *c);\nint64_t {name}_used"
    text += f"(const struct {name} *c)\n{{\n    return {most};\n}}\n"
    library = build([TranslationUnit(name, text)]).functions
    number = np.float32 if float32 else np.float64
    size = int(getattr(library, f"{name}_size")())
    memory = np.full(size, FILL, dtype=np.uint8)  # init must not need zeros
    inputs, outputs = layout.selection.inputs, layout.selection.outputs
    given = np.zeros(max(1, sum(map(layout.count, inputs))), dtype=number)
    made = np.zeros(sum(map(layout.count, outputs)), dtype=number)
    step, message = getattr(library, f"{name}_step"), getattr(library, f"{name}_message")
    message.restype = ctypes.c_char_p
    places = [ctypes.c_void_p(array.ctypes.data) for array in (memory, given, made)]
    getattr(library, f"{name}_init")(places[0])
    found = np.empty((replay.ticks, made.size))
    stopped = layout.failures[("stopped",)][0]
    for tick in range(replay.ticks):
        _rows(layout, inputs, replay, tick, given)
        failure = step(*places)
        if failure and not (failure == stopped and tick + 1 == replay.ticks):
            text = message(failure).decode()
            raise UsageError(f"the exported C fails at tick {tick} of the recording: {text}")
        found[tick] = made
    largest, equal = _apart(layout, replay, found, float32)
    return Native(largest, equal, int(getattr(library, f"{name}_used")(places[0])), size)


def _apart(
    layout: Layout, replay: Replay, found: FloatArray, float32: bool
) -> tuple[dict[Port, float], int]:
    """The largest difference of each output, and the ticks before one is above TOLERANCE."""
    largest: dict[Port, float] = {}
    at, equal = 0, replay.ticks
    for port in layout.selection.outputs:
        rows = replay.values[port][np.arange(replay.ticks) // layout.selection.every(port)]
        own = found[:, at : at + rows.shape[1]]
        at += rows.shape[1]
        with np.errstate(invalid="ignore"):
            scale = replay.range_of(port) if float32 else 1.0 + np.abs(rows)
            apart = np.where(own == rows, 0.0, np.abs(own - rows) / scale)
        largest[port] = float(np.max(apart, initial=0.0))
        wrong = ~(apart <= TOLERANCE).all(axis=1)
        equal = min(equal, int(wrong.argmax())) if wrong.any() else equal
    return largest, equal


def _rows(
    layout: Layout, ports: tuple[Port, ...], replay: Replay, tick: int, into: AnyArray
) -> None:
    at = 0
    for port in ports:
        row = replay.values[port][tick // layout.selection.every(port)]
        into[at : at + len(row)] = row
        at += len(row)
