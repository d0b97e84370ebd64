"""How often each printed test errs, and how often each printed interval covers, by simulation.

In: the functions that every table uses, and draws in which nothing differs. Out: the tables of
docs/experiments.md, which ``python -m tests.runtime.experiments.error_rates`` writes::

    normal, n = 10:  4.9 % "yes" although nothing differs; 95.2 % of the intervals cover 0
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from blocks.core import FloatArray
from runtime.experiments.analysis.estimates import (
    LEVEL,
)
from runtime.experiments.analysis.statistics import (
    Test,
    difference,
    estimate,
    mcnemar_test,
)
from tests.runtime.experiments import error_rates_of_choices

DOCS = Path(__file__).parents[3] / "docs" / "experiments.md"
BEGIN, END = "<!-- error rates, generated -->", "<!-- end -->"
DRAWS = 1000
SEEDS = (3, 5, 6, 10, 20)
Draw = Callable[[np.random.Generator, int], tuple[FloatArray, FloatArray]]


def _failing(values: FloatArray, rng: np.random.Generator, share: float) -> FloatArray:
    return np.where(rng.random(values.shape) < share, math.inf, values)


def _normal(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    common = rng.normal(10.0, 1.0, n)
    return common + rng.normal(0.0, 1.0, n), common + rng.normal(0.0, 1.0, n)


def _skewed(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    common = rng.normal(0.0, 0.5, n)
    return np.exp(common + rng.normal(0.0, 1.0, n)), np.exp(common + rng.normal(0.0, 1.0, n))


def _beside_one(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    return np.exp(rng.normal(0.0, 1.0, n)), np.ones(n)


def _crashing(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    own, base = _normal(rng, n)
    return _failing(own, rng, 0.2), _failing(base, rng, 0.2)


def _counts(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    return rng.poisson(2.0, n).astype(float), rng.poisson(2.0, n).astype(float)


# Both sides have the same distribution, or the same median where one is a single run.
NOTHING_DIFFERS: dict[str, Draw] = {
    "normal": _normal,
    "skewed (lognormal)": _skewed,
    "skewed, beside one run that is always the same": _beside_one,
    "counts with ties": _counts,
    "normal, each run fails with 20 %": _crashing,
}


def rates(draw: Draw, n: int, test: Test, is_skewed: bool | None = None) -> tuple[float, float]:
    """The share of significant results, and that of the intervals that cover no difference."""
    rng = np.random.default_rng(n)
    significant, covering, intervals = 0, 0, 0
    for _ in range(DRAWS):
        own, base = draw(rng, n)
        apart = difference(own.tolist(), base.tolist(), test, is_skewed=is_skewed)
        significant += apart.p < LEVEL and apart.pairs >= apart.needed
        if not math.isnan(apart.low) and apart.pairs >= apart.needed:
            intervals += 1
            covering += apart.low <= 0.0 <= apart.high
    return significant / DRAWS, covering / intervals if intervals else math.nan


def hard_seeds(n: int) -> tuple[float, float]:
    """A variant lowers the error by 0.3 and fails with the hardest 30 % of the seeds.

    Returns how often it is an improving 'yes' if only the other seeds count, and as it is now.
    """
    rng = np.random.default_rng(n)
    before, now = 0, 0
    for _ in range(DRAWS):
        base = np.sort(rng.normal(2.0, 0.5, n))
        own = base - 0.3 + rng.normal(0.0, 0.1, n)
        kept = n - math.ceil(0.3 * n)
        own[kept:] = math.inf
        rest = difference(own[:kept].tolist(), base[:kept].tolist(), "t")
        before += rest.p < LEVEL and rest.mean < 0.0
        whole = difference(own.tolist(), base.tolist())
        now += whole.p < LEVEL and whole.mean < 0.0
    return before / DRAWS, now / DRAWS


def conditions(count: int) -> tuple[float, float]:
    """Held-out conditions of 5 seeds in which nothing differs on average: pooled, and as units."""
    rng = np.random.default_rng(count)
    pooled, units = 0, 0
    for _ in range(DRAWS):
        apart = rng.normal(0.0, 1.0, (count, 1)) + rng.normal(0.0, 1.0, (count, 5))
        zeros = np.zeros(apart.size).tolist()
        pooled += difference(apart.ravel().tolist(), zeros, "t").p < LEVEL
        units += difference(apart.mean(axis=1).tolist(), zeros[:count], "t").p < LEVEL
    return pooled / DRAWS, units / DRAWS


def margins(n: int) -> tuple[float, float]:
    """The true difference is the margin: how often it counts as larger, and as negligible."""
    rng = np.random.default_rng(n)
    larger, negligible = 0, 0
    for _ in range(DRAWS):
        own, base = _normal(rng, n)
        apart = difference((own + 1.0).tolist(), base.tolist(), "t", margin=1.0)
        larger += apart.p < LEVEL
        negligible += apart.is_negligible
    return larger / DRAWS, negligible / DRAWS


def presence(n: int) -> float:
    """McNemar's test where each side has a value with 60 %."""
    rng = np.random.default_rng(n)
    has = rng.random((DRAWS, 2, n)) < 0.6
    return float(
        np.mean(
            [
                mcnemar_test(*([1.0 if x else None for x in side] for side in pair)) < LEVEL
                for pair in has
            ]
        )
    )


def mean_coverage(n: int, is_skewed: bool) -> float:
    """How often the interval of a mean covers it, of normal or of lognormal values."""
    rng = np.random.default_rng(n)
    values = rng.normal(0.0, 1.0, (DRAWS, n))
    truth = math.exp(0.5) if is_skewed else 0.0
    found = (estimate((np.exp(row) if is_skewed else row).tolist()) for row in values)
    return sum(each.low <= truth <= each.high for each in found) / DRAWS


def tables() -> Iterator[str]:
    """The generated part of docs/experiments.md."""
    yield f"Of {DRAWS:,} simulated tables each (a standard error of 0.7 % at 5 %):"
    yield ""
    sizes = " | ".join(f"n = {n}" for n in SEEDS)
    yield f"| nothing differs, yet significant [%] | test | {sizes} |"
    yield "|---|---|" + "---|" * len(SEEDS)
    covered = []
    for name, draw in NOTHING_DIFFERS.items():
        tests: tuple[Test, ...] = ("auto", "t")
        for test in tests if draw not in (_crashing,) else tests[:1]:
            cells = [rates(draw, n, test) for n in SEEDS]
            yield f"| {name} | `{test}` | {_cells(share for share, _ in cells)} |"
            covered.append(f"| {name} | `{test}` | {_cells(share for _, share in cells)} |")
    waiting = [rates(_skewed, n, "auto", True) for n in SEEDS]
    yield f"| skewed, a waiting time | `auto` | {_cells(share for share, _ in waiting)} |"
    covered.append(f"| skewed, a waiting time | `auto` | {_cells(share for _, share in waiting)} |")
    yield f"| whether there is a value (60 %) | McNemar | {_cells(map(presence, SEEDS))} |"
    larger = [margins(n) for n in SEEDS]
    yield f"| as large as the margin: larger | `t` | {_cells(share for share, _ in larger)} |"
    yield f"| as large as the margin: negligible | `t` | {_cells(share for _, share in larger)} |"
    pooled = [conditions(n) for n in SEEDS]
    yield f"| n conditions of 5 seeds, all runs pooled | `t` | {_cells(a for a, _ in pooled)} |"
    yield f"| n conditions of 5 seeds, as `tune` does | `t` | {_cells(b for _, b in pooled)} |"
    hard = [hard_seeds(n) for n in SEEDS]
    yield f"| fails with hard seeds: better by the others | `t` | {_cells(a for a, _ in hard)} |"
    yield f"| fails with hard seeds: better as tested | `auto` | {_cells(b for _, b in hard)} |"
    yield ""
    yield f"| intervals that cover [%] | test | {sizes} |"
    yield "|---|---|" + "---|" * len(SEEDS)
    yield from covered
    for title, is_skewed in (("mean, normal", False), ("mean, lognormal", True)):
        yield f"| {title} | `t` | {_cells(mean_coverage(n, is_skewed) for n in SEEDS)} |"
    yield ""
    yield from error_rates_of_choices.tables(DRAWS)


def _cells(shares: Iterator[float] | map[float]) -> str:
    return " | ".join("–" if math.isnan(share) else f"{100.0 * share:.1f}" for share in shares)


def written(text: str) -> str:
    """The document with its generated part replaced."""
    part = "\n".join([BEGIN, *tables(), END])
    return re.sub(re.escape(BEGIN) + ".*?" + re.escape(END), lambda _: part, text, flags=re.S)


if __name__ == "__main__":
    DOCS.write_text(written(DOCS.read_text(encoding="utf-8")), encoding="utf-8")
