"""Case C with rigid-body physics: the loop of the room with faults at the wheels, over seeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import runtime
from spikeblocks.mujoco import MujocoVacuum
from tests.studies.claims import Claim, spread
from tests.studies.following import ENGINE, FEEDFORWARD, PRINTED, ROBUST, in_parallel

MM = 1e3
NO_FAULT, LOSS = "no fault", "turn rate -35 %"
FAULTS = {NO_FAULT: "", LOSS: "wheel_faults/turn_loss_35.yaml"}
CONTROLLERS = (FEEDFORWARD, PRINTED, ROBUST)
COLUMNS = (
    "fault",
    "controller",
    "whole run",
    "along cylinders",
    "off the kinks",
    "floor",
    "closed",
    "contact",
    "clearance",
    "drift",
    "tilt",
)


@dataclass(frozen=True)
class Job:
    """One run of a controller under a fault."""

    controller: str
    fault: str
    seed: int


def graph_of(job: Job) -> runtime.Graph:
    """The graph of a run, without pictures."""
    robust = job.controller == ROBUST
    graph = runtime.load("wall_following_mujoco" + ("_robust" if robust else ""))
    if job.controller == FEEDFORWARD:
        graph = graph.without("adaptive")
    if FAULTS[job.fault]:
        graph = graph.overlay(FAULTS[job.fault])
    graph = graph.set("plots", {}).set("run.engine", ENGINE)
    return graph.set("probes.tilt", {"of": "plant.tilt", "every": 10})


def measure(job: Job) -> dict[str, float]:
    """One run's metrics, NaN where one has no value, and what only physics has.

    ``clearance`` is the smallest between hull and walls, ``drift`` what the odometry's place is
    off at the end (both m), ``tilt`` the largest (rad).
    """
    graph = graph_of(job)
    result = graph.run(seed=job.seed)
    metrics = {k: np.nan if v is None else float(v) for k, v in result.metrics.items()}
    network = graph.network
    plant = network.entries["plant"].block
    assert isinstance(plant, MujocoVacuum)
    distances = network.world.distance(result["pose"][:, :2])
    believed, true = result["drift"][-1], result["pose"][: 2 * len(result["drift"]) : 2][-1]
    return {
        **metrics,
        "clearance": float(distances.min()) - plant.body_radius,
        "drift": float(np.hypot(*(believed - true)[:2])),
        "tilt": float(result["tilt"].max()),
    }


class Physics:
    """All controllers under all faults over the same seeds."""

    def __init__(self, seeds: range) -> None:
        self.seeds = seeds
        self.results = in_parallel(
            measure, (Job(c, f, s) for f in FAULTS for c in CONTROLLERS for s in seeds)
        )

    def __call__(self, controller: str, fault: str, metric: str) -> np.ndarray:
        """A metric of every seed, NaN where a run has none."""
        return np.array([self.results[Job(controller, fault, s)][metric] for s in self.seeds])

    def aims(self) -> list[Claim]:
        """What we ask of our own controller with 35 % of the turn rate lost at the wheels."""
        loops = self(ROBUST, LOSS, "loops")
        ours, *others = (
            self(name, LOSS, "distance_mae") for name in (ROBUST, FEEDFORWARD, PRINTED)
        )
        best = np.all([ours < theirs for theirs in others], axis=0)
        n = len(self.seeds)
        return [
            Claim("", "", message, f"{np.sum(holds)} of {n}", float(np.mean(holds)))
            for message, holds in (
                ("robust: all loops closed", loops >= 1.0),
                ("robust: the smallest error of the three, on the same seed", best),
            )
        ]

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each fault and controller."""
        return [(f, c, *self._figures(c, f)) for f in FAULTS for c in CONTROLLERS]

    def _figures(self, controller: str, fault: str) -> tuple[str, ...]:
        def of(metric: str) -> np.ndarray:
            return self(controller, fault, metric)

        whole, along, fair = (
            spread(MM * of(name), digits=1)
            for name in ("distance_mae", "distance_mae_cylinders", "distance_mae_reachable")
        )
        loops = of("loops")
        return (
            *(whole, along, fair),
            f"{MM * of('distance_floor').mean():.1f}",
            f"{np.sum(loops >= 1.0)} of {len(loops)}",
            f"{of('contacts').mean():.1%}",
            f"{MM * of('clearance').min():.0f}",
            spread(MM * of("drift"), digits=0),
            f"{np.degrees(of('tilt').max()):.2f}°",
        )
