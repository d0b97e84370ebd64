"""What a session shows of its run: the time, signals, what was recorded.

In: the engine of a session. Out: numbers, rows and results; nothing of the run changes.
"""

from __future__ import annotations

import threading
from datetime import datetime
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine import Engine
from runtime.errors import SimulationError, UsageError
from runtime.runs import Pacing, Result, result_of
from runtime.sessions.calls import alone
from runtime.sessions.kept import ChangeableGraph
from runtime.sessions.log import Log
from runtime.sessions.signals import Signals


class _Readable:
    """The part of a session that only looks."""

    _inside: threading.Lock
    _failed: SimulationError | None
    _engine: Engine
    _signals: Signals
    _log: Log
    _began: datetime
    _pacing: Pacing | None

    @property
    def graph(self) -> ChangeableGraph:
        """The graph with all changes so far."""
        raise NotImplementedError

    def _tear(self, block: str = "") -> None:
        raise NotImplementedError

    @property
    def tick(self) -> int:
        """How many ticks are done."""
        return self._engine.state.tick

    @property
    def t(self) -> float:
        """The time of the next tick."""
        return self.tick * self._engine.network.dt

    @property
    def stopped(self) -> bool:
        """Whether ``run.stop`` has ended the run; it goes on once that has another condition."""
        return self._engine.is_stopped

    def _check(self) -> None:
        """Raise the failure that left a tick half done; a snapshot can be restored."""
        if self._failed is not None:
            raise self._failed

    @alone
    def read(self, *addresses: str) -> Any:
        """A signal, a component or a state at the time ``t``: a float, or an array.

        A signal is what the next tick will compute, a state what it finds. Of several addresses,
        it is a tuple; what they depend on is computed once.

        Raises
        ------
        UsageError : there is no such address.
        """
        self._check()
        return self._signals.read(*addresses)

    @alone
    def rows(self, since: int = 0) -> dict[str, tuple[FloatArray, FloatArray]]:
        """What each probe has recorded at ticks from ``since`` on: times, and rows as in a result.

        A constant probe has one row, of tick 0. Of a run that ``run.keep`` limits, what is kept.
        """
        if not isinstance(since, (int, np.integer)):
            raise UsageError(f"expected a tick from which on rows are wanted, got {since!r}")
        recorder, tick = self._engine.recorder, self.tick
        recorder.flush(tick, all=True)
        return {name: recorder.since(name, int(since), tick) for name in recorder.probes}

    @alone
    def result(self) -> Result:
        """What was recorded up to now, with metrics and plots; the session can go on.

        After a failure, the status is "failed", and the ticks are those before it.
        """
        return self._result()

    def _result(self) -> Result:
        prepared, outcome = self.graph.prepared(growing=True), self._engine.finish()
        if self._failed is not None:
            outcome.status, outcome.error = "failed", self._failed
        result = result_of(prepared, self._engine, outcome, self._began)
        if self._pacing is not None:
            self._pacing.end(result)
        return result

    def __repr__(self) -> str:
        return (
            f"<Session '{self._engine.network.title}' at t = {self.t:g}: {len(self._log)} changes>"
        )
