"""Runs the compiled plan for the engine, and says where it stopped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine.compiled import cache
from runtime.engine.compiled.template import template
from runtime.engine.compiled.translate import plain
from runtime.engine.runners import RunContext

DRIVER = "<the loop around the compiled plan>"
LARGEST_REPORT = 256


class CompiledRunner:
    """The compiled plan of one run, ready to run its ticks."""

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
        """A constant, a state or a probe's array by its name in the text."""
        owner, dot, state = name.partition(".")
        value = self.context.namespace[owner]
        return plain(getattr(value, state) if dot else value, name)

    def adopt(self, held: tuple[Any, ...]) -> tuple[Any, ...]:
        """The first tick's variables, in exactly the form that compiled text takes."""
        from numba import typeof

        adopted = tuple(normalised(value) for value in held)
        is_new = not self.function.overloads
        # No tick at all: compiles the plan, or loads it.
        self._part(0, 0, 0, 0, adopted)
        types = tuple(map(typeof, self._given(0, 0, 0, 0, adopted)))
        # numba looks at every argument of every call, and at a generator in Python: a fifth of a
        # millisecond. The types stay what they are, so that its entry may be called itself.
        self.call = self.function.overloads[types].entry_point
        if is_new:
            blocks = [kernel.module for kernel in self.kernels.compiled.values()]
            cache.seal([self.function.__module__, *blocks])
        return adopted

    def _whole(self, first: int, last: int, held: tuple[Any, ...]) -> tuple[Any, ...]:
        """Run ticks, all of each."""
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
        """The tick and the block that an exception came from."""
        trace = error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == DRIVER and trace.tb_lineno in self.text.lines:
                tick = int(trace.tb_frame.f_locals.get("k", self.at[1]))
                return tick, self.text.lines[trace.tb_lineno]
            trace = trace.tb_next
        return int(self.at[1]), self.text.calls[self.at[0]][0] if self.text.calls else ""


def seen(array: FloatArray) -> FloatArray:
    """An array as a block that is called from Python may have it: read-only."""
    view = array.view()
    view.setflags(write=False)
    return view


def own(array: FloatArray) -> FloatArray:
    """An array in the one form that compiled text takes: contiguous and writeable."""
    return array if array.flags.c_contiguous and array.flags.writeable else array.copy()


def normalised(value: Any) -> Any:
    """A signal's value from Python text in the form that compiled text takes."""
    if isinstance(value, tuple):
        return tuple(float(part) for part in value)
    return own(value) if isinstance(value, np.ndarray) else float(value)
