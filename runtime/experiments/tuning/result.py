"""What a tuning has found, prints and stores: its front, and training beside held-out.

In: configurations with their runs. Out: :class:`TuningTable`, which gives the output of the
command, and the content of ``tuning.json``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from runtime.errors import SimulationError
from runtime.experiments.analysis import (
    CONFIDENCE,
    CORRECTION,
    SAME,
    SAME_RUNS,
    TESTS,
    number_or_none,
    too_few,
)
from runtime.experiments.design import TuningSettings
from runtime.experiments.execution import Outcome
from runtime.experiments.tuning.judgement_table import FEW, NARROW, judgement_table
from runtime.experiments.tuning.judging import Judgement, Verdict, judge, verdicts
from runtime.experiments.tuning.plan import TuningPlan
from runtime.experiments.tuning.scores import Candidate, front
from runtime.terminal import number

NOTHING = "nothing that was tried is better than the graph's own values"
NOT_DISTINGUISHABLE = "not distinguishable from the graph's own values"


@dataclass(repr=False)
class TuningTable(Outcome):
    """A tuning that has ended, or was interrupted.

    Parameters
    ----------
    configurations : all that were tried with their training runs, the graph's own values first.
    winners : the best one, or the front, of the training runs; at most five. Empty if nothing is
        better than the graph's own values.
    held_out : the held-out runs of the graph's own values and of the winners, by number.
    folder : as that of :class:`SweepTable`.
    """

    plan: TuningPlan
    folder: Path
    configurations: list[Candidate]
    winners: Sequence[Candidate] = ()
    held_out: dict[int, Candidate] = field(default_factory=dict)
    wall_s: float = 0.0
    is_interrupted: bool = False

    @cached_property
    def judgements(self) -> list[Judgement]:
        """The graph's own values and the winners on the training and on the held-out runs."""
        if not self.held_out:
            return []
        return judge(self.plan, self.configurations, self.winners, self.held_out)

    @cached_property
    def verdicts(self) -> dict[int, Verdict]:
        """What the held-out runs say of each winner, by number."""
        return verdicts(self.plan, self.held_out, self.judgements)

    @property
    def better(self) -> tuple[Candidate, ...]:
        """The winners of which the held-out runs show that they are better: by a test, or because
        the seed changes nothing."""
        found = self.verdicts
        return tuple(one for one in self.winners if found.get(one.number) == "better")

    @property
    def paths(self) -> tuple[str, ...]:
        """The paths of the factors."""
        return self.plan.paths

    @property
    def best(self) -> dict[str, object]:
        """The values of the first of ``better`` by path; empty if there is none."""
        if not self.better:
            return {}
        return dict(zip(self.paths, self.better[0].values or (), strict=True))

    @property
    def has_feasible(self) -> bool:
        """Whether a configuration, or the graph itself, satisfies the constraints."""
        return bool(front(self.configurations))

    @property
    def runs(self) -> int:
        """The number of training runs."""
        return sum(len(one.rows) for one in self.configurations)

    @property
    def so_far(self) -> str:
        return f" after {self.runs} training runs"

    @property
    def exit_code(self) -> int:
        return 0 if self.has_feasible else SimulationError.exit_code

    def to_dict(self) -> dict[str, Any]:
        """What tuning.json holds."""
        plan = self.plan
        counts = Counter(one.status for one in self.configurations[1:])
        complete = not self.is_interrupted
        return {
            **plan.header(self.folder),
            "status": "complete" if complete else "interrupted",
            **{k: v for k, v in plan.specification.items() if k not in ("training", "held_out")},
            "training": _runs(plan, "training"),
            "held_out": _runs(plan, "held_out"),
            "counts": dict(counts),
            "runs": self.runs,
            "held_out_runs": sum(len(one.rows) for one in self.held_out.values()),
            "confidence": CONFIDENCE,
            "correction": CORRECTION,
            "configurations": [_candidate_data(plan, one) for one in self.configurations],
            "front": [one.number for one in self.winners],
            "better": [one.number for one in self.better],
            "verdicts": {str(number): verdict for number, verdict in self.verdicts.items()},
            "table": [line.to_dict() for line in self.judgements],
            "wall_s": round(self.wall_s, 3),
        }

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"

    @property
    def text(self) -> str:
        """What the command prints, without the folder."""
        plan, tuning = self.plan, self.plan.tuning
        counts = Counter(one.status for one in self.configurations[1:])
        statuses = ", ".join(f"{n} {status}" for status, n in sorted(counts.items()))
        lines = [
            f"{plan.name}: {len(self.configurations) - 1} of {tuning.trials} trials "
            f"by {tuning.sampler}: {statuses}; {self.runs} training runs in {self.wall_s:.1f} s"
        ]
        for name, runs in (("training", tuning.training), ("held out", tuning.held_out)):
            lines.append(f"{name}: seeds {runs.seeds}; conditions {', '.join(runs.names)}")
        if tuning.constraints:
            lines.append(f"constraints: {', '.join(map(str, tuning.constraints))}")
        if not self.winners:
            return "\n".join([*lines, NOTHING if self.has_feasible else _none_feasible(self)])
        kind = "winner" if len(tuning.objectives) == 1 else "front"
        lines.append(f"{kind}:")
        for one in self.winners:
            if one.values is not None:
                values = zip(plan.paths, plan.cells(one.values), strict=True)
                lines.append(
                    f"  {one.number}: {', '.join(f'{path}={value}' for path, value in values)}"
                )
        lines += [f"  {note}" for note in edges(self)]
        if self.held_out:
            shown = judgement_table(self.judgements, tuning.metrics, plan.units, plan.never)
            lines += ["", shown.select(*NARROW).text(), ""]
            lines += [_legend(self.judgements, tuning), *_verdicts(self)]
        return "\n".join(lines)


def _runs(plan: TuningPlan, key: str) -> dict[str, Any]:
    runs = plan.tuning.training if key == "training" else plan.tuning.held_out
    conditions = {
        condition.name: [str(change) for change in condition.changes]
        for condition in runs.conditions
    }
    return {"seeds": str(runs.seeds), "conditions": conditions}


def _candidate_data(plan: TuningPlan, one: Candidate) -> dict[str, Any]:
    score = one.score
    means = {} if score is None else score.metrics
    return {
        "number": one.number,
        "values": None if one.values is None else dict(zip(plan.paths, one.values, strict=True)),
        "status": one.status,
        "feasible": score is not None and score.is_feasible and score.has_values,
        "metrics": {name: number_or_none(v) for name, v in means.items()},
        "never": [name for name, value in means.items() if math.isinf(value)],
        "runs": len(one.rows),
    }


def _verdicts(result: TuningTable) -> list[str]:
    """What the held-out runs say of the winners that they do not show to be better."""
    found = result.verdicts
    if set(found.values()) <= {"better"}:
        return []
    if "better" not in found.values():
        is_worse = "not distinguishable" not in found.values()
        return ["", f"on the held-out runs, {NOTHING if is_worse else NOT_DISTINGUISHABLE}"]
    lines = [""]
    for verdict, text in (
        ("not distinguishable", NOT_DISTINGUISHABLE),
        ("not better", "not better than the graph's own values"),
    ):
        named = [str(number) for number, one in found.items() if one == verdict]
        lines += [f"on the held-out runs, {text}: {', '.join(named)}"] * bool(named)
    return lines


def _legend(lines: list[Judgement], tuning: TuningSettings) -> str:
    """Explanations of the table, as far as they are needed."""
    evaluations = [evaluation for line in lines for evaluation in (line.training, line.held_out)]
    differences = [each for line in lines if (each := line.held_out.difference) is not None]
    units = "conditions" if len(tuning.held_out.conditions) > 1 else "seeds"
    notes = [f"mean over the {units}; difference from the graph's own values on the same runs"]
    if any(not difference.is_same for difference in differences):
        notes[0] += f",\n{TESTS['auto']}, with 95 % intervals;\n* significant after {CORRECTION}"
        notes[0] += ". Winners were chosen by the training runs,\nwhich are therefore not tested"
    notes[0] += ". overfit: training minus held-out."
    if any(evaluation.mean.is_same for evaluation in evaluations):
        notes.append(f"{SAME}: {SAME_RUNS}.")
    if any(evaluation.mean.never for evaluation in evaluations):
        notes.append("Infinite values (never ...) and failed runs count as worse than any value.")
    needed = {difference.needed for difference in differences if difference.is_too_small}
    if needed:
        notes.append(f"{FEW}: {too_few(max(needed))}.")
    return "\n".join(notes)


def _none_feasible(result: TuningTable) -> str:
    best = [
        one for one in result.configurations[1:] if one.score is not None and one.score.has_values
    ]
    if not best:
        return "no configuration has a value of every metric in every run"
    closest = min(best, key=lambda one: one.score.violation if one.score else math.inf)
    means = closest.score.metrics if closest.score else {}
    values = ", ".join(f"{name} {number(means[name])}" for name in result.plan.tuning.metrics)
    return (
        f"no configuration satisfies the constraints; the closest, {closest.number}, has {values}"
    )


def edges(result: TuningTable) -> list[str]:
    """Which values of winners lie at an end of their range."""
    from runtime.experiments.design import Range

    notes = []
    for one in result.winners:
        for factor, value in zip(result.plan.design.factors, one.values or (), strict=False):
            end = factor.end_near(value) if isinstance(factor, Range) else ""
            if end:
                notes.append(
                    f"note: {factor.path}={value:g} of {one.number} is at the {end} end of its "
                    "range; widen it"
                )
    return notes
