"""What trials record, and which of their results are kept besides their rows.

In: ``--keep`` and the rows as they come. Out: how a trial is run, and folders under ``trials``::

    best:2, minimize error; errors 3, 1, 2  ->  trials/000001 and trials/000002; 000000 is removed
"""

from __future__ import annotations

import heapq
import re
import shutil
from io import BytesIO
from pathlib import Path
from typing import Any

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.experiments.execution.folder import RUNS
from runtime.experiments.execution.index import Row
from runtime.experiments.execution.options import RunOptions
from runtime.experiments.execution.plan import ExperimentPlan
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import Task, TrialResult
from runtime.files import write_whole
from runtime.runs import save
from runtime.streaming import DAMAGED, open_arrays, save_arrays

SERIES = "series"  # the folder of signals that figures show
TRIALS, OLD_TRIALS = "trials", "points"  # folders; the second of earlier versions
NOT_OK = ("failed", "timeout")
KEPT = ("ok", *NOT_OK)
_OWN = re.compile(r"[0-9]{6,18}")  # the name of a trial's folder
_BEST = re.compile(r"best:([1-9][0-9]{0,5})")


class Retention:
    """Keeps no result of a trial, but for the signals that figures show.

    Parameters
    ----------
    options : how trials are run, and the folder that their results are kept in.
    signals : that every trial records for figures.
    """

    def __init__(self, options: RunOptions, signals: tuple[str, ...] = ()) -> None:
        self.options, self.signals = options, signals

    def task(self, trial: Trial) -> Task:
        """How to run a trial."""
        return self.options.task(trial, signals=self.signals, **self.recording(trial))

    def recording(self, trial: Trial) -> dict[str, Any]:
        """What a trial records, and when it sends that back, as arguments of :class:`Task`."""
        return {}

    def path(self, trial: Trial) -> Path:
        """The folder of a trial whose result was sent back."""
        return self.options.folder / TRIALS / f"{trial.number:06d}"

    def save(self, trial: Trial, done: TrialResult) -> None:
        """Write what a trial sent back, before its row; an older folder is replaced."""
        if done.result is not None:
            shutil.rmtree(self.path(trial), ignore_errors=True)
            done.result.files = trial.configuration.bundle.files
            save(done.result, self.path(trial))
        if done.series:
            content = BytesIO()
            arrays: dict[str, Any] = {}
            for signal, (t, values) in done.series.items():
                arrays |= {f"{signal} t": t, signal: values}
            save_arrays(content, arrays)
            folder = self.options.folder / SERIES
            folder.mkdir(exist_ok=True)
            write_whole(folder / f"{trial.number:06d}.npz", content.getvalue())

    def rank(self, row: Row) -> None:
        """After a row was read or written: remove a folder that is no longer kept."""

    def clean(self) -> None:
        """After all rows were read: remove folders that an interruption has left."""


class VariantRetention(Retention):
    """Keeps the trajectory of each variant with the first seed, under ``runs``."""

    def __init__(self, plan: ExperimentPlan, options: RunOptions) -> None:
        super().__init__(options, plan.signals)
        self._first, self._settings = next(iter(plan.seeds)), len(plan.design)
        self._slugs = {variant.name: variant.slug for variant in plan.variants}

    def recording(self, trial: Trial) -> dict[str, Any]:
        # The settings of a variant would all have the same folder: the first one is kept.
        is_first = trial.configuration.number % self._settings == 0
        if trial.seed == self._first and is_first:
            return {"record": "trajectory", "keep": KEPT}
        return {}

    def path(self, trial: Trial) -> Path:
        return self.options.folder / RUNS / self._slugs[trial.configuration.cells[0]]


class TrialRetention(Retention):
    """Keeps the trials that ``--keep`` chooses: ``none``, ``all``, ``failed`` or ``best:N``.

    Raises
    ------
    UsageError : it is none of these, or there is no metric that could be best.
    """

    def __init__(self, plan: ExperimentPlan, options: RunOptions) -> None:
        super().__init__(options, plan.signals)
        self.policy, self.objective = options.keep, plan.objective
        best = _BEST.fullmatch(self.policy)
        if self.policy not in ("none", "all", "failed") and best is None:
            raise UsageError(f"--keep {self.policy}: expected all, failed, best:N or none")
        self.most = int(best[1]) if best else 0
        if self.most and self.objective is None:
            raise UsageError(f"--keep {self.policy}: the graph has no metric that could be best")
        self._metrics = plan.metrics
        self._heap: list[tuple[float, int]] = []
        older = options.folder / OLD_TRIALS
        self.runs = older if older.is_dir() else options.folder / TRIALS

    def recording(self, trial: Trial) -> dict[str, Any]:
        if self.policy == "none":
            return {}
        keep = {"all": KEPT, "failed": NOT_OK}.get(self.policy, ("ok",))
        # A worker sends a recording only if it is among the best so far: it may be gigabytes.
        is_full = self.most and len(self._heap) == self.most
        beat = (self.objective, -self._heap[0][0]) if is_full else None
        return {"record": "all", "keep": keep, "beat": beat}

    def path(self, trial: Trial) -> Path:
        return self._folder(trial.number)

    def _folder(self, number: int) -> Path:
        return self.runs / f"{number:06d}"

    def rank(self, row: Row) -> None:
        goal = self.objective
        if not self.most or goal is None or goal.metric not in self._metrics:
            return
        value = row.metrics[self._metrics.index(goal.metric)]
        if value is None:
            return
        entry = (-goal.of(value), row.trial)
        if len(self._heap) < self.most:
            heapq.heappush(self._heap, entry)
        else:
            dropped = heapq.heappushpop(self._heap, entry)[1]
            shutil.rmtree(self._folder(dropped), ignore_errors=True)

    def clean(self) -> None:
        for path in self.runs.glob(".*.partial"):  # of a folder that was being written
            shutil.rmtree(path, ignore_errors=True)
        best = {number for _, number in self._heap}
        for path in self.runs.glob("[0-9]*") if self.most else ():
            if _OWN.fullmatch(path.name) and int(path.name) not in best:
                shutil.rmtree(path, ignore_errors=True)


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
