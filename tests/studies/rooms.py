"""Rooms that nothing was tuned on, looped by the robust controller."""

from __future__ import annotations

import math

import numpy as np

from blocks import MatchingPoint, WallFitter
from tests.studies.claims import spread
from tests.studies.following import ROBUST, Job, graph_of, length_of, measure_all

ROOMS = ("l_room", "column_room", "cluttered_room", "outdoor")
LOST = 0.2
MM = 1e3
COLUMNS = (
    "room",
    "loops",
    "run",
    "kept the wall",
    "loops followed",
    "whole run",
    "floor",
    "strayed",
    "contact",
    "clearance",
)


def loops_of(room: str) -> tuple[list[float], float]:
    """Lengths (m) of the loops that a room has at the stand-off, the longest first; and a time (s)
    in which to find a wall and go round the longest, with a quarter to spare.
    """
    network = graph_of(ROBUST, world=room).network
    fitter, match = (network.entries[name].block for name in ("fitter", "match"))
    assert isinstance(fitter, WallFitter) and isinstance(match, MatchingPoint)
    lengths = [length_of(loop[:-1]) for loop in network.world.offset_contour(fitter.distance)]
    return lengths, math.ceil(40.0 + 1.25 * lengths[0] / match.v_r)


def rows(seeds: range) -> list[tuple[str, ...]]:
    """A row for each room."""
    known = {room: loops_of(room) for room in ROOMS}
    results = measure_all(
        Job(ROBUST, "ideal", seed, room, known[room][1]) for room in ROOMS for seed in seeds
    )
    return [
        (
            room,
            ", ".join(f"{length:.1f}" for length in known[room][0]),
            f"{known[room][1]:g} s",
            *_figures([run for job, run in results.items() if job.world == room]),
        )
        for room in ROOMS
    ]


def _figures(runs: list[dict[str, float]]) -> tuple[str, ...]:
    whole, floor, strayed, loops, length, contacts, clearance = (
        np.array([run[name] for run in runs])
        for name in (
            "distance_mae",
            "distance_floor",
            "strayed",
            "loops",
            "length",
            "contacts",
            "clearance",
        )
    )
    kept = (loops >= 1.0) & (strayed <= LOST)
    lengths, counts = np.unique(np.round(length, 1), return_counts=True)
    return (
        f"{kept.sum()} of {len(runs)}",
        ", ".join(f"{n} on {m:g} m" for m, n in zip(lengths.tolist(), counts, strict=True)),
        spread(MM * whole, digits=1),
        spread(MM * floor, digits=1),
        f"{MM * strayed.max():.0f}",
        f"{contacts.mean():.1%}",
        f"{MM * max(0.0, clearance.min()):.0f}",
    )
