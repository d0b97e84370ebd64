"""Case C in rooms drawn at random: who has found a wall does not stay without a path."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from blocks import ParameterError
from blocks.world.world import World
from tests.studies.following import CONDITIONS, ROBUST, graph_of

LONGEST = 10.0  # s without a path
EVERY = 0.1  # s, a scan
CLEAR = 0.4  # m around the robot's start


def outline(rng: np.random.Generator, kind: int) -> np.ndarray:
    """Corners (n, 2) around the origin of a rectangle, an L or an irregular polygon."""
    if kind == 0:
        width, height = rng.uniform(2.5, 6.0, 2)
        x, y = -rng.uniform(0.25, 0.75) * width, -rng.uniform(0.25, 0.75) * height
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        return np.array(corners)
    if kind == 1:
        width, height = rng.uniform(4.0, 7.0, 2)
        x, y = rng.uniform(0.35, 0.6, 2) * (width, height)
        corners = [(0, 0), (width, 0), (width, y), (x, y), (x, height), (0, height)]
        return np.array(corners) - (0.5 * x, 0.5 * y)
    n = int(rng.integers(5, 12))
    angle = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * math.tau / n
    return rng.uniform(1.8, 3.5, n)[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))


def room(seed: int) -> tuple[dict[str, Any], float]:
    """A world with circles and polygons in it, and the heading to begin with (rad)."""
    rng = np.random.default_rng([2026, seed])
    while True:
        corners = outline(rng, seed % 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        circles = [
            [*rng.uniform(low, high).tolist(), float(rng.uniform(0.1, 0.5))]
            for _ in range(rng.integers(0, 7))
        ]
        obstacles = []
        for _ in range(rng.integers(0, 3)):
            n = int(rng.integers(3, 6))
            angle = np.sort((np.arange(n) + rng.uniform(0.0, 0.6, n)) * math.tau / n)
            rim = rng.uniform(0.15, 0.5) * np.column_stack((np.cos(angle), np.sin(angle)))
            obstacles.append((rng.uniform(low, high) + rim).tolist())
        world = {"room": corners.tolist(), "circles": circles, "obstacles": obstacles}
        try:
            clear = World(world).distance(np.zeros((1, 2)))[0] > CLEAR
        except ParameterError:
            continue
        if clear:
            return world, float(rng.uniform(-math.pi, math.pi))


def without_a_path(seed: int, until: float = 30.0) -> float:
    """The longest stretch (s) without a path after a wall was first found; NaN if none was."""
    world, heading = room(seed)
    graph = graph_of(ROBUST, list(CONDITIONS)[seed % len(CONDITIONS)]).overlay({"world": world})
    graph = graph.set("plant.x0", [0.0, 0.0, heading]).set("run.until", until).set("metrics", {})
    every = round(EVERY / 1e-3)
    graph = graph.set(
        "probes",
        {
            "engaged": {"of": "explore.engaged", "every": every},
            "valid": {"of": "fitter.valid", "every": every},
        },
    )
    result = graph.run(seed=seed)
    engaged, valid = result["engaged"].ravel(), result["valid"].ravel()
    if not engaged.any():
        return math.nan
    longest = lasted = 0
    for sighted in valid[int(engaged.argmax()) :]:
        lasted = 0 if sighted else lasted + 1
        longest = max(longest, lasted)
    return EVERY * longest


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 300, 50))
def test_who_has_found_a_wall_is_not_without_a_path_for_long(first: int) -> None:
    """300 rooms under all conditions; the wall may lie on the other side when it is found."""
    longest = {seed: without_a_path(seed) for seed in range(first, first + 50)}
    assert [seed for seed, lasted in longest.items() if math.isnan(lasted)] == []
    assert {seed: lasted for seed, lasted in longest.items() if lasted > LONGEST} == {}
