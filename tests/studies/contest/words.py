"""How the page of the contest writes numbers and tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from runtime.experiments.analysis import Estimate

MM = 1e3


def mm(value: float, sign: str = "") -> str:
    """A length in mm."""
    return "-" if math.isnan(value) else f"{MM * value:{sign}.1f}"


def interval(found: Estimate, sign: str = "") -> str:
    """A mean in mm with the ends of its interval, where there is one: identical runs have none."""
    if math.isnan(found.low):
        return mm(found.mean, sign)
    return f"{mm(found.mean, sign)} [{mm(found.low, sign)}, {mm(found.high, sign)}]"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence: a, b and c."""
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last
