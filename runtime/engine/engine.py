"""The engine: owns all states of a run, and runs the plan's function at a fixed step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from blocks.core import FloatArray, ParameterError
from runtime.engine.beside import Beside
from runtime.engine.diagnosis import Diagnosis
from runtime.engine.events import FOUND, TICK, TIME
from runtime.engine.interrupts import stoppable
from runtime.engine.loops import loop_names
from runtime.engine.naming import GLOBALS
from runtime.engine.profile import Profile
from runtime.engine.program import Program
from runtime.engine.recorder import Recorder
from runtime.engine.replay import ExactRunner
from runtime.engine.rosenbrock import implicit
from runtime.engine.runners import (
    CompiledError,
    MakeRunner,
    Progress,
    PythonRunner,
    Run,
    RunContext,
    Runner,
    located,
    silent,
)
from runtime.engine.solvers import (
    blend,
    controls,
    joined,
    judged,
    method_of,
    refused,
    substep,
)
from runtime.engine.state import Held, RunState
from runtime.engine.values import (
    NotFiniteError,
    OutputChecks,
    Zeros,
    bad_slope,
    event_names,
    floats,
    sealed,
    unreached,
    wrong_initial,
)
from runtime.errors import Problem, SimulationError, UsageError, raised_at
from runtime.network import Network
from runtime.plan import Call, Plan, Record, Signal

# The seconds that ticks run between two looks at signals and progress: more, up to the last number,
# where the checkpoint before them takes more than a part of this time.
CHUNK_SECONDS, CHUNK_COPIES, CHUNK_MOST = 0.1, 50.0, 2.0
SMALL_STATE = 1024**2


@dataclass
class Outcome:
    """The outcome of a run: recorded arrays, ticks done, how it ended, and the seconds it took.

    ``stopped_at`` is the time (s) at which ``run.stop`` ended it. ``python_from`` is the tick from
    which a compiled run was under the Python engine; ``notes`` say why.
    ``events`` are the times and guards of the located events, if a probe records some.
    ``ready_s`` is the part of ``wall_s`` before the second tick: initial states, compilation.
    """

    arrays: dict[str, FloatArray]
    ticks: int
    status: str = "complete"
    engine: str = "python"
    wall_s: float = 0.0
    ready_s: float = 0.0
    error: SimulationError | None = None
    stopped_at: float | None = None
    python_from: int | None = None
    events: FloatArray | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def engines(self) -> str:
        """The engine, or both of a run that changed it."""
        if self.python_from is None:
            return self.engine
        return f"{self.engine}, then python from tick {self.python_from}"


@dataclass
class Engine:
    """One run of one program; each run needs a new engine.

    Parameters
    ----------
    program : the graph's plan, and what to record.
    seed : of all noise and neurons.
    make_runner : makes the runner of the ticks after the first; the Python engine's by default.
    note : called with a message for the user when something takes a while.
    profile : measures the time per block; for the Python engine only.
    folder : for recordings that are too large for memory; a temporary one by default.

    ``state`` owns everything that moves.
    """

    program: Program
    seed: int
    make_runner: MakeRunner | None = None
    note: Callable[[str], None] = silent
    profile: Profile | None = None
    folder: Path | None = None
    network: Network = field(init=False)
    plan: Plan = field(init=False)
    state: RunState = field(init=False)
    recorder: Recorder = field(init=False)
    arrays: dict[str, FloatArray] = field(init=False)
    diagnosis: Diagnosis = field(init=False)
    checks: OutputChecks = field(init=False)
    lines: Mapping[int, str] = field(init=False, default_factory=dict)
    runner: Runner = field(init=False)
    exact: ExactRunner | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.network, self.plan = self.program.network, self.program.plan
        probes, ticks = self.program.observation.probes, self.network.ticks
        self.recorder = Recorder(
            *(probes, ticks, self.network.dt, self.program.gathered, self.folder)
        )
        self.arrays = self.recorder.arrays
        self.state = RunState(self.program, self.seed)
        self.diagnosis = Diagnosis(self.network, self.state.blocks)
        self.checks = OutputChecks(self.network)

    def prepare(self) -> Runner:
        """Initialise the states and make the runner, without running a tick."""
        self._start()
        # Zero, as outputs of a part that is off are.
        self.state.held = tuple(signal.kind.zero() for signal in self.plan.held)
        if self.make_runner is None:
            self.runner = PythonRunner(list(self.program.held), self._python())
            return self.runner
        made = self.make_runner(
            RunContext(self.program, self.state.blocks, self.namespace, self.note)
        )
        self.state.arrays["run/plan"] = made.numbers
        self.state.compiled = set(made.blocks)
        own = self.state.own & self.state.compiled
        beside = Beside(self.state, own, self.namespace, made.read) if own else None
        self.runner = self.exact = ExactRunner(self.state, made, self._python, beside)
        return made

    def solve(self) -> list[Problem]:
        """What the blocks that solve for what others publish find wrong; starts only those.

        Such a block is a Decoder, whose system may be singular for the neurons of this seed.
        """
        problems: list[Problem] = []
        failed: set[str] = set()
        receive = {name: self.network.publications(name) for name in self.network.entries}
        publish = {source.block for found in receive.values() for _, source in found}
        for name in self._starting_order():
            sources = {source.block for _, source in receive[name]}
            if not (name in publish or sources) or sources & failed:
                continue
            try:
                self._start_block(name)
            except SimulationError as error:
                failed.add(name)
                entry, cause = self.network.entries[name], error.__cause__
                if isinstance(cause, ParameterError):
                    problems += [entry.problem(*each) for each in cause.problems]
                else:
                    problems.append(Problem(entry.node.key, entry.address, str(error)))
        return problems

    def run(self, progress: Progress | None = None) -> Outcome:
        """Run all ticks; an interrupt or a failure ends the run, and the recording is kept."""
        began = time.perf_counter()
        engine = "python" if self.make_runner is None else "compiled"
        outcome = Outcome(self.arrays, 0, engine=engine)
        try:
            with stoppable():
                held = self._first_tick()
                outcome.ready_s = time.perf_counter() - began
                if self.profile is not None:
                    self.profile.restart()
                self._loop(held, progress)
            if self.state.stop[FOUND]:
                outcome.status, outcome.stopped_at = "stopped", float(self.state.stop[TIME])
        except KeyboardInterrupt as error:
            self.locate(error)
            outcome.status = "interrupted"
        except SimulationError as error:
            outcome.status, outcome.error = "failed", error
        outcome.ticks = self.state.tick
        if self.exact is not None:
            outcome.python_from, outcome.notes = self.exact.python_from, self.exact.notes
        outcome.wall_s = time.perf_counter() - began
        outcome.arrays = self.recorder.finish(self.state.tick)
        count = self.state.arrays.get("run/count")
        outcome.events = None if count is None else self.namespace["log"][: int(count[0])]
        return outcome

    def _first_tick(self) -> Held:
        """Run the first tick in Python, which checks the form of every value."""
        try:
            self.prepare()
            held = self.state.held = self.runner.adopt(self._checked_tick())
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:  # an exception of a block must not end the process
            raise self._failed(error) from error
        self.state.tick = 1
        return held

    def _checked_tick(self) -> Held:
        """Run the first tick; returns the variables that outlive it."""
        names = self.program.held
        held = dict(zip(names, self.state.held, strict=True))
        scope = {**self.namespace, **held, "k": 0, "t": 0.0}
        lines, self.lines = self.lines, self.program.first.lines
        for number, piece in enumerate(self.program.first.pieces):
            if self.state.stop[FOUND]:
                break
            compiled = number == self.program.first.integration and self.exact is not None
            if not (compiled and self.exact.integrate(scope)):  # type: ignore[union-attr]
                exec(piece, scope)
        self.lines = lines  # of the other ticks; in a failure, those of this one remain
        return tuple(scope[name] for name in names)

    def _loop(self, held: Held, progress: Progress | None) -> None:
        total, chunk = self.network.ticks, 16
        run, recorder = self.runner.run, self.recorder
        try:
            while self.state.tick < total and not self.state.stop[FOUND]:
                stop = min(self.diagnosis.boundary(self.state.tick), self.state.tick + chunk)
                stop = min(total, stop, recorder.boundary())
                first, began = self.state.tick, time.perf_counter()
                self.state.held = held = run(first, stop, held)
                took = time.perf_counter() - began
                stop = round(self.state.stop[TICK]) + 1 if self.state.stop[FOUND] else stop
                self.state.tick = stop
                recorder.flush(stop)
                self.diagnosis.look(stop)
                copied = self.exact.copied if self.exact is not None else 0.0
                wanted = max(CHUNK_SECONDS, min(CHUNK_COPIES * copied, CHUNK_MOST))
                rate = (stop - first) / max(took - copied, 1e-6)
                chunk = max(1, min(4 * chunk, int(wanted * rate)))
                if progress is not None:
                    progress(self.state.tick, total)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an exception of a block must not end the process
            raise self._failed(error) from error

    def _failed(self, error: BaseException) -> SimulationError:
        """The error that names the block, the tick and the time of an exception."""
        found = self.locate(error)
        block = getattr(error, "block", "") or found
        is_message = isinstance(error, (NotFiniteError, UsageError, CompiledError))
        text = str(error) if is_message else _described(error)
        network, tick = self.network, self.state.tick
        return SimulationError(block, tick, tick * network.dt, text, network.time_unit)

    def _start(self) -> None:
        """Initialise the states, and compute the constant outputs."""
        functions = (
            *(math.isfinite, math.isnan, np.vdot, np.array, np.full, np.concatenate, Zeros()),
            *(self.checks.forms, sealed, self.checks.not_finite, floats),
        )
        self.namespace: dict[str, Any] = dict(zip(GLOBALS, functions, strict=True))
        self.namespace |= {f"probe_{i}": array for i, array in enumerate(self.arrays.values())}
        self.namespace |= {} if self.profile is None else self.profile.names()
        self.namespace |= self._continuous_names()
        self.namespace |= loop_names(self.plan, self.state.arrays)
        if self.program.observation.stop is not None:
            self.namespace["stop"] = self.state.stop
        names = self.program.names
        for name, entry in self.network.entries.items():
            self.namespace[names.blocks[name]] = entry.block
            self.namespace[names.states[name]] = self.state.blocks[name]
        for name in self._starting_order():
            self._start_block(name)
        for record in self.plan.records:
            if record.publisher:
                self._record_tuning(record)
        for name, initial in names.initial.items():
            state = self.state.blocks[name]
            keys = [each.name for each in self.plan.states[name]]
            copies = {key: getattr(state, key).copy() for key in keys}
            self.namespace[initial] = SimpleNamespace(**copies)
        for call in self.plan.evaluations:
            if call.gate.once:
                self._compute_constants(call)

    def _compute_constants(self, call: Call) -> None:
        """Call a method whose outputs never change, and record them."""
        method = getattr(self.network.entries[call.block].block, call.method)
        value = self._guard(call.block, partial(method, self.state.blocks[call.block], 0.0))
        values = (value,) if len(call.outputs) == 1 else value
        for signal, item in zip(call.outputs, values, strict=True):
            self.checks.form(signal.block, signal.port, item)
            if isinstance(item, np.ndarray):
                item = sealed(item)
            self.namespace[self.program.names.of(signal)] = item
            self._record_constant(signal, item)

    def _starting_order(self) -> list[str]:
        """Blocks by name; those that publish descriptions before the others."""
        outputs = {n: e.cls.spec.outputs.values() for n, e in self.network.entries.items()}
        return sorted(outputs, key=lambda n: not any(port.publishes for port in outputs[n]))

    def _start_block(self, name: str) -> None:
        """Initialise one block's state, with what the outputs wired to it publish."""
        published = {}
        for port, source in self.network.publications(name):
            made = self.network.entries[source.block].block
            describe = getattr(made, type(made).spec.outputs[source.port].publishes)
            call = partial(describe, self.state.blocks[source.block])
            published[port] = self._guard(source.block, call)
        state = self.state.blocks[name]
        state.published = published
        block = self.network.entries[name].block
        self._guard(name, partial(block.start, state))
        if name in self.network.initial:
            for key, array in self.network.initial[name].items():
                wrong = wrong_initial(key, getattr(state, key), array)
                if wrong:
                    raise SimulationError(name, 0, 0.0, wrong)
                getattr(state, key)[...] = array
            self._guard(name, partial(block.resume, state))

    def final_states(self) -> dict[str, FloatArray]:
        """Copies of the states by ``block.state``, as far as ``run.states`` keeps them."""
        kept = self.network.states
        largest = {"none": -1, "small": SMALL_STATE, "all": math.inf}[kept]
        found = {}
        for name, entry in self.network.entries.items():
            for key, declared in entry.cls.spec.states.items():
                array = getattr(self.state.blocks[name], key)
                if 0 < array.nbytes <= largest and not declared.cached:
                    found[f"{name}.{key}"] = array.copy()
        return found

    def _continuous_names(self) -> dict[str, Any]:
        """What the text of a graph with continuous states refers to."""
        part = self.plan.integration
        if part is None:
            return {}
        size = part.row.size
        method = method_of(part.solver, part.colours)
        slopes = np.zeros((method.slope_rows(size), size))
        solver, dt = self.network.solver, self.network.dt
        control = controls(
            solver.rtol, solver.atol, min(dt, solver.max_step or dt), self.network.until
        )
        self.state.arrays["run/control"] = control
        jacobian: dict[str, FloatArray] = {}
        move: Callable[..., None] = blend
        if part.coupling is not None:
            jacobian = {"colours": part.coupling.colours, "pattern": part.coupling.pattern}
            move = partial(implicit, colours=part.coupling.colours, pattern=part.coupling.pattern)
        return {
            **jacobian,
            **event_names(part, self.state.arrays),
            "states": self.state.continuous,
            "start": np.zeros(size),
            "slopes": slopes,
            "nodes": method.nodes,
            "weights": method.table if method.is_implicit else method.terms,
            "table": method.table,
            "blend": move,
            "joined": joined,
            "rates": self.checks.rates,
            "bad_slope": partial(bad_slope, part, slopes),
            "errors": np.array(method.errors),
            "control": control,
            "substep": substep,
            "judged": judged,
            "refused": refused,
            "unreached": partial(unreached, part, solver.name, control),
        }

    def _guard(self, block: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except ParameterError as error:
            entry = self.network.entries[block]
            texts = [str(entry.problem(parameter, text)) for parameter, text in error.problems]
            raise SimulationError(block, 0, 0.0, "; ".join(texts)) from error
        except BaseException as error:
            raise SimulationError(block, 0, 0.0, _described(error)) from error

    def _python(self) -> Run:
        """The function of the Python plan."""
        code = self.program.code
        self.lines = code.lines
        self.namespace |= self.state.stacks()
        exec(code.pieces[0], self.namespace)
        run: Run = self.namespace["run"]
        return run

    def locate(self, error: BaseException) -> str:
        """Set the tick to the one that raised an exception; returns the block."""
        found = located(error, self.lines)
        if found is None and self.state.tick:
            found = self.runner.locate(error)
        if found is None:
            return ""
        self.state.tick, block = found
        return block

    def _record_tuning(self, record: Record) -> None:
        """Record what a block publishes about the neurons behind a signal."""
        block = record.block
        describe = getattr(self.network.entries[block].block, record.publisher)
        self.namespace[f"probe_{record.number}"][0] = describe(self.state.blocks[block]).table()

    def _record_constant(self, signal: Signal, value: Any) -> None:
        for record in self.plan.records:
            if record.gate.once and not record.publisher and record.source.whole == signal:
                array, source = self.namespace[f"probe_{record.number}"], record.source
                item = value[source.columns] if source.component else value
                array[0 if record.columns is None else (0, record.columns)] = item


def _described(error: BaseException) -> str:
    """An exception in one line, with its location in the user's code."""
    place = raised_at(error)
    # Compiled text has no lines of its own.
    place = f" ({place})" if place and Path(place).parent.name != "compiled" else ""
    suggestion = ""
    if isinstance(error, ValueError) and "read-only" in str(error):
        suggestion = "; arrays that a block receives or has returned are read-only: write to a copy"
    return f"{type(error).__name__}: {error}{place}{suggestion}"
