"""The winners of a tuning beside its baseline, on the training runs and on the held-out ones.

In: the runs of the baseline and of the winners. Out: a :class:`Judgement` per metric and
configuration::

    baseline 0.5 and 0.5; configuration 7: training 0.2, held out 0.4
    ->  optimism -0.2 (of an error: training promised too much)

The winner of many trials is best on its training runs even where nothing differs, so that these are
neither tested nor given an interval. It is *better* than the graph's own values only where the
held-out runs show it, by a test or because the seed changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

from runtime.experiments.analysis import (
    Estimate,
    PairedDifference,
    Questions,
    Sample,
    compare,
    failed_value,
    has_failed,
    is_same,
    is_significant,
    number_or_nan,
    number_or_none,
    sample_of,
)
from runtime.experiments.design import RunSet
from runtime.experiments.tuning.plan import BASELINE, TuningPlan
from runtime.experiments.tuning.scores import Candidate, Scorer

Verdict = Literal["better", "not better", "not distinguishable"]


@dataclass(frozen=True)
class Evaluation:
    """A metric of a configuration on one set of runs, beside the baseline on the same runs.

    ``over`` is as in tuning: over the conditions the mean or the worst. ``mean`` and ``difference``
    are over ``units``: the conditions if there are several, each the mean of its seeds, otherwise
    the seeds; ``p`` is corrected over the held-out differences of the table.
    """

    mean: Estimate
    units: int
    over: float
    difference: PairedDifference | None
    p: float = math.nan

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Evaluation:
        """An evaluation from its plain data, also from those of earlier versions."""
        paired = stored.get("difference")
        return cls(
            mean=Estimate.from_dict(stored),
            units=stored.get("runs", stored["n"]),
            over=number_or_nan(stored.get("over")),
            difference=None if paired is None else PairedDifference.from_dict(paired),
            p=number_or_nan((paired or {}).get("p_adjusted")),
        )

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

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Judgement:
        """A judgement from its plain data."""
        runs = (Evaluation.from_dict(stored[key]) for key in ("training", "held_out"))
        return cls(stored["configuration"], stored["metric"], *runs)

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
    training = {one.number: one for one in (candidates[BASELINE], *winners)}
    seen = _evaluate(plan, plan.tuning.training, training)
    judged = _evaluate(
        plan, plan.tuning.held_out, {number: held_out[number] for number in training}
    )
    lines = []
    for number, metric in product(training, plan.tuning.metrics):
        own = seen[number, metric]
        own = own if number == BASELINE else _without_test(own)
        lines.append(Judgement(number, metric, own, judged[number, metric]))
    return lines


def _evaluate(
    plan: TuningPlan, runs: RunSet, results: Mapping[int, Candidate]
) -> dict[tuple[int, str], Evaluation]:
    """Each metric of each configuration beside the baseline, with corrected p values."""
    scorer, metrics = Scorer(plan.tuning, plan.metrics), plan.tuning.metrics
    over = {n: scorer.score(one.rows, runs, runs.seeds).metrics for n, one in results.items()}
    samples = {
        (metric, ""): {
            str(n): _sample(plan, scorer, metric, runs, one) for n, one in results.items()
        }
        for metric in metrics
    }
    questions = Questions(ends=plan.ends, never=plan.never, is_of_presence=False)
    found = {}
    for line in compare(samples, str(BASELINE), questions):
        number, metric = int(line.variant), line.metric
        found[number, metric] = Evaluation(
            line.own, line.runs, over[number][metric], line.difference, line.p_adjusted
        )
    return found


def _without_test(seen: Evaluation) -> Evaluation:
    """The training runs of a winner, which has been chosen by them: no interval and no test."""
    mean, paired = replace(seen.mean, low=math.nan, high=math.nan), seen.difference
    if paired is not None:
        mean_only = (paired.n, paired.mean, math.nan, math.nan, paired.never, paired.is_same)
        paired = PairedDifference(*mean_only, pairs=paired.pairs, scale=paired.scale)
    return replace(seen, mean=mean, difference=paired, p=math.nan)


def verdicts(
    plan: TuningPlan, held_out: Mapping[int, Candidate], lines: Sequence[Judgement]
) -> dict[int, Verdict]:
    """What the held-out runs say of each winner beside the graph's own values."""
    judged = {(line.number, line.metric): line.held_out for line in lines}
    return {
        number: _verdict(plan, {m: judged[number, m] for m in plan.tuning.metrics}, one, held_out)
        for number, one in held_out.items()
        if number != BASELINE
    }


def _verdict(
    plan: TuningPlan,
    judged: Mapping[str, Evaluation],
    one: Candidate,
    held_out: Mapping[int, Candidate],
) -> Verdict:
    """Better in an objective, or in a constraint that the graph's own values violate."""
    tuning, own, score = plan.tuning, held_out[BASELINE].score, one.score
    if own is None or score is None or not score.is_feasible:
        return "not better"
    asked = [o.metric for o in tuning.objectives]
    if not own.is_feasible:
        violations = zip(tuning.constraints, own.violations, strict=True)
        asked = [c.metric for c, violation in violations if violation > 0.0]
    found = [_direction(judged[metric], metric in plan.larger_is_better) for metric in asked]
    if score.improves_on(own):
        return "better" if 1 in found else "not distinguishable"
    return (
        "not better"
        if -1 in found or not any(map(_is_tested, judged.values()))
        else ("not distinguishable")
    )


def _is_tested(judged: Evaluation) -> bool:
    return judged.difference is not None and not (
        judged.difference.is_same or judged.difference.is_equal
    )


def _direction(judged: Evaluation, larger_is_better: bool) -> int:
    """1 if it is shown that a metric is better, -1 that it is worse, 0 for neither."""
    difference = judged.difference
    if difference is None or math.isnan(difference.mean) or difference.is_equal:
        return 0
    if not difference.is_same and not is_significant(judged.p):
        return 0
    return 1 if (difference.mean > 0.0) == larger_is_better else -1


def held_out_values(
    plan: TuningPlan, metric: str, one: Candidate
) -> tuple[list[list[float]], list[list[bool]], bool]:
    """A metric of the held-out runs by condition and seed, which of them failed, and whether the
    seed changes nothing.

    NaN where there is no value, infinite of a run that failed.
    """
    runs, column = plan.tuning.held_out, plan.metrics.index(metric)
    rows = [[one.rows[name, seed] for seed in runs.seeds] for name in runs.names]
    found = [[failed_value(row, column, plan.worst(metric)) for row in each] for each in rows]
    values = [[math.nan if value is None else value for value in each] for each in found]
    failed = [[has_failed(row, column) for row in each] for each in rows]
    return values, failed, all(is_same(each, column) for each in rows)


def _sample(plan: TuningPlan, scorer: Scorer, metric: str, runs: RunSet, one: Candidate) -> Sample:
    """A metric's value in each condition, or of a single one with each seed.

    The seeds of one condition tell nothing of others: taken for independent, 18 to 28 of 100
    tables would show a difference that is none.
    """
    rows = [[one.rows[name, seed] for seed in runs.seeds] for name in runs.names]
    return sample_of(rows, scorer.columns[metric], plan.worst(metric), is_sampled=True)
