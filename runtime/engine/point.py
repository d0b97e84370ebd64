"""A graph as two functions of numbers, for its linearization: what a tick does, and the rates.

In: an engine whose run has come to a tick. Out: a :class:`Point`, whose columns are the continuous
states x, the states z of sampled blocks, and the outputs w that hold between ticks. For a gain with
``dt`` that drives an integrator: x = (integral), w = (gain.out), ``rates`` gives x' = w, and
``tick`` writes w = gain * x.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import FloatArray, SignalType
from runtime.engine.engine import Engine
from runtime.engine.program import FILENAME, Program
from runtime.engine.python_text import PythonText
from runtime.engine.state import Held, Snapshot
from runtime.network import Endpoint
from runtime.plan import (
    ALWAYS,
    Argument,
    Call,
    Operation,
    Port,
    Restore,
    Signal,
    Solve,
    Source,
    Test,
    Zero,
)


@dataclass(frozen=True)
class Watched:
    """A whole output, or state, of a linearization, and which of its numbers; None for all."""

    end: Endpoint
    is_state: bool = False
    numbers: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Offsets:
    """The numbers u that are added to signals, or that replace one of them where it is cut.

    first : the first number of each signal: inputs and outputs of blocks.
    cut : a signal that its readers do not get, and its components that they do not; all, if empty.
    """

    first: Mapping[Port, int] = field(default_factory=dict)
    cut: Port | None = None
    components: tuple[int, ...] = ()


# A whole signal or state, and which of its numbers are wanted; None for all.
Picked = tuple[Source, tuple[int, ...] | None]


class PointText(PythonText):
    """Writes ``probe_tick(k, t, held, u)`` and ``probe_flow(t, held, u)``.

    Names of a plan never begin with ``probe_``, so that these are free.
    """

    def __init__(self, program: Program, offsets: Offsets) -> None:
        super().__init__(program.plan, program.names)
        self.offsets = offsets
        self.depth = 1
        self.is_inside = True

    def tick(
        self, operations: Sequence[Operation], held: Sequence[Signal], watched: Sequence[Picked]
    ) -> None:
        """All outputs and updates of a tick; returns what holds after it, and what is watched."""
        names = ", ".join(map(self.names.of, held))
        first = [each for each in operations if _outputs(each)]
        last = [
            each
            for each in operations
            if isinstance(each, (Call, Zero, Restore)) and not _outputs(each)
        ]
        self.begin("probe_tick(k, t, held, probe_u)", held)
        self.operations(first)
        self.at(ALWAYS)
        self.watch(watched)
        self.operations(last)
        self.at(ALWAYS)
        self.line(1, f"return ({names},), probe_y" if names else "return (), probe_y")

    def flow(
        self, operations: Sequence[Operation], held: Sequence[Signal], watched: Sequence[Picked]
    ) -> None:
        """The outputs that move between ticks, and the rates of change."""
        self.begin("probe_flow(t, held, probe_u)", held)
        self.line(1, "stage = 0")
        self.operations(operations)
        self.at(ALWAYS)
        self.watch(watched)
        self.line(1, f"return {'slopes[0].tolist()' if self.plan.row.size else '[]'}, probe_y")

    def begin(self, signature: str, held: Sequence[Signal]) -> None:
        self.rate = ALWAYS
        self.line(0, f"def {signature}:")
        if held:
            self.line(1, f"({', '.join(map(self.names.of, held))},) = held")
        self.at(ALWAYS)

    def watch(self, watched: Sequence[Picked]) -> None:
        self.code("probe_y = []")
        for source, numbers in watched:
            # What is behind a cut is what its block computes, not what its readers get.
            key = source.whole.key if isinstance(source.whole, Signal) else None
            self.is_inside = key is None or key != self.offsets.cut
            chosen = "" if numbers is None else f"[{list(numbers)}]"
            self.code(f"probe_y += array({self.source(source)}).ravel(){chosen}.tolist()")
            self.is_inside = True

    def argument(self, argument: Argument) -> str:
        text = super().argument(argument)
        return self.moved(text, (argument.block, argument.port), argument.kind)

    def source(self, source: Source, target: SignalType | None = None) -> str:
        whole = source.whole
        if not isinstance(whole, Signal) or whole.key not in self.offsets.first:
            return super().source(source, target)
        # The component is taken of the whole, which has the offsets.
        plain = super().source(Source(whole))
        moved = self.moved(plain, whole.key, whole.kind)
        return super().source(source, target).replace(plain, moved, 1)

    def moved(self, text: str, port: Port, kind: SignalType) -> str:
        """An expression plus its offsets, or what replaces it where it is cut."""
        if port not in self.offsets.first or not self.is_inside:
            return text
        first, size = self.offsets.first[port], math.prod(kind.shape)
        given = [f"probe_u[{i}]" for i in range(first, first + size)]
        inside = self.offsets.components if port == self.offsets.cut else ()
        if port == self.offsets.cut and not inside:
            inside = tuple(range(size))
        if kind.form == "scalar":
            return given[0] if inside else f"({text} + {given[0]})"
        if kind.form == "record":
            parts = [
                given[i] if i in inside else f"({text})[{i}] + {given[i]}" for i in range(size)
            ]
            return f"({', '.join(parts)},)"
        moved = f"array(probe_u[{first}:{first + size}]).reshape({kind.shape!r})"
        if not inside:
            return f"({text} + {moved})"
        kept = np.array([0.0 if i in inside else 1.0 for i in range(size)]).reshape(kind.shape)
        return f"(array({kept.tolist()!r}) * {text} + {moved})"


def _outputs(each: Operation) -> tuple[Signal, ...]:
    return each.outputs if isinstance(each, (Call, Solve, Test, Zero)) else ()


@dataclass(eq=False)
class Point:
    """A graph at one tick, as functions of its columns (x, z, w) and of u.

    Parameters
    ----------
    engine : its run has come to the tick.
    tick_number : the tick; time is held there.
    sampled : the blocks whose states are columns.

    ``columns`` are the addresses of the numbers.
    """

    engine: Engine
    tick_number: int
    sampled: Collection[str]
    offsets: Offsets
    watched: Sequence[Watched]
    saved: Snapshot = field(init=False)
    functions: tuple[Callable[..., Any], Callable[..., Any]] = field(init=False)

    def __post_init__(self) -> None:
        text = PointText(self.engine.program, self.offsets)
        sources = [(self._source(each), each.numbers) for each in self.watched]
        operations = self.engine.plan.operations
        text.tick(operations, self.held, sources)
        text.flow(self._moving, self.held, sources)
        exec(compile("\n".join(text.text) + "\n", FILENAME, "exec"), self.engine.namespace)
        namespace = self.engine.namespace
        self.functions = namespace["probe_tick"], namespace["probe_flow"]
        for name, entry in self.engine.network.entries.items():
            entry.block.before_differences(self.engine.state.blocks[name])
        self.saved = self.engine.state.snapshot()

    @property
    def t(self) -> float:
        return self.tick_number * self.engine.network.dt

    @cached_property
    def _moving(self) -> list[Operation]:
        """What may change between ticks: outputs of continuous and memoryless blocks, and rates."""
        entries, plan = self.engine.network.entries, self.engine.plan
        moving = {n for n, e in entries.items() if e.cls.spec.continuous or e.is_memoryless}
        found = [
            each
            for each in plan.operations
            if _outputs(each) and (each.block in moving or isinstance(each, Solve))
        ]
        if plan.integration is not None:
            stage = plan.integration.stage
            found += [e for e in stage if isinstance(e, (Call, Zero)) and not e.outputs]
        return found

    @cached_property
    def held(self) -> tuple[Signal, ...]:
        """The signals that hold between ticks, as far as anything reads them there."""
        plan = self.engine.plan
        calls = [each for each in self._moving if isinstance(each, (Call, Solve))]
        moving = {s.key for each in calls for s in each.outputs}
        read = {s.key: s for each in calls for s in each.reads}
        read |= {s.key: s for each in self._moving for s in each.gate.switches}
        sources = [self._source(each).whole for each in self.watched]
        read |= {s.key: s for s in sources if isinstance(s, Signal)}
        varying = {s.key for c in plan.evaluations if not c.gate.once for s in c.outputs}
        found = {s.key: s for s in plan.held}
        found |= {k: s for k, s in read.items() if k in varying and k not in moving}
        return tuple(found.values())

    @cached_property
    def _states(self) -> list[tuple[str, FloatArray, FloatArray | None]]:
        """Arrays of states of sampled blocks, by address; of a ring, with where it begins."""
        found: list[tuple[str, FloatArray, FloatArray | None]] = []
        for name in sorted(self.sampled):
            spec, state = self.engine.network.entries[name].cls.spec, self.engine.state.blocks[name]
            heads = {each.ring for each in spec.states.values()}
            for key, declared in spec.states.items():
                if declared.continuous or declared.cached or declared.event or key in heads:
                    continue
                head = getattr(state, declared.ring) if declared.ring else None
                found.append((f"{name}.{key}", getattr(state, key), head))
        return found

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The addresses of the numbers of x, z and w."""
        row = self.engine.plan.row
        names = [slot.address(i) for slot in row.slots for i in range(slot.start, slot.stop)]
        for address, array, _ in self._states:
            names += [f"{address}.{i}" for i in range(array.size)] if array.shape else [address]
        for signal in self.held:
            names += labels(str(signal), signal.kind)
        return tuple(names)

    @cached_property
    def sizes(self) -> tuple[int, int, int]:
        """How many numbers x, z and w have."""
        n, z = self.engine.plan.row.size, sum(array.size for _, array, _ in self._states)
        return n, z, len(self.columns) - n - z

    @property
    def shapes(self) -> list[tuple[str, tuple[int, ...]]]:
        """The states x and z by address, with their shapes, in the order of the columns."""
        row = [(str(slot), slot.shape) for slot in self.engine.plan.row.slots]
        return row + [(address, array.shape) for address, array, _ in self._states]

    def values(self) -> FloatArray:
        """The columns as the engine has them, with w as of before the tick."""
        parts = [self.engine.state.continuous]
        parts += [_turned(array, head) for _, array, head in self._states]
        found = dict(zip(self.engine.plan.held, self.saved.held, strict=True))
        held = tuple(found.get(signal, signal.kind.zero()) for signal in self.held)
        return np.concatenate([*(part.ravel() for part in parts), self._flat(held)])

    def tick(self, k: int, columns: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The columns after a tick with number k, and what is watched, before its updates."""
        self._set(columns)
        held, y = _call(self.functions[0], k, self.t, self._held(columns), u.tolist())
        parts = [self.engine.state.continuous]
        parts += [_turned(array, head) for _, array, head in self._states]
        after = np.concatenate([*(part.ravel() for part in parts), self._flat(held)])
        return after, np.array(y)

    def flow(self, columns: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The rates of change of x, and what is watched."""
        self._set(columns)
        slopes, y = _call(self.functions[1], self.t, self._held(columns), u.tolist())
        return np.array(slopes), np.array(y)

    def drawing(self, columns: FloatArray, u: FloatArray) -> list[str]:
        """The blocks that draw random numbers in a tick."""
        state = self.engine.state
        state.restore(self.saved)
        before = {name: _bits(state.generators(name)) for name in state.blocks}
        self.tick(0, columns, u)
        return [name for name in state.blocks if _bits(state.generators(name)) != before[name]]

    def _set(self, columns: FloatArray) -> None:
        self.engine.state.restore(self.saved)
        n = self.sizes[0]
        self.engine.state.continuous[:] = columns[:n]
        for _, array, head in self._states:
            part = columns[n : n + array.size].reshape(array.shape)
            array[...] = part if head is None else np.roll(part, int(head[0]), axis=0)
            n += array.size

    def _held(self, columns: FloatArray) -> Held:
        at, values = sum(self.sizes[:2]), []
        for signal in self.held:
            size = math.prod(signal.kind.shape)
            values.append(signal.kind.pack(columns[at : at + size].reshape(signal.kind.shape)))
            at += size
        return tuple(values)

    def _flat(self, held: Held) -> FloatArray:
        return np.concatenate([np.zeros(0), *(np.ravel(np.asarray(each, float)) for each in held)])

    def _source(self, watched: Watched) -> Source:
        end = watched.end
        if not watched.is_state:
            kind = self.engine.network.types[end.block, end.port]
            return Source(Signal(end.block, end.port, kind))
        states = {state.name: state for state in self.engine.plan.states[end.block]}
        return Source(states[end.port])


def labels(address: str, kind: SignalType) -> list[str]:
    """The addresses of the numbers of a signal."""
    if kind.form == "scalar":
        return [address]
    table = len(kind.shape) > 1
    parts = map(str, range(math.prod(kind.shape))) if table else kind.names
    return [f"{address}.{part}" for part in parts]


def _turned(array: FloatArray, head: FloatArray | None) -> FloatArray:
    """An array's numbers; of a ring the oldest row first, so that each tick does the same."""
    return array if head is None else np.roll(array, -int(head[0]), axis=0)


def _call(function: Callable[..., Any], *given: Any) -> Any:
    with np.errstate(all="ignore"):  # beside a point, a function may have no value
        return function(*given)


def _bits(generators: Mapping[str, np.random.Generator]) -> dict[str, Any]:
    return {key: repr(each.bit_generator.state) for key, each in generators.items()}
