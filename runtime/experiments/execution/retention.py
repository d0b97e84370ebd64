"""Which trials leave a run folder.

In: ``--keep`` and the rows as they come. Out: what a trial records, and folders under ``trials``::

    best:2, minimize error; errors 3, 1, 2  ->  trials/000001 and trials/000002; 000000 is removed
"""

from __future__ import annotations

import heapq
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.experiments.design import Objective
from runtime.experiments.execution.folder import RunOptions
from runtime.experiments.execution.index import Row
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import Task, TrialResult
from runtime.files import write_whole
from runtime.runs import save
from runtime.streaming import DAMAGED, open_arrays, save_arrays

SERIES = "series"  # the folder of signals that figures show
TRIALS, OLD_TRIALS = "trials", "points"  # folders; the second of earlier versions
NOT_OK = ("failed", "timeout")
_OWN = re.compile(r"[0-9]{6,18}")  # the name of a trial's folder
_BEST = re.compile(r"best:([1-9][0-9]{0,5})")


@dataclass
class RetentionPolicy:
    """Decides what each trial records, and writes the run folders of the trials that are kept.

    Parameters
    ----------
    options : of the sweep, with the policy: ``none``, ``all``, ``failed`` or ``best:N``.
    objective : what 'best' means, with the metric's column in the index.
    signals : that every trial records for figures.
    """

    options: RunOptions
    objective: Objective | None
    column: int | None
    signals: tuple[str, ...] = ()
    _heap: list[tuple[float, int]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.folder, self.policy = self.options.folder, self.options.keep
        best = _BEST.fullmatch(self.policy)
        if self.policy not in ("none", "all", "failed") and best is None:
            raise UsageError(f"--keep {self.policy}: expected all, failed, best:N or none")
        self.most = int(best[1]) if best else 0
        older = self.folder / OLD_TRIALS
        self.runs = older if older.is_dir() else self.folder / TRIALS
        if self.most and self.objective is None:
            raise UsageError(f"--keep {self.policy}: the graph has no metric that could be best")

    def resume(self, rows: Iterable[Row]) -> None:
        """Continue with what an interrupted sweep kept; other trial folders are removed."""
        for path in self.runs.glob(".*.partial"):  # of a folder that was being written
            shutil.rmtree(path, ignore_errors=True)
        if self.most:
            for row in rows:
                self._rank(row)
            best = {number for _, number in self._heap}
            for path in self.runs.glob("[0-9]*"):
                if _OWN.fullmatch(path.name) and int(path.name) not in best:
                    shutil.rmtree(path, ignore_errors=True)

    def task(self, trial: Trial) -> Task:
        """How to run a trial."""
        if self.policy == "none":
            return self.options.task(trial, signals=self.signals)
        keep = {"all": ("ok", *NOT_OK), "failed": NOT_OK}.get(self.policy, ("ok",))
        # A worker sends a recording only if it is among the best so far: it may be gigabytes.
        beat = None
        if self.objective is not None and self.most and len(self._heap) == self.most:
            beat = (self.objective, -self._heap[0][0])
        return self.options.task(trial, record="all", keep=keep, beat=beat, signals=self.signals)

    def save(self, trial: Trial, done: TrialResult) -> None:
        """Write a trial's folder, before its row; a folder left by an interruption is replaced."""
        save_trial(trial, done, self.path(trial.number))
        save_series(done, self.folder, trial.number)

    def discard(self, row: Row) -> None:
        """After a row was written: remove the folder that is no longer among the best."""
        if self.most:
            dropped = self._rank(row)
            if dropped is not None:
                shutil.rmtree(self.path(dropped), ignore_errors=True)

    def path(self, number: int) -> Path:
        """A trial's folder."""
        return self.runs / f"{number:06d}"

    def _rank(self, row: Row) -> int | None:
        value = None if self.column is None else row.metrics[self.column]
        if value is None or self.objective is None:
            return None
        entry = (-self.objective.of(value), row.trial)
        if len(self._heap) < self.most:
            heapq.heappush(self._heap, entry)
            return None
        return heapq.heappushpop(self._heap, entry)[1]


def save_trial(trial: Trial, done: TrialResult, path: Path) -> None:
    """Write the run folder of a trial that sent its result back; an older folder is replaced."""
    if done.result is not None:
        shutil.rmtree(path, ignore_errors=True)
        done.result.files = trial.configuration.bundle.files
        save(done.result, path)


def save_series(done: TrialResult, folder: Path, number: int) -> None:
    """Write the signals that a trial recorded for figures, before its row."""
    if done.series:
        content = BytesIO()
        arrays: dict[str, Any] = {}
        for signal, (t, values) in done.series.items():
            arrays |= {f"{signal} t": t, signal: values}
        save_arrays(content, arrays)
        (folder / SERIES).mkdir(exist_ok=True)
        write_whole(folder / SERIES / f"{number:06d}.npz", content.getvalue())


def read_series(folder: Path, number: int, signal: str) -> tuple[FloatArray, FloatArray] | None:
    """A signal of a trial as its times (s) and values; None if the trial has not recorded it.

    Raises
    ------
    UsageError : the file is damaged.
    """
    path = folder / SERIES / f"{number:06d}.npz"
    try:
        stored = open_arrays(path)
        return (stored[f"{signal} t"], stored[signal]) if signal in stored else None
    except FileNotFoundError:
        return None
    except DAMAGED as error:
        raise UsageError(f"cannot read '{path}': {error}") from None
