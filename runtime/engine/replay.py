"""Compiled ticks with Python's results: what compiled code does not compute is computed by Python.

In: ticks to run. Out: the same ticks as Python has them, compiled as far as that goes. C code ends
with a failure wherever Python might raise, or continue with another number than C has: an index out
of range, a division by zero, integers of more than 64 bits, an output that is not finite::

    ticks 400 to 800 compiled      x / y fails at tick 512
    ticks 400 to 511 compiled      from a snapshot, with the same results
    tick 512 in Python             raises: the error of the run, the same as without compiling;
    ticks 513 to 800 in Python     or goes on

Some ticks of blocks that are not built in are compared with their Python form, see
:mod:`.comparison`; at a difference, that tick and the rest of the run are under the Python engine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from runtime.engine.comparison import Comparison
from runtime.engine.events import FOUND
from runtime.engine.runners import CompiledError, CompiledPlan, Run
from runtime.engine.state import Held, RunState, Snapshot
from runtime.errors import NotCopiedError


@dataclass
class ExactRunner:
    """Runs compiled ticks, and those under the Python plan that compiled code does not compute.

    Parameters
    ----------
    state : of the run. compiled : runs its ticks. python : makes the function of the Python plan.
    comparison : compares own compiled blocks with their Python form; None if there are none.

    ``python_from`` is the tick from which the run is under the Python engine; ``notes`` say why.
    ``copied`` is what the last snapshot took (s).
    """

    state: RunState
    compiled: CompiledPlan
    python: Callable[[], Run]
    comparison: Comparison | None
    notes: list[str] = field(default_factory=list)
    python_from: int | None = None

    def __post_init__(self) -> None:
        self.held, self.adopt = self.compiled.held, self.compiled.adopt
        self._python: Run | None = None
        self.copied = 0.0

    def locate(self, error: BaseException) -> tuple[int, str] | None:
        """The tick and the block that raised an exception in compiled code."""
        return None if self._python is not None else self.compiled.locate(error)

    def integrate(self, scope: dict[str, Any]) -> bool:
        """Integrate the first tick, whose outputs Python has checked; whether that could be done.

        A form of a rate of change needs no check: compiled code has a type for it. With own blocks,
        whose first ticks are compared with their Python form, this tick stays Python's.

        Parameters
        ----------
        scope : the variables of the tick, changed where an event changes them.
        """
        if self.comparison is not None:
            return False
        try:
            saved = self.state.snapshot()
        except NotCopiedError:
            return False
        try:
            return self.compiled.integrate(scope)
        except CompiledError:
            self.state.restore(saved)
            return False

    def run(self, first: int, last: int, held: Held) -> Held:
        """Run ticks.

        Raises
        ------
        CompiledError : compiled code failed, and the tick cannot be run again.
        """
        is_stopped = self.state.stop.item
        while first < last and not is_stopped(FOUND):
            if self._python is not None:
                return self._python(first, last, held)
            due = last if self.comparison is None else self.comparison.next(first)
            end = min(last, max(due, first + 1))
            held = self._ticks(first, end, held, compare=due == first)
            first = end
        return held

    def leave(self, tick: int, notes: Sequence[str]) -> None:
        """Go on under the Python engine, as a run does that left compiled code at a tick."""
        self.python_from, self.notes = tick, list(notes)
        self._python = self._python or self.python()

    def _ticks(self, first: int, last: int, held: Held, compare: bool) -> Held:
        """Run ticks, of which the first is compared with own blocks' Python form."""
        self.state.tick, self.state.held = first, held
        began = time.perf_counter()
        try:
            saved = self.state.snapshot()
        except NotCopiedError as why:
            return self._once(first, last, held, str(why))
        self.copied = time.perf_counter() - began
        try:
            held = self.compiled.run(first, last, held)
        except CompiledError as error:
            cause = f"{error.place}: compiled code ended with {error}, which Python does not do"
            return self._again(saved, error.tick, last, cause)
        if compare and self.comparison is not None and not self.state.stop[FOUND]:
            self.state.tick, self.state.held = last, held
            difference = self.comparison.difference(saved, self.state.snapshot())
            if difference is not None:
                return self._again(saved, first, last, str(difference))
        return held

    def _once(self, first: int, last: int, held: Held, why: str) -> Held:
        """Run ticks that cannot be run again."""
        if self.comparison is not None:
            own = ", ".join(self.comparison.own)
            self.notes.append(f"{own}: not compared with the Python form, since {why}")
            self.comparison = None
        try:
            return self.compiled.run(first, last, held)
        except CompiledError as error:
            text = f"{error}; Python could not run the tick again, since {why}"
            raise CompiledError(error.block, error.tick, text) from None

    def _again(self, saved: Snapshot, tick: int, last: int, cause: str) -> Held:
        """Run the ticks after a snapshot again, from this one on under Python."""
        self.state.restore(saved)
        held = saved.held
        if tick > saved.tick:
            held = self.compiled.run(saved.tick, tick, held)
        self._python = self.python()
        held = self._python(tick, tick + 1, held)
        self.python_from = tick
        network = self.state.program.network
        t = f"t = {tick * network.dt:g} {network.time_unit} (tick {tick})"
        self.notes.append(f"{cause}; from {t} on, the run is under the Python engine")
        if tick + 1 == last or self.state.stop[FOUND]:
            return held
        return self._python(tick + 1, last, held)
