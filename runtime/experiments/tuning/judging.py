"""The winners of a tuning beside its baseline, on the training runs and on the held-out ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from runtime.experiments.analysis import (
    Difference,
    Estimate,
    adjusted,
    difference,
    estimate,
    is_significant,
    number_or_none,
)
from runtime.experiments.design import RunSet
from runtime.experiments.tuning.plan import BASELINE, TuningPlan
from runtime.experiments.tuning.scores import Scorer, Tried


@dataclass(frozen=True)
class Judged:
    """A metric of a configuration on one set of runs, beside the baseline on the same runs.

    ``over`` is as in tuning: over the conditions the mean or the worst. ``mean`` and ``difference``
    are over all runs, paired by condition and seed; ``p`` is corrected over the table.
    """

    mean: Estimate
    over: float
    difference: Difference | None
    p: float = math.nan

    def to_dict(self) -> dict[str, Any]:
        apart = None
        if self.difference is not None:
            p = number_or_none(self.p)
            apart = self.difference.to_dict() | {
                "p": number_or_none(self.difference.p),
                "p_adjusted": p,
                "distinguishable": is_significant(p),
            }
        return self.mean.to_dict() | {"over": number_or_none(self.over), "difference": apart}


@dataclass(frozen=True)
class Judgement:
    """A metric of a configuration: on the training runs and on the held-out runs."""

    number: int
    metric: str
    training: Judged
    held_out: Judged

    @property
    def optimism(self) -> float:
        """Training minus held-out; of an error, negative if training promised too much."""
        return self.training.mean.mean - self.held_out.mean.mean

    def to_dict(self) -> dict[str, Any]:
        return {
            "configuration": self.number,
            "metric": self.metric,
            "training": self.training.to_dict(),
            "held_out": self.held_out.to_dict(),
            "optimism": number_or_none(self.optimism),
        }


def judge(
    plan: TuningPlan, tried: Sequence[Tried], winners: Sequence[Tried], held_out: dict[int, Tried]
) -> list[Judgement]:
    """A line for each metric that matters, of the baseline and of each winner."""
    scorer = Scorer(plan.tuning, plan.metrics)
    training = {one.number: one for one in (tried[BASELINE], *winners)}
    lines = []
    for number in training:
        for metric in plan.tuning.metrics:
            sets = []
            for runs, ran in ((plan.tuning.training, training), (plan.tuning.held_out, held_out)):
                sets.append(_judged(scorer, metric, runs, ran[number], ran[BASELINE]))
            lines.append(Judgement(number, metric, *sets))
    return _corrected(lines)


def _judged(scorer: Scorer, metric: str, runs: RunSet, one: Tried, baseline: Tried) -> Judged:
    mine, theirs = (
        [
            value
            for condition in scorer.values(metric, ran.rows, runs, runs.seeds)
            for value in condition
        ]
        for ran in (one, baseline)
    )
    mean = estimate([value for value in mine if value is not None])
    over = scorer.score(one.rows, runs, runs.seeds).metrics[metric]
    apart = None if one.number == BASELINE else difference(mine, theirs)
    return Judged(mean, over, apart)


def _corrected(lines: list[Judgement]) -> list[Judgement]:
    """The lines with p values corrected over all differences of the table."""
    both = [judged for line in lines for judged in (line.training, line.held_out)]
    found = adjusted([math.nan if j.difference is None else j.difference.p for j in both])
    fixed = [Judged(j.mean, j.over, j.difference, p) for j, p in zip(both, found, strict=True)]
    return [
        Judgement(line.number, line.metric, fixed[2 * i], fixed[2 * i + 1])
        for i, line in enumerate(lines)
    ]
