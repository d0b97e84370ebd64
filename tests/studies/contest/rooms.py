"""Rooms drawn at random, on which nothing was tuned: ``python -m tests.studies.contest.rooms``."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent / "rooms"
SEEDS = range(3)
CLEAR = 0.5  # m, around the start, in which the robot looks for a wall
# Passages that a robot with a stand-off of 0.18 m can neither take nor leave (m).
NARROW = (0.0, 0.5)


def draw(seed: int) -> dict[str, list[list[float]]]:
    """A rectangle of 3 to 6 m by 3 to 5 m with up to five circles of 0.15 to 0.4 m, some of
    which stand in a wall; the origin is clear.
    """
    rng = np.random.default_rng(seed)
    right, top = rng.uniform(1.5, 3.0), rng.uniform(1.5, 2.5)
    left, bottom = -rng.uniform(1.5, 3.0), -rng.uniform(1.5, 2.5)
    circles: list[list[float]] = []
    wanted = int(rng.integers(2, 6))
    while len(circles) < wanted:
        x, y = rng.uniform(left, right), rng.uniform(bottom, top)
        r = rng.uniform(0.15, 0.4)
        to_walls = [abs(x - left) - r, abs(x - right) - r, abs(y - bottom) - r, abs(y - top) - r]
        to_others = [math.hypot(x - a, y - b) - r - c for a, b, c in circles]
        passages = [*to_walls, *to_others]
        if math.hypot(x, y) - r > CLEAR and not any(NARROW[0] < p < NARROW[1] for p in passages):
            circles.append([round(float(value), 2) for value in (x, y, r)])
    corners = [[left, bottom], [right, bottom], [right, top], [left, top]]
    room = [[round(float(value), 2) for value in corner] for corner in corners]
    return {"room": room, "circles": circles}


def heading(seed: int) -> float:
    """The heading (rad) with which the robot starts in the room of that seed."""
    return round(float(np.random.default_rng([seed, 1]).uniform(-math.pi, math.pi)), 3)


def write() -> None:
    """Write the rooms."""
    FOLDER.mkdir(exist_ok=True)
    for seed in SEEDS:
        found = draw(seed)
        lines = [
            f"# Drawn at random with seed {seed} by python -m tests.studies.contest.rooms",
            f"room: {found['room']}",
            "circles:",
            *(f"  - {circle}" for circle in found["circles"]),
        ]
        (FOLDER / f"random_{seed}.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write()
