"""Whether a body meets the world: its clearance, for any pose of the graph.

In: a pose. Out: how far the body is from the nearest surface, and whether it touches one::

    touch: {type: Contact, body: 0.2}                       # wires: touch: {pose: car.pose}
    run: {stop: {when: touch.clearance, below: 0}}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Pose,
    PoseValue,
    Scalar,
    Vector,
    param,
)
from blocks.world import TOUCH, Surfaces, nearest_kernel, required_world

Approach = tuple[float, float, float]


class Contact(Block):
    """The clearance of a body at a pose: what it is from the nearest surface of the world.

        pose ─▶ [ Contact ] ─▶ clearance, contact, normal
                     ▲
                   world

    It measures and stops nothing; vehicles with a ``body_radius`` are held back by the world. The
    clearance of a round body is the distance of its centre less its radius; that of a polygon is
    the smallest distance of its outline. Where the body overlaps a surface the clearance is not
    above 0: for a disc, and where a corner is inside, it is minus the depth.
    """

    pose = Input(Pose, doc="the pose of the body's frame")

    clearance = Output(Scalar, unit="m", doc="from the body to the nearest surface; below 0 inside")
    contact = Output(Scalar, doc="1 while the body touches a surface (within 1e-6 m), else 0")
    normal = Output(Vector(2), doc="unit vector from the nearest surface towards the body")

    body: FloatArray = param(
        unit="m",
        shape=[(), ("corners", 2)],
        doc="the radius of a round body, or the corners of a polygon in the body's frame",
    )

    def validate(self) -> None:
        if self.body.ndim == 0:
            if not self.body > 0.0:
                raise ParameterError([("body", f"expected a radius above 0 m, got {self.body:g}")])
        elif len(self.body) < 3:
            message = f"expected a radius or at least three corners, got {len(self.body)}"
            raise ParameterError([("body", message)])

    def validate_in(self, context: BlockContext) -> None:
        required_world(context)

    def start(self, state: BlockState) -> None:
        state.surfaces = required_world(state.context).arrays
        state.radius = float(self.body) if self.body.ndim == 0 else 0.0
        state.outline = np.zeros((0, 2)) if self.body.ndim == 0 else np.array(self.body)

    def output(
        self, state: BlockState, t: float, pose: PoseValue
    ) -> tuple[float, float, FloatArray]:
        if len(state.outline):
            gap, nx, ny = approach(state.surfaces, _placed(state.outline, pose))
        else:
            gap, nx, ny = nearest_kernel(state.surfaces, pose[0], pose[1])
            gap -= state.radius
        normal = np.empty(2)
        normal[0], normal[1] = nx, ny
        return gap, 1.0 if gap <= TOUCH else 0.0, normal


def _placed(outline: FloatArray, pose: PoseValue) -> FloatArray:
    """The corners (n, 2) of a body at a pose."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    corners = np.empty((len(outline), 2))
    for i in range(len(outline)):
        corners[i, 0] = x + c * outline[i, 0] - s * outline[i, 1]
        corners[i, 1] = y + s * outline[i, 0] + c * outline[i, 1]
    return corners


def approach(surfaces: Surfaces, corners: FloatArray) -> Approach:
    """The signed distance (m) of a polygon to the nearest surface, and the unit normal there.

    Two outlines that do not cross are nearest at a corner of one of them: so corners of the body
    are compared with all surfaces, and corners and circles of the world with the body's sides.
    """
    edges, _, circles, _ = surfaces
    gap, nx, ny = nearest_kernel(surfaces, corners[0, 0], corners[0, 1])
    for i in range(1, len(corners)):
        near = nearest_kernel(surfaces, corners[i, 0], corners[i, 1])
        if near[0] < gap:
            gap, nx, ny = near
    for k in range(len(edges)):
        near = _from_point(corners, edges[k, 0], edges[k, 1], 0.0)
        if near[0] < gap:
            gap, nx, ny = near
    for k in range(len(circles)):
        near = _from_point(corners, circles[k, 0], circles[k, 1], circles[k, 2])
        if near[0] < gap:
            gap, nx, ny = near
    if gap > 0.0 and _crosses(edges, corners):
        gap = 0.0
    return gap, nx, ny


def _from_point(corners: FloatArray, px: float, py: float, r: float) -> Approach:
    """The signed distance of a polygon's outline from a disc, and the direction away from it."""
    square, bx, by, inside = math.inf, 1.0, 0.0, False
    ax, ay = corners[len(corners) - 1, 0], corners[len(corners) - 1, 1]
    for i in range(len(corners)):
        ex, ey = corners[i, 0] - ax, corners[i, 1] - ay
        # The even-odd rule: how often a ray from the point meets the outline.
        if (ay > py) != (ay + ey > py) and px < ax + ex * (py - ay) / ey:
            inside = not inside
        length = ex * ex + ey * ey
        s = 0.0 if length == 0.0 else ((px - ax) * ex + (py - ay) * ey) / length
        s = 0.0 if s < 0.0 else 1.0 if s > 1.0 else s
        dx, dy = ax + s * ex - px, ay + s * ey - py
        if dx * dx + dy * dy < square:
            square, bx, by = dx * dx + dy * dy, dx, dy
        ax, ay = corners[i, 0], corners[i, 1]
    away = math.sqrt(square)
    if away == 0.0:
        return -r, 1.0, 0.0
    if inside:
        return -away - r, -bx / away, -by / away
    return away - r, bx / away, by / away


def _crosses(edges: FloatArray, corners: FloatArray) -> bool:
    """Whether a side of a polygon crosses an edge of the world."""
    ax, ay = corners[len(corners) - 1, 0], corners[len(corners) - 1, 1]
    for i in range(len(corners)):
        ex, ey = corners[i, 0] - ax, corners[i, 1] - ay
        for k in range(len(edges)):
            px, py, qx, qy = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
            one = ex * (py - ay) - ey * (px - ax)
            two = ex * (py + qy - ay) - ey * (px + qx - ax)
            three = qx * (ay - py) - qy * (ax - px)
            four = qx * (ay + ey - py) - qy * (ax + ex - px)
            if (one > 0.0) != (two > 0.0) and (three > 0.0) != (four > 0.0):
                return True
        ax, ay = corners[i, 0], corners[i, 1]
    return False
