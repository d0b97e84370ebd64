"""Case C in the paper's room, over conditions, controllers and seeds; its claims and our aims."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tests.studies.claims import Claim, spread
from tests.studies.following import (
    CONDITIONS,
    CONTROLLERS,
    FEEDFORWARD,
    LQR,
    PRINTED,
    ROBUST,
    Job,
    measure_all,
)

LOSS = "turn rate -50 %"
MM = 1e3
# What the paper gives (mm), and by how much a value may differ from it.
PAPER_LQR, PAPER_SNN, PART = 110.0, 60.0, 0.1


class Walls:
    """All controllers under some conditions, all if not given, over the same seeds."""

    def __init__(self, seeds: range, conditions: Iterable[str] = CONDITIONS) -> None:
        self.seeds = seeds
        self.results = measure_all(
            Job(controller, condition, seed)
            for condition in conditions
            for controller in CONTROLLERS
            for seed in seeds
        )

    def __call__(self, controller: str, condition: str, metric: str) -> np.ndarray:
        """A metric of every seed, NaN where a run has none."""
        jobs = (Job(controller, condition, seed) for seed in self.seeds)
        return np.array([self.results[job][metric] for job in jobs])

    def claims(self) -> list[Claim]:
        """What the paper says of case C, judged at half of the turn rate."""
        lqr, forward, printed = (
            MM * self(name, LOSS, "distance_mae") for name in (LQR, FEEDFORWARD, PRINTED)
        )
        along, along_lqr, along_forward = (
            MM * self(name, LOSS, "distance_mae_cylinders") for name in (PRINTED, LQR, FEEDFORWARD)
        )
        ratio = printed / lqr
        credit = (lqr.mean() - forward.mean()) / (lqr.mean() - printed.mean())
        return [
            Claim(
                "C1a",
                "LQR: mean absolute error 0.11 m",
                f"without feedforward within {PART:.0%} of the paper's {PAPER_LQR:g} mm over the "
                "whole run",
                f"{spread(lqr, digits=1)} and {spread(along_lqr, 'mm', 1)}",
                float((np.abs(lqr - PAPER_LQR) <= PART * PAPER_LQR).mean()),
                "Whole way and along the cylinders. Half of the turn rate is lost; the paper does "
                "not say how it disturbs its robot, nor over which part of the way it averages: "
                f"{lqr.mean() / PAPER_LQR:.2f} and {along_lqr.mean() / PAPER_LQR:.2f} of it.",
            ),
            Claim(
                "C1b",
                "adaptive: 0.06 m",
                f"feedforward and the SNN as printed within {PART:.0%} of the paper's "
                f"{PAPER_SNN:g} mm over the whole run",
                f"{spread(printed, digits=1)} and {spread(along, 'mm', 1)}",
                float((np.abs(printed - PAPER_SNN) <= PART * PAPER_SNN).mean()),
                f"{(printed < PAPER_SNN).mean():.0%} of the networks have less than the paper. "
                f"Without a network the feedforward has {spread(forward, digits=1)} and "
                f"{spread(along_forward, 'mm', 1)}: {credit:.0%} of what it and the network gain "
                f"on the LQR over the whole run. The worst network is {along.max():.0f} mm off "
                "along the cylinders.",
            ),
            Claim(
                "C1c",
                "adaptive has 0.55 of the LQR's error",
                "at most 0.65 of it over the whole run, on the same seed",
                spread(ratio),
                float((ratio <= 0.65).mean()),
            ),
        ]

    def aims(self) -> list[Claim]:
        """What we ask of our own controller, under what it was made for."""
        rows = []
        for condition in ("turn rate -35 %", LOSS, "turn bias 0.15 rad/s", "mixed"):
            error = MM * self(ROBUST, condition, "distance_mae")
            message = f"robust: at most 25 mm under {condition}"
            measured = f"{spread(error, 'mm', 1)}, {error.max():.1f} at worst"
            rows.append(Claim("", "", message, measured, float((error <= 25.0).mean())))
        for condition in CONDITIONS:
            ours, theirs = (self(name, condition, "distance_mae") for name in (ROBUST, FEEDFORWARD))
            message = f"robust: better than LQR + feedforward on the same seed, {condition}"
            measured = f"{(ours < theirs).sum()} of {len(ours)}"
            rows.append(Claim("", "", message, measured, float((ours < theirs).mean())))
        return rows

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each condition and controller."""
        return [
            (condition, controller, *self._figures(controller, condition))
            for condition in CONDITIONS
            for controller in CONTROLLERS
        ]

    def _figures(self, controller: str, condition: str) -> tuple[str, ...]:
        whole, along, fair, floor, clearance, contacts, loops = (
            self(controller, condition, name)
            for name in (
                "distance_mae",
                "distance_mae_cylinders",
                "distance_mae_reachable",
                "distance_floor",
                "clearance",
                "contacts",
                "loops",
            )
        )
        return (
            spread(MM * whole, digits=1),
            spread(MM * along, digits=1),
            spread(MM * fair, digits=1),
            f"{MM * floor.mean():.1f}",
            f"{(loops >= 1.0).sum()} of {len(loops)}",
            f"{contacts.mean():.1%}",
            f"{MM * max(0.0, clearance.min()):.0f}",
        )


COLUMNS = (
    "condition",
    "controller",
    "whole run",
    "along cylinders",
    "off the kinks",
    "floor",
    "closed",
    "contact",
    "clearance",
)
