"""Run a sweep: from its plan to its summary.

In: a plan with a design, and where it is run. Out: :class:`SweepTable`, ``index.csv`` with a row
for each trial, and ``summary.json`` with the best configurations. An interrupted sweep runs only
the trials that have no row::

    12 trials planned, rows 0..6 and 9 in the index  ->  7, 8, 10 and 11 run
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from runtime.errors import SimulationError
from runtime.experiments.analysis import (
    ANY,
    NEVER,
    SAME,
    SAME_RUNS,
    Estimate,
    Tally,
    chosen_among,
    gather,
    interval,
    mean_of,
)
from runtime.experiments.design import Objective
from runtime.experiments.execution import (
    INDEX,
    SUMMARY,
    ExperimentPlan,
    Row,
    RunOptions,
    Study,
    TrialRetention,
    read_rows,
)
from runtime.experiments.tables import TrialTable, values_of
from runtime.files import write_json
from runtime.runs import Figures
from runtime.tables import Cell, Column, Table
from runtime.terminal import Progress, short, with_unit

MOST = 20  # configurations that are shown
HALF = "±: half of the 95 % interval of the mean over the seeds."
SOME = "n/N: n of N seeds have a value; the mean is over those."
SPREAD = ", mean and 95 % interval over seeds"
MEANS = ", mean over seeds"


@dataclass(frozen=True)
class SweepConfiguration:
    """One combination of factors' values, with the mean of each metric over the seeds.

    ``ok`` counts the trials that ended well; an estimate's ``n`` counts those with a value.
    """

    values: Mapping[str, object]
    ok: int
    metrics: Mapping[str, Estimate]


@dataclass(repr=False)
class SweepTable(TrialTable):
    """A sweep that has ended, or was interrupted; ``best`` is by the objective.

    ``folder`` is for ``runtime report``; without a folder of your own it is a temporary one, which
    is removed together with this object.
    """

    plan: ExperimentPlan
    folder: Path
    tally: Tally
    wall_s: float
    is_interrupted: bool = False
    _rows_read: Sequence[Row] | None = field(default=None, init=False)

    @property
    def so_far(self) -> str:
        return f" after {self.tally.done} of {self.plan.total} trials"

    @property
    def exit_code(self) -> int:
        return 0 if self.tally.counts["ok"] else SimulationError.exit_code

    def to_dict(self) -> dict[str, Any]:
        """What summary.json holds."""
        plan, tally = self.plan, self.tally
        factors = list(plan.columns.factors)
        goal = plan.objective
        return {
            **plan.header(self.folder),
            "status": "interrupted" if self.is_interrupted else "complete",
            "trials": plan.total,
            "counts": dict(tally.counts),
            "factors": factors,
            "seeds": str(plan.seeds),
            "objective": None if goal is None else {"metric": goal.metric, "goal": goal.goal},
            "chosen_among": plan.total // len(plan.seeds),
            "best": [
                {"values": dict(zip(factors, ranked.cells, strict=True))}
                | ranked.objective.to_dict()
                for ranked in tally.best
            ],
            "reasons": tally.top_reasons(),
            "wall_s": round(self.wall_s, 3),
        }

    @property
    def text(self) -> str:
        """The best configurations, as the command prints them."""
        plan, tally = self.plan, self.tally
        counts = ", ".join(f"{count} {status}" for status, count in sorted(tally.counts.items()))
        lines = [
            f"{plan.name}: {tally.done} of {plan.total} trials "
            f"({plan.total // len(plan.seeds)} configurations, seeds {plan.seeds}): {counts}; "
            f"{self.wall_s:.1f} s"
        ]
        if not plan.metrics:
            lines.append("the graph has no metrics, so that there is nothing to compare")
        if plan.objective is None:
            return "\n".join(lines)
        if not tally.best:
            lines.append(f"no configuration has a value of {plan.objective.metric} for every seed")
            return "\n".join(lines)
        goal = "smallest" if plan.objective.goal == "minimize" else "largest"
        metric = with_unit(plan.objective.metric, plan.units)
        same = [ranked.objective.is_same for ranked in tally.best]
        tried = plan.total // len(plan.seeds)
        spread = SPREAD if tried == 1 else MEANS
        lines.append(f"{goal} {metric}{'' if all(same) else spread}:")
        for ranked in tally.best:
            estimate = ranked.objective
            mean = str(mean_of(estimate, len(plan.seeds), tally.never))
            ends = f"  {interval(estimate)}" if estimate.n > 1 and tried == 1 else ""
            values = zip(plan.columns.factors, ranked.cells, strict=True)
            configuration = ", ".join(f"{factor}={short(value)}" for factor, value in values)
            lines.append(f"  {mean:<10}{ends}  {configuration}".rstrip())
        if tried > 1 and not all(same):
            lines.append(chosen_among(tried))
        return "\n".join([*lines, *[f"{SAME}: {SAME_RUNS}"] * any(same)])

    def all_rows(self) -> Sequence[Row]:
        """The rows of its index, read once."""
        if self._rows_read is None:
            path, columns = self.folder / INDEX, self.plan.columns
            self._rows_read = tuple(read_rows(path, columns))
        return self._rows_read

    @property
    def factors(self) -> tuple[str, ...]:
        """The paths of the factors."""
        return self.plan.columns.factors

    @property
    def objective(self) -> Objective | None:
        """What ``best`` means."""
        return self.plan.objective

    @cached_property
    def configurations(self) -> tuple[SweepConfiguration, ...]:
        """The combinations of the factors' values, in the order of the plan."""
        plan = self.plan
        groups = sorted(gather(self.all_rows(), len(self.seeds)), key=lambda group: group.number)
        return tuple(
            SweepConfiguration(
                values_of(plan.columns, group.cells),
                sum(row.status == "ok" for row in group.rows),
                {
                    name: group.estimate(i, plan.ends.get(name, ANY))
                    for i, name in enumerate(plan.metrics)
                },
            )
            for group in groups
        )

    @property
    def best(self) -> SweepConfiguration | None:
        """The best configuration among those with a value of the objective for every seed."""
        goal = self.objective
        if goal is None:
            return None
        metric, most = goal.metric, len(self.seeds)
        candidates = [each for each in self.configurations if each.metrics[metric].is_over(most)]
        return min(candidates, key=lambda each: goal.of(each.metrics[metric].mean), default=None)

    def plot(self) -> Figures:
        """The sweep's figures by their names."""
        from runtime.experiments.analysis.sweep_plots import sweep_figures

        return Figures(sweep_figures(self.folder))

    @property
    def table(self) -> Table:
        """The first configurations with the means of their metrics, and what to know of them."""
        metrics = list(self.configurations[0].metrics) if self.configurations else []
        is_ok = all(each.ok == len(self.seeds) for each in self.configurations)
        columns = [Column(name, "number") for name in (*self.factors, *["ok"] * (not is_ok))]
        columns += [Column(name, "number", self.units.get(name, "")) for name in metrics]
        rows = []
        for each in self.configurations[:MOST]:
            values = map(_cell, each.values.values())
            share = () if is_ok else (f"{each.ok}/{len(self.seeds)}",)
            means = (self._mean(name, each) for name, each in each.metrics.items())
            rows.append([*values, *share, *means])
        return Table(columns, rows, self._head(), self._notes())

    def _mean(self, metric: str, estimate: Estimate) -> Cell:
        """A mean with half of its interval, and how many seeds have a value if not all."""
        return mean_of(estimate, len(self.seeds), self.never.get(metric, NEVER), spread=True)

    def _head(self) -> str:
        count = len(self.configurations)
        return f"sweep {self.name}: {count} configurations x {len(self.seeds)} seeds: " + (
            self._counts()
        )

    def _notes(self) -> list[str]:
        notes = []
        if len(self.configurations) > MOST:
            notes.append(f"... and {len(self.configurations) - MOST} more configurations")
        best = self.best
        if best is not None and self.objective is not None:
            goal = "smallest" if self.objective.goal == "minimize" else "largest"
            chosen = ", ".join(f"{path}={_cell(value)}" for path, value in best.values.items())
            found, count = best.metrics[self.objective.metric], len(self.configurations)
            never = self.never.get(self.objective.metric, NEVER)
            mean = mean_of(found, len(self.seeds), never, spread=count == 1)
            metric = with_unit(self.objective.metric, self.units)
            notes.append(f"{goal} {metric}: {mean} at {chosen or 'its only configuration'}")
            notes += [chosen_among(count)] * (count > 1 and not found.is_same)
        estimates = [e for each in self.configurations for e in each.metrics.values()]
        notes += [HALF] * any(each.n > 1 for each in estimates)
        notes += [f"{SAME}: {SAME_RUNS}."] * any(each.is_same for each in estimates)
        seeds = len(self.seeds)
        notes += [SOME] * any(each.n and not each.is_over(seeds) for each in estimates)
        return [*notes, *self._failures()]

    def __repr__(self) -> str:
        return str(self.table)

    def _repr_html_(self) -> str:
        return self.table.notebook() + self.plot()._repr_html_()


def run_sweep(plan: ExperimentPlan, options: RunOptions, progress: Progress) -> SweepTable:
    """Run the trials of a plan that have no row in the index yet.

    Raises
    ------
    UsageError : as for :class:`Study`.
    """
    tally = Tally.of(len(plan.seeds), plan.metrics, plan.objective, plan.ends, plan.never)
    with Study(plan, options, progress, TrialRetention(plan, options)) as study:
        for row in study.all_rows():
            tally.add(row)
            study.show(tally.line(plan.columns.factors))
    result = SweepTable(plan, options.folder, tally, study.wall_s, study.is_interrupted)
    write_json(options.folder / SUMMARY, result.to_dict())
    return result


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
