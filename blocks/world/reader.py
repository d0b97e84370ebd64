"""Reads and checks the description of a world: a mapping with polygons and circles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import BoolArray, FloatArray, ParameterError, misspelt, show

# Distances are exact to about 1e-9 m only while coordinates are no larger than that (m).
FARTHEST = 1e4
SECTIONS = ("room", "obstacles", "circles")
WorldProblems = list[tuple[str, str]]


@dataclass(frozen=True)
class WorldShapes:
    """The shapes of a world.

    room : corners of the outer polygon, (k, 2), counterclockwise; None outdoors.
    obstacles : corners of the solid polygons, each (k, 2), clockwise.
    circles : x, y, r of the solid circles, (c, 3).

    Free space is to the left of every edge.
    """

    room: FloatArray | None
    obstacles: tuple[FloatArray, ...]
    circles: FloatArray


def read_shapes(description: Any) -> WorldShapes:
    """Turn ``{room: [[x, y], ...], obstacles: [[[x, y], ...], ...], circles: [[x, y, r], ...]}``
    into arrays (m).

    Raises
    ------
    ParameterError : one (address, text) for each entry that is wrong; addresses are relative to
        the mapping, as in ``obstacles[0][2]``.
    """
    if not isinstance(description, Mapping):
        message = f"expected a mapping with {_any_of(SECTIONS)}, got {show(description)}"
        raise ParameterError([("", message)])
    other = f"; a world has {', '.join(SECTIONS)}"
    problems: WorldProblems = [
        (str(key), misspelt("unknown-key", "unknown entry", key, SECTIONS, other))
        for key in description
        if key not in SECTIONS
    ]
    room = None
    if description.get("room") is not None:
        room = _polygon("room", description["room"], problems)
    obstacles = [
        _polygon(f"obstacles[{i}]", corners, problems)
        for i, corners in enumerate(_list(description, "obstacles", problems))
    ]
    circles = [
        _circle(f"circles[{i}]", circle, problems)
        for i, circle in enumerate(_list(description, "circles", problems))
    ]
    if not problems and room is None and not obstacles and not circles:
        problems.append(
            ("", f"a world without walls; expected at least one of {_any_of(SECTIONS)}")
        )
    if problems:
        raise ParameterError(problems)
    return WorldShapes(
        room=_frozen(room) if room is not None else None,
        obstacles=tuple(_frozen(corners[::-1]) for corners in obstacles),
        circles=_frozen(np.array(circles, dtype=float).reshape(-1, 3)),
    )


def _any_of(names: tuple[str, ...]) -> str:
    return ", ".join(names[:-1]) + " or " + names[-1]


def _frozen(array: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array


def _list(description: Mapping[Any, Any], section: str, problems: WorldProblems) -> list[Any]:
    value = description.get(section)
    if value is None:
        return []
    if isinstance(value, (list, tuple)):
        return list(value)
    problems.append((section, f"expected a list of {section}, got {show(value)}"))
    return []


def _numbers(address: str, value: Any, names: str, problems: WorldProblems) -> list[float] | None:
    """The numbers of a point or circle; None, and a problem, if they are invalid."""
    count = names.count(",") + 1
    right = isinstance(value, (list, tuple)) and len(value) == count
    if right and all(
        isinstance(part, (int, float))
        and not isinstance(part, bool)
        and -math.inf < part < math.inf
        for part in value
    ):
        if max(map(abs, value)) > FARTHEST:
            problems.append((address, f"expected lengths up to {FARTHEST:g} m, got {show(value)}"))
            return None
        return [float(part) for part in value]
    problems.append((address, f"expected {count} numbers [{names}] in m, got {show(value)}"))
    return None


def _circle(address: str, value: Any, problems: WorldProblems) -> list[float]:
    circle = _numbers(address, value, "x, y, r", problems)
    if circle is None:
        return [0.0, 0.0, 0.0]
    if circle[2] <= 0.0:
        problems.append((address, f"expected a radius above 0 m, got {circle[2]:g}"))
    return circle


def _polygon(address: str, value: Any, problems: WorldProblems) -> FloatArray:
    """A polygon's corners, counterclockwise; errors are added to ``problems``."""
    nothing = np.empty((0, 2))
    if not isinstance(value, (list, tuple)):
        message = f"expected a list of corners [x, y], got {show(value)}"
        problems.append((address, message))
        return nothing
    # Shapes are judged only where all numbers are right: one mistake, one message.
    before = len(problems)
    points = [_numbers(f"{address}[{i}]", p, "x, y", problems) for i, p in enumerate(value)]
    if len(problems) > before:
        return nothing
    if len(points) < 3:
        problems.append((address, f"a polygon needs at least 3 corners, got {len(points)}"))
        return nothing
    corners = np.array(points, dtype=float)
    problems += _misdrawn(address, corners)
    # The order of corners is the user's; free space is on the left of every edge from here on.
    area = _doubled_area(corners)
    if len(problems) == before and abs(area) <= 1e-12 * float(np.ptp(corners)) ** 2:
        problems.append((address, "the polygon encloses no area"))
    return corners if area > 0.0 else corners[::-1]


def _misdrawn(address: str, corners: FloatArray) -> WorldProblems:
    """Edges without length; if there are none, edges that cross."""
    n = len(corners)
    edges = np.roll(corners, -1, axis=0) - corners
    same = [
        (
            f"{address}[{(i + 1) % n}]",
            f"the same point as corner {i}; a polygon closes by itself"
            if i + 1 == n
            else f"the same point as corner {i}; an edge needs a length",
        )
        for i in np.flatnonzero(~edges.any(axis=1)).tolist()
    ]
    if same:
        return same
    i, j = np.nonzero(np.triu(_crossings(corners, edges)))
    crossing = zip(i.tolist(), j.tolist(), strict=True)
    return [(address, f"the edges from corners {i} and {j} cross") for i, j in crossing][:1]


def _crossings(corners: FloatArray, edges: FloatArray) -> BoolArray:
    """Which pairs of edges cross at interior points, (n, n)."""
    x, y = corners.T
    side = edges[:, :1] * (y - y[:, None]) - edges[:, 1:] * (x - x[:, None])
    straddles: BoolArray = side * np.roll(side, -1, axis=1) < 0.0
    return np.logical_and(straddles, straddles.T)


def _doubled_area(corners: FloatArray) -> float:
    """Twice the signed area, positive counterclockwise (the shoelace formula)."""
    x, y = (corners - corners[0]).T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
