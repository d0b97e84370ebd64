"""What more trials would have bought: how far each tuning was from its end."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator

import numpy as np

from tests.studies.comparison import plan, rows

LATE = 0.75  # the part of a tuning after which its progress is counted


def table(task: str, called: Callable[[str], str]) -> list[str]:
    """For each contestant that is tuned: its trials and factors, when its winner came, its gain."""
    lines = [
        "| contestant | factors | trials | per factor | winner at | gained in the last quarter |"
    ]
    lines += ["|" + "---|" * 6]
    for name in plan.read()["tasks"][task]["contestants"]:
        factors = len(plan.factors(task, name))
        found = list(_tunings(task, name))
        if not factors or not found:
            continue
        tried = [len(errors) for errors in found]
        best = [int(np.argmin(errors)) + 1 for errors in found]
        gained = [_late_gain(errors) for errors in found]
        cells = [called(name), str(factors), _span(tried), f"{np.mean(tried) / factors:.0f}"]
        cells += [f"{_span(best)}", f"{np.mean(gained):.0%}, at most {max(gained):.0%}"]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _late_gain(errors: list[float]) -> float:
    """By which share the best error fell in the last quarter of the trials."""
    before = min(errors[: max(1, round(LATE * len(errors)))])
    best = min(errors)
    return 1.0 - best / before if math.isfinite(before) else 1.0


def _tunings(task: str, contestant: str) -> Iterator[list[float]]:
    """The training error of each trial; infinite if it was stopped or above the effort."""
    limit = plan.read()["tasks"][task]["effort"]
    runs: dict[int, dict[str, list[rows.Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows.read(task):
        if row["contestant"] == contestant and row["part"] == plan.TRAINING:
            runs[int(row["tuning"])][row["values"]].append(row)
    for trials in runs.values():
        most = max(len(own) for own in trials.values())
        yield [_error(own, most, limit) for own in trials.values()]


def _error(own: list[rows.Row], most: int, limit: float) -> float:
    values = [(row["error"], row["effort"]) for row in own if row["status"] == "ok"]
    if len(values) < most or any(not error or not effort for error, effort in values):
        return math.inf
    errors, efforts = (np.array([float(x) for x in one]) for one in zip(*values, strict=True))
    return float(errors.mean()) if efforts.mean() < limit else math.inf


def _span(numbers: list[int]) -> str:
    low, high = min(numbers), max(numbers)
    return str(low) if low == high else f"{low} to {high}"
