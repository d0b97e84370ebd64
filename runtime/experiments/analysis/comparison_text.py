"""The table of a comparison as text: for a terminal, a notebook or a page.

In: the lines of a comparison. Out: rows of strings, and what their words mean::

    total [m]
      baseline  6  2.1   0.4
      soft      6  2.6   0.5  +0.5  0.2  yes
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from runtime.experiments.analysis.comparison import ComparisonLine
from runtime.experiments.analysis.statistics import CORRECTION, LEVEL, TESTS, Estimate, Test
from runtime.experiments.analysis.words import (
    NEGLIGIBLE,
    NEVER,
    NO_DIRECTION,
    SAME,
    SAME_BESIDE,
    SAME_RUNS,
    TOO_FEW,
    UNRANKED,
    apart,
    half_width,
    interval,
    lost,
    seeds_of,
    too_few,
)
from runtime.terminal import number, table, with_unit

HEAD = (*("", "n", "mean", "interval of mean", "difference", "interval of difference", "differs"),)
SOME = "n/N: n of N seeds have a value (of a difference: both); means are over those."


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
    interval_text : writes an interval, the second argument being the sign of its format.
    """
    rows: list[tuple[str, ...]] = [HEAD]
    above = ("", "")
    for line in lines:
        if (line.metric, line.place) != above:
            above = line.metric, line.place
            rows.append((", ".join(filter(None, (with_unit(above[0], units or {}), above[1]))),))
        rows.append(_cells(line, interval_text, (never or {}).get(line.metric, NEVER)))
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


def legend(
    lines: Sequence[ComparisonLine],
    test: Test = "auto",
    paired: str = "the baseline on the same seed",
    how: str = "",
) -> str:
    """Explanations of the table's columns, as far as they are needed.

    Parameters
    ----------
    paired : what differences are to.
    how : they are tested; by default, by the test.
    """
    if all(line.own.is_same or line.is_removed for line in lines):
        to = paired.partition(" on the same")[0].removesuffix(",")
        return f"Differences are to {to}. {SAME}: {SAME_RUNS}."
    differences = [line.difference for line in lines if line.difference and not line.is_single]
    notes = [
        f"±: 95 % interval. Differences are to {paired}:",
        f"{how or TESTS[test]}.",
        f"differs: p < {LEVEL:.2g}, corrected by {CORRECTION} for all that can differ.",
    ]
    scales = {each.scale for each in differences if not (each.is_same or each.is_equal)}
    if "ranks" in scales and test == "auto":
        notes.append("ranks: signed-rank test and Hodges-Lehmann estimate of the difference.")
    if "log ranks" in scales:
        notes.append("difference in %: of skewed values, the typical ratio, by signed ranks.")
    if "log t" in scales:
        notes.append("difference in %: of skewed values, the ratio of their geometric means.")
    verdicts = {line.verdict for line in lines}
    if any(each.margin for each in differences):
        notes.append(f"margin: differs means by more; {NEGLIGIBLE}: the interval is within it.")
    if any(not line.is_primary for line in lines):
        notes.append("Metrics that are not primary are described, not tested.")
    if singles := ", ".join(dict.fromkeys(line.statistic for line in lines if line.is_single)):
        notes.append(f"{singles}: one number of all observations, without interval and test.")
    if any(line.own.is_same for line in lines):
        notes.append(_of_same_runs(lines))
    if any(line.own.n < line.runs and not line.own.is_same for line in lines):
        notes.append(SOME)
    if any(line.own.never or line.own.failed for line in lines):
        notes.append("Infinite values (never ...) and failed runs are worse than any value.")
    if UNRANKED in verdicts:
        notes.append(f"{UNRANKED}: {NO_DIRECTION}.")
    if TOO_FEW in verdicts:
        notes.append(_few([line for line in lines if line.verdict == TOO_FEW]))
    if any(line.has_significant_presence for line in lines):
        notes.append("in seeds: the share of seeds that have a value differs (McNemar's test).")
    if any(line.is_removed for line in lines):
        notes.append("removed: what the metric measures was removed.")
    return "\n".join(notes)


def _few(lines: Sequence[ComparisonLine]) -> str:
    """Why there are too few pairs, and how many are needed."""
    line = max(lines, key=lambda line: line.needed)
    pairs = line.difference.pairs if line.difference is not None else 0
    against = line.difference.against if line.difference is not None else 0
    pairs = pairs or line.runs
    why = f"; of {pairs} pairs p is at least {2.0 ** (1 - pairs):.2g}"
    if against:
        runs = f"{against} failed or infinite run{'s' * (against > 1)}"
        why = f": {runs} of {pairs} against the others, with the largest rank"
    return f"{too_few(line.needed)}{why}."


def _of_same_runs(lines: Sequence[ComparisonLine]) -> str:
    """What n = 1 means: beside runs that the seed does change, a difference is tested."""
    found = [line.difference for line in lines if line.own.is_same and line.difference is not None]
    is_tested = any(not each.is_same for each in found)
    return f"{SAME}: {SAME_BESIDE if is_tested else SAME_RUNS}."


def _cells(
    line: ComparisonLine, interval_text: Callable[[Estimate, str], str], never: str
) -> tuple[str, ...]:
    word = lost(line.own.never, line.own.failed, never)
    cells = [f"  {line.title}", seeds_of(line.own, line.runs)]
    cells += [number(line.own.mean) if line.own.n or not word else word]
    cells += [interval_text(line.own, "")]
    difference = line.difference
    if difference is None:
        return (*cells, "", "", line.verdict)
    mean, ends = apart(difference, interval_text)
    if 0 < difference.of < line.runs and not difference.is_same and mean != "-":
        mean += f" ({difference.of}/{line.runs})"
    verdict = line.verdict
    if verdict in ("yes", "no") and difference.scale == "ranks":
        verdict += ", ranks"
    return (*cells, mean, ends, verdict)
