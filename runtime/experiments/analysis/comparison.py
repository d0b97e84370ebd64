"""The comparison of variants with their baseline: an ablation's table, as data and as text.

In: for each variant and metric one value per seed. Out: a :class:`ComparisonLine` each::

    {baseline: {error: [2.0, 2.4, 2.2]}, soft: {error: [2.1, 2.7, 2.4]}}
    ->  soft  error  mean 2.4  difference +0.2, p 0.07, corrected 0.07: no
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.experiments.analysis.statistics import (
    ANY,
    CORRECTION,
    LEVEL,
    TESTS,
    Ends,
    Estimate,
    PairedDifference,
    Test,
    Values,
    benjamini_hochberg,
    difference,
    estimate,
    fewest,
    is_significant,
    mcnemar_test,
    number_or_none,
)
from runtime.experiments.analysis.words import (
    NEVER,
    SAME,
    SAME_RUNS,
    TOO_FEW,
    half_width,
    interval,
    seeds_of,
    too_few,
)
from runtime.terminal import number, table, with_unit


@dataclass(frozen=True)
class ComparisonLine:
    """One metric of one variant.

    Parameters
    ----------
    runs : number of seeds; ``own.n`` of them have a value, ``own.never`` an infinite one.
    difference : the paired difference to the baseline; None for the baseline itself.
    p_adjusted : ``difference.p`` corrected for the number of comparisons in the table.
    p_presence : likewise, for having a value as often as the baseline.
    is_removed : the variant does not record what the metric measures.
    """

    variant: str
    metric: str
    runs: int
    own: Estimate
    difference: PairedDifference | None = None
    p_adjusted: float = math.nan
    p_presence: float = math.nan
    is_removed: bool = False

    @property
    def has_significant_difference(self) -> bool | None:
        """Whether the difference is significantly different from zero; None if it has no p."""
        if self.difference is None or math.isnan(self.p_adjusted):
            return None
        return is_significant(self.p_adjusted)

    @property
    def has_significant_presence(self) -> bool:
        """Whether the share of seeds with a value differs significantly from the baseline's."""
        return is_significant(self.p_presence)

    @property
    def verdict(self) -> str:
        """Whether the difference is significant, in a word or two."""
        if self.is_removed:
            return "removed"
        difference = self.difference
        if difference is None:
            return ""
        if self.has_significant_presence:
            return "yes, in seeds"
        if difference.is_same:
            return "equal" if difference.mean == 0.0 else SAME
        if difference.pairs and difference.p == 1.0 and not difference.mean:
            return "equal"
        if self.has_significant_difference:
            return "yes"
        if difference.is_too_small or self.needed > self.runs:
            return TOO_FEW
        return "-" if self.has_significant_difference is None else "no"

    @property
    def needed(self) -> int:
        """The seeds that the tests of this line need for any result to be significant."""
        if self.difference is None or self.difference.is_same:
            return 0
        return max(self.difference.needed, 0 if math.isnan(self.p_presence) else fewest())

    def to_dict(self) -> dict[str, Any]:
        """The line as plain data."""
        difference = self.difference
        line: dict[str, Any] = {
            "variant": self.variant,
            "metric": self.metric,
            "runs": self.runs,
            "recorded": not self.is_removed,
            **self.own.to_dict(),
            "difference": None,
        }
        if difference is not None:
            line["difference"] = {
                **difference.to_dict(),
                "p_adjusted": number_or_none(self.p_adjusted),
                "distinguishable": self.has_significant_difference,
                "p_presence": number_or_none(self.p_presence),
                "verdict": self.verdict,
            }
        return line


def compare(
    values: Mapping[str, Mapping[str, Values]],
    baseline: str,
    test: Test = "t",
    removed: Container[tuple[str, str]] = (),
    same: Container[tuple[str, str]] = (),
    ends: Mapping[str, Ends] | None = None,
) -> list[ComparisonLine]:
    """The lines of the table, metric by metric, the baseline first.

    Parameters
    ----------
    values : for each variant and metric, one value per seed; all in the same order of seeds.
    removed : (variant, metric) where the variant removes what the metric measures.
    same : (variant, metric) where the seed changes nothing, so that all runs are one.
    ends : of the intervals of each metric's mean.

    Both kinds of p value, of differences and of missing values, are corrected together: without
    it, a table of many comparisons would show some that are significant by chance.
    """
    lines = []
    for metric, base in values[baseline].items():
        for variant, columns in values.items():
            own_values = columns[metric]
            is_same = (variant, metric) in same
            known = [value for value in own_values if value is not None]
            own = estimate(known, test, (ends or {}).get(metric, ANY), is_same)
            line = ComparisonLine(
                variant, metric, len(own_values), own, is_removed=(variant, metric) in removed
            )
            if variant != baseline and not line.is_removed:
                # Where both lack the same values there is nothing to test, and another p value of 1
                # would only weaken the correction of the others.
                differs = [a is None for a in own_values] != [b is None for b in base]
                line = replace(
                    line,
                    difference=difference(
                        own_values, base, test, is_same and (baseline, metric) in same
                    ),
                    p_presence=mcnemar_test(own_values, base) if differs else math.nan,
                )
            lines.append(line)
    compared = [line.difference.p if line.difference is not None else math.nan for line in lines]
    corrected = benjamini_hochberg([*compared, *(line.p_presence for line in lines)])
    triples = zip(lines, corrected[: len(lines)], corrected[len(lines) :], strict=True)
    return [replace(line, p_adjusted=p, p_presence=q) for line, p, q in triples]


def comparison_rows(
    lines: Sequence[ComparisonLine],
    units: Mapping[str, str] | None = None,
    never: Mapping[str, str] | None = None,
    interval_text: Callable[[Estimate, str], str] = interval,
) -> list[tuple[str, ...]]:
    """The table as strings: its header, and for each metric its name and a row per variant.

    Parameters
    ----------
    never : for each metric that may be infinite, what that means, such as ``never settled``.
    shown : writes an interval, the second argument being the sign of its format.
    """
    rows: list[tuple[str, ...]] = [
        (
            "",
            "seeds",
            "mean",
            "interval of mean",
            "difference",
            "interval of difference",
            "differs",
        )
    ]
    metric = ""
    for line in lines:
        if line.metric != metric:
            metric = line.metric
            rows.append((with_unit(metric, units or {}),))
        rows.append(_cells(line, interval_text, (never or {}).get(metric, NEVER)))
    return rows


def comparison_table(
    lines: Sequence[ComparisonLine],
    units: Mapping[str, str] | None = None,
    never: Mapping[str, str] | None = None,
) -> str:
    """The table for a terminal; ``units`` are those of the metrics."""
    shorter = {"interval of mean": "±", "interval of difference": "±"}
    rows = comparison_rows(lines, units, never, half_width)
    rows[0] = tuple(shorter.get(title, title) for title in rows[0])
    return table(rows, range(1, len(rows[0])), indent="")


def legend(lines: Sequence[ComparisonLine], test: Test) -> str:
    """Explanations of the table's columns, as far as they are needed."""
    if all(line.own.is_same or line.is_removed for line in lines):
        return f"Differences are to the baseline. {SAME}: {SAME_RUNS}."
    notes = [
        f"±: 95 % interval, {TESTS[test]}. Differences are to the baseline on the same seed.",
        f"differs: p < {LEVEL:.2g}, corrected by {CORRECTION} for all comparisons.",
    ]
    verdicts = {line.verdict for line in lines}
    if any(line.own.is_same for line in lines):
        notes.append(f"{SAME}: {SAME_RUNS}.")
    if any(line.own.n < line.runs and not line.own.is_same for line in lines):
        notes.append(
            "n/N: n of N seeds have a value (of a difference: both); means are over those."
        )
    if any(line.own.never for line in lines):
        notes.append("Infinite values (never ...) count as worse than any other: sign test.")
    if TOO_FEW in verdicts:
        needed = max(line.needed for line in lines if line.verdict == TOO_FEW)
        notes.append(f"{too_few(needed)}.")
    if any(line.has_significant_presence for line in lines):
        notes.append("in seeds: the share of seeds that have a value differs (McNemar's test).")
    if any(line.is_removed for line in lines):
        notes.append("removed: what the metric measures was removed.")
    return "\n".join(notes)


def _cells(
    line: ComparisonLine, interval_text: Callable[[Estimate, str], str], never: str
) -> tuple[str, ...]:
    cells = [f"  {line.variant}", seeds_of(line.own, line.runs)]
    cells += [number(line.own.mean) if line.own.n or not line.own.never else never]
    cells += [interval_text(line.own, "")]
    difference = line.difference
    if difference is None:
        return (*cells, "", "", line.verdict)
    mean = number(difference.mean, "+")
    if 0 < difference.n < line.runs and not difference.is_same:
        mean += f" ({difference.n}/{line.runs})"
    return (*cells, mean, interval_text(difference, "+"), line.verdict)
