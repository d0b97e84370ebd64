"""The path never runs against the direction of travel, whatever the options and the noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from blocks.world.world import World
from tests.blocks.fitter import Fitter, Pose
from tests.examples import examples

HALF = 3.0  # m, of a square room
WORLD = World({"room": [[-HALF, -HALF], [HALF, -HALF], [HALF, HALF], [-HALF, HALF]]})


@st.composite
def options(draw: st.DrawFn) -> dict[str, Any]:
    """Parameters of a fitter, all that shape the path."""
    chosen = {
        "distance": (0.1, 0.18, 0.5, 0.8),
        "fit": ("control_points", "least_squares"),
        "degree": (2, 3, 5),
        "bin": (0.0, 0.01, 0.03, 0.08, 0.15),
        "wall_spacing": (0.03, 0.08, 0.2),
        "spacing": (0.05, 0.1, 0.2),
        "fillet": (0.0, 0.05, 0.15, 0.4, 0.9),
        "bridge": (0.0, 0.5, 1.5),
        "incidence": (0.07, 0.14, 0.3),
        "trim": (0.0, 0.01, 0.05),
        "sigma": (0.0, 0.01, 0.02),
        "side": ("right", "left"),
        "samples": (150, 250),
        "step": (0.01, 0.02),
    }
    found = {name: draw(st.sampled_from(values)) for name, values in chosen.items()}
    return {**found, "reach": found["distance"] + draw(st.sampled_from([0.3, 0.7, 1.8]))}


def seen(pose: Pose, noise: float, lost: float, rng: np.random.Generator) -> np.ndarray:
    """A scan of the square room, of some returns, with noise (m)."""
    bearing = pose[2] - math.pi + np.arange(360) * math.tau / 360
    scan = WORLD.cast(pose[0], pose[1], bearing) + noise * rng.standard_normal(360)
    scan[rng.uniform(size=360) < lost] = math.inf
    return scan


@examples(200)
@given(
    parameters=options(),
    along=st.floats(-0.9, 0.9),
    off=st.floats(0.75, 1.25),
    turned=st.floats(-0.5, 0.5),
    noise=st.sampled_from([0.0, 0.01, 0.02, 0.03]),
    lost=st.sampled_from([0.0, 0.0, 0.2]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_path_beside_a_robot_that_follows_a_wall_goes_its_way(
    parameters: dict[str, Any],
    along: float,
    off: float,
    turned: float,
    noise: float,
    lost: float,
    seed: int,
) -> None:
    """Near the stand-off from the lower wall, so that the way is along x."""
    mirror = 1.0 if parameters["side"] == "right" else -1.0
    distance = parameters["distance"]
    x = along * (HALF - 1.5 * distance)
    pose = (x, -HALF + off * distance, turned if mirror > 0.0 else math.pi + turned)
    scan = seen(pose, noise, lost, np.random.default_rng(seed))
    path, _, valid = Fitter(**parameters)(scan, pose)
    here = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1]).argmin()
    # Past a corner that is near the path goes at a right angle, for which noise has its share.
    assert valid == 0.0 or mirror * math.cos(path[here, 2]) > -0.3
