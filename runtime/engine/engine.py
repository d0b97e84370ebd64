"""The engine: owns all states of a run, and runs the plan's function at a fixed step.

In: a program, a seed and a maker of the runner. Out: recordings, states and how the run ended::

    engine = Engine(program, seed=3)
    engine.advance(1000)          # prepares the run, and does its first thousand ticks
    engine.advance(2000)          # goes on
    outcome = engine.finish()     # the recordings so far

``run`` does all of that for the length that the graph gives, and keeps what was recorded when it
ends early.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from blocks.core import Block, FloatArray, retune
from runtime.engine.comparison import Comparison
from runtime.engine.diagnosis import Diagnosis
from runtime.engine.events import FOUND, TICK, TIME
from runtime.engine.interrupts import stoppable
from runtime.engine.profile import Profile
from runtime.engine.program import Program
from runtime.engine.recorder import Recorder
from runtime.engine.replay import ExactRunner
from runtime.engine.runners import (
    CompiledError,
    CompiledPlan,
    MakeRunner,
    Progress,
    PythonRunner,
    Run,
    RunContext,
    Runner,
    located,
    silent,
)
from runtime.engine.starting import Start, described
from runtime.engine.state import Begun, Held, RunState, Snapshot
from runtime.engine.values import (
    FormError,
    NotFiniteError,
    OutputChecks,
    unmet,
)
from runtime.errors import NotCopiedError, Problem, SimulationError, UsageError
from runtime.network import Network
from runtime.plan import Plan

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
    repeats : whether it shall be able to run again, see :mod:`.repeating`.

    ``state`` owns everything that moves.
    """

    program: Program
    seed: int
    make_runner: MakeRunner | None = None
    note: Callable[[str], None] = silent
    profile: Profile | None = None
    folder: Path | None = None
    repeats: bool = False
    first: Snapshot | None = field(init=False, default=None)
    network: Network = field(init=False)
    plan: Plan = field(init=False)
    state: RunState = field(init=False)
    recorder: Recorder = field(init=False)
    arrays: dict[str, FloatArray] = field(init=False)
    diagnosis: Diagnosis = field(init=False)
    starting: Start = field(init=False)
    namespace: dict[str, Any] = field(init=False, default_factory=dict)
    is_checked: bool = field(init=False, default=False)
    wall_s: float = field(init=False, default=0.0)
    ready_s: float = field(init=False, default=0.0)
    began: float | None = field(init=False, default=None)
    begun: Begun = field(init=False)
    lines: Mapping[int, str] = field(init=False, default_factory=dict)
    runner: Runner = field(init=False)
    exact: ExactRunner | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.network, self.plan = self.program.network, self.program.plan
        probes, ticks = self.program.observation.probes, self.network.ticks
        keep = self.network.keep
        self.recorder = Recorder(
            probes,
            ticks,
            self.network.dt,
            self.program.gathered,
            folder=self.folder,
            growing=self.program.growing,
            keep=None if keep is None else max(1, round(keep / self.network.dt)),
        )
        self.arrays = self.recorder.arrays
        self.state = RunState(self.program, self.seed)
        self.diagnosis = Diagnosis(self.network, self.state.blocks)
        self.starting = Start(
            program=self.program,
            state=self.state,
            checks=OutputChecks(self.network),
            arrays=self.arrays,
            names={} if self.profile is None else self.profile.names(),
        )

    def prepare(self) -> Runner:
        """Initialise the states and make the runner, without running a tick."""
        self.namespace = self.starting.all()
        # Zero, as outputs of a part that is off are.
        self.state.held = tuple(signal.kind.zero() for signal in self.plan.held)
        made = None
        if self.make_runner is not None:
            made = self.make_runner(
                RunContext(self.program, self.state.blocks, self.namespace, self.note)
            )
            self.state.numbers = made.numbers
            self.state.compiled = set(made.blocks)
        return self._begin(made)

    def _begin(self, made: CompiledPlan | None) -> Runner:
        """Let a runner begin."""
        if self.program.growing:
            self.begun = self.state.begun()
        if self.repeats:
            with suppress(NotCopiedError):  # then it cannot run again
                self.first = self.state.snapshot()
        if made is None:
            self.runner = PythonRunner(list(self.program.held), self._python())
            return self.runner
        own = self.state.own & self.state.compiled
        comparison = Comparison(self.state, own, self.namespace, made.read) if own else None
        self.runner = self.exact = ExactRunner(self.state, made, self._python, comparison)
        return self.runner

    def run_again(self, changed: Collection[str], anew: Collection[str]) -> bool:
        """Let the runner begin again; False if that takes a new one.

        Parameters
        ----------
        changed : the blocks with other parameters. anew : those that have started again.
        """
        self.first = None
        made = None if self.exact is None else self.exact.compiled
        if made is not None and not made.begin_again(self.network, changed, anew):
            return False
        self._begin(made)
        return self.first is not None

    def solve(self) -> list[Problem]:
        """What the blocks that solve for what others publish find wrong; starts only those."""
        return self.starting.solve()

    def run(
        self,
        progress: Progress | None = None,
        advance: Callable[[int, Progress | None], None] | None = None,
    ) -> Outcome:
        """Run all ticks; an interrupt or a failure ends the run, and the recording is kept.

        ``advance`` is called instead of :meth:`advance`: one that waits between calls of it.
        """
        status, failure = "complete", None
        try:
            (advance or self.advance)(self.network.ticks, progress)
        except KeyboardInterrupt as error:
            self.locate(error)
            status = "interrupted"
        except SimulationError as error:
            status, failure = "failed", error
        outcome = self.finish()
        if failure is not None or status != "complete":
            outcome.status, outcome.error = status, failure
        return outcome

    def advance(self, last: int, progress: Progress | None = None, at_once: bool = True) -> None:
        """Run the ticks up to one, which is the next that is done; or to where the run stops.

        ``progress`` is called between ticks; ``at_once``, signals end the run within a tick, too.

        Raises
        ------
        SimulationError : a block failed. KeyboardInterrupt : the run was interrupted.
        """
        began = self.began = time.perf_counter()
        try:
            with stoppable() if at_once else nullcontext():
                if not self.is_checked and self.state.tick < last:
                    self._first_tick()
                    self.ready_s = time.perf_counter() - began
                    if self.profile is not None:
                        self.profile.restart()
                self._loop(last, progress)
        finally:
            self.wall_s, self.began = self.elapsed(), None

    def elapsed(self) -> float:
        """The time (s) that its ticks took so far, also in the middle of :meth:`advance`."""
        return self.wall_s + (0.0 if self.began is None else time.perf_counter() - self.began)

    def finish(self) -> Outcome:
        """What was recorded up to now."""
        outcome = Outcome({}, self.state.tick, wall_s=self.wall_s, ready_s=self.ready_s)
        outcome.engine = "python" if self.make_runner is None else "compiled"
        if self.state.stop[FOUND]:
            outcome.status, outcome.stopped_at = "stopped", float(self.state.stop[TIME])
        if self.exact is not None:
            outcome.python_from, outcome.notes = self.exact.python_from, self.exact.notes
        outcome.arrays = self.recorder.finish(self.state.tick)
        outcome.events = self.log
        if outcome.events is not None and len(outcome.events) == len(self.namespace["log"]):
            at = f"{len(outcome.events)} events, the last at t = {outcome.events[-1, 0]:g}"
            outcome.notes = [*outcome.notes, f"probes of events are full after {at}"]
        if self.plan.integration is not None and "run/sides" in self.state.arrays:
            sides = self.state.arrays["run/sides"]
            outcome.notes = [*outcome.notes, *unmet(self.plan.integration, self.network, sides)]
        return outcome

    @property
    def is_current(self) -> bool:
        """Whether compiled code is that of the user's present globals and functions."""
        return self.exact is None or self.exact.compiled.is_current

    @property
    def is_stopped(self) -> bool:
        """Whether ``run.stop`` has ended the run."""
        return bool(self.state.stop.item(FOUND))

    @property
    def log(self) -> FloatArray | None:
        """The located events so far, rows of time and guard; None if there are none to locate."""
        count = self.state.arrays.get("run/count")
        return None if count is None else self.namespace["log"][: int(count[0])]

    def _first_tick(self) -> None:
        """Run a tick in Python, which checks the form of every value."""
        try:
            if not self.namespace:
                self.prepare()
            self.state.held = self.runner.adopt(self._checked_tick())
        except (SimulationError, KeyboardInterrupt):
            raise
        except BaseException as error:  # an exception of a block must not end the process
            raise self._failed(error) from error
        self.state.tick += 1
        self.is_checked = True

    def _checked_tick(self) -> Held:
        """Run a tick with checks; returns the variables that outlive it."""
        names, k = self.program.held, self.state.tick
        held = dict(zip(names, self.state.held, strict=True))
        scope = {**self.namespace, **held, "k": k, "t": k * self.network.dt}
        lines, self.lines = self.lines, self.program.first.lines
        for number, piece in enumerate(self.program.first.pieces):
            if self.state.stop[FOUND]:
                break
            compiled = number == self.program.first.integration and self.exact is not None
            if not (compiled and self.exact.integrate(scope)):  # type: ignore[union-attr]
                exec(piece, scope)
        self.lines = lines  # of the other ticks; in a failure, those of this one remain
        return tuple(scope[name] for name in names)

    def _loop(self, total: int, progress: Progress | None) -> None:
        chunk, run, recorder, state = 16, self.runner.run, self.recorder, self.state
        is_stopped = state.stop.item
        try:
            while (first := state.tick) < total and not is_stopped(FOUND):
                stop = min(total, first + chunk, recorder.boundary())
                stop = min(stop, self.diagnosis.boundary(first))
                began = time.perf_counter()
                state.held = run(first, stop, state.held)
                took = time.perf_counter() - began
                state.tick = stop = round(state.stop[TICK]) + 1 if is_stopped(FOUND) else stop
                recorder.flush(stop)
                self.diagnosis.look(stop)
                if stop < total:
                    chunk = self._chunk(chunk, stop - first, took)
                if progress is not None:
                    progress(stop, total)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an exception of a block must not end the process
            raise self._failed(error) from error

    def _chunk(self, last: int, ticks: int, took: float) -> int:
        """How many ticks to run at once, after ``ticks`` of ``last`` took some seconds."""
        copied = self.exact.copied if self.exact is not None else 0.0
        wanted = max(CHUNK_SECONDS, min(CHUNK_COPIES * copied, CHUNK_MOST))
        return max(1, min(4 * last, int(wanted * ticks / max(took - copied, 1e-6))))

    def _failed(self, error: BaseException) -> SimulationError:
        """The error that names the block, the tick and the time of an exception."""
        found = self.locate(error)
        block = getattr(error, "block", "") or found
        is_message = isinstance(error, (FormError, NotFiniteError, UsageError, CompiledError))
        text = str(error) if is_message else described(error)
        network, tick = self.network, self.state.tick
        return SimulationError(block, tick, tick * network.dt, text, network.time_unit)

    def retune(self, name: str, block: Block) -> bool:
        """Give a block other parameters before the next tick, without a new engine.

        Returns whether that is possible; if not, nothing has changed. It is not of blocks of the
        user's own, of those that others have read from when they started, and of what the Python
        engine computes together.

        Parameters
        ----------
        block : of the same type, with other values of tunable parameters.
        """
        entry, state = self.network.entries[name], self.state.blocks[name]
        publishes = any(port.publishes for port in entry.cls.spec.outputs.values())
        is_together = self.exact is None and self.state.is_together(name)
        if name in self.state.own or publishes or is_together:
            return False
        entries = {**self.network.entries, name: replace(entry, block_or_none=block)}
        network, variable = self.network.changed(entries=entries), self.program.names.blocks[name]
        try:
            retune(block, state)
        except Exception:  # noqa: BLE001 -- what is wrong is said by who makes a new engine
            return False
        before, self.namespace[variable] = self.namespace[variable], block
        self.starting.network = network
        constants = [c for c in self.plan.evaluations if c.gate.once and c.block == name]
        for call in constants:
            self.starting.compute_constants(call)
        if self.exact is not None and not self.exact.compiled.retune(network, name):
            retune(before, state)
            self.namespace[variable], self.starting.network = before, self.network
            for call in constants:
                self.starting.compute_constants(call)
            return False
        self.network = self.diagnosis.network = network
        return True

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

    def _python(self) -> Run:
        """The function of the Python plan."""
        code = self.program.code
        self.lines = code.lines
        self.namespace |= self.state.stacks(self.network)
        exec(code.pieces[0], self.namespace)
        run: Run = self.namespace["run"]
        return run

    def locate(self, error: BaseException) -> str:
        """Set the tick to the one that raised an exception; returns the block."""
        found = located(error, self.lines)
        if found is None and self.is_checked:
            found = self.runner.locate(error)
        if found is None:
            return ""
        self.state.tick, block = found
        return block
