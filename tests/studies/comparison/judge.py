"""Ratios of errors with intervals that contain tunings, conditions and seeds.

In: ln(error) of each tuning under each condition with each seed, for two contestants. Out: a
:class:`Contrast`, the ratio of their typical errors::

    0.030, 0.034, ... against 0.040, 0.041, ...  ->  0.76 [0.68, 0.85], better

The three are crossed: every tuning meets every condition with every seed. The variance of the mean
is the sum of that of the mean over tunings (of either contestant, which are not paired), over
conditions and over seeds (of the paired difference). Each of these means holds a share of the rest
as well, so that the sum is a little too large rather than too small. Student's t with
Satterthwaite's degrees of freedom (1946) gives the interval. A plain bootstrap of five tunings
and two seeds covers too seldom (tests/studies/test_comparison.py): n values that are drawn again
from themselves vary by (n - 1) / n of the variance that they come from. Errors of failed runs and
of single bad conditions are far from normal, though. So the interval of a verdict reaches as far
as that of Student's t and that of a studentized bootstrap (Efron, 1981) do, which follows the skew,
and p is the larger of the two.

p values are corrected by Benjamini and Hochberg over the places where a question compares the same
two controllers, alike for differences and for equivalence.

A run that failed, or whose error is above the plan's limit, has this limit as its error: no value
that counts is worse. Who fails more than the other is neither better than it nor equivalent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy import special

from blocks.core import FloatArray
from runtime.experiments.analysis import benjamini_hochberg
from tests.studies.comparison import plan, rows

LEVEL = 0.05
COVERAGE = rows.ROWS / "coverage.csv"
SEEDS = 2
PLACES = 3  # where the same two are compared, in the simulations of power


@dataclass(frozen=True)
class Contrast:
    """ln of a ratio of errors with its interval; p of a difference, and of equivalence."""

    mean: float
    low: float
    high: float
    p: float
    p_equivalent: float
    failed: tuple[int, int] = (0, 0)
    runs: tuple[int, int] = (1, 1)

    @property
    def word(self) -> str:
        """The verdict, from p values that are corrected."""
        # As shares: one of 32 runs is more than one of 512.
        more = self.failed[0] * self.runs[1] - self.failed[1] * self.runs[0]
        if self.p_equivalent < LEVEL and more == 0:
            return "equivalent"
        if self.p < LEVEL and self.mean < 0.0 and more <= 0:
            return "better"
        if self.p < LEVEL and self.mean > 0.0 and more >= 0:
            return "worse"
        return "undecided"


@dataclass(frozen=True)
class Cells:
    """ln(error) by tuning, condition and seed, and how many runs failed."""

    values: FloatArray
    failed: int = 0


def contrast(
    a: FloatArray, b: FloatArray, margin: float, confidence: float = 0.95, of_these: bool = False
) -> Contrast:
    """The mean of a - b, both of tunings x conditions x seeds, in logarithms.

    With ``of_these`` the tunings are not a sample: the interval is about these controllers.
    """
    mean = float(a.mean() - b.mean())
    by_place = a.mean(axis=0) - b.mean(axis=0)  # conditions x seeds, paired
    parts = [(_spread(one.mean(axis=(1, 2))), len(one) - 1) for one in (a, b) if not of_these]
    parts += [(_spread(by_place.mean(axis=1)), len(by_place) - 1)]
    parts += [(_spread(by_place.mean(axis=0)), by_place.shape[1] - 1)]
    variance = sum(v for v, _ in parts)
    if variance == 0.0:
        return Contrast(mean, mean, mean, float(mean == 0.0), float(abs(mean) >= margin))
    freedom = variance**2 / sum(v**2 / n for v, n in parts if n > 0 and v > 0.0)
    error = math.sqrt(variance)
    half = float(special.stdtrit(freedom, 0.5 + 0.5 * confidence)) * error
    p = 2.0 * float(special.stdtr(freedom, -abs(mean) / error))
    beyond = float(special.stdtr(freedom, (abs(mean) - margin) / error))
    return Contrast(mean, mean - half, mean + half, p, beyond)


def judged(
    a: FloatArray, b: FloatArray, margin: float, of_these: bool = False, times: int = 2000
) -> Contrast:
    """As :func:`contrast`, widened to what a studentized bootstrap allows.

    The bootstrap draws tunings, conditions and seeds again, ``times`` times, always the same ones.
    """
    found = contrast(a, b, margin, of_these=of_these)
    mean, error = (float(x) for x in _mean_and_error(a, b, of_these))
    if error == 0.0:
        return found
    rng = np.random.default_rng([7, *a.shape, len(b)])
    means, errors = _drawn_again(a, b, of_these, times, rng)
    # Draws without any scatter have no t; each stands for less than one of the times.
    t = (means - mean)[errors > 0.0] / errors[errors > 0.0]
    low, high = (float(x) for x in np.quantile(t, [0.5 * LEVEL, 1.0 - 0.5 * LEVEL]))
    at = mean / error

    def beyond(value: float) -> float:
        return float((1 + np.count_nonzero(t >= value)) / (1 + len(t)))

    def below(value: float) -> float:
        return float((1 + np.count_nonzero(t <= value)) / (1 + len(t)))

    p = min(1.0, 2.0 * min(beyond(at), below(at)))
    # Not equivalent: the truth is at the margin, on the one or on the other side.
    p_equivalent = max(below((mean - margin) / error), beyond((mean + margin) / error))
    return Contrast(
        mean,
        min(found.low, mean - high * error),
        max(found.high, mean - low * error),
        max(found.p, p),
        max(found.p_equivalent, p_equivalent),
    )


def _drawn_again(
    a: FloatArray, b: FloatArray, of_these: bool, times: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """The means of a - b and their standard errors, of draws of tunings, conditions and seeds."""
    conditions, seeds = (rng.integers(0, n, (times, n)) for n in a.shape[1:])

    def drawn(x: FloatArray) -> FloatArray:
        n = len(x)
        tunings = np.tile(np.arange(n), (times, 1)) if of_these else rng.integers(0, n, (times, n))
        found: FloatArray = x[
            tunings[:, :, None, None], conditions[:, None, :, None], seeds[:, None, None, :]
        ]
        return found

    return _mean_and_error(drawn(a), drawn(b), of_these)


def _mean_and_error(a: FloatArray, b: FloatArray, of_these: bool) -> tuple[FloatArray, FloatArray]:
    """The mean of a - b and its standard error as in :func:`contrast`, (..., tunings, ., .)."""
    by_place = a.mean(axis=-3) - b.mean(axis=-3)
    means = [by_place.mean(axis=-1), by_place.mean(axis=-2)]
    means += [] if of_these else [x.mean(axis=(-2, -1)) for x in (a, b)]
    variance = sum(m.var(axis=-1, ddof=1) / m.shape[-1] for m in means if m.shape[-1] > 1)
    return by_place.mean(axis=(-2, -1)), np.sqrt(np.asarray(variance))


def _spread(means: FloatArray) -> float:
    """The variance of the mean of independent values; 0 of a single one."""
    return float(means.var(ddof=1)) / len(means) if len(means) > 1 else 0.0


def cells(task: str, metric: str, group: str) -> dict[str, Cells]:
    """The held-out runs of each contestant in a group."""
    limit = plan.read()["tasks"][task]["failure"]
    found = {}
    for name, runs in rows.held_out(task, metric).items():
        chosen = {place: e for place, e in runs.items() if plan.group_of(place[1]) == group}
        axes: list[list[Any]] = [sorted({place[i] for place in chosen}) for i in range(3)]
        if len(axes[0]) < plan.fewest(task, name):
            continue
        bad = [e is None or not e < limit for e in chosen.values()]
        capped = [
            math.log(limit if (e := chosen[t, k, s]) is None or not e < limit else e)
            for t in axes[0]
            for k in axes[1]
            for s in axes[2]
        ]
        found[name] = Cells(np.array(capped).reshape([len(axis) for axis in axes]), sum(bad))
    return found


def raw(task: str, metric: str, group: str) -> dict[str, float]:
    """The mean of a metric over the held-out runs of each contestant in a group that have one."""
    found = {}
    for name, runs in rows.held_out(task, metric).items():
        known = [x for at, x in runs.items() if plan.group_of(at[1]) == group and x is not None]
        found[name] = float(np.mean(known)) if known else math.nan
    return found


@dataclass(frozen=True)
class Answer:
    """A line of a question: one contestant against another."""

    task: str
    group: str
    metric: str
    one: str
    other: str
    contrast: Contrast
    effort: float  # the mean effort of the one over that of the other


def answers(question: dict[str, object]) -> list[Answer]:
    """All lines of a question; p is corrected over the lines of the same two controllers.

    Not over the question: whether two learners are equivalent does not depend on how many others,
    whose difference nobody doubts, are compared beside them.
    """
    found = list(_answers(question))
    for pair in dict.fromkeys((line.one, line.other) for line in found):
        own = [i for i, line in enumerate(found) if (line.one, line.other) == pair]
        p = benjamini_hochberg([found[i].contrast.p for i in own])
        beyond = benjamini_hochberg([found[i].contrast.p_equivalent for i in own])
        for i, one, two in zip(own, p, beyond, strict=True):
            corrected = replace(found[i].contrast, p=one, p_equivalent=two)
            found[i] = replace(found[i], contrast=corrected)
    return found


def _answers(question: dict[str, object]) -> Iterator[Answer]:
    of_these = question.get("of_these") is True
    for task, groups in _where(question).items():
        for group in groups if task in rows.tasks() else ():
            effort = raw(task, "effort", group)
            for metric in _names(question.get("measures", ["error"])):
                found = cells(task, metric, group)
                for one, other in _pairs(question):
                    if one in found and other in found:
                        a, b = found[one], found[other]
                        result = judged(a.values, b.values, plan.margin(), of_these)
                        runs = a.values.size, b.values.size
                        result = replace(result, failed=(a.failed, b.failed), runs=runs)
                        share = effort[one] / effort[other]
                        yield Answer(task, group, metric, one, other, result, share)


def _where(question: dict[str, object]) -> Mapping[str, Sequence[str]]:
    """The groups of each task that a question is about; of an attempt all of its task."""
    if "task" in question:
        task = str(question["task"])
        return {task: [*plan.read()["tasks"][task]["groups"]]}
    where = question["where"]
    return where if isinstance(where, dict) else {}


def _pairs(question: dict[str, object]) -> Sequence[tuple[str, str]]:
    """Who is compared with whom: listed as pairs, or all of some with all of others."""
    if "pairs" in question:
        return [(one, other) for one, other in map(_names, _list(question["pairs"]))]
    return list(product(_names(question["of"]), _names(question["against"])))


def _list(entry: object) -> list[object]:
    return entry if isinstance(entry, list) else []


def _names(entry: object) -> Sequence[str]:
    return [str(name) for name in entry] if isinstance(entry, list) else []


def bootstrap(
    a: FloatArray, b: FloatArray, rng: np.random.Generator, times: int = 400
) -> tuple[float, float]:
    """The percentile interval of a - b by drawing tunings, conditions and seeds again."""

    def drawn(n: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        return rng.integers(0, n, n)

    means = []
    for _ in range(times):
        k, s = drawn(a.shape[1]), drawn(a.shape[2])
        one, other = (x[drawn(len(x))][:, k][:, :, s].mean() for x in (a, b))
        means.append(one - other)
    low, high = np.quantile(means, [LEVEL / 2, 1 - LEVEL / 2])
    return float(low), float(high)


Spread = Mapping[str, float]


def simulated(
    rng: np.random.Generator, shape: tuple[int, int, int], apart: float, spread: Spread
) -> tuple[FloatArray, FloatArray]:
    """Two contestants with these standard deviations, as in the plan's ``power`` entry."""
    tunings, conditions, seeds = shape
    place = rng.normal(0, spread["conditions"], (1, conditions, 1))
    place = place + rng.normal(0, spread["seeds"], (1, 1, seeds))
    first, second = (
        rng.normal(0, spread["tunings"], (tunings, 1, 1)) + rng.normal(0, spread["rest"], shape)
        for _ in range(2)
    )
    return first + place + apart, second


def spread_of(a: FloatArray, b: FloatArray) -> dict[str, float]:
    """The standard deviations of two contestants' runs, as in the plan's ``power`` entry."""
    tunings = math.sqrt(sum(one.mean(axis=(1, 2)).var(ddof=1) for one in (a, b)) / 2)
    place = a.mean(axis=0) - b.mean(axis=0)
    rows_, columns = place.mean(axis=1), place.mean(axis=0)
    rest = place - rows_[:, None] - columns + place.mean()
    spread = {"tunings": tunings, "conditions": rows_.std(ddof=1), "seeds": columns.std(ddof=1)}
    return {key: float(sd) for key, sd in (spread | {"rest": rest.std()}).items()}


def coverage(shape: tuple[int, int, int], times: int = 1000) -> tuple[float, float]:
    """How often the interval holds the truth, and how often that of the bootstrap does."""
    rng = np.random.default_rng([5, *shape])
    within = again = 0
    for i in range(times):
        a, b = simulated(rng, shape, 0.0, plan.read()["power"])
        found = contrast(a, b, plan.margin())
        within += found.low <= 0.0 <= found.high
        if i % 4 == 0:
            low, high = bootstrap(a, b, rng)
            again += low <= 0.0 <= high
    return within / times, 4 * again / times


def write_coverage() -> None:
    """Write how often the intervals of the plan's groups hold the truth."""
    settings = plan.read()
    sizes = {
        group[plan.HELD_OUT]
        for task in settings["tasks"].values()
        for group in task["groups"].values()
    }
    lines = ["tunings,conditions,seeds,interval,bootstrap"]
    for n in sorted(sizes):
        shape = (settings["tunings"], n, SEEDS)
        lines.append(",".join(map(str, (*shape, *coverage(shape)))))
    COVERAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def power(
    shape: tuple[int, int, int],
    apart: float,
    spread: Spread,
    of_these: bool = False,
    times: int = 400,
) -> tuple[float, float]:
    """The shares of simulated studies that find a difference, and that find equivalence.

    As verdicts are reached: with the wider of the two intervals, and corrected over three places.
    """
    rng = np.random.default_rng([*shape[:2], round(1000 * apart)])
    if of_these:
        spread = {**spread, "tunings": 0.0}
    margin = plan.margin()
    found = [
        judged(*simulated(rng, shape, apart, spread), margin, of_these, times=200)
        for _ in range(times)
    ]
    shares = []
    for values in ([one.p for one in found], [one.p_equivalent for one in found]):
        places = [values[i : i + PLACES] for i in range(0, len(values) - PLACES + 1, PLACES)]
        corrected = [p for place in places for p in benjamini_hochberg(place)]
        shares.append(float(np.mean([p < LEVEL for p in corrected])))
    return shares[0], shares[1]


def power_again(task: str) -> str:
    """Power of a task whose contestants were tuned in another one, from that one's rows."""
    entry = plan.read()["tasks"][task]
    lines = ["| pair | group | tunings | conditions | seeds | of any tunings | of these tunings |"]
    lines[0] += " tunings for 80 % |"
    lines += ["|" + "---|" * 8]
    pairs = [("spikes", other) for other in entry["only"] if not other.startswith("spikes")]
    for group, about in entry["groups"].items():
        found = cells(entry["tuned"], "error", group)
        for one, other in pairs:
            if one not in found or other not in found:
                continue
            spread = spread_of(found[one].values, found[other].values)
            shape = (len(found[one].values), about[plan.HELD_OUT], SEEDS)
            shown = [f"{spread[key]:.2f}" for key in ("tunings", "conditions", "seeds")]
            shares = [power(shape, plan.margin(), spread, is_of)[0] for is_of in (False, True)]
            enough = (n for n in (5, 10, 15, 20, 30, 40) if _finds((n, *shape[1:]), spread))
            cells_ = [f"{one}, {other}", group, *shown, *(f"{100 * x:.0f} %" for x in shares)]
            lines.append(f"| {' | '.join([*cells_, str(next(enough, 'more than 40'))])} |")
    return "\n".join(lines)


def _finds(shape: tuple[int, int, int], spread: Spread) -> bool:
    return power(shape, plan.margin(), spread)[0] >= 0.8


def power_table() -> str:
    """Power by the numbers of tunings and conditions, as Markdown."""
    lines = [
        "| tunings | conditions | a ratio of the margin is found | equal ones are equivalent |"
    ]
    lines += ["|---|---|---|---|"]
    for tunings in (5, 10, 20):
        for conditions in (6, 10, 20):
            shape, spread = (tunings, conditions, SEEDS), plan.read()["power"]
            larger = power(shape, plan.margin(), spread)[0]
            equal = power(shape, 0.0, spread)[1]
            shares = f"{100 * larger:.0f} % | {100 * equal:.0f} %"
            lines.append(f"| {tunings} | {conditions} | {shares} |")
    return "\n".join(lines)
