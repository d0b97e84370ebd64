"""A small ray caster, independent of the library's own, for tests of what reads scans."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np


def square(half: float) -> np.ndarray:
    return half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class Room:
    """The inside of a polygon (counterclockwise corners, m), with circles (x, y, radius) in it."""

    corners: np.ndarray
    circles: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))

    def cast(self, pose: tuple[float, float, float], beams: int = 360) -> np.ndarray:
        """Exact ranges of beams from bearing -pi on; inf where nothing is hit."""
        x, y, theta = pose
        bearing = theta - math.pi + np.arange(beams) * (2.0 * math.pi / beams)
        ranges = np.full(beams, math.inf)
        for i, phi in enumerate(bearing):
            u = np.array([math.cos(phi), math.sin(phi)])
            for a, b in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
                matrix = np.column_stack((u, a - b))
                if abs(np.linalg.det(matrix)) > 1e-12:
                    r, share = np.linalg.solve(matrix, a - (x, y))
                    if r > 0.0 and -1e-12 <= share <= 1.0 + 1e-12:
                        ranges[i] = min(ranges[i], r)
            for cx, cy, radius in self.circles:
                along = u @ (cx - x, cy - y)
                inside = along**2 - math.hypot(cx - x, cy - y) ** 2 + radius**2
                if inside > 0.0 and along - math.sqrt(inside) > 0.0:
                    ranges[i] = min(ranges[i], along - math.sqrt(inside))
        return ranges

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points (n, 2) to the nearest surface, negative inside circles."""
        near = [np.hypot(*(points - (x, y)).T) - radius for x, y, radius in self.circles]
        for a, b in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            near.append(np.hypot(*(points - a - share[:, None] * (b - a)).T))
        return np.min(near, axis=0)

    def contour(self, d: float, spacing: float) -> np.ndarray:
        """Poses (n, 3) on the level set at distance d of rooms with convex corners, wall right."""
        rows = []
        for a, b in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            way = math.hypot(*(b - a))
            u = (b - a) / way
            at = np.arange(0.5 * spacing, way, spacing)[:, None] * u + a
            heading = np.full(len(at), math.atan2(u[1], u[0]))
            rows.append(np.column_stack((at + d * np.array([-u[1], u[0]]), heading)))
        for x, y, radius in self.circles:
            turn = np.arange(0.0, 2.0 * math.pi, spacing / (radius + d))
            rim = np.column_stack((np.cos(turn), np.sin(turn))) * (radius + d) + (x, y)
            rows.append(np.column_stack((rim, turn - 0.5 * math.pi)))
        poses = np.concatenate(rows)
        inside = (np.abs(poses[:, :2]) < np.abs(self.corners).max(axis=0)).all(axis=1)
        return poses[inside & (self.distance(poses[:, :2]) > d - 1e-9)]


PAPER = Room(
    square(2.0),
    np.array([(0.3, -1.5, 0.5), (1.6, 0.2, 0.4), (-0.2, 1.7, 0.3), (-1.8, -0.3, 0.2)]),
)
