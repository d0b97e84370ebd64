"""The world around the robot: walls and obstacles, and how far they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import BlockContext, BoolArray, FloatArray, ParameterError, directions
from blocks.messages import Message
from blocks.world.curves import LineOrArc, foot
from blocks.world.level_set import deviation, kinks, level_set, loops, sampled
from blocks.world.reader import WorldShapes, read_shapes
from blocks.world.surfaces import (
    TOUCH,
    TOUCHING,
    Edge,
    Nearest,
    Surfaces,
    as_arrays,
    from_surface,
    to_circles,
    to_edges,
)

Polygon = tuple[bool, tuple[Edge, ...], FloatArray, FloatArray]


class World:
    """Walls and obstacles of the plane; immutable.

    Parameters
    ----------
    description : as a graph's ``world:`` section, all in m::

            room: [[x, y], ...]              # the outer wall; free space is inside
            obstacles: [[[x, y], ...], ...]  # solid polygons
            circles: [[x, y, r], ...]        # solid circles

        At least one of the three; without a room, the outside is free. Solids may overlap.

    Attributes
    ----------
    room : corners of the outer wall, (k, 2), counterclockwise; None without one.
    obstacles : corners of the solid polygons, each (k, 2), clockwise.
    circles : x, y, r of the solid circles, (c, 3).
    surfaces : the boundary of free space, as unordered lines and arcs with free space on their
        left; what lies inside another solid is not part of it.

    Raises
    ------
    ParameterError : one (address, text) for each entry that is wrong.
    """

    room: FloatArray | None
    obstacles: tuple[FloatArray, ...]
    circles: FloatArray
    surfaces: tuple[LineOrArc, ...]

    _shapes: WorldShapes
    _corner: FloatArray
    _edge: FloatArray
    _circle: FloatArray
    _polygons: tuple[Polygon, ...]
    _discs: tuple[tuple[float, float, float], ...]

    def __init__(self, description: Mapping[str, Any]) -> None:
        shapes = read_shapes(description)
        room = [] if shapes.room is None else [shapes.room]
        polygons = [np.empty((0, 2)), *room, *shapes.obstacles]
        corners = np.vstack(polygons)
        edges = np.vstack([np.roll(p, -1, axis=0) - p for p in polygons])
        # Corners and edges as (2, n, 1), against which points (m,) broadcast.
        self.__dict__.update(
            vars(shapes),
            _shapes=shapes,
            _corner=corners.T[:, :, None],
            _edge=edges.T[:, :, None],
            _circle=shapes.circles.T[:, :, None],
            _polygons=tuple(
                (p is shapes.room, _edges(p), p[:, 0, None], p[:, 1, None]) for p in polygons[1:]
            ),
            _discs=tuple((x, y, r) for x, y, r in shapes.circles.tolist()),
        )
        self.__dict__["surfaces"] = tuple(level_set(shapes, self.gap, 0.0))
        if not self.surfaces:
            raise ParameterError([("room", "the obstacles leave no free space in it")])

    @cached_property
    def arrays(self) -> Surfaces:
        """The data of :meth:`nearest` and :meth:`cast` for their kernels."""
        polygons = [(is_room, edges) for is_room, edges, _, _ in self._polygons]
        return as_arrays(polygons, self.circles, self.surfaces)

    def touched(self, points: FloatArray, radius: float) -> BoolArray:
        """Whether a round body of a radius (m) at each position (m, 2) touches a surface."""
        return np.asarray(self.distance(points) - radius <= TOUCH)

    def distance(self, points: FloatArray) -> FloatArray:
        """Signed distance to the nearest surface (m), (m,).

        Positive in free space, negative inside of a wall or obstacle and outside of the room. It
        is exact everywhere: a surface inside another solid does not count.

        Parameters
        ----------
        points : x and y (m), (m, 2).
        """
        x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
        gap, solid = self.gap(x, y)
        if solid.any():
            z = x[solid] + 1j * y[solid]
            # Inside a solid the nearest edge may lie inside another one: only true surfaces count.
            feet = np.stack([foot(curve, z) for curve in self.surfaces])
            gap[solid] = -np.abs(feet - z).min(axis=0)
        return gap

    def gap(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Distance (m) of each point to the nearest solid, where it is outside of all of them,
        and which points are not: both (m,).
        """
        solid = self._in_polygons(x, y)
        gap = np.full(x.shape, np.inf)
        if self._edge.shape[1]:
            (ax, ay), (ex, ey) = self._corner, self._edge
            px, py = x - ax, y - ay
            s = np.clip((px * ex + py * ey) / (ex * ex + ey * ey), 0.0, 1.0)
            gap = np.hypot(px - s * ex, py - s * ey).min(axis=0)
        if len(self.circles):
            cx, cy, r = self._circle
            rounds = (np.hypot(x - cx, y - cy) - r).min(axis=0)
            solid |= rounds < 0.0
            gap = np.minimum(gap, rounds)
        return gap, solid

    def _in_polygons(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Which points are outside of the room or in an obstacle (even-odd rule)."""
        solid = np.zeros(x.shape, dtype=bool)
        for is_room, _, ax, ay in self._polygons:
            bx, by = np.roll(ax, -1, axis=0), np.roll(ay, -1, axis=0)
            spans = (ay > y) != (by > y)
            left = (x - ax) * (by - ay) < (y - ay) * (bx - ax)
            inside = (spans & (left == (by > ay))).sum(axis=0) % 2 == 1
            solid |= inside != is_room
        return solid

    def extent(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lower left and upper right corner (m) of all walls and the positions ``xy`` (n, 2)."""
        centre, reach = self.circles[:, :2], self.circles[:, 2:]
        corners = [*self.obstacles, centre - reach, centre + reach]
        everything = np.concatenate([*corners, xy, *([] if self.room is None else [self.room])])
        return everything.min(axis=0), everything.max(axis=0)

    def nearest(self, x: float, y: float) -> Nearest:
        """Signed distance to the nearest surface (m), and the unit normal there, which points
        into free space: :meth:`distance` for one point, on plain floats.

        Where several surfaces meet, the normal is the bisector of the widest free sector between
        them, see :func:`blocks.world.surfaces.outward`.
        """
        # Plain floats: for one point, NumPy's calls would cost more than the arithmetic.
        square, bx, by, solid = math.inf, 0.0, 0.0, False
        for is_room, edges, _, _ in self._polygons:
            inside = False
            for ax, ay, ex, ey, inverse, end in edges:
                px, py = x - ax, y - ay
                # The even-odd rule; > on one side and not on the other counts a corner once.
                if (ay > y) != (end > y) and (px * ey < py * ex) == (end > ay):
                    inside = not inside
                s = (px * ex + py * ey) * inverse
                s = 0.0 if s < 0.0 else 1.0 if s > 1.0 else s
                px -= s * ex
                py -= s * ey
                if px * px + py * py < square:
                    square, bx, by = px * px + py * py, px, py
            solid = solid or inside != is_room
        gap = span = math.sqrt(square)
        for cx, cy, r in self._discs:
            px, py = x - cx, y - cy
            from_centre = math.hypot(px, py)
            if from_centre - r < gap:
                gap, span, bx, by = from_centre - r, from_centre, px, py
        # On a surface the difference to the nearest point is rounding and has no direction.
        if solid or gap < TOUCHING:
            return from_surface(self.arrays[3], x, y, solid or gap < 0.0)
        return gap, bx / span, by / span

    def cast(self, x: float, y: float, angles: FloatArray) -> FloatArray:
        """Range (m) along each ray to the first surface, (n,); inf where there is none.

        Parameters
        ----------
        x, y : where the rays begin (m), in free space.
        angles : their directions (rad), (n,).
        """
        units = directions(angles).T
        ranges = np.full(units.shape[1], np.inf)
        if self._edge.shape[1]:
            ranges = to_edges(x, y, units, self._corner[..., 0], self._edge[..., 0])
        if len(self.circles):
            ranges = np.minimum(ranges, to_circles(x, y, units, self._circle[..., 0]))
        return ranges

    def offset_contour(self, d: float, spacing: float = 0.01) -> list[FloatArray]:
        """The contour at distance ``d`` from the surfaces: closed loops, each (k, 2) in m.

        The wall is to the right of the direction in which a loop runs; its last row repeats the
        first. Loops come longest first; the list is empty where no free space is that wide.

        Parameters
        ----------
        d : the distance (m), above 0.
        spacing : largest distance between two samples (m); kinks are sampled exactly.
        """
        return [sampled(loop, spacing) for loop in self._loops(d)]

    def _loops(self, d: float) -> list[list[LineOrArc]]:
        if not d > 0.0:
            raise ValueError(f"expected a distance above 0 m, got {d}")
        return loops(level_set(self._shapes, self.gap, d))

    def kinks(self, d: float) -> FloatArray:
        """Concave kinks of the contour at distance ``d``, where two surfaces meet: (k, 2) in m."""
        points = [kink for loop in self._loops(d) for kink in kinks(loop)]
        return np.array([(z.real, z.imag) for z in points]).reshape(-1, 2)

    def reachable(self, points: FloatArray, d: float, rho: float) -> BoolArray:
        """Which points, (m, 2), are at least ``rho`` (m) from every kink of the contour at ``d``:
        there, a robot whose smallest turning radius is ``rho`` can be on the contour. (m,).
        """
        corners = self.kinks(d)
        apart = np.asarray(points, dtype=float).reshape(-1, 1, 2) - corners
        clear: BoolArray = np.all(np.hypot(apart[..., 0], apart[..., 1]) >= rho, axis=1)
        return clear

    def kink_floor(self, d: float, rho: float, near: tuple[float, float] | None = None) -> float:
        """Mean of ``|distance - d|`` (m) of a robot that follows the contour at ``d`` without any
        error and rounds its concave kinks by arcs of radius ``rho``.

        This is close to the optimum for that turning radius: swinging wide before each kink
        improves it by about a tenth.

        Parameters
        ----------
        d : distance to follow (m).
        rho : smallest turning radius (m).
        near : count only the loop that passes nearest to this point (m); default all loops.

        Returns
        -------
        float : nan if there is no contour, or if the arcs do not fit into it.
        """
        counted = self._loops(d)
        if near is not None and counted:
            at = complex(*near)
            counted = [min(counted, key=lambda loop: _apart(loop, at))]
        return deviation(self.distance, counted, d, rho)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a World cannot change after construction (attribute '{name}')")

    def __delattr__(self, name: str) -> None:
        raise AttributeError("a World cannot change after construction")

    @property
    def description(self) -> dict[str, Any]:
        """The mapping that describes this world."""
        plain: dict[str, Any] = {} if self.room is None else {"room": self.room.tolist()}
        if self.obstacles:
            plain["obstacles"] = [corners.tolist() for corners in self.obstacles]
        if len(self.circles):
            plain["circles"] = self.circles.tolist()
        return plain

    def __eq__(self, other: object) -> bool:
        return isinstance(other, World) and self.description == other.description

    def __hash__(self) -> int:
        return hash(repr(self.description))

    def __repr__(self) -> str:
        return f"World({self.description})"


def world_of(context: BlockContext) -> World | None:
    """The world of the graph that a block is in; None without one."""
    return context.world if isinstance(context.world, World) else None


def required_world(context: BlockContext) -> World:
    """The world of a block that needs one.

    Raises
    ------
    ParameterError : the graph has none.
    """
    world = world_of(context)
    if world is None:
        message = "needs a world: section in the graph, such as world: {circles: [[2.0, 0.0, 0.5]]}"
        raise ParameterError([("world", Message(message, "missing-world"))])
    return world


def misplaced(world: World, body: str, x: float, y: float, radius: float) -> str:
    """Why a round body does not fit at a point; empty if it does."""
    distance = world.nearest(x, y)[0]
    if distance >= radius:
        return ""
    message = f"a {body} of radius {radius:g} m does not fit at ({x:g}, {y:g})"
    return message + (f": the nearest surface is {distance:.3g} m away" if distance > 0.0 else "")


def _edges(corners: FloatArray) -> tuple[Edge, ...]:
    """Per edge: its corner's x and y, the vector to the next corner, 1 / length^2, the next's y."""
    (ax, ay), (bx, by) = corners.T, np.roll(corners, -1, axis=0).T
    ex, ey = bx - ax, by - ay
    rows = np.column_stack((ax, ay, ex, ey, 1.0 / (ex * ex + ey * ey), by))
    return tuple((r[0], r[1], r[2], r[3], r[4], r[5]) for r in rows.tolist())


def _apart(loop: list[LineOrArc], point: complex) -> float:
    return min(float(np.abs(foot(curve, np.array([point])) - point)[0]) for curve in loop)
