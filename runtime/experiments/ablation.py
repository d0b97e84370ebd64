"""Run an ablation: from its plan to its table.

In: a plan with variants, and where it is run. Out: :class:`AblationTable`, with a line for each
metric and variant, and ``ablation.json``::

    baseline 2.0, 2.4; without half 1.0, 1.3   (total, seeds 0 and 1)
    ->  without half  total  mean 1.15  difference -1.05
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from runtime.diagrams import stored_picture
from runtime.errors import SimulationError
from runtime.experiments.analysis import (
    CONFIDENCE,
    CORRECTION,
    MEAN,
    NARROW,
    TESTS,
    WIDE,
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
    TABLE,
    ExperimentPlan,
    Row,
    RunOptions,
    Study,
    VariantBundle,
    VariantRetention,
    write_checked,
)
from runtime.experiments.tables import TrialTable
from runtime.files import own_folder, system_errors, write_whole
from runtime.runs import Figures
from runtime.tables import Table
from runtime.terminal import Progress


@dataclass(repr=False)
class AblationTable(TrialTable):
    """An ablation that has ended: its rows by variant, and the table made from them.

    ``folder`` is as that of :class:`SweepTable`.
    """

    plan: ExperimentPlan
    folder: Path
    test: Test
    rows: dict[str, list[Row]] = field(default_factory=dict)
    is_interrupted: bool = False

    def all_rows(self) -> Iterable[Row]:
        return (row for rows in self.rows.values() for row in rows)

    @property
    def variants(self) -> tuple[str, ...]:
        """Their names, the baseline first."""
        return tuple(variant.name for variant in self.plan.variants)

    @property
    def essential(self) -> Mapping[str, str]:
        """The blocks that cannot be removed alone, with the reasons."""
        return self.plan.essential

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

    @property
    def exit_code(self) -> int:
        is_ok = any(row.status == "ok" for row in self.all_rows())
        return 0 if is_ok else SimulationError.exit_code

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

    @property
    def table(self) -> Table:
        """The comparison with its title and notes."""
        table = comparison_table(self.lines, self.plan.units, self.plan.never)
        return replace(table, title=self.head, notes=self.notes())

    @property
    def text(self) -> str:
        """The table with its head and notes, as the command prints it."""
        return "\n".join([self.head, self.table.select(*NARROW).text(""), "", *self.notes()])

    @property
    def html(self) -> str:
        """The table as a notebook shows it."""
        return self.table.select(*WIDE).notebook()

    def line(self, variant: str, metric: str, statistic: str = MEAN) -> ComparisonLine:
        """The comparison of one metric of one variant.

        Parameters
        ----------
        statistic : ``mean``, or of a file with ``quantile`` or ``worst`` such as ``0.9-quantile``.

        Raises
        ------
        KeyError : there is no such variant, metric or statistic.
        """
        for each in self.lines:
            if (each.variant, each.metric, each.statistic) == (variant, metric, statistic):
                return each
        metrics = ", ".join(dict.fromkeys(each.metric for each in self.lines))
        variants = ", ".join(self.variants)
        raise KeyError(
            f"no line for '{variant}' and '{metric}' ({statistic}); "
            f"variants: {variants}; metrics: {metrics}"
        )

    def plot(self) -> Figures:
        """The ablation's figure."""
        from runtime.experiments.analysis.ablation_plots import ablation_figure

        return Figures({"ablation": ablation_figure(self.folder)})

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return self.html + self.plot()._repr_html_()

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
) -> AblationTable:
    """Run the trials of the baseline and of all variants that have no row in the index yet.

    The trajectory with the first seed is kept for each variant, under ``runs``.

    Raises
    ------
    UsageError : as for :class:`Study`.
    """
    rows: dict[str, list[Row]] = {variant.name: [] for variant in plan.variants}
    with Study(plan, options, progress, VariantRetention(plan, options)) as study:
        for row in study.all_rows():
            rows[row.cells[0]].append(row)
            study.show(row.cells[0])
    for own in rows.values():
        own.sort(key=lambda row: row.trial)
    folder = options.folder
    done = AblationTable(plan, folder, test, rows, study.is_interrupted)
    if not done.is_interrupted:
        write_checked(folder / TABLE, done.to_dict())
        _draw_diagrams(plan, folder)
    return done


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
