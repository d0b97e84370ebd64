"""The comparison of variants with their baseline: an ablation's table, as data and as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.experiments.analysis.statistics import (
    CORRECTION,
    LEVEL,
    TESTS,
    Difference,
    Estimate,
    Test,
    adjusted,
    difference,
    estimate,
    interval,
    is_significant,
    number_or_none,
    presence,
)
from runtime.terminal import number, table, with_unit

Values = Sequence[float | None]


@dataclass(frozen=True)
class ComparisonLine:
    """One metric of one variant.

    Parameters
    ----------
    runs : number of seeds; ``own.n`` of them have a value.
    difference : the paired difference to the baseline; None for the baseline itself.
    p_adjusted : ``difference.p`` corrected for the number of comparisons in the table.
    p_presence : likewise, for having a value as often as the baseline.
    is_removed : the variant does not record what the metric measures.
    """

    variant: str
    metric: str
    runs: int
    own: Estimate
    difference: Difference | None = None
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
                "p": number_or_none(difference.p),
                "p_adjusted": number_or_none(self.p_adjusted),
                "distinguishable": self.has_significant_difference,
                "p_presence": number_or_none(self.p_presence),
            }
        return line


def compare(
    values: Mapping[str, Mapping[str, Values]],
    baseline: str,
    test: Test = "t",
    removed: Container[tuple[str, str]] = (),
) -> list[ComparisonLine]:
    """The lines of the table, metric by metric, the baseline first.

    Parameters
    ----------
    values : for each variant and metric, one value per seed; all in the same order of seeds.
    removed : (variant, metric) where the variant removes what the metric measures.

    Both kinds of p value, of differences and of missing values, are corrected together: without
    it, a table of many comparisons would show some that are significant by chance.
    """
    lines = []
    for metric, base in values[baseline].items():
        for variant, columns in values.items():
            mine = columns[metric]
            own = estimate([value for value in mine if value is not None], test)
            line = ComparisonLine(
                variant, metric, len(mine), own, is_removed=(variant, metric) in removed
            )
            if variant != baseline and not line.is_removed:
                differs = [a is None for a in mine] != [b is None for b in base]
                line = replace(
                    line,
                    difference=difference(mine, base, test),
                    p_presence=presence(mine, base) if differs else math.nan,
                )
            lines.append(line)
    compared = [line.difference.p if line.difference is not None else math.nan for line in lines]
    corrected = adjusted([*compared, *(line.p_presence for line in lines)])
    found = zip(lines, corrected[: len(lines)], corrected[len(lines) :], strict=True)
    return [replace(line, p_adjusted=p, p_presence=q) for line, p, q in found]


def comparison_rows(
    lines: Sequence[ComparisonLine],
    units: Mapping[str, str] | None = None,
    shown: Callable[[Estimate, str], str] = interval,
) -> list[tuple[str, ...]]:
    """The table as texts: its header, and for each metric its name and a row per variant.

    ``shown`` writes an interval, the second argument being the sign of its format.
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
        rows.append(_cells(line, shown))
    return rows


def comparison_table(
    lines: Sequence[ComparisonLine], units: Mapping[str, str] | None = None
) -> str:
    """The table for a terminal; ``units`` are those of the metrics."""
    shorter = {"interval of mean": "±", "interval of difference": "±"}
    rows = comparison_rows(lines, units, half_width)
    rows[0] = tuple(shorter.get(title, title) for title in rows[0])
    return table(rows, range(1, len(rows[0])), indent="")


def legend(lines: Sequence[ComparisonLine], test: Test) -> str:
    """Explanations of the table's columns, as far as they are needed."""
    notes = [
        f"±: 95 % interval, {TESTS[test]}. Differences are to the baseline on the same seed.",
        f"differs: p < {LEVEL:.2g}, corrected by {CORRECTION} for all comparisons.",
    ]
    if any(line.own.n < line.runs for line in lines):
        notes.append(
            "n/N: n of N seeds have a value (of a difference: both); means are over those."
        )
    if any(line.has_significant_presence for line in lines):
        notes.append("in seeds: the share of seeds that have a value differs (McNemar's test).")
    if any(line.is_removed for line in lines):
        notes.append("removed: what the metric measures was removed.")
    return "\n".join(notes)


def half_width(found: Estimate, sign: str = "") -> str:
    """Half of a confidence interval; both ends where its middle is not the mean."""
    half = 0.5 * (found.high - found.low)
    if math.isnan(half) or found.mean is None:
        return "-"
    if abs(0.5 * (found.low + found.high) - found.mean) > 1e-6 * half:
        return interval(found, sign)
    return f"{half:.2g}"


def _cells(line: ComparisonLine, shown: Callable[[Estimate, str], str]) -> tuple[str, ...]:
    seeds = f"{line.own.n}/{line.runs}" if line.own.n < line.runs else str(line.runs)
    cells = [f"  {line.variant}", seeds, number(line.own.mean), shown(line.own, "")]
    if line.is_removed:
        cells += ["", "", "removed"]
    elif line.difference is not None:
        mean = number(line.difference.mean, "+")
        if 0 < line.difference.n < line.runs:
            mean += f" ({line.difference.n}/{line.runs})"
        found, differs = line.difference, line.has_significant_difference
        word = verdict(found.n, found.mean, found.p, line.p_presence, differs)
        cells += [mean, shown(found, "+"), word]
    else:
        cells += ["", "", ""]
    return tuple(cells)


def verdict(
    n: int, mean: float | None, p: float | None, p_presence: float | None, differs: bool | None
) -> str:
    """Whether a difference is significant, in a word or two."""
    if is_significant(p_presence):
        return "yes, in seeds"
    if n and mean == 0.0 and p == 1.0:
        return "equal"
    return {True: "yes", False: "no", None: "-"}[differs]
