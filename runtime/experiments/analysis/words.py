"""Estimates in words, as all tables show them.

In: an :class:`Estimate`. Out: a cell::

    Estimate(n=3, mean=0.21, low=0.18, high=0.24)     ->  "0.21 ± 0.03"
    Estimate(n=0, never=3), never="never settled"     ->  "never settled, 0 of 3"
"""

from __future__ import annotations

import math

from runtime.experiments.analysis.estimates import (
    LEVEL,
    Estimate,
    PairedDifference,
)
from runtime.experiments.analysis.ranks import fewest
from runtime.tables import NO_VALUE, Cell, interval_cell, number_cell
from runtime.terminal import number

SAME = "n = 1"
SAME_RUNS = "the seed changes nothing, so that all runs are one: no interval, no test"
SAME_BESIDE = "the seed changes nothing, so that all runs are one, and their mean has no interval"
TOO_FEW = "too few pairs"
NEVER = "never"
FAILED = "failed"
EQUAL = "equal"
NEGLIGIBLE = "negligible"
THESE = "these controllers"
UNRANKED = "failures not ranked"
NO_DIRECTION = (
    "runs failed, and the metric has no direction in which that is worse\n"
    "(no minimize or maximize, below or above): neither side is better"
)


def too_few(needed: int | None = None) -> str:
    """That a test cannot have a significant result, with the number of seeds that it needs."""
    return f"{TOO_FEW} to test ({fewest(LEVEL) if needed is None else needed} needed)"


def chosen_among(count: int) -> str:
    """What the best of several configurations is not: an estimate of what it is worth.

    The 95 % interval of the best of 2 to 100 that are equal covers their mean in 88 to 45 %.
    """
    return f"chosen among {count} by these runs, which flatter it: run it again on other seeds"


def seeds_of(estimate: Estimate, runs: int) -> str:
    """How many seeds an estimate is over, as ``2/3``, or that all of them are one run."""
    if estimate.is_same:
        return SAME
    return str(runs) if estimate.n == runs else f"{estimate.n}/{runs}"


def each_mean(count: int, unit: str) -> str:
    """What an observation is the mean over, such as ``, its mean over 4 settings``."""
    return f", its mean over {count} {unit}s" if count > 1 else ""


def lost(never: int, failed: int, words: str = NEVER) -> str:
    """What became of runs without a finite value: they failed, or what they never did.

    Parameters
    ----------
    never, failed : how many of each.
    words : what it means that a value is infinite, such as ``never settled``.
    """
    return " or ".join([FAILED] * bool(failed) + [words] * bool(never))


def mean_of(
    estimate: Estimate, runs: int, never: str = NEVER, *, spread: bool = False, shares: bool = True
) -> Cell:
    """A mean, with how many seeds it is over if not all; what an infinite value means if all are.

    Parameters
    ----------
    never : such as ``never settled``.
    spread : whether its interval follows, as ``± 0.1`` or with both ends.
    shares : False in a table that has the number of seeds in a column of its own.
    """
    if not estimate.n:
        word = lost(estimate.never, estimate.failed, never)
        share = f" ({SAME})" if estimate.is_same else f", 0 of {runs}"
        return Cell(word + share * shares, tone="bad") if word else Cell(NO_VALUE)
    shown, half = number(estimate.mean), half_width(estimate) if spread else NO_VALUE
    if half != NO_VALUE:
        shown += f" {half}" if half.startswith("[") else f" ± {half}"
    note = "" if estimate.n == runs or not shares else seeds_of(estimate, runs)
    return Cell(shown, estimate.mean, note)


def interval(estimate: Estimate, sign: str = "") -> Cell:
    """The confidence interval of an estimate, or a dash."""
    return interval_cell(estimate.low, estimate.high, sign)


def half_width(estimate: Estimate, sign: str = "") -> str:
    """Half of a confidence interval; both ends where its middle is not the mean."""
    half = 0.5 * (estimate.high - estimate.low)
    if math.isnan(half) or estimate.mean is None:
        return NO_VALUE
    if math.isinf(half) or abs(0.5 * (estimate.low + estimate.high) - estimate.mean) > 1e-6 * half:
        return interval(estimate, sign).text
    return f"{half:.2g}"


def apart(difference: PairedDifference, runs: int = 0) -> tuple[Cell, str, Cell]:
    """A difference, half of its interval and its ends; of a ratio all in percent.

    Parameters
    ----------
    runs : the difference is over fewer, which follows it; 0 for any number.
    """
    if not math.isfinite(difference.mean):
        return Cell(NO_VALUE), NO_VALUE, Cell(NO_VALUE)
    is_partial = 0 < difference.of < runs and not difference.is_same
    note = f"{difference.of}/{runs}" if is_partial else ""
    if not difference.is_ratio:
        middle = number_cell(difference.mean, "+", note=note)
        return middle, half_width(difference, "+"), interval(difference, "+")
    values = [100.0 * each for each in (difference.mean, difference.low, difference.high)]
    shown, low, high = (f"{each:+.3g} %" for each in values)
    ends = Cell(f"[{low}, {high}]".replace(" %,", ","), values[1:])
    ends = Cell(NO_VALUE) if math.isnan(difference.low) else ends
    return Cell(shown, values[0], note), ends.text, ends


def p_cell(p: float) -> Cell:
    """A p value in two digits; a bound for a very small one."""
    if math.isnan(p):
        return Cell(NO_VALUE)
    return Cell("< 0.0001" if p < 1e-4 else f"{p:.2g}", p)
