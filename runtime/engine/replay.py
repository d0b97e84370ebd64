"""Compiled ticks with Python's results: what compiled code does not compute is computed by Python.

C code ends with a failure wherever Python might raise, or continue with another number than C has:
an index out of range, a division by zero, integers of more than 64 bits, an output that is not
finite. The ticks of a call then run again from a checkpoint up to the one that failed, with the
same results, and this one runs under the Python plan. If Python raises, too, that is the error of
the run: the same as without compiling. Otherwise the run goes on under the Python engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from runtime.engine.runners import CompiledError, Run, Runner
from runtime.engine.solvers import FOUND
from runtime.engine.state import Checkpoint, Held, NotCopiedError, RunState


@dataclass
class ExactRunner:
    """Runs compiled ticks, and those under the Python plan that compiled code does not compute.

    Parameters
    ----------
    state : of the run. compiled : runs its ticks. python : makes the function of the Python plan.

    ``python_from`` is the tick from which the run is under the Python engine; ``notes`` say why.
    """

    state: RunState
    compiled: Runner
    python: Callable[[], Run]
    notes: list[str] = field(default_factory=list)
    python_from: int | None = None

    def __post_init__(self) -> None:
        self.held, self.numbers = self.compiled.held, self.compiled.numbers
        self.adopt = self.compiled.adopt
        self._python: Run | None = None

    def locate(self, error: BaseException) -> tuple[int, str] | None:
        """The tick and the block that raised an exception in compiled code."""
        return None if self._python is not None else self.compiled.locate(error)

    def run(self, first: int, last: int, held: Held) -> Held:
        """Run ticks.

        Raises
        ------
        CompiledError : compiled code failed, and the tick cannot be run again.
        """
        if self._python is not None:
            return self._python(first, last, held)
        self.state.tick, self.state.held = first, held
        try:
            saved = self.state.checkpoint()
        except NotCopiedError as why:
            return self._once(first, last, held, str(why))
        try:
            return self.compiled.run(first, last, held)
        except CompiledError as error:
            return self._again(saved, error, last)

    def _once(self, first: int, last: int, held: Held, why: str) -> Held:
        """Run ticks that cannot be run again."""
        try:
            return self.compiled.run(first, last, held)
        except CompiledError as error:
            text = f"{error}; Python could not run the tick again, since {why}"
            raise CompiledError(error.block, error.tick, text) from None

    def _again(self, saved: Checkpoint, error: CompiledError, last: int) -> Held:
        """Run the ticks after a checkpoint again, from the one that failed under Python."""
        self.state.restore(saved)
        held, tick = saved.held, error.tick
        if tick > saved.tick:
            held = self.compiled.run(saved.tick, tick, held)
        self._python = self.python()
        held = self._python(tick, tick + 1, held)
        self.python_from = tick
        network = self.state.program.network
        t = f"{tick * network.dt:g} {network.time_unit}"
        self.notes.append(
            f"{error.place}: compiled code ended with {error}, which Python does not do; from "
            f"t = {t} (tick {tick}) on, the run is under the Python engine"
        )
        if tick + 1 == last or self.state.stop[FOUND]:
            return held
        return self._python(tick + 1, last, held)
