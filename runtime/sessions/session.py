"""A session: one run between its start and whatever comes, with one owner of its state.

Its methods let time pass (``run``, ``step``), look (``read``, ``result``), change what is run
(``write``, ``set``, ``wire``, ``without``, ...) or copy it (``snapshot``, ``restore``, ``branch``).
A change acts from the next tick on and is logged with it; the graph, the seed and the log are all
that it takes to compute the same bits again.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from runtime.document import changed_paths, read_graph
from runtime.engine import (
    BetweenTicks,
    Engine,
    adopt,
    adopt_changed,
    carried,
    is_within,
)
from runtime.errors import SimulationError, UsageError
from runtime.runs import Pacing, chosen_runner
from runtime.sessions.calls import alone, block_with, copied, is_numeric, plain
from runtime.sessions.kept import (
    Became,
    ChangeableGraph,
    Course,
    SessionSnapshot,
    change_between,
)
from runtime.sessions.log import Change, Log, repeat
from runtime.sessions.readable import _Readable
from runtime.sessions.saving import save_session
from runtime.sessions.signals import Signals

_T = TypeVar("_T")
_P = ParamSpec("_P")
# The methods that are logged; all but the first are those of a graph.
CALLS = ("write", "set", "wire", "without", "bypass", "replace", "overlay")


class Session(_Readable):
    """A run of a graph that goes on as it is told.

    Parameters
    ----------
    graph : with the seed and the engine of the run, and how much of it is kept (``run.keep``).

    ``first`` is the graph before the first change. Times are in the graph's ``time_unit``.

    Raises
    ------
    GraphError : the graph is wrong. SimulationError : a block cannot start.
    """

    def __init__(self, graph: ChangeableGraph) -> None:
        self._inside = threading.Lock()
        self._failed: SimulationError | None = None
        self.first = self._graph = graph
        self._began = datetime.now().astimezone()
        self._log = Log()
        # Tunable parameters that the engine has and the graph does not yet: writing takes longer.
        self._unwritten: dict[str, Any] = {}
        self._pacing: Pacing | None = None  # of the last time in real time
        self._course: Course = ((object(), 0),)
        self._begin(self._prepared(graph))

    # Time

    @property
    def graph(self) -> ChangeableGraph:
        """The graph with all changes so far."""
        for path, value in self._unwritten.items():
            self._graph = self._graph.set(path, value, origin=f"set {path}")
        self._unwritten.clear()
        return self._graph

    @property
    def log(self) -> tuple[Change, ...]:
        """The changes that led to the present state, in order."""
        return tuple(self._log)

    @alone
    def run(
        self, seconds: float, *, real_time: bool = False, speed: float | None = None
    ) -> Session:
        """Let time pass, rounded to whole ticks, or until ``run.stop`` is met; returns itself.

        Parameters
        ----------
        real_time : each tick waits until it is due by the clock, from this call on; how late they
            were is in the manifest of the result, as ``real_time``.
        speed : seconds of the graph in one second of the clock, 1 by default.

        Raises
        ------
        SimulationError : a block failed; every call repeats that until a snapshot is restored.
        KeyboardInterrupt : Ctrl-C was pressed; the session can go on from the tick it came to. A
            second Ctrl-C does not wait for the end of a tick, and leaves it failed.
        UsageError : another call has not returned, in another thread or around this one.
        """
        number = isinstance(seconds, (int, float, np.number))
        ticks = seconds / self._engine.network.dt if number else math.nan
        if not (math.isfinite(ticks) and ticks >= 0.0):
            raise UsageError(f"expected a time of at least 0 to run, got {seconds!r}")
        if speed is not None and not real_time:
            raise UsageError("speed: is for runs that wait for the clock; add real_time=True")
        pacing = Pacing(1.0 if speed is None else speed) if real_time else None
        self._advance(round(ticks), pacing)
        self._pacing = pacing or self._pacing
        return self

    @alone
    def step(self, ticks: int = 1) -> Session:
        """Do some ticks; returns itself."""
        self._advance(ticks)
        return self

    def _advance(self, ticks: int, pacing: Pacing | None = None) -> None:
        self._check()
        if not isinstance(ticks, (int, np.integer)) or ticks < 0:
            raise UsageError(f"expected a number of ticks of at least 0, got {ticks!r}")
        state = self._engine.state
        last, own = state.tick + int(ticks), state.own_state if state.own else None
        is_left = own is not None and own.left is not None
        if own is not None and is_left:
            copied(own.check_left)
        if last > self._engine.network.ticks:
            self._extend(last)
        elif not self._engine.is_current:
            self._move_to(self.graph)
        try:
            with BetweenTicks() as interrupts:
                if pacing is None:
                    self._engine.advance(last, interrupts.check, at_once=False)
                else:
                    pacing.advance(self._engine, last, interrupts.check)
        except SimulationError as error:
            self._failed = error
            error.result = self._result()
            raise
        except KeyboardInterrupt as error:
            if not interrupts.is_between and is_within(error, Engine.advance):
                self._tear(self._engine.locate(error))
            raise
        finally:
            if is_left:
                self._engine.state.own_state.leave()

    def _tear(self, block: str = "") -> None:
        """Let every call say that an interrupt left the state half changed."""
        engine = self._engine
        text = "interrupted within it, so that a part of it is done; restore a snapshot to go on"
        unit = engine.network.time_unit
        self._failed = SimulationError(block, self.tick, self.t, text, unit)

    # Signals

    @alone
    def write(self, port: str, value: Any) -> None:
        """Set an input of the graph, from the next tick on.

        Raises
        ------
        UsageError : there is no such input, or the value is none of its type or out of bounds.
        """
        self._check()
        written = self._signals.write(port, value)
        self._log.write(self._engine.state.tick, port, written)

    # Changes

    @alone
    def set(self, path: str, value: Any) -> None:
        """Change one entry of the graph, such as ``fault.gain``, from the next tick on.

        Tunable parameters, see ``runtime blocks TYPE``, change in the running engine; for others,
        there is a new one.

        Raises
        ------
        GraphError : it is wrong; the session stays as it was. So for the other changes.
        """
        self._check()
        if self._retune(path, value):
            self._note("set", path, value)
        else:
            self._change("set", path, value)

    def _retune(self, path: str, value: Any) -> bool:
        """Change a tunable parameter in the running engine; False if that is not possible."""
        name, _, parameter = path.removeprefix("blocks.").rpartition(".")
        entry = self._engine.network.entries.get(name)
        if entry is None or not is_numeric(value) or not entry.block.is_tunable(parameter):
            return False
        block = block_with(entry.block, parameter, value, self._engine.program.contexts[name])
        # What is wrong is said, with its place, by the check of the changed graph.
        if block is None or not self._engine.retune(name, block):
            return False
        place = f"blocks.{name}.{parameter}"
        self._unwritten.pop(place, None)  # the last one counts
        self._unwritten[place] = plain(value)
        self._signals.clear()
        return True

    @alone
    def wire(self, consumer: str, source: str | Sequence[str] | None) -> None:
        """Connect an input to another source: ``wire("snn.error", "error.heading")``."""
        self._change("wire", consumer, source)

    @alone
    def without(self, *names: str) -> None:
        """Remove blocks or parts, one or more."""
        self._change_of("without", names)

    @alone
    def bypass(self, *names: str) -> None:
        """Bypass blocks, one or more: what they take in passes straight through."""
        self._change_of("bypass", names)

    @alone
    def replace(self, name: str, kind: str) -> None:
        """Put a block of another type in a block's place."""
        self._change("replace", name, kind)

    @alone
    def overlay(self, source: Any) -> None:
        """Merge another graph over this one; a file is read now, and its content is logged."""
        if not isinstance(source, Mapping):
            source = read_graph(source)[0].plain()
        self._change("overlay", source)

    @alone
    def become(self, graph: ChangeableGraph) -> Became:
        """Go on as another graph, such as this one after an edit of its file.

        Numbers that are tunable change in the running engine; for all else, there is a new one.
        After a failure, what was done before it is computed again first.

        Returns
        -------
        Became : which numbers changed, which blocks kept their state, and which began anew.

        Raises
        ------
        GraphError : the graph is wrong; the session stays as it was. UsageError : it has another
            ``run.dt``, or what no overlay can say; a new session is what can run it.
        """
        graph.check()
        change = change_between(self.graph, graph)
        before = set(self._engine.network.entries)
        if self._failed is not None:
            self._compute_again()
        numbers = [*changed_paths(change)]
        if all(self._retune(".".join(path), node.plain()) for path, node in numbers):
            for path, node in numbers:
                self._note("set", ".".join(path), node.plain())
            return Became(tuple(".".join(path) for path, _ in numbers), tuple(before))
        kept = self._change("overlay", change.plain())
        now = set(self._engine.network.entries)
        begun, gone = now - set(kept), before - now
        return Became((), tuple(kept), tuple(sorted(begun)), tuple(sorted(gone)))

    def prepare(self, graph: ChangeableGraph) -> None:
        """Compile what :meth:`become` will need, in another thread and while the session runs.

        Raises
        ------
        GraphError, UsageError : as :meth:`become`.
        """
        graph.check()
        self._prepared(self._graph.overlay(change_between(self._graph, graph).plain()))

    def _compute_again(self) -> None:
        """Come to the tick before a failure, from the first graph and the log."""
        other = type(self)(self.first)
        repeat(other, self._log)
        other.step(self.tick - other.tick)
        self._graph = other.graph
        self._unwritten.clear()
        self._begin(other._engine)

    def _change_of(self, call: str, names: Sequence[str]) -> None:
        if not names:
            raise UsageError(f"{call}: expected the name of a block, as in {call}('noise')")
        self._change(call, *names)

    def _change(self, call: str, *arguments: Any) -> list[str]:
        self._check()
        try:
            arguments = tuple(map(plain, arguments))
            graph = getattr(self.graph, call)(*arguments)
        except (TypeError, AttributeError) as error:
            raise UsageError(f"{call}: {error}") from None
        graph.check()
        if graph.network.dt != self._engine.network.dt:
            raise UsageError("run.dt cannot change in a session: ticks count its time")
        kept = self._move_to(graph)
        self._note(call, *arguments)
        return kept

    def _note(self, call: str, *arguments: Any) -> None:
        self._log.note(Change(self.tick, call, tuple(map(plain, arguments))))

    def _extend(self, last: int) -> None:
        """Plan for a longer time: edges of sources are known up to ``run.until``."""
        network = self._engine.network
        until = max(last, 2 * network.ticks) * network.dt
        self._move_to(self.graph.set("run.until", until, origin="until"))

    def _move_to(self, graph: ChangeableGraph) -> list[str]:
        """Go on in an engine for a changed graph; nothing changes if it cannot start.

        Returns the blocks that keep their state.
        """
        before = self._engine
        given = copied(partial(carried, before, moves=True))
        shared = copied(before.state.own_state.shared_now)
        engine = self._prepared(graph)  # which starts blocks: what they share begins again
        kept = adopt_changed(engine, before, given)
        engine.state.own_state.restore(shared)
        self._graph = graph
        self._begin(engine)
        return kept

    # Copies

    @alone
    def snapshot(self, rows: bool = True) -> SessionSnapshot:
        """The present state, recordings included.

        Without ``rows``, it is small, and restoring it keeps what the session has recorded up to
        there; if that was another course of events, recordings begin at the snapshot.
        """
        return self._snapshot() if rows else self._snapshot().small()

    def _snapshot(self) -> SessionSnapshot:
        self._check()
        given = copied(partial(carried, self._engine))
        return SessionSnapshot(
            self.t, self.first, self.graph, self._engine, given, self._log.copy(), self._course
        )

    @alone
    def restore(self, saved: SessionSnapshot) -> None:
        """Go back, or forth, to a snapshot of this session or of one that it was branched from."""
        if not isinstance(saved, SessionSnapshot) or saved.first is not self.first:
            raise UsageError("expected a snapshot of this session, or of one it was branched from")
        # An engine whose parameters have changed since, or another one, has other numbers.
        same = saved.graph is self.graph and saved.engine is self._engine
        engine = saved.engine if same else self._prepared(saved.graph)
        adopt(engine, saved.complete(self._engine, self._course))
        saved.engine.state.own_state.restore_shared()
        self._course = (*saved.course, (object(), saved.carried.tick))
        self._graph, self._log = saved.graph, saved.log.copy()
        self._unwritten.clear()
        self._begin(engine)

    @alone
    def branch(self) -> Session:
        """Another session that goes on from here, independent of this one."""
        other = Session.__new__(Session)
        other.first, other._began, other._pacing = self.first, self._began, self._pacing
        other._inside = threading.Lock()
        saved = self._snapshot()
        other._log, other._graph, other._unwritten = saved.log, saved.graph, {}
        engine = self._prepared(saved.graph)
        adopt(engine, saved.carried)
        for each in (self._engine, engine):
            each.state.own_state.leave()
        other._begin(engine)
        other._course = (*self._course, (object(), self.tick))
        self._course += ((object(), self.tick),)
        return other

    @alone
    def save(self, folder: str | Path) -> Path:
        """Write the session into a folder that must not exist yet; returns the folder.

        It has the graph before the first change, each change with its tick, and the result;
        ``runtime replay a`` computes it again. See :mod:`runtime.sessions.saving`.

        Raises
        ------
        UsageError : the folder exists, or cannot be written.
        """
        return save_session(Path(folder), self.first, self._log, self.tick, self._result)

    def _prepared(self, graph: ChangeableGraph) -> Engine:
        prepared = graph.prepared(growing=True)
        network = prepared.network
        engine = Engine(prepared.program, network.seed, chosen_runner(network))
        engine.prepare()
        return engine

    def _begin(self, engine: Engine) -> None:
        # What reads a signal is made of the engine's text: it stays where that does.
        if engine is not getattr(self, "_engine", None):
            self._engine = engine
            self._signals = Signals(engine)
        self._failed = None
