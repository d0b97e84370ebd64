"""Beams cast in a MuJoCo model, from a site of the robot as it is tilted."""

from __future__ import annotations

from typing import Any

import numpy as np

from blocks.core import FloatArray, directions, product

GROUPS = 6


class Beams:
    """Casts all beams of a scan at once.

    Parameters
    ----------
    mujoco : the module.
    model, data : the simulation to cast in; ``data`` gets its kinematics up to date.
    bearings : directions in the plane of the site (rad), (n,).
    group : the group of the shapes that beams see.
    reach : beams end here (m).
    """

    def __init__(
        self, mujoco: Any, model: Any, data: Any, bearings: FloatArray, group: int, reach: float
    ) -> None:
        self.mujoco, self.model, self.data, self.reach = mujoco, model, data, reach
        self.site = data.site("lidar")
        level = np.zeros_like(bearings)
        self.units = np.column_stack((directions(bearings), level))
        self.groups = np.zeros(GROUPS, dtype=np.uint8)
        self.groups[group] = 1
        self.shapes = np.zeros(len(bearings), dtype=np.int32)

    def ways(self) -> FloatArray:
        """Where the beams point in the world, unit vectors, (n, 3)."""
        return product(self.units, self.site.xmat.reshape(3, 3).T)

    def cast(self) -> FloatArray:
        """Range along each beam (m), (n,); inf where it meets nothing within reach."""
        # A step leaves the places of its begin behind.
        self.mujoco.mj_kinematics(self.model, self.data)
        n = len(self.units)
        ranges = np.empty(n)
        self.mujoco.mj_multiRay(
            self.model,
            self.data,
            self.site.xpos,
            self.ways().ravel(),
            self.groups,
            True,
            -1,
            self.shapes,
            ranges,
            None,
            n,
            self.reach,
        )
        ranges[(ranges < 0.0) | (ranges > self.reach)] = np.inf
        return ranges
