"""Runners execute ticks: the interface between the engine and its two kinds of runner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

from blocks.core import BlockState
from runtime.engine.program import FILENAME, Program

Progress = Callable[[int, int], None]
Held = tuple[Any, ...]
Run = Callable[[int, int, Held], Held]


def silent(text: str) -> None:
    """Discard a note."""


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


@dataclass(frozen=True)
class RunContext:
    """What the engine gives a runner, once states are initialised and constants computed.

    ``namespace`` holds the names that the plan's text uses. ``not_finite`` raises the error of a
    block's method whose outputs are not finite. ``note`` is called with messages for the user.
    """

    program: Program
    states: Mapping[str, BlockState]
    namespace: Mapping[str, Any]
    not_finite: Callable[..., NoReturn]
    note: Callable[[str], None]


MakeRunner = Callable[[RunContext], Runner]


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
