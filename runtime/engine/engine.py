"""The engine: owns all that moves, and runs the plan's function at a fixed step."""

from __future__ import annotations

import hashlib
import math
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from blocks.core import BlockState, FloatArray
from runtime.engine.diagnosis import Diagnosis
from runtime.engine.interrupts import stoppable
from runtime.engine.profile import Profile
from runtime.engine.program import Program
from runtime.engine.recorder import Recorder
from runtime.engine.runners import (
    Held,
    MakeRunner,
    Progress,
    PythonRunner,
    Run,
    RunContext,
    Runner,
    located,
    silent,
)
from runtime.engine.schedule import GLOBALS, Plan
from runtime.engine.values import brief, form, has_form, is_bad, sealed
from runtime.errors import SimulationError, UsageError
from runtime.network import Network, state_shape

CHUNK_SECONDS = 0.1


def seed_of(seed: int, name: str) -> np.random.SeedSequence:
    """The seed of one block: from the run's seed and the block's name, and nothing else.

    Taking a block out leaves every other block's neurons and noise as they were.
    """
    digest = hashlib.sha256(name.encode()).digest()
    words = tuple(int.from_bytes(digest[i : i + 4], "little") for i in (0, 4, 8, 12))
    return np.random.SeedSequence(seed, spawn_key=words)


class NotFiniteError(ArithmeticError):
    """A block put out something that is no number."""


@dataclass
class Outcome:
    """What a run left: recorded arrays, ticks done, how it ended, and the seconds it took.

    ``ready_s`` of these passed before the second tick: states filled, the plan compiled.
    """

    arrays: dict[str, FloatArray]
    ticks: int
    status: str = "complete"
    engine: str = "python"
    wall_s: float = 0.0
    ready_s: float = 0.0
    error: SimulationError | None = None


@dataclass
class Engine:
    """One run of one program. Make a new one for each run.

    Parameters
    ----------
    program : the graph's plan, and what to record.
    seed : of all noise and neurons.
    make_runner : makes what runs the ticks after the first; the plan's Python text by default.
    note : called with a line of text for people, when something takes a while.
    profile : measures what each block takes; the Python engine's only.
    folder : for recordings that are too large for memory; a temporary one by default.
    """

    program: Program
    seed: int
    make_runner: MakeRunner | None = None
    note: Callable[[str], None] = silent
    profile: Profile | None = None
    folder: Path | None = None
    network: Network = field(init=False)
    plan: Plan = field(init=False)
    states: dict[str, BlockState] = field(init=False, default_factory=dict)
    recorder: Recorder = field(init=False)
    arrays: dict[str, FloatArray] = field(init=False)
    diagnosis: Diagnosis = field(init=False)
    tick: int = field(init=False, default=0)
    lines: Mapping[int, str] = field(init=False, default_factory=dict)
    runner: Runner = field(init=False)

    def __post_init__(self) -> None:
        self.network, self.plan = self.program.network, self.program.plan
        probes, ticks = self.program.observation.probes, self.network.ticks
        self.recorder = Recorder(probes, ticks, self.program.gathered, self.folder)
        self.arrays = self.recorder.arrays
        self.states = {name: self._state(name) for name in self.network.entries}
        self.diagnosis = Diagnosis(self.network, self.states)

    def prepare(self) -> Runner:
        """Fill the states and make what runs the ticks, without running any."""
        self._start()
        self.runner = self._runner()
        return self.runner

    def run(self, progress: Progress | None = None) -> Outcome:
        """Run all ticks; an interrupt or a failure ends the run and keeps what was recorded."""
        began = time.perf_counter()
        engine = "python" if self.make_runner is None else "compiled"
        outcome = Outcome(self.arrays, 0, engine=engine)
        try:
            with stoppable():
                held = self._first_tick()
                outcome.ready_s = time.perf_counter() - began
                self._loop(held, progress)
        except KeyboardInterrupt as error:
            self.locate(error)
            outcome.status = "interrupted"
        except SimulationError as error:
            outcome.status, outcome.error = "failed", error
        outcome.ticks = self.tick
        outcome.wall_s = time.perf_counter() - began
        outcome.arrays = self.recorder.finish(self.tick)
        return outcome

    def _first_tick(self) -> Held:
        """The first tick is Python's in any case: there every value is looked at."""
        try:
            self.prepare()
            first = self._compile(checked=True, held=self.runner.held)
            held = self.runner.adopt(first(0, 1, self._held()))
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:  # what a block raises must not end the process
            raise self._failed(error) from error
        self.tick = 1
        return held

    def _loop(self, held: Held, progress: Progress | None) -> None:
        total, chunk = self.network.ticks, 16
        run, recorder = self.runner.run, self.recorder
        try:
            while self.tick < total:
                stop = min(self.diagnosis.boundary(self.tick), self.tick + chunk)
                stop = min(total, stop, recorder.boundary())
                began = time.perf_counter()
                held = run(self.tick, stop, held)
                took = time.perf_counter() - began
                ran, self.tick = stop - self.tick, stop
                recorder.flush(stop)
                self.diagnosis.look(stop)
                chunk = max(1, min(4 * chunk, int(ran * CHUNK_SECONDS / max(took, 1e-6))))
                if progress is not None:
                    progress(self.tick, total)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # what a block raises must not end the process
            raise self._failed(error) from error

    def _failed(self, error: BaseException) -> SimulationError:
        """What happened where, for people."""
        block = self.locate(error)
        told = isinstance(error, (NotFiniteError, UsageError))
        text = str(error) if told else _described(error)
        return SimulationError(block, self.tick, self.tick * self.network.dt, text)

    def _runner(self) -> Runner:
        if self.make_runner is not None:
            return self.make_runner(
                RunContext(self.program, self.states, self.namespace, self.not_finite, self.note)
            )
        return PythonRunner(self.program.emitter().held(), self._compile(checked=False))

    def _start(self) -> None:
        """Fill the states, and compute what never changes."""
        self.namespace: dict[str, Any] = {
            **dict(
                zip(
                    GLOBALS,
                    (
                        *(math.isfinite, math.isnan, np.dot, np.array, np.full),
                        *(self._checked, sealed, self.not_finite),
                    ),
                    strict=True,
                )
            ),
            **{f"probe_{i}": array for i, array in enumerate(self.arrays.values())},
            **({} if self.profile is None else self.profile.names()),
        }
        for name, entry in self.network.entries.items():
            identifier = self.plan.names[name]
            self.namespace[identifier] = entry.made
            self.namespace[self.plan.variables[name, ""]] = self.states[name]
            self._guard(name, partial(entry.made.start, self.states[name]))
        for step in self.plan.steps:
            if step.constant:
                method = getattr(self.network.entries[step.block].made, step.evaluation.method)
                value = self._guard(step.block, partial(method, self.states[step.block], 0.0))
                values = (value,) if len(step.evaluation.outputs) == 1 else value
                for port, item in zip(step.evaluation.outputs, values, strict=True):
                    self._check_value(step.block, port, item)
                    if isinstance(item, np.ndarray):
                        item = sealed(item)
                    self.namespace[self.plan.variables[step.block, port]] = item
                    self._record_constant(step.block, port, item)

    def _guard(self, block: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            raise SimulationError(block, 0, 0.0, _described(error)) from error

    def _compile(self, checked: bool, held: Sequence[str] | None = None) -> Run:
        made = self.program.code(checked, held)
        # The same for all: checks stand on the lines of the calls that they check.
        self.lines = made.lines
        exec(made.code, self.namespace)
        run: Run = self.namespace["run"]
        return run

    def _held(self) -> Held:
        return (None,) * len(self.program.emitter().held())

    def locate(self, error: BaseException) -> str:
        """Set the tick to the one that an exception came from; returns the block."""
        found = located(error, self.lines)
        if found is None and self.tick:
            found = self.runner.locate(error)
        if found is None:
            return ""
        self.tick, block = found
        return block

    def _state(self, name: str) -> BlockState:
        entry = self.network.entries[name]
        context = self.network.context(name)
        sizes = entry.made.sizes()
        shapes = {
            key: state_shape(sizes, declared, context, entry.cls.spec)
            for key, declared in entry.cls.spec.states.items()
        }
        arrays = {key: np.zeros(shape) for key, shape in shapes.items()}
        return BlockState(context, seed_of(self.seed, name), arrays)

    def _record_constant(self, block: str, port: str, value: Any) -> None:
        for recording in self.program.recordings:
            if recording.constant and (recording.end.block, recording.end.port) == (block, port):
                kind = self.network.types[block, port]
                array = self.namespace[recording.array]
                column = kind.column(recording.end.component) if recording.end.component else None
                item = value if column is None else value[column]
                array[0 if recording.columns is None else (0, recording.columns)] = item

    def _checked(self, block: str, ports: tuple[str, ...], value: Any) -> Any:
        """Hold what a block returned on its first tick against what it declares."""
        if len(ports) > 1 and (not isinstance(value, tuple) or len(value) != len(ports)):
            raise TypeError(f"expected a tuple of its outputs ({', '.join(ports)}), got {value!r}")
        for port, item in zip(ports, (value,) if len(ports) == 1 else value, strict=True):
            self._check_value(block, port, item)
        return value

    def not_finite(self, block: str, method: str, *values: Any) -> NoReturn:
        """Called by the plan where what a method returned is not finite: say which output."""
        evaluations = self.network.entries[block].cls.spec.evaluations
        (outputs,) = (each.outputs for each in evaluations if each.method == method)
        for port, value in zip(outputs, values, strict=True):
            if is_bad(self.network.types[block, port], value):
                raise NotFiniteError(f"output '{port}' is not finite: {brief(value)}")
        raise NotFiniteError(f"an output is not finite: {brief(values)}")

    def _check_value(self, block: str, port: str, value: Any) -> None:
        kind = self.network.types[block, port]
        if not has_form(kind, value):
            raise SimulationError(
                *(block, 0, 0.0), f"output '{port}' must be {form(kind)}, got {brief(value)}"
            )


def _described(error: BaseException) -> str:
    """An exception in one line, with the place in the user's own code."""
    frames: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)
    # What compiled text raises has no line of its own.
    inside = bool(frames) and Path(frames[-1].filename).parent.name != "compiled"
    place = f" ({frames[-1].filename}:{frames[-1].lineno})" if inside else ""
    suggestion = ""
    if isinstance(error, ValueError) and "read-only" in str(error):
        suggestion = (
            "; arrays that come into a block or went out of one are read-only: write to a copy"
        )
    return f"{type(error).__name__}: {error}{place}{suggestion}"
