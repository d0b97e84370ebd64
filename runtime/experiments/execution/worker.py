"""Runs one trial, in the process that it was sent to: a local worker or one of a cluster.

In: a :class:`Task`. Out: a :class:`TrialResult`; an exception of a block becomes its reason::

    Task(trial, timeout=5.0)  ->  TrialResult("ok", metrics={"error": 0.2})
                              ->  TrialResult("timeout", "stopped after 5 s, 812 ticks done")
"""

from __future__ import annotations

import atexit
import hashlib
import json
import math
import pickle
import re
import shutil
import tempfile
import time
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from ctypes import c_ulong, py_object, pythonapi
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from threading import TIMEOUT_MAX, Lock, Timer, current_thread, get_ident, main_thread
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from blocks.core import FloatArray
from blocks.library.registry import blocks_of_module
from runtime.document import parse_scalar, parse_yaml, rename_files, with_folder
from runtime.errors import GraphError, SimulationError, one_line, text_of
from runtime.experiments.design import Objective, shown_probe
from runtime.experiments.execution.trials import GraphBundle, Trial
from runtime.files import write_whole
from runtime.graph import Graph, RepeatedRuns, load
from runtime.observation import CRASHED, Metric
from runtime.runs import Result, program
from runtime.streaming import row_blocks

LOST: Final = "lost"  # its worker died
Status = Literal["ok", "failed", "invalid", "timeout", "lost"]
# What a trial records besides its metrics: nothing, its trajectory, or all plots of the graph.
Record = Literal["metrics", "trajectory", "all"]
TRAJECTORY_PLOTS = ("trajectory", "map")
POINTS = 1000  # rows of a signal that a figure shows over time
_NUMBERS = re.compile(r"[-+.eE0-9\[\], ]+")
GRACE = 3.0  # s; a trial ends itself at its time limit, unless it is stuck inside a block
CACHED_GRAPHS = 4  # the trials of a graph are consecutive, so few are in use at a time
# The graph that ran last; its engine holds a recording, so that one is enough.
_idle: deque[RepeatedRuns] = deque(maxlen=1)


@dataclass(frozen=True)
class Task:
    """A trial and how to run it.

    Parameters
    ----------
    record : what to record; the metrics do not depend on it.
    keep : statuses for which the whole result is sent back.
    beat : of trials that are ok, send only those whose objective is better than this.
    timeout : time limit in seconds; None for no limit.
    signals : what figures show over time, which is recorded as well.
    checkpoints : the folder of those of all trials, and the time between two (s of the clock); a
        trial whose process was killed goes on from its last one. None for none.
    """

    trial: Trial
    record: Record = "metrics"
    keep: Collection[str] = ()
    beat: tuple[Objective, float] | None = None
    timeout: float | None = None
    signals: tuple[str, ...] = ()
    checkpoints: tuple[Path, float] | None = None


@dataclass(frozen=True)
class TrialResult:
    """The outcome of a trial.

    Parameters
    ----------
    metrics : None without a value, infinite for what was never reached, also where the simulation
        failed; otherwise empty unless it is ok.
    wall_s : in seconds.
    signals : for each metric a hash of the signals that it measured.
    series : for each signal of the task its times (s) and values, of at most :data:`POINTS` rows.
    missing : what a block could not import; other workers may have it.
    """

    status: Status
    reason: str = ""
    metrics: dict[str, float | None] = field(default_factory=dict)
    wall_s: float = 0.0
    result: Result | None = None
    signals: dict[str, str] = field(default_factory=dict)
    series: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    missing: str = ""


class Deadline:
    """A progress callback that ends a run at its time limit, as Ctrl-C would."""

    def __init__(self, seconds: float | None) -> None:
        self.began = time.perf_counter()
        self.seconds = seconds
        self.is_exceeded = False

    @property
    def spent(self) -> float:
        return time.perf_counter() - self.began

    def __call__(self, done: int, total: int) -> None:
        if self.seconds is not None and self.spent > self.seconds:
            self.is_exceeded = True
            raise KeyboardInterrupt


@contextmanager
def _watch(deadline: Deadline) -> Iterator[None]:
    """End a run at its time limit even inside a block, in a thread, as of a worker of a cluster.

    A process of our own is killed from outside, and a worker of a cluster is not ours to kill. What
    waits in a function in C is not reached before that returns.
    """
    if deadline.seconds is None or current_thread() is main_thread():
        yield
        return
    guard, running = Lock(), [c_ulong(get_ident())]

    def stop() -> None:
        with guard:
            for thread in running:
                deadline.is_exceeded = True
                pythonapi.PyThreadState_SetAsyncExc(thread, py_object(KeyboardInterrupt))

    timer = Timer(min(deadline.seconds + GRACE, TIMEOUT_MAX), stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with guard:
            running.clear()
        timer.cancel()


def run_task(task: Task) -> TrialResult:
    """Run a trial; any error is part of the result."""
    deadline = Deadline(task.timeout)
    try:
        with _watch(deadline):
            ended = _run_graph(task, deadline)
    except KeyboardInterrupt:  # at the very end of the run
        ended = _End("failed", "interrupted", None, None)
    status, reason, result, runs, missing = ended
    if deadline.is_exceeded:
        reached = "" if result is None else f", {result.ticks} ticks done"
        status, reason = "timeout", f"stopped after {task.timeout:g} s{reached}"
    measured = [] if runs is None or result is None else runs.metrics
    metrics = {} if result is None else _values(measured, result, status)
    is_kept = status in task.keep and _is_wanted(task, metrics)
    if reason:  # the worker's temporary folder of files means nothing to users
        reason = reason.replace(f"{_file_folder(task.trial.configuration.bundle)}/", "")
    done = TrialResult(
        status=status,
        reason=one_line(reason.strip().replace("\n", "; ")),
        metrics=metrics,
        wall_s=deadline.spent,
        result=result if is_kept else None,
        signals={} if result is None or status != "ok" else _signals(measured, result),
        series={} if result is None else dict(_series(task.signals, result)),
        missing=missing,
    )
    # The next run overwrites what this one has recorded.
    if runs is not None and not is_kept:
        _idle.append(runs)
    return done


class _End(NamedTuple):
    """How a trial ended and why, as far as it came, and what a block could not import."""

    status: Status
    reason: str
    result: Result | None = None
    runs: RepeatedRuns | None = None
    missing: str = ""


def _run_graph(task: Task, deadline: Deadline) -> _End:
    """Run the graph of a task."""
    runs = None
    try:
        runs = _take_runs(task)
        values, seed = _values_of(task.trial.configuration.edits), task.trial.seed
        if task.checkpoints is None:
            result = runs.run(values, seed, deadline, whole=bool(task.keep))
        else:
            folder, every = task.checkpoints
            own = folder / task.trial.digest[:32], every
            result = runs.run_with_checkpoints(values, seed, own, deadline, bool(task.keep))
    except GraphError as error:
        return _End("invalid", str(error), None, runs)
    except SimulationError as error:
        partial = error.result if isinstance(error.result, Result) else None
        return _End("failed", str(error), partial, runs, _failed_import(error.__cause__))
    except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything, anywhere
        reason = f"{type(error).__name__}: {text_of(error)}"
        return _End("failed", reason, None, runs, _failed_import(error))
    if result.status not in ("complete", "stopped"):
        # Ctrl-C does not reach workers: only the deadline and blocks can interrupt a run.
        reason = f"a block raised KeyboardInterrupt at tick {result.ticks}"
        return _End("failed", reason, result, runs)
    # What a single run has as a note: its numbers are not those of the compiled engine.
    return _End("ok", "; ".join(result.manifest["engine_notes"]), result, runs)


def run_tasks(tasks: Sequence[Task]) -> list[TrialResult]:
    """Run several trials, one after the other."""
    return [run_task(task) for task in tasks]


def run_sent(message: bytes) -> dict[str, Any]:
    """Run the trials of a message in a worker of a cluster, if it computes what the others do.

    Returns
    -------
    dict : ``kind``, which is ``results``, ``unfit`` or ``mixed``, and ``value``: the results as
        bytes, what is missing, or the program of this process.
    """
    tasks, expected = pickle.loads(message)
    try:
        if expected is not None and expected != (here := program(expected.packages)):
            return {"kind": "mixed", "value": str(here)}
    except ImportError as error:
        return {"kind": "unfit", "value": one_line(f"{type(error).__name__}: {error}")}
    results = []
    for task in tasks:
        result = run_task(task)
        # The graph was checked where it was sent from, with all that its own files import.
        if missing := result.missing or _missing(task.trial.configuration.bundle, result):
            return {"kind": "unfit", "value": missing}
        results.append(result)
    return {"kind": "results", "value": pickle.dumps(results)}


def _missing(bundle: GraphBundle, result: TrialResult) -> str:
    """What the Python files of an invalid graph import and this process lacks; '' for nothing."""
    if result.status == "invalid":
        for name, _ in bundle.beside:
            if name.endswith(".py"):
                try:
                    blocks_of_module(_write_files(bundle) / name)
                except ImportError as error:
                    return one_line(f"{name}: {type(error).__name__}: {error}")
                except BaseException:  # noqa: BLE001 -- any other error is the file's own
                    continue
    return ""


def _failed_import(error: BaseException | None) -> str:
    """What could not be imported; '' for another error."""
    return one_line(f"{type(error).__name__}: {error}") if isinstance(error, ImportError) else ""


def _values(metrics: list[Metric], result: Result, status: Status) -> dict[str, float | None]:
    """The metrics of a run; infinite for what was never reached, or not before it failed."""
    if status not in ("ok", "failed"):
        return {}
    never = {m.name: math.inf for m in metrics if m.never and m.is_recorded(result.probes)}
    if status == "failed":
        crashed = {m.name: 1.0 for m in metrics if m.own is None and m.kind == CRASHED}
        return {**never, **crashed}
    return {
        name: never.get(name) if value is None else value for name, value in result.metrics.items()
    }


def _signals(metrics: list[Metric], result: Result) -> dict[str, str]:
    """For each metric, a hash of what its probes recorded.

    Where all seeds have the same, they are one run. The values alone would not tell: twenty noisy
    runs without a collision all count 0, and are twenty observations.
    """
    hashes: dict[str, bytes] = {}
    signals = {}
    for metric in metrics:
        if metric.is_recorded(result.probes):
            names = [name for name in metric.inputs.values() if name]
            for name in names:
                if name not in hashes:
                    hashes[name] = _hash(result.probes[name].values)
            # A metric of no signal, as the time at which the run stopped, is its own.
            content = (
                b"".join(hashes[n] for n in names) or repr(result.metrics[metric.name]).encode()
            )
            signals[metric.name] = hashlib.sha256(content).hexdigest()[:8]
    return signals


def _series(
    signals: Iterable[str], result: Result
) -> Iterator[tuple[str, tuple[FloatArray, FloatArray]]]:
    for signal in signals:
        recorded = result.probes.get(shown_probe(signal))
        if recorded is not None:
            # Every n-th row; a figure brings trials of other lengths to common times.
            rows = slice(None, None, max(1, -(-len(recorded.t) // POINTS)))
            yield signal, (recorded.t[rows].copy(), recorded.columns[rows, 0].copy())


def _hash(values: FloatArray) -> bytes:
    digest = hashlib.blake2b(digest_size=8)
    for _, (rows,) in row_blocks(values):
        digest.update(np.ascontiguousarray(rows).data)
    return digest.digest()


def _is_wanted(task: Task, metrics: dict[str, float | None]) -> bool:
    if task.beat is None:
        return True
    objective, bound = task.beat
    cost = objective.cost(metrics)
    return cost is not None and cost < bound


def _plots(task: Task) -> tuple[str, ...] | None:
    """The kinds of plots whose signals are recorded; None for all."""
    if task.signals:
        return None
    return {"metrics": (), "trajectory": TRAJECTORY_PLOTS, "all": None}[task.record]


def _take_runs(task: Task) -> RepeatedRuns:
    """The runs of a task's graph, which no other thread has until they are put back."""
    bundle, plots = task.trial.configuration.bundle, _plots(task)
    with suppress(IndexError):
        idle = _idle.pop()
        if idle.key == (bundle, plots):
            return idle
    return RepeatedRuns(_load(bundle), plots, (bundle, plots))


@lru_cache(CACHED_GRAPHS)
def _load(bundle: GraphBundle) -> Graph:
    plain: Any = parse_yaml(bundle.text, "graph.resolved.yaml").plain()
    if bundle.beside:
        folder = _write_files(bundle)
        # A path that is absolute stays what it is.
        plain = rename_files(plain, lambda _, path: str(folder / path))
        plain = with_folder(plain, folder, bundle.files)
    return load(plain)


@lru_cache(1)
def _scratch() -> Path:
    """The folder for files of this process, removed when the process ends."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _file_folder(bundle: GraphBundle) -> Path:
    return _scratch() / bundle.digest[:16]


def _write_files(bundle: GraphBundle) -> Path:
    folder = _file_folder(bundle)
    folder.mkdir(exist_ok=True)
    for name, content in bundle.beside:
        target = folder / name
        if not target.exists():
            write_whole(target, content)
    return folder


@lru_cache(1)
def _values_of(edits: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    """What a configuration sets, by path; the same for all of its seeds."""
    return {path: _value_of(cell, path) for path, cell in edits}


def _value_of(cell: str, path: str) -> Any:
    """What the YAML of a cell says."""
    if _NUMBERS.fullmatch(cell):
        # Numbers and lists of them are JSON, too, which is read in a tenth of the time.
        with suppress(ValueError):
            return json.loads(cell, parse_float=parse_scalar, parse_int=parse_scalar)
    return parse_yaml(cell, path).plain()
