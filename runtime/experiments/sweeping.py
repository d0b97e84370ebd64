"""Run a sweep: from its plan to its summary."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.errors import UsageError
from runtime.experiments.analysis import ANY, NEVER, Tally
from runtime.experiments.execution import (
    INDEX,
    SCHEMA_VERSION,
    SUMMARY,
    ExperimentPlan,
    Index,
    RetentionPolicy,
    Row,
    Trial,
    TrialResult,
    WorkerPool,
    check_same,
    create,
    remaining,
    run_all,
)
from runtime.files import write_json
from runtime.terminal import Progress


@dataclass(frozen=True)
class SweepOptions:
    """How a sweep is run; none of this affects its numbers.

    Parameters
    ----------
    folder : where it is written.
    resume : continue a sweep that is there.
    make_pool : makes the worker pool, once everything else has been checked.
    keep : which trials leave a run folder.
    timeout : time limit of a trial in seconds.
    """

    folder: Path
    resume: bool
    make_pool: Callable[[], WorkerPool]
    keep: str = "none"
    timeout: float | None = None


@dataclass
class SweepResult:
    """A sweep that has ended, or was interrupted."""

    plan: ExperimentPlan
    folder: Path
    tally: Tally
    wall_s: float
    is_interrupted: bool = False

    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        plan, tally = self.plan, self.tally
        factors = [factor.path for factor in plan.design.factors]
        goal = plan.objective
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": "sweep",
            "experiment": plan.name,
            "graph": plan.graph.title,
            "folder": str(self.folder),
            "status": "interrupted" if self.is_interrupted else "complete",
            "points": plan.total,
            "counts": dict(tally.counts),
            "knobs": factors,
            "seeds": str(plan.seeds),
            "metrics": list(plan.metrics),
            "units": plan.units,
            "never": plan.never,
            "objective": None if goal is None else {"metric": goal.metric, "goal": goal.goal},
            "best": [
                {"values": dict(zip(factors, ranked.cells, strict=True))}
                | ranked.objective.to_dict()
                for ranked in tally.best
            ],
            "reasons": tally.top_reasons(),
            "wall_s": round(self.wall_s, 3),
        }


def run_sweep(plan: ExperimentPlan, options: SweepOptions, progress: Progress) -> SweepResult:
    """Run the trials of a plan that have no row in the index yet.

    Raises
    ------
    UsageError : the folder belongs to a different plan, exists although ``resume`` is off, or
        cannot be written.
    """
    began = time.perf_counter()
    column = None if plan.objective is None else plan.metrics.index(plan.objective.metric)
    metric = "" if plan.objective is None else plan.objective.metric
    ends, never = plan.ends.get(metric, ANY), plan.never.get(metric, NEVER)
    tally = Tally(len(plan.seeds), column, plan.objective, ends, never)
    retention = RetentionPolicy(
        options.folder, options.keep, plan.objective, column, options.timeout
    )
    _open_folder(plan, options)

    def draw() -> None:
        progress(tally.done, plan.total, tally.line(plan.columns.factors))

    def record(trial: Trial, done: TrialResult) -> None:
        retention.save(trial, done)
        row = Row.of(trial, done, plan.metrics)
        index.append(row)
        retention.discard(row)
        tally.add(row)

    with closing(Index(options.folder / INDEX, plan.columns)) as index:
        trials = remaining(index, plan.trials())
        retention.resume(index.rows())
        for row in index.rows():
            tally.add(row)
        progress.resume(tally.done)
        result = SweepResult(plan, options.folder, tally, 0.0)
        if tally.done < plan.total:
            result.is_interrupted = not run_all(
                trials, options.make_pool, retention.task, record, progress, draw
            )
    result.wall_s = time.perf_counter() - began
    write_json(options.folder / SUMMARY, result.summary())
    return result


def _open_folder(plan: ExperimentPlan, options: SweepOptions) -> None:
    if not options.folder.exists():
        # With resume too: a sweep may have been killed before it made its folder.
        create(plan, options.folder)
        return
    check_same(plan, options.folder)
    if not options.resume:
        raise UsageError(
            f"'{options.folder}' exists already; --resume continues it, --name begins another"
        )
