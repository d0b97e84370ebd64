"""The engine: owns all that moves, and runs the plan's function at a fixed step."""

from __future__ import annotations

import hashlib
import math
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NoReturn

import numpy as np

from blocks.block import BlockState
from blocks.signals import FloatArray, SignalType
from runtime.errors import SimulationError
from runtime.network import Network
from runtime.observe import Observation, Probe, state_shape
from runtime.plan import GLOBALS, Emitter, Plan, Recording, make_plan

CHUNK_SECONDS = 0.1
FILENAME = "<the plan>"
Progress = Callable[[int, int], None]


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
    """What a run left: recorded arrays, ticks done, how it ended, and the seconds it took."""

    arrays: dict[str, FloatArray]
    ticks: int
    status: str = "complete"
    wall_s: float = 0.0
    error: SimulationError | None = None


@dataclass
class Engine:
    """One run of one network. Make a new one for each run.

    Parameters
    ----------
    network : the checked graph.
    observation : what to record.
    """

    network: Network
    observation: Observation
    plan: Plan = field(init=False)
    states: dict[str, BlockState] = field(init=False, default_factory=dict)
    arrays: dict[str, FloatArray] = field(init=False, default_factory=dict)
    tick: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.plan = make_plan(self.network)
        recordings = self._recordings()
        self.emitter = Emitter(self.plan, recordings)
        self.states = {name: self._state(name) for name in self.network.entries}

    def source(self) -> str:
        """The straight-line function, as it is executed."""
        return self.emitter.emit()

    def run(self, progress: Progress | None = None) -> Outcome:
        """Run all ticks; an interrupt or a failure ends the run and keeps what was recorded."""
        began = time.perf_counter()
        outcome = Outcome(self.arrays, 0)
        try:
            self._start()
            self._loop(progress)
        except KeyboardInterrupt as error:
            self._locate(error)
            outcome.status = "interrupted"
        except SimulationError as error:
            outcome.status, outcome.error = "failed", error
        outcome.ticks = self.tick
        outcome.wall_s = time.perf_counter() - began
        outcome.arrays = self._recorded()
        return outcome

    def _loop(self, progress: Progress | None) -> None:
        total = self.network.ticks
        try:
            held = self._compile(checked=True)(0, 1, self._held())
            self.tick = 1
            run = self._compile(checked=False)
            chunk = 16
            while self.tick < total:
                stop = min(total, self.tick + chunk)
                began = time.perf_counter()
                held = run(self.tick, stop, held)
                took = time.perf_counter() - began
                self.tick = stop
                chunk = max(1, min(4 * chunk, int(chunk * CHUNK_SECONDS / max(took, 1e-6))))
                if progress is not None:
                    progress(self.tick, total)
        except SimulationError:
            raise
        except Exception as error:
            block = self._locate(error)
            text = str(error) if isinstance(error, NotFiniteError) else _described(error)
            raise SimulationError(block, self.tick, self.tick * self.network.dt, text) from error

    def _start(self) -> None:
        """Fill the states, and compute what never changes."""
        self.namespace: dict[str, Any] = {
            **dict(
                zip(
                    GLOBALS,
                    (math.isfinite, math.isnan, np.dot, np.array, self._checked, self._not_finite),
                    strict=True,
                )
            ),
            **{f"probe_{i}": array for i, array in enumerate(self.arrays.values())},
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
                    self.namespace[self.emitter.variable(step.block, port)] = item
                    self._record_constant(step.block, port, item)

    def _guard(self, block: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except Exception as error:
            raise SimulationError(block, 0, 0.0, _described(error)) from error

    def _compile(self, checked: bool) -> Callable[[int, int, tuple[Any, ...]], tuple[Any, ...]]:
        code = compile(self.emitter.emit(checked), FILENAME, "exec")
        exec(code, self.namespace)
        run: Callable[[int, int, tuple[Any, ...]], tuple[Any, ...]] = self.namespace["run"]
        return run

    def _held(self) -> tuple[Any, ...]:
        return (None,) * len(self.emitter.held())

    def _locate(self, error: BaseException) -> str:
        """Find the tick and the block that an exception came from."""
        trace = error.__traceback__
        while trace is not None and trace.tb_frame.f_code.co_filename != FILENAME:
            trace = trace.tb_next
        if trace is None:
            return ""
        self.tick = int(trace.tb_frame.f_locals.get("k", self.tick))
        return self.emitter.lines.get(trace.tb_lineno, "")

    def _state(self, name: str) -> BlockState:
        entry = self.network.entries[name]
        setting = self.network.setting(name)
        sizes = entry.made.sizes()
        shapes = {
            key: state_shape(sizes, declared, setting, entry.cls.spec)
            for key, declared in entry.cls.spec.states.items()
        }
        arrays = {key: np.zeros(shape) for key, shape in shapes.items()}
        return BlockState(setting, seed_of(self.network.seed, name), arrays)

    def _recordings(self) -> list[Recording]:
        """Make the arrays that probes fill, and say which tick fills what."""
        made = []
        for i, probe in enumerate(self.observation.probes.values()):
            array = f"probe_{i}"
            self.arrays[probe.name] = np.full(
                (probe.rows(self.network.ticks), *probe.shape), np.nan
            )
            start = 0
            for signal in probe.signals:
                width = signal.shape[0] if signal.shape else 1
                columns = slice(start, start + width) if len(probe.signals) > 1 else None
                start += width
                made.append(
                    Recording(
                        array=array,
                        end=signal.end,
                        every=probe.every,
                        columns=columns,
                        is_state=signal.is_state,
                        is_event=signal.is_event,
                        constant=probe.constant,
                    )
                )
        return made

    def _record_constant(self, block: str, port: str, value: Any) -> None:
        for recording in self.emitter.recordings:
            if recording.constant and (recording.end.block, recording.end.port) == (block, port):
                kind = self.network.types[block, port]
                array = self.namespace[recording.array]
                column = kind.column(recording.end.component) if recording.end.component else None
                item = value if column is None else value[column]
                array[0 if recording.columns is None else (0, recording.columns)] = item

    def _recorded(self) -> dict[str, FloatArray]:
        """The rows that were filled before the run ended."""
        probes = self.observation.probes
        return {name: a[: _filled(probes[name], self.tick)] for name, a in self.arrays.items()}

    def _checked(self, block: str, ports: tuple[str, ...], value: Any) -> Any:
        """Hold what a block returned on its first tick against what it declares."""
        if len(ports) > 1 and (not isinstance(value, tuple) or len(value) != len(ports)):
            raise TypeError(f"expected a tuple of its outputs ({', '.join(ports)}), got {value!r}")
        for port, item in zip(ports, (value,) if len(ports) == 1 else value, strict=True):
            self._check_value(block, port, item)
        return value

    def _not_finite(self, block: str, *values: Any) -> NoReturn:
        """Called by the plan where an output holds a number that is none: say which."""
        ports = [
            step.evaluation.outputs
            for step in self.plan.steps
            if step.block == block and len(step.evaluation.outputs) == len(values)
        ]
        for outputs in ports:
            for port, value in zip(outputs, values, strict=True):
                if _bad(self.network.types[block, port], value):
                    raise NotFiniteError(f"output '{port}' is not finite: {_brief(value)}")
        raise NotFiniteError(f"an output is not finite: {_brief(values)}")

    def _check_value(self, block: str, port: str, value: Any) -> None:
        kind = self.network.types[block, port]
        if not _has_form(kind, value):
            raise SimulationError(
                *(block, 0, 0.0), f"output '{port}' must be {_form(kind)}, got {_brief(value)}"
            )


def _filled(probe: Probe, ticks: int) -> int:
    return probe.rows(ticks) if not probe.constant else min(1, ticks)


def _described(error: BaseException) -> str:
    """An exception in one line, with the place in the user's own code."""
    frames: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _has_form(kind: SignalType, value: Any) -> bool:
    if kind.form == "scalar":
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind.form == "record":
        return (
            isinstance(value, tuple)
            and len(value) == len(kind.components)
            and all(isinstance(part, (int, float)) for part in value)
        )
    return isinstance(value, np.ndarray) and value.shape == kind.shape and value.dtype == np.float64


def _bad(kind: SignalType, value: Any) -> bool:
    numbers = np.asarray(value)
    return bool(np.isnan(numbers).any() or (kind.finite and np.isinf(numbers).any()))


def _form(kind: SignalType) -> str:
    if kind.form == "scalar":
        return "a float"
    if kind.form == "record":
        return f"a tuple of {len(kind.components)} floats ({', '.join(kind.components)})"
    return f"a float64 array of shape {kind.shape}"


def _brief(value: Any) -> str:
    text = (
        f"an array of shape {value.shape}, {value.dtype}"
        if isinstance(value, np.ndarray)
        else repr(value)
    )
    return text if len(text) < 80 else text[:77] + "..."
