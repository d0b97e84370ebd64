"""Runners execute ticks: the interface between the engine and its two kinds of runner.

In: a prepared run, and the ticks to do. Out: the variables that outlive a tick, which go into the
next call; the engine writes, saves and shows progress in between::

    held = runner.adopt(held)              after the first tick, which the engine does
    held = runner.run(1, 100, held)        ticks 1 to 99
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from blocks.core import BlockState
from runtime.engine.program import FILENAME, Program
from runtime.engine.state import Array, Held
from runtime.network import Network

Progress = Callable[[int, int], None]
Run = Callable[[int, int, Held], Held]


def silent(text: str) -> None:
    """Discard a note."""


class CompiledError(Exception):
    """Compiled code met what it does not compute as Python does; the text says what.

    ``block`` is empty if the failure belongs to none.
    """

    def __init__(self, block: str, tick: int, message: str) -> None:
        super().__init__(message)
        self.block, self.tick = block, tick

    @property
    def place(self) -> str:
        """Where it failed, for messages."""
        return f"block '{self.block}'" if self.block else "solver"


class Runner(Protocol):
    """Runs ticks; ``held`` are the variables that go into each call and come out of it."""

    held: list[str]

    @property
    def run(self) -> Run:
        """Run ticks from the first up to the last."""

    def adopt(self, held: Held) -> Held:
        """The variables after the first tick, in the form that ``run`` takes."""

    def locate(self, error: BaseException) -> tuple[int, str] | None:
        """The tick and the block that raised an exception."""


class CompiledPlan(Runner, Protocol):
    """A runner of compiled code.

    ``numbers`` are the memory of the plan, which moves with the run's state; ``blocks`` are those
    that are compiled.
    """

    numbers: Array
    blocks: Collection[str]

    @property
    def is_current(self) -> bool:
        """Whether the globals and functions that were translated are still the same."""

    def read(self, block: str, port: str) -> Any:
        """An output as it is now, in the form that Python blocks take."""

    def retune(self, network: Network, name: str) -> bool:
        """Take over a block's new numbers; False if its compiled text has the old ones."""

    def begin_again(
        self, network: Network, changed: Collection[str], anew: Collection[str]
    ) -> bool:
        """Take over the numbers of a run that begins again; False if a new runner is needed.

        ``changed`` are the blocks with other parameters, ``anew`` those that have started again.
        """

    def integrate(self, scope: dict[str, Any]) -> bool:
        """Integrate the first tick, if that is compiled; ``scope`` are its variables."""


@dataclass(frozen=True)
class RunContext:
    """What the engine gives a runner, once states are initialised and constants computed.

    ``namespace`` holds the names that the plan's text uses. ``note`` is called with messages for
    the user.
    """

    program: Program
    states: Mapping[str, BlockState]
    namespace: Mapping[str, Any]
    note: Callable[[str], None]


MakeRunner = Callable[[RunContext], CompiledPlan]


class PythonRunner:
    """Runs the plan's Python text."""

    def __init__(self, held: list[str], run: Run) -> None:
        self.held = held
        self.run = run

    def adopt(self, held: Held) -> Held:
        """The first tick's variables, as they are."""
        return held

    def locate(self, error: BaseException) -> tuple[int, str] | None:
        """None: the lines of the plan's text are enough."""
        return None


def located(error: BaseException, lines: Mapping[int, str]) -> tuple[int, str] | None:
    """The tick and the block of the line of the plan in an exception's traceback."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != FILENAME:
        trace = trace.tb_next
    if trace is None:
        return None
    return int(trace.tb_frame.f_locals.get("k", 0)), lines.get(trace.tb_lineno, "")
