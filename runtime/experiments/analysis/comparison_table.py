"""The table of a comparison, and what its words mean.

In: the lines of a comparison. Out: a table for a terminal, a notebook and a page, and its notes::

    total [m]
      baseline  6  2.1   0.4
      soft      6  2.6   0.5  +0.5  0.2  yes
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from runtime.experiments.analysis.comparison import ComparisonLine
from runtime.experiments.analysis.estimates import (
    LEVEL,
)
from runtime.experiments.analysis.statistics import (
    CORRECTION,
    TESTS,
    Test,
)
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
    mean_of,
    p_cell,
    seeds_of,
    too_few,
)
from runtime.tables import Cell, Column, Table
from runtime.terminal import with_unit

COLUMNS = (
    Column("", key="name"),
    Column("n", "number"),
    Column("mean", "number"),
    Column("±", "number", key="half"),
    Column("95 % interval of the mean", "number", key="interval"),
    Column("difference", "number"),
    Column("±", "number", key="difference_half"),
    Column("95 % interval of the difference", "number", key="difference_interval"),
    Column("p, corrected", "number", key="p"),
    Column("differs", "number", key="verdict"),
)
NARROW = ("name", "n", "mean", "half", "difference", "difference_half", "verdict")  # of a terminal
WIDE = ("name", "n", "mean", "interval", "difference", "difference_interval", "p", "verdict")
SOME = "n/N: n of N seeds have a value (of a difference: both); means are over those."


def comparison_table(
    lines: Sequence[ComparisonLine],
    units: Mapping[str, str] | None = None,
    never: Mapping[str, str] | None = None,
) -> Table:
    """A row for each line, below the names of metrics; of these columns, :data:`NARROW` are for a
    terminal and :data:`WIDE` for a page.

    Parameters
    ----------
    units : of the metrics that have one.
    never : for each metric that may be infinite, what that means, such as ``never settled``.
    """
    groups: dict[str, list[list[object]]] = {}
    for line in lines:
        title = ", ".join(filter(None, (with_unit(line.metric, units or {}), line.place)))
        groups.setdefault(title, []).append(_cells(line, (never or {}).get(line.metric, NEVER)))
    return Table(COLUMNS, groups=groups)


def legend(
    lines: Sequence[ComparisonLine],
    test: Test = "auto",
    paired: str = "the baseline on the same seed",
    how: str = "",
    *,
    has_halves: bool = True,
) -> str:
    """Explanations of the table's columns, as far as they are needed.

    Parameters
    ----------
    paired : what differences are to.
    how : they are tested; by default, by the test.
    has_halves : the table has halves of intervals, as :data:`NARROW` has.
    """
    if all(line.own.is_same or line.is_removed for line in lines):
        to = paired.partition(" on the same")[0].removesuffix(",")
        return f"Differences are to {to}. {SAME}: {SAME_RUNS}."
    differences = [line.difference for line in lines if line.difference and not line.is_single]
    notes = [
        "±: 95 % interval. " * has_halves + f"Differences are to {paired}:",
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
    notes += _notes_of_missing(lines)
    if UNRANKED in verdicts:
        notes.append(f"{UNRANKED}: {NO_DIRECTION}.")
    if TOO_FEW in verdicts:
        notes.append(_few([line for line in lines if line.verdict == TOO_FEW]))
    if any(line.has_significant_presence for line in lines):
        notes.append("in seeds: the share of seeds that have a value differs (McNemar's test).")
    if any(line.is_removed for line in lines):
        notes.append("removed: what the metric measures was removed.")
    return "\n".join(notes)


def _notes_of_missing(lines: Sequence[ComparisonLine]) -> Iterator[str]:
    """What is to be known of runs that are one, or have no value."""
    if any(line.own.is_same for line in lines):
        yield _of_same_runs(lines)
    if any(line.own.n < line.runs and not line.own.is_same for line in lines):
        yield SOME
    if any(line.own.never or line.own.failed for line in lines):
        yield "Infinite values (never ...) and failed runs are worse than any value."


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


def _cells(line: ComparisonLine, never: str) -> list[object]:
    own, difference = line.own, line.difference
    cells: list[object] = [line.title, seeds_of(own, line.runs)]
    cells += [mean_of(own, line.runs, never, shares=False), half_width(own), interval(own)]
    if difference is None:
        return [*cells, "", "", "", "", line.verdict]
    is_tested = line.verdict in ("yes", "no") and difference.scale == "ranks"
    word = f"{line.verdict}, ranks" if is_tested else line.verdict
    verdict = Cell(word, tone="strong") if word.startswith("yes") else word
    # That of these controllers says nothing of the methods that were compared.
    p = math.nan if difference.is_of_these else line.p_adjusted
    return [*cells, *apart(difference, line.runs), p_cell(p), verdict]
