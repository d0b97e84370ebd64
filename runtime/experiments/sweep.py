"""A sweep from its plan to its summary."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.errors import UsageError
from runtime.experiments.analysis import Tally
from runtime.experiments.execution import (
    INDEX,
    SCHEMA_VERSION,
    SUMMARY,
    Index,
    Plan,
    RetentionPolicy,
    Row,
    WorkerPool,
    check_same,
    create,
    remaining,
    run_points,
)
from runtime.files import write_json
from runtime.terminal import Progress


@dataclass(frozen=True)
class Way:
    """How a sweep is run, which changes none of its numbers.

    Parameters
    ----------
    folder : where it is written.
    resume : go on with what is there.
    crew : makes the workers, once all else is known to be sound.
    keep : which points leave a run folder.
    timeout : seconds that a point may take.
    """

    folder: Path
    resume: bool
    pool: Callable[[], WorkerPool]
    keep: str = "none"
    timeout: float | None = None


@dataclass
class SweepResult:
    """A sweep that has ended, or was interrupted."""

    plan: Plan
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
            "objective": None if goal is None else {"metric": goal.metric, "goal": goal.goal},
            "best": [
                {
                    "values": dict(zip(factors, ranked.cells, strict=True)),
                    "n": ranked.objective.n,
                    "mean": ranked.objective.mean,
                    "low": number(ranked.objective.low),
                    "high": number(ranked.objective.high),
                }
                for ranked in tally.best
            ],
            "reasons": tally.told(),
            "wall_s": round(self.wall_s, 3),
        }


def number(value: float) -> float | None:
    """A number as JSON holds it: null for NaN."""
    return None if value != value else value


def sweep(plan: Plan, way: Way, progress: Progress) -> SweepResult:
    """Run what is left of a plan.

    Raises
    ------
    UsageError : the folder is of another plan, or there and not to be resumed, or full.
    """
    began = time.perf_counter()
    column = None if plan.objective is None else plan.metrics.index(plan.objective.metric)
    tally = Tally(len(plan.seeds), column, plan.objective)
    keeper = RetentionPolicy(way.folder, way.keep, plan.objective, column, way.timeout)
    _open_folder(plan, way)
    with closing(Index(way.folder / INDEX, plan.columns)) as index:
        points = remaining(index, plan.points())
        keeper.resume(index.rows())
        for row in index.rows():
            tally.add(row)
        progress.resume(tally.done)
        swept = SweepResult(plan, way.folder, tally, 0.0)
        if tally.done < plan.total:
            swept.is_interrupted = not _run(plan, way, index, points, keeper, tally, progress)
    swept.wall_s = time.perf_counter() - began
    write_json(way.folder / SUMMARY, swept.summary())
    return swept


def _run(
    plan: Plan,
    way: Way,
    index: Index,
    points: Any,
    keeper: RetentionPolicy,
    tally: Tally,
    progress: Progress,
) -> bool:
    """Run the remaining points; False if Ctrl-C ended it."""
    factors = plan.columns.factors

    def draw() -> None:
        progress(tally.done, plan.total, tally.line(factors))

    finished = False
    pool = way.pool()
    try:
        draw()
        for point, done in run_points(points, pool, keeper.task, draw):
            keeper.save(point, done)
            row = Row.of(point, done, plan.metrics)
            index.append(row)
            keeper.settle(row)
            tally.add(row)
        finished = True
    except KeyboardInterrupt:
        return False
    finally:
        pool.leave(finished)
        progress.close()
    return True


def _open_folder(plan: Plan, way: Way) -> None:
    if not way.folder.exists():
        # Also with resume: what is killed may be killed before it has begun.
        create(plan, way.folder)
        return
    check_same(plan, way.folder)
    if not way.resume:
        raise UsageError(
            f"'{way.folder}' exists already; --resume goes on with it, --name begins another"
        )
