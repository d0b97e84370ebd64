"""Runs of case C over worlds, conditions, controllers and seeds."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from typing import TypeVar

import numpy as np

import runtime
from blocks import WallFitter
from runtime.document.loader import SHIPPED
from runtime.observation.wall_metrics import first_loop
from runtime.toolchain import available
from tests.studies import kept

WORKERS = 2
ENGINE = "compiled" if available() else "python"
J = TypeVar("J", bound=Hashable)
R = TypeVar("R")
CONDITIONS = {
    "ideal": (),
    "turn rate -35 %": ("turn_loss_35",),
    "turn rate -50 %": ("turn_loss_50",),
    "turn bias 0.15 rad/s": ("turn_bias",),
    "pose noise 5 cm, 0.1 rad": ("pose_noise",),
    "mixed": ("mixed",),
}
LQR, FEEDFORWARD, PRINTED, ROBUST = (
    "LQR",
    "LQR + feedforward",
    "+ SNN as printed",
    "+ robust SNN",
)
CONTROLLERS = (LQR, FEEDFORWARD, PRINTED, ROBUST)


@dataclass(frozen=True)
class Job:
    """One run; ``world`` and ``until`` (s) are the graph's own if not given."""

    controller: str
    condition: str
    seed: int
    world: str = ""
    until: float | None = None


@cache
def graph_of(
    controller: str, condition: str = "ideal", world: str = "", until: float | None = None
) -> runtime.Graph:
    """A controller's graph under a condition, without pictures; see :class:`Job`."""
    graph = runtime.load("wall_following" + ("_robust" if controller == ROBUST else ""))
    if controller in (LQR, FEEDFORWARD):
        graph = graph.without("adaptive")
    if controller == LQR:
        graph = graph.set("blocks.match.alpha", 0.0)
    for name in CONDITIONS[condition]:
        graph = graph.overlay(SHIPPED / "conditions" / f"{name}.yaml")
    if world:
        graph = graph.overlay({"world": str(SHIPPED / "worlds" / f"{world}.yaml")})
    if until is not None:
        graph = graph.set("run.until", until)
    graph = graph.set("plots", {}).set("run.engine", ENGINE)
    graph.check()  # once for all seeds
    return graph


def length_of(loop: np.ndarray) -> float:
    """Length (m) of a closed loop, (k, 2)."""
    return float(np.hypot(*(np.roll(loop, -1, axis=0) - loop).T).sum())


def measure(job: Job) -> dict[str, float]:
    """One run's metrics, NaN where one has no value, and the ``length`` (m) of its loop."""
    graph = graph_of(job.controller, job.condition, job.world, job.until)
    result = graph.run(seed=job.seed)
    metrics = {k: np.nan if v is None else float(v) for k, v in result.metrics.items()}
    fitter = graph.network.entries["fitter"].block
    assert isinstance(fitter, WallFitter)
    engaged = result.time("pose") >= metrics["time_to_engage"]
    _, loop = first_loop(graph.network.world, result["pose"][engaged, :2], fitter.distance)
    return {**metrics, "length": length_of(loop) if len(loop) else np.nan}


def measure_all(jobs: Iterable[Job]) -> dict[Job, dict[str, float]]:
    """The metrics of all of them."""
    return in_parallel(measure, jobs)


def in_parallel(call: Callable[[J], R], jobs: Iterable[J]) -> dict[J, R]:
    """What a function makes of each job, two at a time, unless it is kept."""
    jobs = list(jobs)
    keys = {job: f"{call.__module__}.{call.__name__} {job!r}" for job in jobs}
    missing = [job for job in jobs if not kept.known(keys[job])]
    # The matrices are small: threads of the linear algebra would only fight over the cores.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        for job, found in zip(missing, pool.map(call, missing), strict=True):
            kept.add(keys[job], found)
    return {job: kept.result(keys[job]) for job in jobs}
