"""Runs the compiled plan for the engine, and locates where it stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from blocks.core import BlockState, FloatArray
from runtime.engine.compiled import cache
from runtime.engine.compiled.emit import (
    BAD_SLOPE,
    UNREACHED,
    CompiledEmitter,
    CompiledText,
    fields_name,
)
from runtime.engine.compiled.kernels import Kernels, make_kernels
from runtime.engine.compiled.translate import plain
from runtime.engine.program import Program
from runtime.engine.runners import RunContext

DRIVER = "<the loop around the compiled plan>"
LARGEST_REPORT = 256


@dataclass(frozen=True)
class Template:
    """What the compiled runs of a program share: its kernels, the plan's text and its function.

    ``owners`` maps each argument of the text that holds a block's fields to the block.
    """

    kernels: Kernels
    text: CompiledText
    function: Callable[..., tuple[Any, ...]]
    owners: dict[str, str]


# The last template of each program; it may not fit the next seed.
_latest: WeakKeyDictionary[Program, Template] = WeakKeyDictionary()


def template(
    program: Program, states: Mapping[str, BlockState], note: Callable[[str], None]
) -> Template:
    """The template of a program: the last one if it fits these states, or a new one.

    Parameters
    ----------
    states : after ``start``.
    note : called with a message for the user when something is compiled.
    """
    known = _latest.get(program)
    entries = program.network.entries
    if known is not None and all(
        kernel.fits(entries[name].made, states[name])
        for name, kernel in known.kernels.compiled.items()
    ):
        return known
    kernels = make_kernels(program.network, states, note)
    for name in sorted(kernels.broken):
        note(f"block '{name}' is called from Python: {kernels.refused[name]}")
    emitter = CompiledEmitter(
        program.plan, list(program.recordings), kernels.compiled, program.observation.stop
    )
    text = emitter.compiled()
    owners = {fields_name(program.plan, name): name for name in kernels.compiled}
    made = Template(kernels, text, cache.module("plan", text.text).run, owners)
    _latest[program] = made
    return made


class CompiledRunner:
    """Runs the compiled plan of one run."""

    def __init__(self, context: RunContext) -> None:
        self.context = context
        self.network = context.program.network
        made = template(context.program, context.states, context.note)
        self.kernels, self.text = made.kernels, made.text
        self.function: Any = made.function
        self.held = self.text.held
        self.call = self.function
        self.at = np.zeros(3, dtype=np.int64)
        self.report = np.zeros(LARGEST_REPORT)
        self.arguments = tuple(
            self._fields(made.owners[name]) if name in made.owners else self._argument(name)
            for name in self.text.arguments
        )
        self.run = self._driver() if self.text.driver else self._whole

    def _fields(self, block: str) -> tuple[Any, ...]:
        made = self.network.entries[block].made
        return self.kernels.compiled[block].fields(made, self.context.states[block])

    def _argument(self, name: str) -> Any:
        """A constant, a state or a probe's array, by its name in the text."""
        owner, dot, state = name.partition(".")
        value = self.context.namespace[owner]
        return plain(getattr(value, state) if dot else value, name)

    def adopt(self, held: tuple[Any, ...]) -> tuple[Any, ...]:
        """The first tick's variables, in exactly the form that compiled text expects."""
        from numba import typeof

        adopted = tuple(normalised(value) for value in held)
        is_new = not self.function.overloads
        # Runs no tick, but compiles the plan or loads it.
        self._part(0, 0, 0, 0, adopted)
        types = tuple(map(typeof, self._given(0, 0, 0, 0, adopted)))
        # numba checks the type of every argument of every call, that of a generator in Python: 0.2
        # ms. The types never change here, so its entry point is called directly.
        self.call = self.function.overloads[types].entry_point
        if is_new:
            blocks = [kernel.module for kernel in self.kernels.compiled.values()]
            cache.seal([self.function.__module__, *blocks])
        return adopted

    def _whole(self, first: int, last: int, held: tuple[Any, ...]) -> tuple[Any, ...]:
        """Run whole ticks."""
        return self._part(first, last, 0, 1, held)

    def _part(
        self, first: int, last: int, low: int, high: int, held: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        result: tuple[Any, ...] = self.call(*self._given(first, last, low, high, held))
        if self.at[2]:
            self._not_finite()
        return result

    def _given(
        self, first: int, last: int, low: int, high: int, held: tuple[Any, ...]
    ) -> tuple[Any, ...]:
        ticks = (first, last, low, high, self.network.dt)
        return (*ticks, self.at, self.report, held, *self.arguments)

    def _driver(self) -> Callable[[int, int, tuple[Any, ...]], tuple[Any, ...]]:
        scope = {**self.context.namespace, "run": self._part, "own": own, "seen": seen}
        exec(compile(self.text.driver, DRIVER, "exec"), scope)
        drive: Callable[[int, int, tuple[Any, ...]], tuple[Any, ...]] = scope["drive"]
        return drive

    def _not_finite(self) -> None:
        if self.at[2] == BAD_SLOPE:
            stage, t = self.report[:2].tolist()
            self.context.namespace["bad_slope"](int(stage), t)
        if self.at[2] == UNREACHED:
            self.context.namespace["unreached"](*self.report[:2].tolist())
        block, evaluation = self.text.calls[self.at[0]]
        values: list[Any] = []
        entries = iter(self.report.tolist())
        for port in evaluation.outputs:
            kind = self.network.types[block, port]
            if kind.form == "record":
                values.append(tuple(next(entries) for _ in kind.components))
            else:
                value = next(entries)
                values.append(np.full(kind.shape, value) if kind.form == "array" else value)
        self.context.not_finite(block, evaluation.method, *values)

    def locate(self, error: BaseException) -> tuple[int, str]:
        """The tick and the block that raised an exception."""
        trace = error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == DRIVER and trace.tb_lineno in self.text.lines:
                tick = int(trace.tb_frame.f_locals.get("k", self.at[1]))
                return tick, self.text.lines[trace.tb_lineno]
            trace = trace.tb_next
        return int(self.at[1]), self.text.calls[self.at[0]][0] if self.text.calls else ""


def seen(array: FloatArray) -> FloatArray:
    """A read-only view of an array, for a block that is called from Python."""
    view = array.view()
    view.setflags(write=False)
    return view


def own(array: FloatArray) -> FloatArray:
    """An array in the form that compiled text expects: contiguous and writeable."""
    return array if array.flags.c_contiguous and array.flags.writeable else array.copy()


def normalised(value: Any) -> Any:
    """A signal's value from Python in the form that compiled text expects."""
    if isinstance(value, tuple):
        return tuple(float(part) for part in value)
    return own(value) if isinstance(value, np.ndarray) else float(value)
