"""The winners of a tuning beside its baseline, on the training runs and on the held-out ones.

In: the runs of the baseline and of the winners. Out: a :class:`Judgement` per metric and
configuration::

    own 0.5 and 0.5; configuration 7: training 0.2, held out 0.4  ->  optimism -0.2 (of an error,
                                                                      training promised too much)
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
    is_same,
    is_significant,
    number_or_none,
)
from runtime.experiments.design import RunSet
from runtime.experiments.tuning.plan import BASELINE, TuningPlan
from runtime.experiments.tuning.scores import Candidate, Scorer


@dataclass(frozen=True)
class Evaluation:
    """A metric of a configuration on one set of runs, beside the baseline on the same runs.

    ``over`` is as in tuning: over the conditions the mean or the worst. ``mean`` and ``difference``
    are over all ``runs``, paired by condition and seed; ``p`` is corrected over the table. A
    condition in which the seed changes nothing is one run.
    """

    mean: Estimate
    runs: int
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
            "runs": self.runs,
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
    values, same = _by_condition(scorer, metric, runs, one)
    own, own_same = _by_condition(scorer, metric, runs, baseline)
    observations = _observations(values, same)
    known = [value for value in observations if value is not None]
    is_one = all(same) and len(same) == 1
    mean = estimate(known, ends=plan.ends.get(metric, ANY), is_same=is_one)
    over = scorer.score(one.rows, runs, runs.seeds).metrics[metric]
    paired = None
    if one.number != BASELINE:
        same_in_both = [a and b for a, b in zip(same, own_same, strict=True)]
        is_one = all(same_in_both) and len(same_in_both) == 1
        baseline_observations = _observations(own, same_in_both)
        paired = difference(
            _observations(values, same_in_both), baseline_observations, is_same=is_one
        )
    return Evaluation(mean, len(observations), over, paired)


def _by_condition(
    scorer: Scorer, metric: str, runs: RunSet, one: Candidate
) -> tuple[list[list[float | None]], list[bool]]:
    """A metric's values in each condition, and whether the seed changes nothing there."""
    values = scorer.values(metric, one.rows, runs, runs.seeds)
    column = scorer.columns[metric]
    rows = ([one.rows.get((name, seed)) for seed in runs.seeds] for name in runs.names)
    same = [is_same([row for row in each if row is not None], column) for each in rows]
    return values, same


def _observations(values: list[list[float | None]], same: list[bool]) -> list[float | None]:
    """All values; of a condition in which the seed changes nothing the first."""
    pairs = zip(values, same, strict=True)
    return [value for each, is_one in pairs for value in (each[:1] if is_one else each)]


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
