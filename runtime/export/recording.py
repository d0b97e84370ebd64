"""A recorded run to compare a controller with, and the C text run natively against it."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine import Engine, Program
from runtime.errors import UsageError
from runtime.export.files import Replay
from runtime.export.selection import Port, Selection
from runtime.export.step import Layout
from runtime.graph import Graph
from runtime.observation import RunData
from runtime.toolchain import Unit, build

AnyArray = np.ndarray[Any, Any]
Learnt = Mapping[tuple[str, str], FloatArray]  # block and state to values
MOST_NUMBERS = 200_000  # in the tables of a test
USUAL_TICKS, USUAL_ROWS = 1000, 50
FILL = 0xA5


class StartedEngine(Engine):
    """An engine whose blocks start with what was learnt before."""

    def __init__(self, program: Program, seed: int, learnt: Learnt) -> None:
        super().__init__(program, seed)
        self.learnt = learnt

    def _start(self) -> None:
        super()._start()
        for (block, state), values in self.learnt.items():
            getattr(self.states[block], state)[...] = values


def learnt_of(run: RunData, selection: Selection, states: tuple[str, ...]) -> Learnt:
    """What a run recorded last of the states that learn, such as weights.

    Raises
    ------
    UsageError : it recorded none of them, or of another shape.
    """
    found: dict[tuple[str, str], FloatArray] = {}
    wanted = []
    for block in selection.blocks:
        for state in selection.network.entries[block].cls.spec.states:
            if state not in states:
                continue
            address = f"{block}.{state}"
            wanted.append(address)
            for probe in run.probes.values():
                if address in probe.addresses and len(probe.values):
                    first, last = probe.addresses[address]
                    row = probe.values[-1]
                    found[block, state] = row if probe.values.ndim != 2 else row[first:last]
    missing = [name for name in wanted if tuple(name.rsplit(".", 1)) not in found]
    if not wanted:
        raise UsageError("--learnt: nothing that is exported learns")
    if missing:
        probes = ", ".join(missing)
        message = f"--learnt: the run did not record {probes}; record each with a probe, as in"
        raise UsageError(f"{message} 'probes: {{learnt: {{of: {missing[0]}, every: 1000}}}}'")
    return found


def usual_ticks(selection: Selection) -> int:
    """Ticks that show every rate, in tables of a moderate size."""
    ports = (*selection.inputs, *selection.outputs)
    slowest = max(selection.every(port) for port in ports)
    ticks = min(selection.network.ticks, max(USUAL_TICKS, USUAL_ROWS * slowest))
    layout_free = sum(_numbers(selection, port) / selection.every(port) for port in ports)
    return max(1, min(ticks, int(MOST_NUMBERS / max(layout_free, 1e-9))))


def _numbers(selection: Selection, port: Port) -> int:
    kind = selection.network.types[port]
    return int(np.prod(kind.shape)) if kind.form == "array" else len(kind.components) or 1


def record(graph: Graph, selection: Selection, learnt: Learnt, ticks: int) -> Replay:
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
    engine = StartedEngine(graph.program(), graph.network.seed, learnt)
    outcome = engine.run()
    if outcome.error is not None:
        raise outcome.error
    values = {
        port: np.asarray(outcome.arrays[name], dtype=np.float64).reshape(
            -1, _numbers(selection, port)
        )
        for port, name in names.items()
    }
    return Replay(outcome.ticks, values)


@dataclass(frozen=True)
class Native:
    """What a native run of the C text showed.

    largest : for each output, the largest difference, divided by 1 + |recorded value|.
    arena : bytes of the arena that were used. size : bytes of the struct.
    """

    largest: dict[Port, float]
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
    library = build([Unit(name, text)]).functions
    number = np.float32 if float32 else np.float64
    size = int(getattr(library, f"{name}_size")())
    memory = np.full(size, FILL, dtype=np.uint8)
    inputs, outputs = layout.selection.inputs, layout.selection.outputs
    given = np.zeros(max(1, sum(map(layout.count, inputs))), dtype=number)
    made = np.zeros(sum(map(layout.count, outputs)), dtype=number)
    step, message = getattr(library, f"{name}_step"), getattr(library, f"{name}_message")
    message.restype = ctypes.c_char_p
    places = [ctypes.c_void_p(array.ctypes.data) for array in (memory, given, made)]
    getattr(library, f"{name}_init")(places[0])
    largest = dict.fromkeys(outputs, 0.0)
    for tick in range(replay.ticks):
        _rows(layout, inputs, replay, tick, given)
        failure = step(*places)
        if failure:
            text = message(failure).decode()
            raise UsageError(f"the exported text fails at tick {tick} of the recording: {text}")
        at = 0
        for port in outputs:
            row = replay.values[port][tick // layout.selection.every(port)]
            found = made[at : at + len(row)].astype(np.float64)
            at += len(row)
            with np.errstate(invalid="ignore"):
                apart = np.where(found == row, 0.0, np.abs(found - row) / (1.0 + np.abs(row)))
            largest[port] = max(largest[port], float(np.max(apart, initial=0.0)))
    return Native(largest, _used(memory, 8 * layout.arena_words), size)


def _rows(
    layout: Layout, ports: tuple[Port, ...], replay: Replay, tick: int, into: AnyArray
) -> None:
    at = 0
    for port in ports:
        row = replay.values[port][tick // layout.selection.every(port)]
        into[at : at + len(row)] = row
        at += len(row)


def _used(memory: AnyArray, arena: int) -> int:
    """How many bytes of the arena, the last member, were written to."""
    changed = np.flatnonzero(memory[memory.size - arena :] != FILL)
    return int(changed[-1]) + 1 if changed.size else 0
