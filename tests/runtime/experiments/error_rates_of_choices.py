"""Simulated contests, tunings, sweeps, margins and fits: more rows of error_rates.py.

In: draws in which nothing differs, or by as much as is said. Out: lines of Markdown::

    equal contestants are called different, 10 conditions of 2 seeds:  0 %, 3.5 %, 4.1 %
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy import stats
from scipy.signal import lfilter

from blocks.core import FloatArray
from runtime.experiments.analysis.crossed import Contestant, crossed_difference
from runtime.experiments.analysis.estimates import (
    LEVEL,
)
from runtime.experiments.analysis.statistics import (
    difference,
    estimate,
)
from runtime.fitting.noise import noise_of, variances

TUNINGS = (1, 3, 5)
SETS = ((10, 2), (10, 5), (1, 20))  # conditions and seeds
MARGINS = (6, 10, 20, 40)
# Standard deviations of ln(error) over tunings, and of a contestant's own conditions and runs.
OF_TUNINGS, OF_CONDITIONS, OF_RUNS = 0.3, 0.2, 0.2
APART = 0.7


def _contestants(
    rng: np.random.Generator, shape: tuple[int, int, int], apart: float, fails: float, dead: float
) -> tuple[Contestant, Contestant]:
    """Lognormal errors; the second is larger by ``apart``; runs, and whole tunings, fail."""
    tunings, conditions, seeds = shape
    place = rng.normal(0.0, 0.5, (1, conditions, 1)) + rng.normal(0.0, 0.1, (1, 1, seeds))
    found = []
    for shift in (0.0, apart):
        own = rng.normal(0.0, OF_CONDITIONS * (conditions > 1), (1, conditions, 1))
        logs = place + own + rng.normal(0.0, OF_TUNINGS, (tunings, 1, 1)) + shift
        values = np.exp(logs + rng.normal(0.0, OF_RUNS, shape))
        is_bad = (rng.random(shape) < fails) | (rng.random((tunings, 1, 1)) < dead)
        found.append(Contestant(np.where(is_bad, math.inf, values), True))
    return found[0], found[1]


def contests(
    shape: tuple[int, int, int],
    draws: int,
    apart: float = 0.0,
    fails: float = 0.0,
    dead: float = 0.0,
) -> tuple[float, float, float]:
    """How often methods are called different, also by conditions alone; and coverage."""
    rng = np.random.default_rng([7, *shape])
    called = alone = covered = 0
    for _ in range(draws):
        a, b = _contestants(rng, shape, apart, fails, dead)
        found = crossed_difference(a, b, is_skewed=True)
        called += not found.is_of_these and found.p < LEVEL
        covered += found.low <= math.expm1(-apart) <= found.high
        if shape[1] > 1 and not fails and not dead:
            means = (np.log(one.values).mean(axis=(0, 2)) for one in (a, b))
            alone += difference(*(mean.tolist() for mean in means), "t").p < LEVEL
    return called / draws, alone / draws, covered / draws


def lucky(draws: int, trials: int, seeds: int) -> tuple[float, float, float]:
    """Of equal configurations, the best in training beside the graph's own values.

    How often its held-out mean is smaller, and how often it is called better; how often the
    interval over its training runs covers its true mean.
    """
    rng = np.random.default_rng([8, trials, seeds])
    smaller = better = covered = 0
    for _ in range(draws):
        training = rng.normal(0.0, 1.0, (trials, seeds))
        best = estimate(training[training.mean(axis=1).argmin()].tolist())
        own, winner = rng.normal(0.0, 1.0, (2, 20))
        found = difference(winner.tolist(), own.tolist())
        smaller += found.mean < 0.0
        better += found.mean < 0.0 and found.p < LEVEL
        covered += best.low <= 0.0 <= best.high
    return smaller / draws, better / draws, covered / draws


def shares(n: int, draws: int) -> tuple[float, float, float]:
    """Lognormal values whose ratio is the margin of 10 %, and equal ones.

    How often the first count as larger, as negligible, and the second as negligible.
    """
    rng = np.random.default_rng([9, n])
    larger = negligible = equal = 0
    for _ in range(draws):
        base = np.exp(rng.normal(0.0, 1.2, n))
        own = base * np.exp(rng.normal(0.0, 0.1, n))
        found = difference((1.1 * own).tolist(), base.tolist(), is_skewed=True, margin="10%")
        larger += found.p < LEVEL and found.pairs >= found.needed
        negligible += found.is_negligible
        same = difference(own.tolist(), base.tolist(), is_skewed=True, margin="10%")
        equal += same.is_negligible
    return larger / draws, negligible / draws, equal / draws


# Values, standard deviation and correlation of the noise of each signal.
FITS: dict[str, tuple[tuple[int, float, float], ...]] = {
    "one signal, white noise": ((50, 1.0, 0.0),),
    "two signals, noise of 1 and 10": ((50, 1.0, 0.0), (50, 10.0, 0.0)),
    "100 values of noise 0.1, and 30 of 3": ((100, 0.1, 0.0), (30, 3.0, 0.0)),
    "one signal, r = 0.8": ((100, 1.0, 0.8),),
    "two signals, r = 0.8 and white noise of 5": ((200, 1.0, 0.8), (100, 5.0, 0.0)),
}


def fits(signals: tuple[tuple[int, float, float], ...], draws: int) -> tuple[float, float]:
    """How often intervals of two numbers cover, and did with one variance for all signals."""
    rng = np.random.default_rng([10, len(signals)])
    ends = np.cumsum([n for n, _, _ in signals])[:-1]
    slopes = [
        np.column_stack([np.ones(n), (1.0 - 0.5 * (k > 0)) * np.linspace(0.0, 1.0, n)])
        for k, (n, _, _) in enumerate(signals)
    ]
    inverse = np.linalg.pinv(np.vstack(slopes))
    inner = np.linalg.inv(np.vstack(slopes).T @ np.vstack(slopes)).diagonal()
    covered = pooled = 0.0
    for _ in range(draws):
        noise = np.concatenate([_noise(rng, *each) for each in signals])
        wrong = inverse @ noise
        left = noise - np.vstack(slopes) @ wrong
        parts = np.split(left, ends)
        found, free = variances(
            [noise_of(*each) for each in zip(parts, slopes, strict=True)],
            np.split(inverse.T, ends),
        )
        covered += np.mean(np.abs(wrong) <= stats.t.ppf(0.975, free) * np.sqrt(found))
        count = len(noise) - 2
        half = stats.t.ppf(0.975, count) * np.sqrt(left @ left / count * inner)
        pooled += np.mean(np.abs(wrong) <= half)
    return covered / draws, pooled / draws


def _noise(rng: np.random.Generator, n: int, deviation: float, r: float) -> FloatArray:
    fresh = rng.normal(0.0, deviation, n) * np.where(np.arange(n), math.sqrt(1.0 - r * r), 1.0)
    found: FloatArray = lfilter([1.0], [1.0, -r], fresh)
    return found


def tables(draws: int) -> Iterator[str]:
    """The tables of contests, tunings and sweeps, margins and fits."""
    yield f"| contests [%] | held out | {TUNINGS[0]} tuning of each | 3 of each | 5 of each |"
    yield "|---|---|" + "---|" * len(TUNINGS)
    for conditions, seeds in SETS:
        place = f"conditions: {conditions}, seeds: {seeds}"
        found = [contests((t, conditions, seeds), draws) for t in TUNINGS]
        yield _row("equal: called different", place, (one[0] for one in found))
        if conditions > 1:
            yield _row("equal: different by conditions alone", place, (one[1] for one in found))
        covering = (one[2] if t > 1 else math.nan for one, t in zip(found, TUNINGS, strict=True))
        yield _row("equal: the interval covers", place, covering)
    place = "conditions: 10, seeds: 2"
    cases = {"": {}, ", each run fails with 3 %": {"fails": 0.03}}
    cases[", each tuning fails with 10 %"] = {"dead": 0.1}
    for name, more in cases.items():
        if name:
            found = [contests((t, 10, 2), draws, **more) for t in TUNINGS]
            yield _row(f"equal{name}: called different", place, (one[0] for one in found))
        found = [contests((t, 10, 2), draws, APART, **more) for t in TUNINGS]
        yield _row(f"half the error{name}: found", place, (one[0] for one in found))
    yield ""
    yield "| the best of equal configurations [%] | tuned on | of 5 | of 20 | of 100 |"
    yield "|---|---|---|---|---|"
    found = [lucky(draws, trials, 5) for trials in (5, 20, 100)]
    yield _row("tune: smaller on 20 held-out seeds", "5 seeds", (one[0] for one in found))
    yield _row("tune: called better", "5 seeds", (one[1] for one in found))
    yield _row("sweep: its own interval covers (not printed)", "5 seeds", (x[2] for x in found))
    yield ""
    sizes = " | ".join(f"n = {n}" for n in MARGINS)
    yield f"| skewed values, a margin of 10 % [%] | test | {sizes} |"
    yield "|---|---|" + "---|" * len(MARGINS)
    found = [shares(n, draws) for n in MARGINS]
    for i, name in enumerate(("10 % more: larger", "10 % more: negligible", "equal: negligible")):
        yield _row(name, "log ranks", (one[i] for one in found))
    yield ""
    yield "| intervals of fitted numbers that cover [%] | noise | as printed | pooled |"
    yield "|---|---|---|---|"
    for name, signals in FITS.items():
        yield _row("a fit", name, fits(signals, draws))


def _row(name: str, second: str, shares_: Iterator[float] | tuple[float, ...]) -> str:
    cells = " | ".join("–" if math.isnan(x) else f"{100.0 * x:.1f}" for x in shares_)
    return f"| {name} | {second} | {cells} |"
