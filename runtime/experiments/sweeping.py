"""Run a sweep: from its plan to its summary."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.experiments.analysis import ANY, NEVER, Tally
from runtime.experiments.execution import (
    INDEX,
    SCHEMA_VERSION,
    SUMMARY,
    ExperimentPlan,
    Index,
    RetentionPolicy,
    Row,
    RunOptions,
    Trial,
    TrialResult,
    open_folder,
    remaining,
    run_all,
)
from runtime.files import write_json
from runtime.terminal import Progress


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
            "trials": plan.total,
            "counts": dict(tally.counts),
            "factors": factors,
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


def run_sweep(plan: ExperimentPlan, options: RunOptions, progress: Progress) -> SweepResult:
    """Run the trials of a plan that have no row in the index yet.

    Raises
    ------
    UsageError : as for :func:`open_folder`.
    """
    began = time.perf_counter()
    column = None if plan.objective is None else plan.metrics.index(plan.objective.metric)
    metric = "" if plan.objective is None else plan.objective.metric
    ends, never = plan.ends.get(metric, ANY), plan.never.get(metric, NEVER)
    tally = Tally(len(plan.seeds), column, plan.objective, ends, never)
    retention = RetentionPolicy(
        options.folder, options.keep, plan.objective, column, options.timeout
    )
    open_folder(plan, options)

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
