"""The value of a signal at the tick that comes next, without doing that tick.

In: an engine between two ticks. Out: what a probe of the signal will record there. The outputs that
it depends on are computed in Python, from the states as they are; of ``plant.pose``, which depends
on states alone, that is one call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from blocks.registry import is_built_in
from runtime.engine.engine import Engine
from runtime.engine.program import FILENAME
from runtime.plan import Call, Operation, Plan, Signal, Solve, Test, Zero


class Reader:
    """Reads signals of one engine; the text for each is made once."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._functions: dict[Signal, tuple[Callable[..., Any], bool]] = {}

    def read(self, signal: Signal) -> Any:
        """A signal at the next tick: a float, a tuple or a read-only array."""
        engine = self.engine
        name = engine.program.names.of(signal)
        if name in engine.namespace:  # it never changes
            return engine.namespace[name]
        if signal not in self._functions:
            self._functions[signal] = self._made(signal)
        function, is_pure = self._functions[signal]
        state = engine.state
        if is_pure:
            return function(state.tick, state.tick + 1, state.held)[0]
        # What an own block keeps undeclared is left alone: a copy that is put back would not be
        # what other attributes refer to, and an output changes no memory (blocks.core.Block).
        memory, generators = state.memory.copy(), state.drawn()
        (value,) = function(state.tick, state.tick + 1, state.held)
        state.memory[:] = memory
        state.set_drawn(generators)
        return value

    def _made(self, signal: Signal) -> tuple[Callable[..., Any], bool]:
        """The function that computes a signal, and whether that changes no state."""
        program = self.engine.program
        operations = upstream(program.plan, signal)
        text = program.printer().function(operations, program.held, [program.names.of(signal)])
        scope = dict(self.engine.namespace)
        exec(compile(text, FILENAME, "exec"), scope)
        entries = self.engine.network.entries
        calls = all(isinstance(each, (Call, Test, Zero)) for each in operations)
        pure = calls and all(is_built_in(entries[each.block].cls) for each in operations)
        return scope["run"], pure


def upstream(plan: Plan, signal: Signal) -> list[Operation]:
    """The operations of a tick on which a signal depends, in their order."""
    wanted = {signal.key}
    found: list[Operation] = []
    for each in reversed(plan.operations):
        if not isinstance(each, (Call, Solve, Zero)):
            continue
        if any(output.key in wanted for output in each.outputs):
            found.append(each)
            reads = [] if isinstance(each, Zero) else each.reads
            wanted |= {read.key for read in (*reads, *each.gate.switches)}
    return found[::-1]
