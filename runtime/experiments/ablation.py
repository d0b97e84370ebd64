"""An ablation from its plan to its table."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from runtime.diagrams import diagram, stored_picture
from runtime.errors import UsageError
from runtime.experiments.analysis import CONFIDENCE, CORRECTION, TESTS, Line, Test, compare
from runtime.experiments.design import BASELINE, Variant
from runtime.experiments.execution import (
    DIAGRAMS,
    INDEX,
    RUNS,
    SCHEMA_VERSION,
    TABLE,
    Case,
    Index,
    Plan,
    Row,
    Task,
    Trial,
    WorkerPool,
    check_same,
    create,
    remaining,
    run_points,
)
from runtime.files import own_file, own_folder, write_json
from runtime.graph import Graph
from runtime.runs import save
from runtime.terminal import Progress

KEPT = ("ok", "failed", "timeout")


@dataclass
class AblationResult:
    """An ablation that has ended: its rows by variant, and what they say."""

    plan: Plan
    folder: Path
    variants: dict[str, Variant]
    essential: dict[str, str]
    test: Test
    rows: dict[str, list[Row]] = field(default_factory=dict)
    is_interrupted: bool = False

    def lines(self) -> list[Line]:
        """The lines of the table; a run that is not ok has no values."""
        values = {
            name: {
                metric: [row.metrics[i] for row in rows]
                for i, metric in enumerate(self.plan.metrics)
            }
            for name, rows in self.rows.items()
        }
        return compare(values, BASELINE, self.test, self._gone())

    def _gone(self) -> set[tuple[str, str]]:
        """Metrics of each variant that have lost what they measure."""
        gone = set()
        for name, variant in self.variants.items():
            inputs = {m.name: m.inputs.values() for m in variant.graph.observation.metrics}
            gone |= {(name, m) for m in self.plan.metrics if None in inputs.get(m, (None,))}
        return gone

    def to_dict(self) -> dict[str, Any]:
        """What ablation.json holds."""
        plan = self.plan
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": "ablation",
            "experiment": plan.name,
            "graph": plan.graph.title,
            "folder": str(self.folder),
            "seeds": list(plan.seeds),
            "metrics": list(plan.metrics),
            "confidence": CONFIDENCE,
            "test": TESTS[self.test],
            "correction": CORRECTION,
            "variants": [self._variant(case) for case in plan.cases],
            "essential": self.essential,
            "table": [line.to_dict() for line in self.lines()],
        }

    def _variant(self, case: Case) -> dict[str, Any]:
        graph = self.variants[case.name].graph
        rows = self.rows[case.name]
        reasons = Counter(row.reason for row in rows if row.status != "ok")
        return {
            "name": case.name,
            "slug": case.slug,
            "changes": list(case.changes),
            "removed": dict(graph.network.removed),
            "notes": list(graph.notes),
            "runs": len(rows),
            "failed": sum(reasons.values()),
            "reasons": [{"reason": r, "count": n} for r, n in reasons.most_common(5)],
        }


def ablate(
    plan: Plan,
    variants: list[Variant],
    essential: dict[str, str],
    folder: Path,
    pool: Callable[[], WorkerPool],
    test: Test = "t",
    timeout: float | None = None,
    progress: Progress | None = None,
) -> AblationResult:
    """Run the baseline and all variants with all seeds, or what of them has no row yet.

    The way that the robot goes with the first seed is kept for each, under ``runs``.

    Parameters
    ----------
    folder : a new one, or that of an ablation by the same plan which was interrupted.

    Raises
    ------
    UsageError : the folder cannot be written, or is of another plan.
    """
    everything = {BASELINE: Variant(BASELINE, plan.graph)} | {v.name: v for v in variants}
    if folder.exists():
        check_same(plan, folder)
    else:
        create(plan, folder)
    with closing(Index(folder / INDEX, plan.columns)) as index:
        finished = _run(plan, folder, index, pool, timeout, progress or Progress("", wanted=False))
        rows: dict[str, list[Row]] = {case.name: [] for case in plan.cases}
        for row in sorted(index.rows(), key=lambda row: row.point):
            rows[row.cells[0]].append(row)
    done = AblationResult(plan, folder, everything, essential, test, rows, not finished)
    if finished:
        write_json(folder / TABLE, done.to_dict())
        _draw_diagrams(plan, everything, folder)
    return done


def _run(
    plan: Plan,
    folder: Path,
    index: Index,
    make_crew: Callable[[], WorkerPool],
    timeout: float | None,
    progress: Progress,
) -> bool:
    """Run all points; False if Ctrl-C ended it."""
    first = next(iter(plan.seeds))
    slugs = {case.name: case.slug for case in plan.cases}

    def task(point: Trial) -> Task:
        if point.seed == first:
            return Task(point, "ways", KEPT, timeout=timeout)
        return Task(point, timeout=timeout)

    points = remaining(index, plan.points())
    done = sum(1 for _ in index.rows())
    if done == plan.total:
        return True
    progress.resume(done)
    finished = False
    pool = make_crew()
    try:
        for point, ended in run_points(points, pool, task):
            name = point.configuration.cells[0]
            if ended.result is not None:
                ended.result.files = point.configuration.bundle.files
                kept = folder / RUNS / slugs[name]
                shutil.rmtree(kept, ignore_errors=True)
                save(ended.result, kept)
            index.append(Row.of(point, ended, plan.metrics))
            done += 1
            progress(done, plan.total, name)
        finished = True
    except KeyboardInterrupt:
        return False
    finally:
        pool.leave(finished)
        progress.close()
    return True


def _draw_diagrams(plan: Plan, variants: dict[str, Variant], folder: Path) -> None:
    target = folder / DIAGRAMS
    try:
        own_folder(target)
        for case in plan.cases:
            network = _graph(variants, case).network
            texts = {"svg": str(diagram(network, "svg")), "json": stored_picture(network)}
            for suffix, text in texts.items():
                if text is not None:
                    path = own_file(target / f"{case.slug}.{suffix}")
                    path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write '{target}': {error.strerror}") from None


def _graph(variants: dict[str, Variant], case: Case) -> Graph:
    return variants[case.name].graph
