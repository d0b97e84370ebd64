"""A study: trials that are proposed by a source, run by workers, and kept in one folder.

In: a plan, how it is run, and trials as they are proposed. Out: the row of each; what the folder
has a row of already is not run again::

    12 trials of a plan, rows 0..6 and 9 in the index  ->  their rows, then 7, 8, 10 and 11 run
    a batch of an optimiser, trials 40..47             ->  their rows, in this order

Sweeps and ablations take all trials of their plan (:meth:`Study.all_rows`), tunings a batch at a
time (:meth:`Study.rows_of`). Judging rows is no part of it.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any

from runtime.experiments.execution.folder import elsewhere, open_folder
from runtime.experiments.execution.index import Columns, Index, Row, check_row, remaining
from runtime.experiments.execution.options import RunOptions
from runtime.experiments.execution.plan import INDEX, ExperimentPlan
from runtime.experiments.execution.retention import Retention
from runtime.experiments.execution.runner import run_trials
from runtime.experiments.execution.starts import programs, record_end, record_start
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker_pool import WorkerPool
from runtime.runs import check_same_program
from runtime.terminal import Progress


class Outcome(ABC):
    """What a study has given: rows that were judged, as they are printed and stored."""

    folder: Path
    is_interrupted: bool

    @property
    def exit_code(self) -> int:
        """That of its command."""
        return 0

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """What its JSON file holds."""

    @property
    @abstractmethod
    def text(self) -> str:
        """What its command prints before the folder."""

    @property
    def so_far(self) -> str:
        """How far it came, as in 'interrupted after 3 of 12 trials'."""
        return ""


class Study:
    """A plan that runs in its folder; a context, at whose end Ctrl-C is noted and not raised.

    Parameters
    ----------
    plan, options : what is run, and how.
    progress : shows how far it is.
    retention : what trials record, and which of their results are kept.

    Raises
    ------
    UsageError : as for :func:`open_folder`; or another process writes the index.
    """

    def __init__(
        self,
        plan: ExperimentPlan,
        options: RunOptions,
        progress: Progress,
        retention: Retention | None = None,
    ) -> None:
        self.plan, self.options, self.progress = plan, options, progress
        self.retention = retention or Retention(options)
        self.is_interrupted = False
        self.done = 0  # rows that it has given
        self._began = time.perf_counter()
        self._pool: WorkerPool | None = None
        self._indexes: list[Index] = []
        open_folder(plan, options)
        self.index = self.open_index(options.folder / INDEX, plan.columns)

    def __enter__(self) -> Study:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        self.is_interrupted = isinstance(error, KeyboardInterrupt)
        try:
            self.progress.close()
            if self._pool is not None:
                self._pool.leave(kind is None)
                record_end(self.options.folder, self._pool)
        finally:
            for index in self._indexes:
                index.close()
        if kind is None:
            self.options.remove_checkpoints()
        return self.is_interrupted

    @property
    def wall_s(self) -> float:
        """How long it has taken so far (s)."""
        return time.perf_counter() - self._began

    def open_index(self, path: Path, columns: Columns) -> Index:
        """An index of this study, made if it is not there; closed with it."""
        if not path.exists():
            Index.create(path, columns)
        index = Index(path, columns, self.options.again)
        self._indexes.append(index)
        return index

    def all_rows(self) -> Iterator[Row]:
        """The rows of all trials of the plan: those of the index, then others as they end.

        Raises
        ------
        UsageError : a row of the index is not of this plan, or no worker can run trials.
        """
        missing = remaining(self.index, self.plan.trials())
        for row in self.index.rows():
            self.retention.rank(row)
            self.done += 1
            yield row
        self.retention.clean()
        for row in self._run(missing, self.index):
            self.done += 1
            yield row

    def rows_of(self, trials: Sequence[Trial], index: Index) -> list[Row]:
        """The rows of some trials, in their order; those without one are run first.

        Raises
        ------
        UsageError : as for :meth:`all_rows`.
        """
        known = index.by_trial
        for trial in trials:
            if trial.number in known:
                check_row(trial, known[trial.number], index.path)
        for row in self._run((t for t in trials if t.number not in known), index):
            known[row.trial] = row
        self.done += len(trials)
        return [known[trial.number] for trial in trials]

    def show(self, note: str) -> None:
        """Show how far it is, once trials run."""
        if self._pool is not None:
            self.progress(self.done, self.plan.total, note)

    def _run(self, trials: Iterator[Trial], index: Index) -> Iterator[Row]:
        """Run trials, and add their rows to an index."""
        first = next(trials, None)
        if first is None:
            return
        pool = self._pool = self._pool or self._start()

        def watch() -> None:
            self.progress.workers = pool.workers()
            self.progress.redraw()

        watch()
        retention = self.retention
        for trial, done in run_trials(chain([first], trials), pool, retention.task, watch):
            retention.save(trial, done)
            row = Row.of(trial, done, self.plan.metrics)
            index.append(row)
            retention.rank(row)
            yield row

    def _start(self) -> WorkerPool:
        """Make the workers, and record the start.

        What was computed by one program is not continued by another unless that is asked for: the
        rows would be mixed without a trace.

        Raises
        ------
        UsageError : rows were computed by another program, or there are no workers.
        """
        folder, option = self.options.folder, self.options.option
        here = self.plan.program
        if any(next(index.rows(), None) for index in self._indexes):
            mixed = option.format("mixed")
            way_out = f"{elsewhere(option)} begins anew, {mixed} continues all the same"
            recorded = programs(folder) or [""]
            check_same_program(recorded, here, f"'{folder}'", way_out, self.options.mixed)
        pool = self.options.make_pool(here)
        record_start(folder, here)
        self.progress.resume(self.done)
        return pool
