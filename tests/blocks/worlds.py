"""Worlds to test with, drawn by hypothesis on a coarse grid so that shapes touch and overlap."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from hypothesis import assume
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from scipy.spatial import cKDTree

from blocks import Block, BlockState, ParameterError, Scan
from blocks.core.signals import FloatArray
from blocks.world.world import World
from runtime.checking.bench import Bench
from runtime.checking.check import context_for

FOLDER = Path(__file__).parents[2] / "graphs" / "worlds"
SHIPPED = {path.stem: yaml.safe_load(path.read_text()) for path in sorted(FOLDER.glob("*.yaml"))}
SQUARE = [[-2, -2], [2, -2], [2, 2], [-2, 2]]
OVERLAPPING: dict[str, Any] = {
    "room": SQUARE,
    "obstacles": [
        [[1, -2], [2, -2], [2, -1], [1, -1]],  # flush with two walls
        [[0.5, -2], [1, -2], [1, -1.5]],  # flush with a wall and with the first
        [[-1, 0], [0, 0.5], [-0.5, 1]],
    ],
    "circles": [[-2, -2, 0.7], [-1.5, -1.2, 0.4], [0, 0.5, 0.3], [1.5, 0, 0.5], [1.5, 0, 0.5]],
}


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """A room, or none, with up to two polygons and three circles."""

    def number(low: float, high: float) -> st.SearchStrategy[float]:
        return st.integers(round(10 * low), round(10 * high)).map(lambda n: n / 10)

    def polygon(x: float, y: float, size: float, corners: int) -> list[list[float]]:
        point = st.tuples(number(x - size, x + size), number(y - size, y + size))
        points = draw(st.lists(point, min_size=3, max_size=corners, unique=True))
        mx, my = np.mean(points, axis=0)
        return [list(p) for p in sorted(points, key=lambda p: math.atan2(p[1] - my, p[0] - mx))]

    description: dict[str, Any] = {}
    if draw(st.booleans()):
        description["room"] = polygon(0.0, 0.0, 2.0, 7)
    spot = st.tuples(number(-2, 2), number(-2, 2))
    description["obstacles"] = [polygon(x, y, 0.8, 5) for x, y in draw(st.lists(spot, max_size=2))]
    circle = st.tuples(number(-2, 2), number(-2, 2), number(0.1, 0.8)).map(list)
    description["circles"] = draw(st.lists(circle, max_size=3))
    try:
        return World(description)
    except ParameterError:
        assume(False)
        raise


def is_free(world: World, points: FloatArray) -> np.ndarray:
    """Which points are in free space, by matplotlib's polygons."""
    free = np.ones(len(points), dtype=bool)
    if world.room is not None:
        free &= Outline(world.room).contains_points(points)
    for corners in world.obstacles:
        free &= ~Outline(corners).contains_points(points)
    for x, y, r in world.circles:
        free &= np.hypot(points[:, 0] - x, points[:, 1] - y) >= r
    return free


Edge = tuple[FloatArray, FloatArray]


def edges_of(world: World) -> list[Edge]:
    """The two ends of each edge of the room and the obstacles."""
    polygons = (*(() if world.room is None else (world.room,)), *world.obstacles)
    return [(a, b) for p in polygons for a, b in zip(p, np.roll(p, -1, axis=0), strict=True)]


def crossings(edges: list[Edge], circles: FloatArray) -> FloatArray:
    """Where the lines of edges, and circles, cross each other: (n, 2), with points off an edge."""
    found = [np.zeros(2)]
    for (a, b), (p, q) in itertools.combinations(edges, 2):
        (dx, dy), (ex, ey), (x, y) = b - a, q - p, p - a
        det = dx * ey - dy * ex
        if det != 0.0:
            found.append(a + (x * ey - y * ex) / det * (b - a))
    for (a, b), (x, y, r) in itertools.product(edges, circles):
        along = (b - a) / math.hypot(*(b - a))
        near = a + ((x, y) - a) @ along * along
        half = math.sqrt(max(0.0, r**2 - (near[0] - x) ** 2 - (near[1] - y) ** 2))
        found += [near - half * along, near + half * along]
    for (x, y, r), (u, v, s) in itertools.combinations(circles, 2):
        gap = math.hypot(u - x, v - y)
        if gap > 0.0:
            along = np.array([u - x, v - y]) / gap
            t = (gap**2 + r**2 - s**2) / (2.0 * gap)
            half = math.sqrt(max(0.0, r**2 - t**2))
            across = half * np.array([-along[1], along[0]])
            found += [(x, y) + t * along - across, (x, y) + t * along + across]
    return np.array(found)


def outline(world: World, spacing: float) -> FloatArray:
    """Points of all edges and circles that have free space next to them.

    They are at most ``spacing`` apart, and there is one between any two crossings, so that no piece
    that is shorter is missed.
    """
    parts = []
    edges, circles = edges_of(world), np.reshape(world.circles, (-1, 3))
    crossed = crossings(edges, circles)
    for a, b in edges:
        n = math.ceil(math.hypot(*(b - a)) / spacing) + 1
        along = (crossed - a) @ (b - a) / math.hypot(*(b - a)) ** 2
        off = np.hypot(*(crossed - a - np.outer(along, b - a)).T)
        cuts = np.sort([0.0, 1.0, *along[(off < 1e-9) & (along > 0.0) & (along < 1.0)]])
        parts.append(a + np.outer((cuts[:-1] + cuts[1:]) / 2.0, b - a))
        parts.append(np.linspace(a, b, n))
    for x, y, r in circles:
        dx, dy = (crossed - (x, y)).T
        cuts = np.sort(np.arctan2(dy, dx)[np.abs(np.hypot(dx, dy) - r) < 1e-9])
        between = (cuts + np.append(cuts[1:], cuts[:1] + 2 * math.pi)) / 2.0
        even = np.linspace(0.0, 2 * math.pi, math.ceil(2 * math.pi * r / spacing) + 1)
        angle = np.append(even, between)
        parts.append(np.column_stack((x + r * np.cos(angle), y + r * np.sin(angle))))
    points = np.concatenate(parts)
    exposed = np.zeros(len(points), dtype=bool)
    # Not along edges: there, what is free is decided by rounding.
    for angle in 0.123 + np.linspace(0.0, 2 * math.pi, 16, endpoint=False):
        beside = points + 1e-5 * np.array([math.cos(angle), math.sin(angle)])
        exposed |= is_free(world, beside)
    return points[exposed]


def brute_distance(world: World, points: FloatArray, spacing: float) -> FloatArray:
    """Signed distance to the nearest of many points on the surfaces: up to spacing / 2 too far."""
    gap, _ = cKDTree(outline(world, spacing)).query(points)
    return np.where(is_free(world, points), gap, -gap)


def started(
    block: Block, world: World | None = None, *, dt: float = 0.01, seed: int = 0, beams: int = 360
) -> BlockState:
    """A block's state before the first tick, in a world."""
    scans = {name: Scan(beams) for name in block.spec.inputs if name == "scan"}
    state = Bench(block, context_for(block, scans, dt, world), 1)._state(seed)
    block.start(state)
    return state
