"""Runs of the paper's cases, measured: what docs/reproduction.md and its test are made from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

import runtime
from tests.studies.following import ENGINE

FRESH = 100  # the first seed; nothing was chosen on it and those that follow


@dataclass(frozen=True)
class Runs:
    """One variant over several seeds: metrics as arrays (NaN where there is none), and signals."""

    metrics: dict[str, np.ndarray]
    signals: dict[str, list[np.ndarray]] = field(default_factory=dict)
    times: dict[str, np.ndarray] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.metrics[name]


@cache
def case(name: str, variant: str, seeds: int) -> Runs:
    """Run a shipped graph.

    Parameters
    ----------
    name : line_actuator_failure or sine_estimation_error.
    variant : adaptive (as printed), robust, forward (LQR and feedforward) or lqr (the benchmark:
        the LQR alone); after a slash a value for every weight of Q, and after another one for
        every weight of R.
    seeds : how many, from ``FRESH`` on; without noise and neurons, one run says all.
    """
    kind, *weights = variant.split("/")
    graph = runtime.load(f"{name}_robust" if kind == "robust" else name)
    for key, count, weight in zip(("q", "r"), (3, 2), weights, strict=False):
        graph = graph.set(f"blocks.lqr.{key}", [float(weight)] * count)
    if kind in ("lqr", "forward"):
        graph = graph.without("adaptive")
    if kind == "lqr":
        graph = graph.set("match.alpha", 0.0)
    source = "miss" if name.startswith("sine") else "error"
    graph = (
        graph.set("plots", {})
        .set("run.engine", ENGINE)
        .probe("lateral", f"{source}.lateral", every=10)
    )
    return measured(graph, range(FRESH, FRESH + seeds))


def measured(graph: runtime.Graph, seeds: Iterable[int]) -> Runs:
    """A graph's runs with some seeds."""
    results = [graph.run(seed=seed) for seed in seeds]
    metrics = {
        key: np.array([np.nan if r.metrics[key] is None else r.metrics[key] for r in results])
        for key in results[0].metrics
    }
    names = [n for n in ("errors", "lateral", "adaptive") if n in results[0]]
    return Runs(
        metrics,
        {n: [r[n] for r in results] for n in names},
        {n: results[0].time(n) for n in names},
    )


def after(runs: Runs, name: str, start: float, stop: float = np.inf) -> list[np.ndarray]:
    """A signal of every seed between two times (s)."""
    t = runs.times[name]
    return [values[(t >= start) & (t < stop)] for values in runs.signals[name]]
