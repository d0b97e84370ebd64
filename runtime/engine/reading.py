"""The values of signals at the tick that comes next, without doing that tick.

In: an engine between two ticks, and what is read. Out: what probes of it will record there, and
states as they are. The outputs that it depends on are computed in Python, each once::

    read = Reader(engine, [Source(Signal("plant", "pose", Pose), "x"), StateArray("x", "sum", ())])
    read()      # [0.5, 1.7]: of plant.pose.x, which depends on states alone, one call of a block
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from types import CodeType
from typing import Any

from blocks.library.registry import is_built_in
from runtime.engine.engine import Engine
from runtime.engine.naming import Names
from runtime.engine.program import FILENAME
from runtime.errors import NotCopiedError
from runtime.plan import Call, Operation, Plan, Signal, Solve, Source, Test, Zero


class Reader:
    """Reads signals and states of one engine together, as floats and arrays that are copies.

    Parameters
    ----------
    sources : that exist; a component of a state is the number of a row.
    """

    def __init__(self, engine: Engine, sources: Sequence[Source]) -> None:
        self.state, program = engine.state, engine.program
        signals = [source.whole for source in sources if isinstance(source.whole, Signal)]
        operations = upstream(program.plan, signals)
        values = [_expression(program.names, source) for source in sources]
        text = program.printer().function(operations, program.held, values)
        scope = dict(engine.namespace)
        exec(_compiled(text), scope)
        self._function = scope["run"]
        entries = engine.network.entries
        # Such outputs change no state.
        self._is_pure = all(
            isinstance(each, (Call, Test, Zero)) and is_built_in(entries[each.block].cls)
            for each in operations
        )

    def __call__(self) -> Sequence[Any]:
        """The values at the next tick, in order."""
        state = self.state
        if self._is_pure:
            values: Sequence[Any] = self._function(state.tick, state.tick + 1, state.held)
            return values
        memory, generators = state.memory.copy(), state.drawn()
        own = None
        with suppress(NotCopiedError):  # an output should change no memory (blocks.core.Block)
            own = state.own_state.kept(state.compiled) if state.own else None
        try:
            values = self._function(state.tick, state.tick + 1, state.held)
        finally:  # of an interrupt, too
            state.memory[:] = memory
            if own is not None:
                state.own_state.restore(own)
            state.set_drawn(generators)
        return values


@lru_cache(maxsize=100)
def _compiled(text: str) -> CodeType:
    return compile(text, FILENAME, "exec")


def _expression(names: Names, source: Source) -> str:
    """What is read, in the plan's text."""
    whole, index = source.whole, ""
    if isinstance(whole, Signal):
        text, shape, columns = names.of(whole), whole.kind.shape, source.columns
        if isinstance(columns, slice):
            return f"array({text}[{columns.start}:{columns.stop}], float)"
        index = "" if columns is None else f"[{columns}]"
    else:
        text, shape = f"{names.states[whole.block]}.{whole.name}", whole.shape
        index = f"[{source.component}]" if source.component else ""
    is_number = not shape[1:] if index else not shape
    return f"float({text}{index})" if is_number else f"array({text}{index}, float)"


def upstream(plan: Plan, signals: Sequence[Signal]) -> list[Operation]:
    """The operations of a tick on which signals depend, in their order."""
    wanted = {signal.key for signal in signals}
    found: list[Operation] = []
    for each in reversed(plan.operations):
        if not isinstance(each, (Call, Solve, Zero)):
            continue
        if any(output.key in wanted for output in each.outputs):
            found.append(each)
            reads = [] if isinstance(each, Zero) else each.reads
            wanted |= {read.key for read in (*reads, *each.gate.switches)}
    return found[::-1]
