"""Contests: contestants that are tuned with equal budgets, and judged on the same held-out runs.

In: a tuning for each contestant and each repeat. Out: :class:`ContestResult`: one paired table over
the held-out conditions (or seeds, of one condition), and how far the tunings of each agree::

    LQR: 0.031, 0.039; PID: 0.044, 0.180   (held-out error of two tunings each)
    ->  PID - LQR  difference +0.077 ...   PID: tunings from 0.044 to 0.18

What a contestant enters is the winner of its training runs, or its own values where none is better:
held-out runs choose nothing. A tuning repeated with another seed of the sampler is the same
contestant, tuned as well as it happened to be: tunings are a sample as conditions and seeds are,
and of one tuning each the table compares these controllers, not what they are tuned from.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from runtime.experiments.analysis import (
    CORRECTION,
    NARROW,
    ComparisonLine,
    Contestant,
    Questions,
    Sample,
    compare,
    comparison_table,
    legend,
    lost,
)
from runtime.experiments.design import Experiment, RunSet, slugs
from runtime.experiments.execution import Note, Outcome, RunOptions, write_checked
from runtime.experiments.tuning.judging import held_out_values
from runtime.experiments.tuning.plan import BASELINE, TuningPlan, contestant_plan
from runtime.experiments.tuning.result import TuningTable
from runtime.experiments.tuning.running import run_tuning
from runtime.experiments.tuning.scores import Candidate
from runtime.tables import Table
from runtime.terminal import Progress, number

CONTEST = "contest.json"
HOW = "t of tunings, conditions and seeds as samples (Satterthwaite)"
WORST = "each counts as the worst value of its condition"
ONCE = (
    "one tuning of each: differences are between these controllers. What other tunings would have "
    "found\nis not known, so that no difference between the methods is called (repeats: 2 or more)"
)


@dataclass
class ContestResult(Outcome):
    """A contest that has ended, or was interrupted: the tunings of each contestant."""

    name: str
    folder: Path
    tunings: dict[str, list[TuningTable]] = field(default_factory=dict)
    margins: Mapping[str, float | str] = field(default_factory=dict)
    is_interrupted: bool = False

    @property
    def plan(self) -> TuningPlan:
        """That of the first contestant: runs and objectives are those of all."""
        return next(iter(self.tunings.values()))[0].plan

    @cached_property
    def lines(self) -> list[ComparisonLine]:
        """The table: each contestant beside the first, then all other pairs."""
        names, plan = list(self.tunings), self.plan
        others = [(b, a) for i, a in enumerate(names[1:], 1) for b in names[i + 1 :]]
        questions = Questions(
            contrasts=others,
            margins=self.margins,
            ends=plan.ends,
            never=plan.never,
            is_of_presence=False,
        )
        samples = {
            (metric, ""): {name: self._sample(name, metric) for name in names}
            for metric in plan.tuning.metrics
        }
        return compare(samples, names[0], questions)

    def _sample(self, name: str, metric: str) -> Sample:
        one = self._contestant(name, metric)
        return Sample(one.units, one.estimate().failed, one.is_same, crossed=one)

    def _contestant(self, name: str, metric: str) -> Contestant:
        own = self.tunings[name]
        found = [held_out_values(each.plan, metric, winner_of(each)) for each in own]
        is_same = all(same for *_, same in found)
        values, failed = (np.array([each[i] for each in found]) for i in (0, 1))
        if is_same and values.shape[1] > 1:  # a seed that changes nothing has been run once
            values, failed = values[:, :, :1], failed[:, :, :1]
        return Contestant(values, bool(own[0].plan.paths), is_same, failed)

    def _failures(self) -> Iterator[str]:
        """How many held-out runs of each contestant count as the worst value."""
        for name, own in self.tunings.items():
            failed = sum(
                row.status != "ok" for each in own for row in winner_of(each).rows.values()
            )
            if failed:
                runs = len(own) * len(self.plan.tuning.held_out)
                yield f"{name}: {failed} of {runs} held-out runs failed: {WORST}"

    @property
    def is_once(self) -> bool:
        """Whether a method was tuned only once."""
        return any(len(own) == 1 and own[0].plan.paths for own in self.tunings.values())

    def to_dict(self) -> dict[str, Any]:
        """What contest.json holds."""
        plan, tuning = self.plan, self.plan.tuning
        return {
            **plan.header(self.folder),
            "kind": "contest",
            "experiment": self.name,
            "metrics": list(tuning.metrics),
            **{o.goal: o.metric for o in tuning.objectives[:1]},
            "constraints": list(map(str, tuning.constraints)),
            "budget": tuning.budget,
            "trials": tuning.trials,
            "training": _runs(tuning.training),
            "held_out": _runs(tuning.held_out),
            "paired_by": self._unit,
            "contestants": {
                name: [_tuning_data(each) for each in tunings]
                for name, tunings in self.tunings.items()
            },
            "correction": CORRECTION,
            "table": [line.to_dict() for line in self.lines],
        }

    @property
    def text(self) -> str:
        """The tunings, the table, and how far tunings agree."""
        plan, tuning = self.plan, self.plan.tuning
        repeats = len(next(iter(self.tunings.values())))
        cost = f"{tuning.trials} trials" if tuning.budget is None else f"{tuning.budget} runs"
        lines = [f"{self.name}: {len(self.tunings)} contestants x {repeats} tunings of {cost}"]
        lines.append(f"held out: {_runs(tuning.held_out)}")
        head = ["contestant", "seed", "trials", "runs", *tuning.metrics, "values"]
        rows = [[name, *row] for name, own in self.tunings.items() for row in map(self._row, own)]
        numbers = range(1, 4 + len(tuning.metrics))
        lines += ["", Table.of(head, rows, numbers=numbers).text()]
        if len(self.tunings) > 1:
            shown = comparison_table(self.lines, plan.units, plan.never).select(*NARROW)
            lines += ["", shown.text(""), ""]
            lines += [legend(self.lines, paired=self._paired, how=HOW)]
            lines += [ONCE] * self.is_once
        return "\n".join([*lines, *self._failures(), *agreement(self.to_dict())])

    @property
    def _unit(self) -> str:
        """What the differences are paired by."""
        return "condition" if len(self.plan.tuning.held_out.conditions) > 1 else "seed"

    @property
    def _paired(self) -> str:
        return f"{next(iter(self.tunings))}, or to the one named, on the same {self._unit}"

    def _row(self, tuning: TuningTable) -> list[str]:
        one, plan = winner_of(tuning), tuning.plan
        values = [] if one.values is None else zip(plan.paths, plan.cells(one.values), strict=True)
        shown = ", ".join(f"{path}={value}" for path, value in values) or "its own"
        shown += "".join(f"; not {constraint}" for constraint in violations_of(tuning))
        metrics = [] if one.score is None else [one.score.metrics[m] for m in plan.tuning.metrics]
        tried = len(tuning.configurations) - 1
        return [str(plan.tuning.seed), str(tried), str(tuning.runs), *map(number, metrics), shown]


def agreement(facts: Mapping[str, Any]) -> Iterator[str]:
    """By how much the tunings of each contestant differ; nothing if there is one of each.

    Parameters
    ----------
    facts : what contest.json holds.
    """
    metric = facts["metrics"][0]
    for name, tunings in facts["contestants"].items():
        if len(tunings) < 2 or not any(each["values"] for each in tunings):
            continue
        found = [each["metrics"].get(metric) for each in tunings]
        scores = [x for x in found if x is not None and math.isfinite(x)]
        failed = len(found) - len(scores)
        never = (facts.get("never") or {}).get(metric, "")
        why = lost(bool(never), 1, never)
        bad = f"; {failed} without a value, since held-out runs {why}" * bool(failed)
        if not scores:
            yield f"{name}: {metric} of none of {len(found)} tunings{bad}"
            continue
        best, worst = min(scores), max(scores)
        ratio = f", a ratio of {worst / best:.3g}" * (best > 0.0)
        many = f"{len(scores)} of {len(found)}" if failed else f"{len(found)}"
        ends = f"{number(best)} to {number(worst)}"
        yield f"{name}: {metric} of {many} tunings from {ends}{ratio}{bad}"


def winner_of(tuning: TuningTable) -> Candidate:
    """The held-out runs of a tuning's winner, or of its own values if it has none."""
    winner = tuning.winners[0].number if tuning.winners else BASELINE
    return tuning.held_out[winner]


def violations_of(tuning: TuningTable) -> list[str]:
    """The constraints that the held-out runs violate; in training, a winner meets them all.

    Not those of a metric without a value: its runs failed, which is reported by itself.
    """
    score = winner_of(tuning).score
    if score is None:
        return []
    pairs = zip(tuning.plan.tuning.constraints, score.violations, strict=True)
    return [str(constraint) for constraint, by in pairs if 0.0 < by < math.inf]


def contest_plans(experiment: Experiment, note: Note) -> dict[str, list[TuningPlan]]:
    """The plans of each contestant: one for each seed of the sampler.

    An experiment without contestants is its only one, so that a tuning can be repeated.

    Raises
    ------
    UsageError, MissingExtraError : a contestant cannot run, or optuna is not installed.
    """
    plans = {}
    for each in experiment.contestants or (experiment,):
        # Options of the command line are laid over what the file says of all contestants.
        entries = each.entries
        if each is not experiment:
            entries = replace(
                entries.overlay(experiment.entries),
                factors=entries.factors,
                training=_overlay(entries.training, experiment.entries.training),
                held_out=_overlay(entries.held_out, experiment.entries.held_out),
            )
        first = entries.sampling_seed or 0
        plans[each.name] = [
            contestant_plan(replace(each, entries=replace(entries, sampling_seed=seed)), note)
            for seed in range(first, first + (entries.repeats or 1))
        ]
    return plans


def _overlay(own: Any, common: Any) -> Any:
    """The conditions of a contestant's own graph, with the seeds that a command may have set."""
    return (common[0] or own[0], own[1])


def run_contest(
    name: str,
    plans: Mapping[str, Sequence[TuningPlan]],
    options: RunOptions,
    progress_of: Callable[[str], Progress],
    margins: Mapping[str, float | str] | None = None,
) -> ContestResult:
    """Tune each contestant, in a folder of its own; what has been tuned is not tuned again.

    Raises
    ------
    UsageError : as for :func:`run_tuning`.
    """
    result = ContestResult(name, options.folder, {}, margins or {})
    folders = slugs(list(plans))
    for contestant, repeats in plans.items():
        own = result.tunings.setdefault(contestant, [])
        for plan in repeats:
            folder = options.folder / f"{folders[contestant]}-{plan.tuning.seed}"
            own_options = replace(options, folder=folder)
            done = run_tuning(plan, own_options, progress_of(folder.name), always_judge=True)
            own.append(done)
            if done.is_interrupted:
                result.is_interrupted = True
                return result
    write_checked(options.folder / CONTEST, result.to_dict())
    return result


def _runs(runs: RunSet) -> str:
    return f"seeds {runs.seeds}; conditions {', '.join(runs.names)}"


def _tuning_data(tuning: TuningTable) -> dict[str, Any]:
    one = winner_of(tuning)
    paths = tuning.plan.paths
    status = Counter(each.status for each in tuning.configurations[1:])
    rows = [row for each in (*tuning.configurations, one) for row in each.rows.values()]
    reasons = Counter(row.reason for row in rows if row.status != "ok")
    return {
        "folder": tuning.folder.name,
        "sampling_seed": tuning.plan.tuning.seed,
        "trials": len(tuning.configurations) - 1,
        "runs": tuning.runs,
        "stopped": status["stopped"],
        "without_value": status["no value"],
        "reasons": [{"reason": r, "count": n} for r, n in reasons.most_common(5)],
        "values": None if one.values is None else dict(zip(paths, one.values, strict=True)),
        "metrics": {} if one.score is None else dict(one.score.metrics),
        "violated": violations_of(tuning),
    }
