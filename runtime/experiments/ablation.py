"""Run an ablation: from its plan to its table.

In: a plan with variants, and where it is run. Out: :class:`AblationResult`, with a line for each
metric and variant, and ``ablation.json``::

    baseline 2.0, 2.4; without half 1.0, 1.3   (total, seeds 0 and 1)
    ->  without half  total  mean 1.15  difference -1.05
"""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from runtime.diagrams import stored_picture
from runtime.experiments.analysis import (
    CONFIDENCE,
    CORRECTION,
    TESTS,
    ComparisonLine,
    Questions,
    Test,
    compare,
    comparison_table,
    legend,
    samples_of,
)
from runtime.experiments.design import BASELINE
from runtime.experiments.execution import (
    DIAGRAMS,
    INDEX,
    RUNS,
    TABLE,
    ExperimentPlan,
    Index,
    Row,
    RunOptions,
    Start,
    Task,
    Trial,
    TrialResult,
    VariantBundle,
    open_folder,
    remaining,
    run_all,
    save_series,
    save_trial,
    write_checked,
)
from runtime.files import own_folder, system_errors, write_whole
from runtime.terminal import Progress

SAVED_STATUSES = ("ok", "failed", "timeout")


@dataclass
class AblationResult:
    """An ablation that has ended: its rows by variant, and the table made from them."""

    plan: ExperimentPlan
    folder: Path
    test: Test
    rows: dict[str, list[Row]] = field(default_factory=dict)
    is_interrupted: bool = False

    @cached_property
    def lines(self) -> list[ComparisonLine]:
        """The lines of the table."""
        plan = self.plan
        questions = Questions(
            self.test, plan.primary, plan.contrasts, plan.margins, plan.ends, plan.never
        )
        return compare(samples_of(plan, self.rows, self._removed_metrics()), BASELINE, questions)

    def _removed_metrics(self) -> set[tuple[str, str]]:
        """(variant, metric) where the variant removes what the metric measures."""
        pairs = set()
        for variant in self.plan.variants:
            inputs = {m.name: m.inputs.values() for m in variant.graph.observation.metrics}
            pairs |= {
                (variant.name, m) for m in self.plan.metrics if None in inputs.get(m, (None,))
            }
        return pairs

    def to_dict(self) -> dict[str, Any]:
        """What ablation.json holds."""
        plan = self.plan
        return {
            **plan.header(self.folder),
            "seeds": list(plan.seeds),
            "factors": [factor.path for factor in plan.design.factors],
            "primary": list(plan.primary),
            "margins": dict(plan.margins),
            "confidence": CONFIDENCE,
            "test": TESTS[self.test],
            "correction": CORRECTION,
            "variants": [self._variant(variant) for variant in plan.variants],
            "essential": dict(plan.essential),
            "table": [line.to_dict() for line in self.lines],
        }

    @property
    def head(self) -> str:
        """What was compared, in one line."""
        plan = self.plan
        settings = len(plan.design)
        crossed = f" x {settings} settings" if settings > 1 else ""
        return f"{plan.name}: {len(plan.variants)} variants{crossed}, seeds {plan.seeds}"

    def notes(self) -> list[str]:
        """What the table means, which trials failed, and which blocks are essential."""
        notes = legend(self.lines, self.test).splitlines()
        undirected = [m for m in self.plan.metrics if self.plan.worst(m) is None]
        if self.plan.with_worst and undirected:
            notes.append(f"no worst value, since neither less nor more is: {', '.join(undirected)}")
        for name, rows in self.rows.items():
            failed = [row for row in rows if row.status != "ok"]
            if failed:
                reason = failed[0].reason
                notes.append(f"{name}: {len(failed)} of {len(rows)} trials failed, first: {reason}")
        if self.plan.essential:
            notes += ["", "essential, cannot be removed alone:"]
        return notes + [f"  {name}: {reason}" for name, reason in self.plan.essential.items()]

    def text(self) -> str:
        """The table with its head and notes, as the command prints it."""
        shown = comparison_table(self.lines, self.plan.units, self.plan.never)
        return "\n".join([self.head, shown, "", *self.notes()])

    def _variant(self, variant: VariantBundle) -> dict[str, Any]:
        graph = variant.graph
        rows = self.rows[variant.name]
        reasons = Counter(row.reason for row in rows if row.status != "ok")
        return {
            "name": variant.name,
            "slug": variant.slug,
            "changes": list(variant.changes),
            "removed": dict(graph.network.removed),
            "notes": list(graph.notes),
            "runs": len(rows),
            "failed": sum(reasons.values()),
            "reasons": [{"reason": r, "count": n} for r, n in reasons.most_common(5)],
        }


def run_ablation(
    plan: ExperimentPlan, options: RunOptions, progress: Progress, test: Test = "auto"
) -> AblationResult:
    """Run the trials of the baseline and of all variants that have no row in the index yet.

    The trajectory with the first seed is kept for each variant, under ``runs``.

    Raises
    ------
    UsageError : as for :func:`open_folder`.
    """
    folder = options.folder
    open_folder(plan, options)
    with closing(Index(folder / INDEX, plan.columns, options.again)) as index:
        finished = _run(plan, options, index, progress)
        rows: dict[str, list[Row]] = {variant.name: [] for variant in plan.variants}
        for row in sorted(index.rows(), key=lambda row: row.trial):
            rows[row.cells[0]].append(row)
    done = AblationResult(plan, folder, test, rows, not finished)
    if finished:
        options.finish()
        write_checked(folder / TABLE, done.to_dict())
        _draw_diagrams(plan, folder)
    return done


def _run(plan: ExperimentPlan, options: RunOptions, index: Index, progress: Progress) -> bool:
    """Run the trials that have no row yet; False if Ctrl-C interrupted them."""
    first = next(iter(plan.seeds))
    slugs = {variant.name: variant.slug for variant in plan.variants}
    trials = remaining(index, plan.trials())
    finished = sum(1 for _ in index.rows())
    if finished == plan.total:
        return True
    progress.resume(finished)
    start = Start(plan, options, finished > 0)

    def task(trial: Trial) -> Task:
        # The settings of a variant would all have the same folder: the first one is kept.
        if trial.seed == first and trial.configuration.number % len(plan.design) == 0:
            shown = {"record": "trajectory", "keep": SAVED_STATUSES}
            return options.task(trial, signals=plan.signals, **shown)
        return options.task(trial, signals=plan.signals)

    def record(trial: Trial, result: TrialResult) -> None:
        nonlocal finished
        name = trial.configuration.cells[0]
        save_trial(trial, result, options.folder / RUNS / slugs[name])
        save_series(result, options.folder, trial.number)
        index.append(Row.of(trial, result, plan.metrics))
        finished += 1
        progress(finished, plan.total, name)

    return run_all(trials, start, task, record, progress)


def _draw_diagrams(plan: ExperimentPlan, folder: Path) -> None:
    target = folder / DIAGRAMS
    with system_errors(f"write '{target}'"):
        own_folder(target)
        for variant in plan.variants:
            graph = variant.graph
            write_whole(target / f"{variant.slug}.svg", str(graph.diagram("svg")))
            picture = stored_picture(graph.network, graph.observation.probes.values())
            if picture is not None:
                write_whole(target / f"{variant.slug}.json", picture)
