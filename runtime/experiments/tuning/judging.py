"""The winners of a tuning beside its baseline, on the training runs and on the held-out ones.

In: the runs of the baseline and of the winners. Out: a :class:`Judgement` per metric and
configuration::

    baseline 0.5 and 0.5; configuration 7: training 0.2, held out 0.4
    ->  optimism -0.2 (of an error: training promised too much)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.experiments.analysis import (
    ANY,
    Estimate,
    PairedDifference,
    benjamini_hochberg,
    difference,
    estimate,
    failed_value,
    is_same,
    is_significant,
    mean_value,
    number_or_none,
)
from runtime.experiments.design import RunSet
from runtime.experiments.tuning.plan import BASELINE, TuningPlan
from runtime.experiments.tuning.scores import Candidate, Scorer


@dataclass(frozen=True)
class Evaluation:
    """A metric of a configuration on one set of runs, beside the baseline on the same runs.

    ``over`` is as in tuning: over the conditions the mean or the worst. ``mean`` and ``difference``
    are over ``units``: the conditions if there are several, each the mean of its seeds, otherwise
    the seeds; ``p`` is corrected over the table.
    """

    mean: Estimate
    units: int
    over: float
    difference: PairedDifference | None
    p: float = math.nan

    def to_dict(self) -> dict[str, Any]:
        paired = None
        if self.difference is not None:
            p = number_or_none(self.p)
            paired = self.difference.to_dict() | {
                "p_adjusted": p,
                "distinguishable": is_significant(p),
            }
        return self.mean.to_dict() | {
            "runs": self.units,
            "over": number_or_none(self.over),
            "difference": paired,
        }


@dataclass(frozen=True)
class Judgement:
    """A metric of a configuration: on the training runs and on the held-out runs."""

    number: int
    metric: str
    training: Evaluation
    held_out: Evaluation

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
    plan: TuningPlan,
    candidates: Sequence[Candidate],
    winners: Sequence[Candidate],
    held_out: dict[int, Candidate],
) -> list[Judgement]:
    """A line for each metric that matters, of the baseline and of each winner."""
    scorer = Scorer(plan.tuning, plan.metrics)
    training = {one.number: one for one in (candidates[BASELINE], *winners)}
    lines = []
    for number in training:
        for metric in plan.tuning.metrics:
            sets = []
            for runs, results in (
                (plan.tuning.training, training),
                (plan.tuning.held_out, held_out),
            ):
                sets.append(
                    _evaluate(plan, scorer, metric, runs, results[number], results[BASELINE])
                )
            lines.append(Judgement(number, metric, *sets))
    return _correct(lines)


def _evaluate(
    plan: TuningPlan, scorer: Scorer, metric: str, runs: RunSet, one: Candidate, baseline: Candidate
) -> Evaluation:
    values, is_one = _units(plan, scorer, metric, runs, one)
    own, own_is_one = _units(plan, scorer, metric, runs, baseline)
    known = [value for value in values if value is not None]
    mean = estimate(known, plan.ends.get(metric, ANY), is_one)
    over = scorer.score(one.rows, runs, runs.seeds).metrics[metric]
    paired = None
    if one.number != BASELINE:
        paired = difference(
            *(values, own),
            is_same=is_one and own_is_one,
            is_skewed=True if metric in plan.never else None,
        )
    return Evaluation(mean, len(values), over, paired)


def held_out_units(
    plan: TuningPlan, metric: str, one: Candidate
) -> tuple[list[float | None], bool]:
    """A metric of the held-out runs: one value per condition, or per seed of a single one."""
    scorer = Scorer(plan.tuning, plan.metrics)
    return _units(plan, scorer, metric, plan.tuning.held_out, one)


def _units(
    plan: TuningPlan, scorer: Scorer, metric: str, runs: RunSet, one: Candidate
) -> tuple[list[float | None], bool]:
    """A metric's value in each condition, or of a single one with each seed.

    Also whether the seed changes nothing there. The seeds of one condition tell nothing of others:
    taken for independent, 18 to 28 of 100 tables would show a difference that is none.
    """
    column = scorer.columns[metric]
    worst = -math.inf if metric in plan.larger_is_better else math.inf
    rows = [[one.rows[name, seed] for seed in runs.seeds] for name in runs.names]
    values = [[failed_value(row, column, worst) for row in each] for each in rows]
    if len(rows) == 1:
        return values[0], is_same(rows[0], column)
    return [mean_value(each) for each in values], False


def _correct(lines: list[Judgement]) -> list[Judgement]:
    """The lines with p values corrected over all differences of the table."""
    evaluations = [evaluation for line in lines for evaluation in (line.training, line.held_out)]
    corrected = benjamini_hochberg(
        [math.nan if j.difference is None else j.difference.p for j in evaluations]
    )
    fixed = [replace(evaluation, p=p) for evaluation, p in zip(evaluations, corrected, strict=True)]
    return [
        Judgement(line.number, line.metric, fixed[2 * i], fixed[2 * i + 1])
        for i, line in enumerate(lines)
    ]
