"""One point, run by whatever process it was sent to: a local worker or one of a cluster."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from runtime.document import parse_yaml
from runtime.errors import GraphError, SimulationError, one_line
from runtime.experiments.design import Objective
from runtime.experiments.execution.trials import GraphBundle, Trial
from runtime.graph import Graph, load
from runtime.runs import Result, simulate

Status = Literal["ok", "failed", "invalid", "timeout", "lost"]
# What a point records beside its metrics: nothing, its way, or all that the graph asks for.
Record = Literal["metrics", "ways", "all"]
WAYS = ("trajectory", "map")
GRAPHS_KEPT = 4


@dataclass(frozen=True)
class Task:
    """A point with how it is to be run.

    Parameters
    ----------
    record : what to record; the numbers are the same.
    keep : statuses for which the result itself is sent back.
    beat : of those that are ok, only where the objective is better than this.
    timeout : seconds; None for as long as it takes.
    """

    point: Trial
    record: Record = "metrics"
    keep: Collection[str] = ()
    beat: tuple[Objective, float] | None = None
    timeout: float | None = None


@dataclass(frozen=True)
class TrialResult:
    """What became of a point. ``metrics`` are empty unless it is ok; ``wall_s`` in seconds."""

    status: Status
    reason: str = ""
    metrics: dict[str, float | None] = field(default_factory=dict)
    wall_s: float = 0.0
    result: Result | None = None


class Deadline:
    """Ends a run, as Ctrl-C would, once it has taken too long; called with its progress."""

    def __init__(self, seconds: float | None) -> None:
        self.began = time.perf_counter()
        self.seconds = seconds
        self.passed = False

    @property
    def spent(self) -> float:
        return time.perf_counter() - self.began

    def __call__(self, done: int, total: int) -> None:
        if self.seconds is not None and self.spent > self.seconds:
            self.passed = True
            raise KeyboardInterrupt


def run_task(task: Task) -> TrialResult:
    """Run a point; whatever goes wrong with it is part of the answer."""
    deadline = Deadline(task.timeout)
    status: Status = "ok"
    reason, result = "", None
    try:
        result = _simulated(task, deadline)
        if result.status != "complete":
            # Ctrl-C does not reach workers: nothing but the deadline and blocks can interrupt.
            status, reason = "failed", f"a block raised KeyboardInterrupt at tick {result.ticks}"
    except GraphError as error:
        status, reason = "invalid", str(error)
    except SimulationError as error:
        status, reason = "failed", str(error)
        result = error.result if isinstance(error.result, Result) else None
    except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything, anywhere
        status, reason = "failed", f"{type(error).__name__}: {error}"
    if deadline.passed:
        reached = "" if result is None else f", {result.ticks} ticks done"
        status, reason = "timeout", f"stopped after {task.timeout:g} s{reached}"
    metrics = result.metrics if result is not None and status == "ok" else {}
    # Modules lie in a folder of the worker's own, which says nothing and is gone afterwards.
    reason = reason.replace(f"{_module_folder(task.point.configuration.bundle)}/", "")
    return TrialResult(
        status=status,
        reason=one_line(reason.strip().replace("\n", "; ")),
        metrics=metrics,
        wall_s=deadline.spent,
        result=result if status in task.keep and _is_wanted(task, metrics) else None,
    )


def _is_wanted(task: Task, metrics: dict[str, float | None]) -> bool:
    if task.beat is None:
        return True
    objective, bound = task.beat
    cost = objective.cost(metrics)
    return cost is not None and cost < bound


def _simulated(task: Task, deadline: Deadline) -> Result:
    configuration = task.point.configuration
    graph = _built(configuration.bundle, configuration.edits).with_seed(task.point.seed)
    plots = {"metrics": (), "ways": WAYS, "all": None}[task.record]
    return simulate(graph.prepared(plots), deadline)


@lru_cache(GRAPHS_KEPT)
def _loaded(bundle: GraphBundle) -> Graph:
    plain: Any = parse_yaml(bundle.text, "graph.resolved.yaml").plain()
    if bundle.modules:
        folder = _written_modules(bundle)
        _place_modules(plain["blocks"], folder)
    return load(plain)


@lru_cache(GRAPHS_KEPT)
def _built(bundle: GraphBundle, edits: tuple[tuple[str, str], ...]) -> Graph:
    """A graph with its network, which all seeds of a setting share."""
    graph = _loaded(bundle)
    for path, cell in edits:
        graph = graph.set(path, parse_yaml(cell, path).plain(), origin=path)
    return graph.check()


@lru_cache(1)
def _scratch() -> Path:
    """This process's folder for modules, which goes when the process does."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _module_folder(bundle: GraphBundle) -> Path:
    return _scratch() / bundle.digest[:16]


def _written_modules(bundle: GraphBundle) -> Path:
    folder = _module_folder(bundle)
    folder.mkdir(exist_ok=True)
    for name, text in bundle.modules:
        target = folder / name
        if not target.exists():
            partial = folder / f".{name}-{os.getpid()}-{threading.get_ident()}"
            partial.write_text(text, encoding="utf-8")
            partial.replace(target)
    return folder


def _place_modules(blocks: dict[str, Any], folder: Path) -> None:
    """Let the entries of a document name their modules where they lie now."""
    for entry in blocks.values():
        if isinstance(entry.get("module"), str):
            entry["module"] = str(folder / entry["module"])
        if isinstance(entry.get("blocks"), dict):
            _place_modules(entry["blocks"], folder)
