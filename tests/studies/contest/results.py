"""What the contestants' tunings hold: winners, held-out runs, and comparisons on the same runs."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from runtime.experiments.analysis import Difference, Estimate, adjusted, difference, estimate
from tests.studies.contest.contestants import CONTESTANTS, name_of

ERROR, CHANGE, UNLEARNT, EFFORT = "error", "effort_change", "unlearnt", "effort"
COUNTS = 1e-3  # m; a difference of the mean error that counts
RIVAL = "LQR"
LEVEL = 0.05
Run = tuple[str, int]  # a condition and a seed


@dataclass(frozen=True)
class Contestant:
    """One contestant's tuning, complete. ``runs`` are the winner's held-out runs."""

    name: str
    stored: dict[str, Any]
    runs: dict[Run, dict[str, float]]

    @property
    def winner(self) -> int:
        return int(self.stored["front"][0])

    @property
    def values(self) -> dict[str, Any]:
        values: dict[str, Any] = self.stored["configurations"][self.winner]["values"]
        return values

    def line(self, metric: str) -> dict[str, Any]:
        """The winner's line of the table."""
        for line in self.stored["table"]:
            if line["metric"] == metric and line["configuration"] == self.winner:
                found: dict[str, Any] = line
                return found
        raise KeyError(metric)

    def held_out(self, metric: str, condition: str | None = None) -> Estimate:
        """A metric over the held-out runs, or over those of one condition; NaN does not count."""
        values = [run[metric] for (name, _), run in self.runs.items() if condition in (None, name)]
        return estimate([value for value in values if not math.isnan(value)])

    @property
    def lost(self) -> int:
        """Held-out runs without an error: they failed, or never followed the wall."""
        return sum(math.isnan(run[ERROR]) for run in self.runs.values())

    @cached_property
    def edges(self) -> list[str]:
        """Factors whose value is within 2 % of an end of their range."""
        found = []
        for path, written in self.stored["vary"].items():
            low, high = (float(end) for end in str(written)[4:-1].split(".."))
            share = math.log(float(self.values[path]) / low) / math.log(high / low)
            if not 0.02 <= share <= 0.98:
                found.append(path)
        return found


@dataclass(frozen=True)
class Verdict:
    """A contestant against the tuned LQR on the same held-out runs.

    ``word`` is better or worse by a significant difference of at least ``COUNTS``, equivalent if
    the difference is significantly smaller than that, else undecided.
    """

    difference: Difference
    p: float
    p_equivalent: float

    @property
    def word(self) -> str:
        if self.p_equivalent < LEVEL:
            return "equivalent"
        if self.p < LEVEL and abs(self.difference.mean) >= COUNTS:
            return "better" if self.difference.mean < 0.0 else "worse"
        return "undecided"


def read(folder: Path, limit: str) -> list[Contestant]:
    """The contestants whose tuning under that limit is complete, in the order of the list."""
    found = []
    for name in CONTESTANTS:
        own = folder / f"{limit}_{name_of(name)}"
        if not (own / "tuning.json").exists():
            continue
        stored = json.loads((own / "tuning.json").read_text(encoding="utf-8"))
        if stored["status"] == "complete" and stored["front"]:
            found.append(Contestant(name, stored, _runs(own, str(stored["front"][0]))))
    return found


def _runs(folder: Path, winner: str) -> dict[Run, dict[str, float]]:
    with (folder / "held_out.csv").open(encoding="utf-8", newline="") as lines:
        return {
            (row["condition"], int(row["seed"])): {
                key: float(row[key]) if row[key] else math.nan
                for key in (ERROR, EFFORT, CHANGE, UNLEARNT)
            }
            for row in csv.DictReader(lines)
            if row["configuration"] == winner
        }


def verdicts(found: Sequence[Contestant]) -> dict[str, Verdict]:
    """Every contestant but the tuned LQR, p values corrected over all of them."""
    rival = next(one for one in found if one.name == RIVAL)
    others = [one for one in found if one is not rival]
    apart = [_apart(one, rival) for one in others]
    p = adjusted([each.p for each in apart])
    same = adjusted([_equivalence(one, rival) for one in others])
    return {one.name: Verdict(*each) for one, *each in zip(others, apart, p, same, strict=True)}


def _pairs(one: Contestant, rival: Contestant) -> tuple[list[float | None], list[float | None]]:
    runs = sorted(rival.runs)
    mine, theirs = ([who.runs[run][ERROR] for run in runs] for who in (one, rival))
    return [_known(v) for v in mine], [_known(v) for v in theirs]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _apart(one: Contestant, rival: Contestant) -> Difference:
    return difference(*_pairs(one, rival))


def _equivalence(one: Contestant, rival: Contestant) -> float:
    """p of two one-sided t tests that the mean difference is within +-COUNTS."""
    from scipy import stats

    mine, theirs = _pairs(one, rival)
    apart = np.array(
        [a - b for a, b in zip(mine, theirs, strict=True) if a is not None and b is not None]
    )
    low = stats.ttest_1samp(apart, -COUNTS, alternative="greater").pvalue
    high = stats.ttest_1samp(apart, COUNTS, alternative="less").pvalue
    return float(max(low, high))
