"""Run a sweep: from its plan to its summary.

In: a plan with a design, and where it is run. Out: :class:`SweepResult`, ``index.csv`` with a row
for each trial, and ``summary.json`` with the best configurations. An interrupted sweep runs only
the trials that have no row::

    12 trials planned, rows 0..6 and 9 in the index  ->  7, 8, 10 and 11 run
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.errors import SimulationError
from runtime.experiments.analysis import (
    SAME,
    SAME_RUNS,
    Tally,
    chosen_among,
    interval,
    mean_of,
)
from runtime.experiments.execution import (
    SUMMARY,
    ExperimentPlan,
    Outcome,
    RunOptions,
    Study,
    TrialRetention,
)
from runtime.files import write_json
from runtime.terminal import Progress, short, with_unit

SPREAD = ", mean and 95 % interval over seeds"
MEANS = ", mean over seeds"


@dataclass
class SweepResult(Outcome):
    """A sweep that has ended, or was interrupted."""

    plan: ExperimentPlan
    folder: Path
    tally: Tally
    wall_s: float
    is_interrupted: bool = False

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
            mean = mean_of(estimate, len(plan.seeds), tally.never)
            ends = f"  {interval(estimate)}" if estimate.n > 1 and tried == 1 else ""
            values = zip(plan.columns.factors, ranked.cells, strict=True)
            configuration = ", ".join(f"{factor}={short(value)}" for factor, value in values)
            lines.append(f"  {mean:<10}{ends}  {configuration}".rstrip())
        if tried > 1 and not all(same):
            lines.append(chosen_among(tried))
        return "\n".join([*lines, *[f"{SAME}: {SAME_RUNS}"] * any(same)])


def run_sweep(plan: ExperimentPlan, options: RunOptions, progress: Progress) -> SweepResult:
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
    result = SweepResult(plan, options.folder, tally, study.wall_s, study.is_interrupted)
    write_json(options.folder / SUMMARY, result.to_dict())
    return result
