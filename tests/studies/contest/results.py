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

from runtime.experiments.analysis import (
    Estimate,
    PairedDifference,
    benjamini_hochberg,
    difference,
    estimate,
)
from tests.studies.contest.contestants import FRONT, FRONTS, LIMITS, TASKS, name_of

ERROR, CHANGE, UNLEARNT, SATURATION = "error", "effort_change", "unlearnt", "saturation"
RIVAL = "LQR"
LEVEL = 0.05
DOUBLED = "doubled"
Run = tuple[str, int]  # a condition and a seed


@dataclass(frozen=True)
class Contestant:
    """A winner of one contestant's tuning, which is complete, and its held-out runs."""

    name: str
    stored: dict[str, Any]
    winner: int
    runs: dict[Run, dict[str, float]]

    @property
    def values(self) -> dict[str, Any]:
        values: dict[str, Any] = self.stored["configurations"][self.winner]["values"]
        return values

    def line(self, metric: str, configuration: int | None = None) -> dict[str, Any]:
        """The winner's line of the table, or that of another configuration; 0 is the graph's."""
        wanted = self.winner if configuration is None else configuration
        for line in self.stored["table"]:
            if line["metric"] == metric and line["configuration"] == wanted:
                found: dict[str, Any] = line
                return found
        raise KeyError(metric)

    def held_out(self, metric: str, condition: str | None = None) -> Estimate:
        """A metric over the held-out conditions, or over the seeds of one; NaN does not count.

        The runs of a condition resemble each other, so that its mean counts as one value.
        """
        runs = {run: values[metric] for run, values in self.runs.items()}
        if condition is None:
            return estimate(list(by_condition(runs).values()))
        known = [value for run, value in runs.items() if run[0] == condition]
        return estimate([value for value in known if not math.isnan(value)])

    def worst(self, metric: str) -> float:
        """The largest mean over the seeds of a condition."""
        runs = {run: values[metric] for run, values in self.runs.items()}
        return max(by_condition(runs).values())

    def against(self, other: Contestant) -> dict[str, float]:
        """By how much the error (m) is larger than another's, on the same runs, by condition."""
        return by_condition(
            {run: own[ERROR] - other.runs[run][ERROR] for run, own in self.runs.items()}
        )

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

    ``word`` is better or worse by a significant difference of at least ``counts`` (m), equivalent
    if the difference is significantly smaller than that, else undecided; also if a doubled budget
    changes it.
    """

    counts: float
    difference: PairedDifference
    p: float
    p_equivalent: float
    survives: bool = True

    @property
    def word(self) -> str:
        if not self.survives:
            return "undecided"
        if self.p_equivalent < LEVEL:
            return "equivalent"
        if self.p < LEVEL and abs(self.difference.mean) >= self.counts:
            return "better" if self.difference.mean < 0.0 else "worse"
        return "undecided"


@dataclass(frozen=True)
class Infeasible:
    """A contestant for which no setting within the limit of effort was found.

    ``error`` (m) and ``effort`` (rad/s) are those of the setting with the smallest effort, in
    training.
    """

    name: str
    trials: int
    error: float
    effort: float


class Contest:
    """All that a folder holds.

    ``limits`` are the contestants under each limit at the budget of all, if there are two or more,
    ``doubled`` those at twice that budget, ``infeasible`` those without a winner, and ``fronts``
    the winners by contestant.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        found = {limit: _winners(folder, limit) for limit in LIMITS}
        self.limits = {limit: who if len(who) > 1 else [] for limit, who in found.items()}
        self.doubled = {limit: _winners(folder / DOUBLED, limit) for limit in LIMITS}
        self.infeasible = {limit: _infeasible(folder, limit) for limit in LIMITS}
        self.fronts = {name: _read(folder, FRONT, name) for name in FRONTS}


def _stored(folder: Path, limit: str, name: str) -> dict[str, Any] | None:
    """A tuning, if it is complete."""
    path = folder / f"{limit}_{name_of(name)}" / "tuning.json"
    if not path.exists():
        return None
    stored: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return stored if stored["status"] == "complete" else None


def _read(folder: Path, limit: str, name: str) -> list[Contestant]:
    """The winners of a tuning, the one with the smallest error first."""
    stored = _stored(folder, limit, name)
    if stored is None:
        return []
    own = folder / f"{limit}_{name_of(name)}"
    found = [
        Contestant(name, stored, number, _runs(own, str(number))) for number in stored["front"]
    ]
    return [one for one in found if one.runs]


def _winners(folder: Path, limit: str) -> list[Contestant]:
    return [one for name in TASKS[limit].contestants for one in _read(folder, limit, name)]


def _infeasible(folder: Path, limit: str) -> list[Infeasible]:
    found = []
    for name in TASKS[limit].contestants:
        stored = _stored(folder, limit, name)
        if stored is None or stored["front"]:
            continue
        metrics = [
            one["metrics"] for one in stored["configurations"] if one["status"] == "complete"
        ]
        least = min(metrics, key=lambda one: float(one[CHANGE]))
        found.append(Infeasible(name, stored["trials"], least[ERROR], least[CHANGE]))
    return found


def _runs(folder: Path, winner: str) -> dict[Run, dict[str, float]]:
    with (folder / "held_out.csv").open(encoding="utf-8", newline="") as lines:
        return {
            (row["condition"], int(row["seed"])): {
                key: float(row[key]) if row.get(key) else math.nan
                for key in (ERROR, CHANGE, UNLEARNT, SATURATION)
            }
            for row in csv.DictReader(lines)
            if row["configuration"] == winner
        }


def rival_of(found: Sequence[Contestant]) -> Contestant | None:
    """The tuned LQR among some contestants."""
    return next((one for one in found if one.name == RIVAL), None)


def verdicts(found: Sequence[Contestant], rival: Contestant, counts: float) -> dict[str, Verdict]:
    """Every contestant but the tuned LQR, p values corrected over all of them."""
    others = [one for one in found if one.name != RIVAL]
    apart = [_apart(one, rival) for one in others]
    p = benjamini_hochberg([each.p for each in apart])
    same = benjamini_hochberg([_equivalence(one, rival, counts) for one in others])
    return {
        one.name: Verdict(counts, *each) for one, *each in zip(others, apart, p, same, strict=True)
    }


def by_condition(runs: dict[Run, float]) -> dict[str, float]:
    """The mean over the seeds of each condition, of the runs that have a value."""
    found: dict[str, list[float]] = {}
    for (condition, _), value in runs.items():
        if not math.isnan(value):
            found.setdefault(condition, []).append(value)
    return {condition: float(np.mean(values)) for condition, values in found.items()}


def _apart(one: Contestant, rival: Contestant) -> PairedDifference:
    apart = list(one.against(rival).values())
    return difference(apart, [0.0] * len(apart), "t")


def _equivalence(one: Contestant, rival: Contestant, counts: float) -> float:
    """p of two one-sided t tests that the mean difference is within +-``counts``."""
    from scipy import stats

    apart = np.array(list(one.against(rival).values()))
    low = stats.ttest_1samp(apart, -counts, alternative="greater").pvalue
    high = stats.ttest_1samp(apart, counts, alternative="less").pvalue
    return float(max(low, high))
