"""Own compiled blocks beside their Python form: a check that does not rely on the translation.

In: the state before a compiled tick and after it. Out: the first :class:`Difference`, or None::

    block 'mine': output 'out' is 0.30000001 compiled and 0.3 in Python

A text in Python computes what blocks that are not built in compute on that tick, from the same
state and from the outputs that other blocks had: their outputs, states and generators must be
those of the compiled tick. It calls other blocks only where their outputs change between ticks, as
those of a plant do: of these, the compiled tick has left the last value.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Collection, Container, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import has_kernels
from runtime.engine.program import Program
from runtime.engine.state import Array, RunState, Snapshot, seed_of
from runtime.engine.values import brief
from runtime.errors import raised_text
from runtime.plan import (
    Call,
    Integrate,
    Operation,
    Plan,
    Port,
    Restore,
    Solve,
    Test,
    Zero,
    signals_of,
)

FILENAME = "<the blocks of your own>"
# The compared ticks after the first, which is always Python's.
FIRST = 16
# Times (s), measured on graphs of 2 to 18 blocks: what compiled code takes for a call of a block
# and for each number that a block keeps, and what it takes to compare a tick, and each own block;
# and the share of a long run's time that comparing takes.
CALL, NUMBER, COMPARED, BLOCK, SHARE = 1.5e-8, 1e-9, 2e-4, 1e-4, 0.01
# The rounding of sums in another order: of a number, and of the largest that a block works with.
RELATIVE, ABSOLUTE = 1e-9, 1e-13


def compared_calls(plan: Plan, own: Collection[str], moving: Container[Port]) -> list[Operation]:
    """The part of a tick that own blocks take part in.

    Nothing is recorded, and a tick at which a run stops is not compared.

    Parameters
    ----------
    moving : the outputs that change between ticks, of other blocks as well.
    """
    found: list[Operation] = []
    for each in plan.operations:
        if isinstance(each, Restore):
            found.append(each)
        elif isinstance(each, Integrate):
            found += [] if each.blocks.isdisjoint(own) else [each]
        elif isinstance(each, (Call, Solve, Test, Zero)):
            is_again = any(signal.key in moving for signal in each.outputs)
            blocks = each.blocks if isinstance(each, Solve) else {each.block}
            found += [each] if is_again or not blocks.isdisjoint(own) else []
    return found


@dataclass(frozen=True)
class Difference:
    """What of a block is not the same."""

    block: str
    what: str
    compiled: Any
    python: Any

    def __str__(self) -> str:
        values = f"{brief(self.compiled)} compiled and {brief(self.python)} in Python"
        return f"block '{self.block}': {self.what} is {values}"


class Comparison:
    """Compares own compiled blocks with their Python form on some ticks of a run.

    Parameters
    ----------
    state : of the run. own : the blocks, at least one.
    namespace : the names that the plan's text uses.
    read : returns an output as compiled code left it.
    """

    def __init__(
        self,
        state: RunState,
        own: Collection[str],
        namespace: dict[str, Any],
        read: Callable[[str, str], Any],
    ) -> None:
        self.state, self.read = state, read
        self.network = network = state.program.network
        plan, printer = state.program.plan, state.program.printer()
        moving = network.moving if plan.integration is not None else frozenset[Port]()
        operations = compared_calls(plan, own, moving)
        calls = [call for call in plan.evaluations if not call.gate.once]
        named = signals_of(operations)
        self.ends = [s.key for call in calls for s in call.outputs if s.key in named]
        variables = [state.program.names.signals[end] for end in self.ends]
        scope = dict(namespace)
        text = printer.function(operations, variables, variables)
        exec(compile(text, FILENAME, "exec"), scope)
        self.lines, self.call = printer.lines, scope["run"]
        # In the order of a tick, so that the first difference is the cause of the others.
        self.own = [name for name in dict.fromkeys(name for name, _ in self.ends) if name in own]
        self.own += sorted(set(own) - set(self.own))
        self.ticks = compared(state.program, state.seed, own)
        self.due = next(self.ticks)

    def next(self, tick: int) -> int:
        """The next tick to compare, from this one on."""
        while self.due < tick:
            self.due = next(self.ticks)
        return self.due

    def difference(self, saved: Snapshot, after: Snapshot) -> Difference | None:
        """The first difference on the tick between two snapshots, the second of which is now.

        Puts the state back to the second, unless there is a difference.
        """
        given = tuple(self.read(*end) for end in self.ends)
        self.state.restore(saved)
        try:
            found = self.call(saved.tick, saved.tick + 1, given)
        except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything
            text = _Text(raised_text(error, with_place=False))
            return Difference(self._raise(error), "its result", _Text("a value"), text)
        values = dict(zip(self.ends, zip(given, found, strict=True), strict=True))
        for block in self.own:
            difference = self._of(block, values, after)
            if difference is not None:
                return difference
        self.state.restore(after)
        return None

    def _of(
        self, block: str, values: dict[tuple[str, str], tuple[Any, Any]], after: Snapshot
    ) -> Difference | None:
        pairs = {f"output '{p}'": pair for (name, p), pair in values.items() if name == block}
        pairs |= self._states(block, after)
        for what, (compiled, python) in pairs.items():
            if _bits(compiled) != _bits(python):
                apart = _apart(compiled, python, self._scale(block, values, pairs))
                if apart is not None:
                    return Difference(block, what, *apart)
        now = self.state.generators(block)
        for key, generator in now.items():
            before = after.generators.get(f"{block}.{key}")
            bits = generator.bit_generator.state
            if before is None or not _equal(before, bits):
                compiled = _Text("not used") if before is None else _position(before)
                return Difference(block, f"generator state.{key}", compiled, _position(bits))
        return None

    def _states(self, block: str, after: Snapshot) -> dict[str, tuple[Array, Array]]:
        """The states of a block after the compiled tick, and now."""
        spec, slots = self.network.entries[block].cls.spec, self.state.program.plan.row.of(block)
        found = {}
        for key, declared in spec.states.items():
            if not declared.cached and not declared.continuous:
                name = f"{block}.{key}"
                found[f"state '{key}'"] = after.array(name), self.state.arrays[name]
        for slot in slots:
            name = f"{block}.{slot.name}"
            found[f"state '{slot.name}'"] = after.array(name), self.state.arrays[name]
        # A kernel leaves other numbers in what its method uses as scratch memory.
        if after.own is not None and not has_kernels(self.network.entries[block].cls):
            for key, array, copy in after.own.apart(block):
                found[f"state.{key}"] = copy, array
        return found

    def _scale(
        self,
        block: str,
        values: dict[tuple[str, str], tuple[Any, Any]],
        pairs: dict[str, tuple[Any, Any]],
    ) -> float:
        """The largest number that a block reads, keeps or returns."""
        wires = [wire.source for wire in self.network.driving if wire.block == block]
        read = [values[end][1] for s in wires if (end := (s.block, s.port)) in values]
        largest = 0.0
        for value in (*read, *(python for _, python in pairs.values())):
            numbers = np.abs(np.asarray(value, dtype=np.float64))
            largest = max(largest, float(np.max(numbers, initial=0.0, where=numbers < math.inf)))
        return largest

    def _raise(self, error: BaseException) -> str:
        """The block that raised an exception."""
        trace = error.__traceback__
        while trace is not None and trace.tb_frame.f_code.co_filename != FILENAME:
            trace = trace.tb_next
        return self.lines.get(trace.tb_lineno, "") if trace is not None else ""


class _Text:
    """A text in the place of a value, for messages."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def compared(program: Program, seed: int, own: Collection[str]) -> Iterator[int]:
    """The ticks to compare, in order and without end: they depend on the graph and the seed.

    The first ticks of each own block, and one tick in each stretch of the run: stretches grow up to
    the length at which comparing takes its share of the time.
    """
    entries = program.network.entries
    rates = sorted({(entries[name].every, entries[name].offset) for name in own})
    first = sorted({every * i + o for every, o in rates for i in range(1, FIRST + 1)})
    tick, once = 0.0, COMPARED + BLOCK * len(own)
    for name, entry in entries.items():
        numbers = NUMBER * sum(state.size for state in program.plan.states[name])
        tick += (CALL * (len(entry.evaluations) + 1) + numbers) / entry.every
        once += 5 * numbers  # copied, compared, and put back
    most = max(FIRST, round(once / tick / SHARE))
    return heapq.merge(first, _one_each(most, rates, np.random.default_rng(seed_of(seed, ""))))


def _one_each(
    most: int, rates: Sequence[tuple[int, int]], rng: np.random.Generator
) -> Iterator[int]:
    low, length = FIRST + 1, FIRST
    while True:
        tick = low + int(rng.integers(length))
        every, offset = rates[int(rng.integers(len(rates)))]
        yield tick - (tick - offset) % every
        low, length = low + length, min(4 * length, most)


def _bits(value: Any) -> bytes:
    """The bits of an output or a state."""
    return np.asarray(value).tobytes()


def _apart(compiled: Any, python: Any, scale: float) -> tuple[Any, Any] | None:
    """The numbers in two values that differ most, if that is more than rounding.

    Parameters
    ----------
    scale : the largest number that took part.
    """
    a, b = np.asarray(compiled, dtype=np.float64), np.asarray(python, dtype=np.float64)
    if a.shape != b.shape:
        return compiled, python
    with np.errstate(invalid="ignore"):
        distance = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b))
    distance = np.nan_to_num(distance, nan=math.inf)
    bound = np.maximum(RELATIVE * np.maximum(np.abs(a), np.abs(b)), ABSOLUTE * scale)
    if np.all((distance == 0.0) | (np.isfinite(bound) & (distance <= bound))):
        return None
    at = int(np.argmax(distance))
    return float(a.flat[at]), float(b.flat[at])


def _equal(one: Any, other: Any) -> bool:
    """Whether two states of bit generators are the same."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    return bool(np.array_equal(one, other))


def _position(bits: Any) -> _Text:
    """A short text that tells two states of a bit generator apart."""
    inner = bits.get("state")
    number = inner.get("state") if isinstance(inner, dict) else None
    return _Text(f"at ...{str(number)[-8:]}" if isinstance(number, int) else "at another position")
