"""The comparison of variants with their baseline: an ablation's table, as data and as text.

In: for each metric and variant one value per seed. Out: a :class:`ComparisonLine` each::

    {(error, ""): {baseline: [2.0, 2.4, 2.2], soft: [2.1, 2.7, 2.4]}}
    ->  soft  error  mean 2.4  difference +0.2, p 0.07, corrected 0.07: no
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from runtime.experiments.analysis.crossed import Contestant, crossed_difference
from runtime.experiments.analysis.estimates import (
    ANY,
    LEVEL,
    Ends,
    Estimate,
    Margin,
    PairedDifference,
    is_significant,
    number_or_nan,
    number_or_none,
)
from runtime.experiments.analysis.ranks import fewest
from runtime.experiments.analysis.statistics import (
    Test,
    benjamini_hochberg,
    difference,
    estimate,
    mcnemar_test,
)
from runtime.experiments.analysis.words import EQUAL, NEGLIGIBLE, SAME, THESE, TOO_FEW, UNRANKED
from runtime.experiments.design import BASELINE

PER = " per "  # in the name of a trend: error per wind.speed
MEAN, WORST = "mean", "worst"  # statistics, as is "0.9-quantile"


@dataclass(frozen=True)
class ComparisonLine:
    """One metric of one variant.

    Parameters
    ----------
    runs : number of seeds; ``own.n`` of them have a value, ``own.never`` an infinite one.
    setting : values of the factors; '' for all of them together.
    reference : what the variant is compared with; None for the baseline itself.
    difference : the paired difference to the reference.
    p_adjusted : ``difference.p`` corrected for the number of comparisons in the table.
    p_presence : likewise, for having a value as often as the reference.
    failed : runs that failed, which count as worse than any value.
    is_unranked : runs of a side failed, and the metric has no direction in which that is worse.
    is_primary : the metric is tested, and not only described.
    is_removed : the variant does not record what the metric measures.
    statistic : of the values of each seed; of a tail ``worst``, or such as ``0.9-quantile``.
    is_single : the statistic is one number of all observations: no interval, and nothing is tested.
    verdict : whether the difference is significant, in a word or two.
    """

    variant: str
    metric: str
    runs: int
    own: Estimate
    difference: PairedDifference | None = None
    p_adjusted: float = math.nan
    p_presence: float = math.nan
    setting: str = ""
    reference: str | None = None
    failed: int = 0
    is_primary: bool = True
    is_removed: bool = False
    is_unranked: bool = False
    statistic: str = MEAN
    is_single: bool = False
    verdict: str = ""

    @property
    def place(self) -> str:
        """What the line is of besides its metric: a setting, or the statistic of a tail."""
        return self.setting if self.statistic == MEAN else self.statistic

    @property
    def title(self) -> str:
        """What is compared, if not with the baseline."""
        is_contrast = self.reference not in (None, BASELINE)
        return f"{self.variant} - {self.reference}" if is_contrast else self.variant

    @property
    def has_significant_difference(self) -> bool | None:
        """Whether the difference is significantly different from zero; None if it has no p."""
        if self.difference is None or math.isnan(self.p_adjusted) or self.difference.is_of_these:
            return None
        return is_significant(self.p_adjusted)

    @property
    def has_significant_presence(self) -> bool:
        """Whether the share of seeds with a value differs significantly from the baseline's."""
        return is_significant(self.p_presence)

    @property
    def needed(self) -> int:
        """The seeds that the tests of this line need for any result to be significant."""
        if self.difference is None or self.difference.is_same:
            return 0
        return max(self.difference.needed, 0 if math.isnan(self.p_presence) else fewest(LEVEL))

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> ComparisonLine:
        """A line from its plain data; earlier versions have fewer entries."""
        apart, statistic = stored["difference"], stored.get("statistic", MEAN)
        line = cls(
            variant=stored["variant"],
            metric=stored["metric"],
            runs=stored["runs"],
            own=Estimate.from_dict(stored),
            setting=stored.get("setting", ""),
            reference=stored.get("reference"),
            failed=stored.get("failed", 0),
            is_primary=stored.get("primary", True),
            is_removed=not stored.get("recorded", True),
            statistic=statistic,
        )
        if apart is None:
            return replace(line, verdict="removed" if line.is_removed else "")
        plain = {True: "yes", False: "no", None: "-"}[apart.get("distinguishable")]
        verdict = apart.get("verdict", plain)
        return replace(
            line,
            difference=PairedDifference.from_dict(apart),
            p_adjusted=number_or_nan(apart.get("p_of_these", apart.get("p_adjusted"))),
            p_presence=number_or_nan(apart.get("p_presence")),
            is_unranked=verdict == UNRANKED,
            is_single=statistic != MEAN and not verdict,
            verdict=verdict,
        )

    def to_dict(self) -> dict[str, Any]:
        """The line as plain data."""
        difference = self.difference
        line: dict[str, Any] = {
            "variant": self.variant,
            "reference": self.reference,
            "metric": self.metric,
            "setting": self.setting,
            "statistic": self.statistic,
            "primary": self.is_primary,
            "runs": self.runs,
            "recorded": not self.is_removed,
            **self.own.to_dict(),
            "failed": self.failed,
            "difference": None,
        }
        if difference is not None:
            p = number_or_none(self.p_adjusted)
            these = {"p_of_these": p} if difference.is_of_these else {}
            line["difference"] = {
                **difference.to_dict(),
                **these,
                "p_adjusted": None if these else p,
                "distinguishable": self.has_significant_difference,
                "p_presence": number_or_none(self.p_presence),
                "verdict": self.verdict,
            }
        return line


def _verdict(line: ComparisonLine) -> str:
    """Whether the difference is significant, in a word or two."""
    if line.is_removed:
        return "removed"
    difference = line.difference
    if difference is None or line.is_single:
        return ""
    if line.has_significant_presence:
        return "yes, in seeds"
    if line.is_unranked:
        return TOO_FEW if line.needed > line.runs else UNRANKED
    if difference.is_same and not difference.is_equal:
        return SAME
    if difference.is_equal:
        return EQUAL
    if not line.is_primary:
        return "-"
    if difference.is_too_small or line.needed > line.runs:
        return TOO_FEW
    if difference.is_of_these and is_significant(line.p_adjusted):
        return THESE
    if line.has_significant_difference:
        return "yes"
    if difference.is_negligible:
        return NEGLIGIBLE
    return "-" if math.isnan(line.p_adjusted) else "no"


@dataclass(frozen=True)
class Sample:
    """The values of one metric of one variant: one per seed, or per setting of the factors.

    Parameters
    ----------
    values : None where there is none; infinite for what was never reached, or of a failed run.
    failed : how many of these runs failed.
    is_unranked : their values are None, since the metric has no direction that is worse.
    is_same : the seed changes nothing, so that all runs are one.
    is_removed : the variant does not record what the metric measures.
    statistic, is_single : as in :class:`ComparisonLine`.
    crossed : of a contest, the values by tuning, condition and seed.
    """

    values: tuple[float | None, ...]
    failed: int = 0
    is_same: bool = False
    is_removed: bool = False
    is_unranked: bool = False
    statistic: str = MEAN
    is_single: bool = False
    crossed: Contestant | None = None

    def estimate(self, ends: Ends = ANY) -> Estimate:
        """The mean with its interval, as every table and figure shows it."""
        if self.crossed is not None:
            return self.crossed.estimate(ends)
        return estimate(self.values, ends, self.is_same, failed=self.failed)


@dataclass(frozen=True)
class Questions:
    """What is asked of the values.

    Parameters
    ----------
    primary : the metrics whose differences are tested; all if empty. Of the others, intervals are
        shown, without a verdict.
    contrasts : pairs of variants that are compared with each other, besides with the baseline.
    margins : by metric, the smallest difference that counts: in its unit, or a share of what it is
        compared with if it is a string such as ``5%``. That of '' is of all others.
    ends : by metric, of the intervals of its mean.
    never : by metric, what infinite means. Such waiting times have skewed distributions.
    is_of_presence : whether it is tested that both sides have a value equally often.
    """

    test: Test = "auto"
    primary: Sequence[str] = ()
    contrasts: Sequence[tuple[str, str]] = ()
    margins: Mapping[str, float | str] = field(default_factory=dict)
    ends: Mapping[str, Ends] = field(default_factory=dict)
    never: Mapping[str, str] = field(default_factory=dict)
    is_of_presence: bool = True

    def is_primary(self, metric: str) -> bool:
        """Whether a metric, or the trend of one, is tested."""
        return not self.primary or metric.partition(PER)[0] in self.primary

    def margin(self, metric: str) -> Margin:
        """The smallest difference of a metric that counts."""
        return Margin.of(self.margins.get(metric, self.margins.get("", 0.0)))


def compare(
    samples: Mapping[tuple[str, str], Mapping[str, Sample]],
    baseline: str,
    questions: Questions,
) -> list[ComparisonLine]:
    """The lines of the table, metric by metric, the baseline first, contrasts last.

    Parameters
    ----------
    samples : for each metric and setting of the factors ('' for all) or statistic, those of each
        variant, in the same order of seeds.

    Both kinds of p value, of differences and of missing values, are corrected together: without
    it, a table of many comparisons would show some that are significant by chance. What is equal
    in every seed, or has too few pairs for any result, was not tested, and does not count.
    """
    lines = []
    for (metric, place), variants in samples.items():
        if not questions.is_primary(metric) and (place or PER in metric):
            continue  # what is only described is described over all settings
        for variant in variants:
            reference = None if variant == baseline else baseline
            lines.append(_line(metric, place, variants, variant, reference, questions))
        for variant, reference in questions.contrasts:
            lines.append(_line(metric, place, variants, variant, reference, questions))
    return correct(lines, questions)


def correct(lines: Sequence[ComparisonLine], questions: Questions) -> list[ComparisonLine]:
    """The lines with p values corrected over all that are tested, and with their verdicts."""
    tested = [line for line in lines if questions.is_primary(line.metric)]
    compared = [_p(line.difference) for line in tested]
    both = benjamini_hochberg([*compared, *(line.p_presence for line in tested)])
    p = dict(zip(map(id, tested), both[: len(tested)], strict=True))
    q = dict(zip(map(id, tested), both[len(tested) :], strict=True))
    found = [
        replace(
            line,
            is_primary=id(line) in p,
            p_adjusted=p.get(id(line), math.nan),
            p_presence=q.get(id(line), math.nan),
        )
        for line in lines
    ]
    return [replace(line, verdict=_verdict(line)) for line in found]


def _p(difference: PairedDifference | None) -> float:
    """What is corrected; NaN if nothing was tested."""
    return math.nan if difference is None or difference.is_too_small else difference.p


def _line(
    metric: str,
    place: str,
    variants: Mapping[str, Sample],
    variant: str,
    reference: str | None,
    questions: Questions,
) -> ComparisonLine:
    sample, ends = variants[variant], questions.ends.get(metric, ANY)
    own = sample.estimate(ends)
    line = ComparisonLine(
        variant=variant,
        metric=metric,
        runs=len(sample.values),
        own=own,
        setting=place if sample.statistic == MEAN else "",
        reference=reference,
        failed=sample.failed,
        is_removed=sample.is_removed,
        statistic=sample.statistic,
        is_single=sample.is_single,
    )
    if reference is None or sample.is_removed or variants[reference].is_removed:
        return line
    base = variants[reference]
    compared = _compare_samples(metric, sample, base, questions)
    # Where both lack the same values there is nothing to test.
    differs = [a is None for a in sample.values] != [b is None for b in base.values]
    is_tested = questions.is_of_presence and differs and not sample.is_single
    presence = mcnemar_test(sample.values, base.values) if is_tested else math.nan
    is_unranked = sample.is_unranked or base.is_unranked
    if is_unranked:
        # A difference of the runs that survived says nothing of those that did not.
        compared = PairedDifference(
            0, math.nan, math.nan, math.nan, pairs=compared.pairs, scale=compared.scale
        )
    return replace(line, difference=compared, p_presence=presence, is_unranked=is_unranked)


def _compare_samples(
    metric: str, sample: Sample, base: Sample, questions: Questions
) -> PairedDifference:
    """The paired difference of two samples, which a margin and a test belong to unless they are
    single numbers."""
    is_skewed = True if metric in questions.never else None
    margin = Margin() if sample.is_single else questions.margin(metric)
    if sample.crossed is not None and base.crossed is not None:
        return crossed_difference(sample.crossed, base.crossed, is_skewed, margin)
    return difference(
        sample.values,
        base.values,
        "t" if sample.is_single else questions.test,
        is_same=sample.is_same and base.is_same,
        is_skewed=is_skewed,
        margin=margin,
    )
