"""Estimates in words, as all tables show them."""

from __future__ import annotations

import math

from runtime.experiments.analysis.statistics import Estimate, fewest
from runtime.terminal import number

SAME = "n = 1"
SAME_RUNS = "the seed changes nothing, so that all runs are one: no interval, no test"
TOO_FEW = "too few seeds"
NEVER = "never"


def too_few(needed: int | None = None) -> str:
    """That a test cannot have a significant result, with the number of seeds that it needs."""
    return f"{TOO_FEW} to test ({fewest() if needed is None else needed} needed)"


def seeds_of(found: Estimate, runs: int) -> str:
    """How many seeds an estimate is over, as ``2/3``, or that all of them are one run."""
    if found.is_same:
        return SAME
    return str(runs) if found.n == runs else f"{found.n}/{runs}"


def mean_of(found: Estimate, runs: int, never: str = NEVER, *, spread: bool = False) -> str:
    """A mean, with how many seeds it is over if not all; what an infinite value means if all are.

    Parameters
    ----------
    never : such as ``never settled``.
    spread : whether its interval follows, as ``± 0.1`` or with both ends.
    """
    if not found.n:
        share = f" ({SAME})" if found.is_same else f", 0 of {runs}"
        return never + share if found.never else "-"
    half = half_width(found) if spread else "-"
    shown = number(found.mean)
    if half != "-":
        shown += f" {half}" if half.startswith("[") else f" ± {half}"
    return shown if found.n == runs else f"{shown} ({seeds_of(found, runs)})"


def interval(found: Estimate, sign: str = "") -> str:
    """The confidence interval of an estimate for users, or a dash."""
    if math.isnan(found.low):
        return "-"
    return f"[{number(found.low, sign)}, {number(found.high, sign)}]"


def half_width(found: Estimate, sign: str = "") -> str:
    """Half of a confidence interval; both ends where its middle is not the mean."""
    half = 0.5 * (found.high - found.low)
    if math.isnan(half) or found.mean is None:
        return "-"
    if abs(0.5 * (found.low + found.high) - found.mean) > 1e-6 * half:
        return interval(found, sign)
    return f"{half:.2g}"
