"""The form of a plan: what a tick does, as ordered operations on values with names and types.

Nothing here knows Python's text or C's: printers write the operations as either, and passes select
or count them. Each operation prints as one line. Of a Pulse that feeds an Integrator::

    call      wave.out: Scalar = wave.output(t)
    test      wave.out
    record    x[k] = integrator.out
    integrate integrator.integral by rk4
      call      integrator.integral' = integrator.derivative(t, wave.out)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from blocks.core import FloatArray
from runtime.document import SECOND
from runtime.plan.coupling import Coupling
from runtime.plan.values import Argument, GuardSlot, Row, Signal, Slot, Source, StateArray, Target


@dataclass(frozen=True)
class Gate:
    """When an operation is done.

    every : on each tick that is a multiple of this, plus ``offset``.
    starts : on tick 0 as well: an output holds what it is at the start until its block's first
        tick.
    switches : outputs that must all be on: those of the parts around a block, the outer ones first.
    is_off : the other way round: while one of the switches is off.
    once : before the first tick, and not again.
    """

    every: int = 1
    switches: tuple[Signal, ...] = ()
    is_off: bool = False
    once: bool = False
    offset: int = 0
    starts: bool = False

    @property
    def rate(self) -> Gate:
        """The same without the switches."""
        return Gate(self.every, offset=self.offset, starts=self.starts)

    def due(self, tick: str) -> str:
        """The condition on a tick in Python and in C, for a rate below that of the base ticks."""
        text = f"{tick} % {self.every} == {self.offset}"
        return f"{text} {{}} {tick} == 0" if self.starts else text

    def __str__(self) -> str:
        names = " and ".join(map(str, self.switches))
        parts = ["once"] if self.once else [f"every {self.every}"] if self.every > 1 else []
        parts += [f"from {self.offset}"] if self.offset else []
        parts += [f"{'unless' if self.is_off else 'while'} {names}"] if names else []
        return f"  [{', '.join(parts)}]" if parts else ""


ALWAYS = Gate()


@dataclass(frozen=True)
class Call:
    """Call a method of a block; it reads the arguments, the states of its block and the time.

    writes : the outputs that it returns, the rates of change that it returns (slots), or the
        states that it may change in place.
    takes_time : whether t is its first argument.
    takes_which : whether the number of the guard that was met is the next one.
    is_own : whether the block is the user's: what it returns is brought into a signal's form.
    """

    block: str
    method: str
    arguments: tuple[Argument, ...]
    writes: tuple[Target, ...]
    gate: Gate = ALWAYS
    takes_time: bool = True
    is_own: bool = False
    takes_which: bool = False

    @cached_property
    def outputs(self) -> tuple[Signal, ...]:
        return tuple(each for each in self.writes if isinstance(each, Signal))

    @cached_property
    def rates(self) -> tuple[Slot, ...]:
        """The states whose rates of change it returns."""
        return tuple(each for each in self.writes if isinstance(each, Slot))

    @property
    def reads(self) -> list[Signal]:
        """The signals that its arguments read, in order."""
        wholes = (source.whole for argument in self.arguments for source in argument.sources)
        return [each for each in wholes if isinstance(each, Signal)]

    def __str__(self) -> str:
        given = ["t"] * self.takes_time + ["which"] * self.takes_which
        given += map(str, self.arguments)
        outputs = [f"{each}: {each.kind}" for each in self.outputs]
        outputs += [str(s) if isinstance(s, GuardSlot) else f"{s}'" for s in self.rates]
        target = ", ".join(outputs or map(str, self.writes))
        equals = f"{target} = " if target else ""
        return f"call      {equals}{self.block}.{self.method}({', '.join(given)}){self.gate}"


@dataclass(frozen=True)
class Test:
    """Fail if what a method has returned is not finite."""

    block: str
    method: str
    outputs: tuple[Signal, ...]
    gate: Gate = ALWAYS

    def __str__(self) -> str:
        return f"test      {', '.join(map(str, self.outputs))}{self.gate}"


@dataclass(frozen=True)
class Solve:
    """Solve an algebraic loop: signals that its calls compute from themselves.

    unknowns : signals whose values are tried, of type Scalar, a record or an array; with them
        known, ``calls`` can be done in order, and compute them again.
    path : the loop in words.
    """

    number: int
    unknowns: tuple[Signal, ...]
    calls: tuple[Call, ...]
    path: str
    gate: Gate = ALWAYS

    @property
    def block(self) -> str:
        """None: it belongs to all in the loop."""
        return ""

    @property
    def blocks(self) -> set[str]:
        return {call.block for call in self.calls}

    @property
    def outputs(self) -> tuple[Signal, ...]:
        return tuple(signal for call in self.calls for signal in call.outputs)

    @property
    def reads(self) -> list[Signal]:
        return [signal for call in self.calls for signal in call.reads]

    @property
    def slots(self) -> list[tuple[Signal, int, int]]:
        """Each unknown, with the first of its numbers among all and the one after its last."""
        found, start = [], 0
        for signal in self.unknowns:
            stop = start + math.prod(signal.kind.shape)
            found.append((signal, start, stop))
            start = stop
        return found

    @property
    def size(self) -> int:
        """How many numbers are unknown."""
        return self.slots[-1][2]

    def __str__(self) -> str:
        head = f"solve     for {', '.join(map(str, self.unknowns))}{self.gate}"
        return "\n".join([head, *(f"  {each}" for each in self.calls)])


@dataclass(frozen=True)
class Zero:
    """Set outputs, states or rates of change of one block to zero: those of a part that is off."""

    block: str
    targets: tuple[Target, ...]
    gate: Gate = ALWAYS

    @property
    def outputs(self) -> tuple[Signal, ...]:
        return tuple(each for each in self.targets if isinstance(each, Signal))

    def __str__(self) -> str:
        return f"zero      {', '.join(map(str, self.targets))}{self.gate}"


@dataclass(frozen=True)
class Restore:
    """Set the states of a part back to what they were after ``start``.

    block : the one that switches the part.
    """

    block: str
    states: tuple[StateArray, ...]
    gate: Gate = ALWAYS

    def __str__(self) -> str:
        return f"restore   {', '.join(map(str, self.states))}{self.gate}"


@dataclass(frozen=True)
class Record:
    """Fill a row of a probe, or some of its columns.

    number : the position of the probe among all.
    width : the numbers in a row. columns : those that are filled; None for all.
    rows : the length of a buffer that is filled again and again; 0 for one of the whole run.
    publisher : the method of the block that describes what is recorded, once.
    """

    probe: str
    number: int
    source: Source
    width: int
    columns: slice | None = None
    rows: int = 0
    publisher: str = ""
    gate: Gate = ALWAYS

    @property
    def block(self) -> str:
        return self.source.whole.block

    def __str__(self) -> str:
        part = "" if self.columns is None else f", {self.columns.start}:{self.columns.stop}"
        return f"record    {self.probe}[k{part}] = {self.source}{self.gate}"


@dataclass(frozen=True)
class Stop:
    """End the run if a signal rises above a level, falls below it, or does either."""

    direction: float
    level: float
    source: Source
    gate: Gate = ALWAYS

    @property
    def block(self) -> str:
        return self.source.whole.block

    def __str__(self) -> str:
        how = {1.0: "rises above", -1.0: "falls below"}.get(self.direction, "crosses")
        return f"stop      if {self.source} {how} {self.level:g}{self.gate}"


@dataclass(frozen=True)
class Crossing:
    """Guards of one block: numbers whose sign changes where its events are.

    guards : computes them; or a ``Stop``: the distance of its signal from the level is one.
    start : the first of them in the row of all guards.
    directions : of each: 1 rising, -1 falling, 0 either, 3 either and at the start.
    event : what then happens, called with the number of each guard that was met.
    """

    guards: Call | Stop
    start: int
    directions: tuple[float, ...]
    event: Call | None = None

    @property
    def stop(self) -> int:
        return self.start + len(self.directions)

    @property
    def block(self) -> str:
        return self.guards.block


@dataclass(frozen=True)
class Integrate:
    """Integrate the continuous states from this tick to the next one.

    stage : what the solver repeats at each stage, at times between the ticks: outputs that may
        change there, and derivatives.
    projections : calls after each step that bring states back to where they are valid.
    crossings : events between two ticks, by block: each step ends at the first one in time.
        ``watch`` computes what guards and actions read, ``after`` what then changes.
    edges : when sources jump, off the ticks, and infinity. log : most events that are recorded.
    is_left : the last stage of a step sees sources as they are just before the edge at its end.
    coupling : which rate depends on which state, for a solver that needs the Jacobian.
    """

    row: Row
    solver: str
    stage: tuple[Operation, ...]
    projections: tuple[Call, ...] = ()
    crossings: tuple[Crossing, ...] = ()
    watch: tuple[Operation, ...] = ()
    after: tuple[Operation, ...] = ()
    time_unit: str = SECOND
    gate: Gate = ALWAYS
    coupling: Coupling | None = field(default=None, compare=False, repr=False)
    edges: FloatArray = field(default_factory=lambda: np.empty(0), compare=False, repr=False)
    log: int = 0
    is_left: bool = False

    @property
    def block(self) -> str:
        """None: it belongs to all."""
        return ""

    @property
    def colours(self) -> int:
        """How many evaluations the Jacobian takes; 0 for a solver that needs none."""
        return self.coupling.count if self.coupling else 0

    @property
    def ends_steps(self) -> bool:
        """Whether steps end at events or edges."""
        return bool(self.crossings or len(self.edges))

    @property
    def directions(self) -> FloatArray:
        """Of all guards."""
        return np.array([each for crossing in self.crossings for each in crossing.directions])

    @cached_property
    def between(self) -> tuple[Operation, ...]:
        """All that is done between two ticks."""
        met = [each for c in self.crossings for each in (c.guards, c.event) if each]
        return (*self.stage, *self.projections, *self.watch, *met, *self.after)

    @property
    def blocks(self) -> set[str]:
        """The blocks that are called."""
        return {call.block for call in calls_in(self.between)}

    def __str__(self) -> str:
        lines = [f"integrate {', '.join(map(str, self.row.slots))} by {self.solver}"]
        lines += [f"  {each}" for each in (*self.stage, *self.projections)]
        if self.ends_steps:
            first = len(self.stage) + len(self.projections)
            lines += ["until", *(f"  {each}" for each in self.between[first:])]
        return "\n".join(lines)


@dataclass(frozen=True)
class Load:
    """Take signals over from the memory of compiled code."""

    block: str
    signals: tuple[Signal, ...]
    gate: Gate = ALWAYS

    def __str__(self) -> str:
        return f"load      {', '.join(map(str, self.signals))}{self.gate}"


@dataclass(frozen=True)
class Store:
    """Hand signals over to the memory of compiled code."""

    block: str
    signals: tuple[Signal, ...]
    gate: Gate = ALWAYS

    def __str__(self) -> str:
        return f"store     {', '.join(map(str, self.signals))}{self.gate}"


Operation = Call | Solve | Test | Zero | Restore | Record | Stop | Integrate | Load | Store


def calls_in(operations: Iterable[Operation]) -> Iterator[Call]:
    """The calls among operations, those in loops included."""
    for each in operations:
        if isinstance(each, Call):
            yield each
        elif isinstance(each, Solve):
            yield from each.calls


@dataclass(frozen=True)
class Plan:
    """What a tick does, in order.

    dt : the base step (s). solver : the name of the method that integrates.
    states : the declared states of all blocks, by block.
    """

    title: str
    dt: float
    time_unit: str
    solver: str
    operations: tuple[Operation, ...]
    states: dict[str, tuple[StateArray, ...]] = field(default_factory=dict, repr=False)

    @cached_property
    def evaluations(self) -> tuple[Call, ...]:
        """The calls that compute outputs in order, those of constants included."""
        return tuple(each for each in calls_in(self.operations) if each.outputs)

    @cached_property
    def loops(self) -> tuple[Solve, ...]:
        """The algebraic loops that are solved."""
        return tuple(each for each in self.operations if isinstance(each, Solve))

    @cached_property
    def records(self) -> tuple[Record, ...]:
        return tuple(each for each in self.operations if isinstance(each, Record))

    @cached_property
    def integration(self) -> Integrate | None:
        """The continuous part of the plan; None without continuous states."""
        return next((each for each in self.operations if isinstance(each, Integrate)), None)

    @cached_property
    def row(self) -> Row:
        return Row() if self.integration is None else self.integration.row

    @cached_property
    def held(self) -> tuple[Signal, ...]:
        """The signals that outlive a tick: outputs of blocks that are slow, or switched."""
        calls = [each for each in self.evaluations if not each.gate.once]
        held = [each for each in calls if each.gate.every > 1 or each.gate.switches]
        return tuple(signal for each in held for signal in each.outputs)

    @cached_property
    def restored(self) -> frozenset[str]:
        """The blocks whose states are set back to what they were after ``start``."""
        found = (each.states for each in self.operations if isinstance(each, Restore))
        return frozenset(state.block for states in found for state in states)

    @property
    def can_stop(self) -> bool:
        """Whether a condition may end a run early."""
        crossings = () if self.integration is None else self.integration.crossings
        guards = (each.guards for each in crossings)
        return any(isinstance(each, Stop) for each in (*self.operations, *guards))

    def __str__(self) -> str:
        return "\n".join(map(str, self.operations))
