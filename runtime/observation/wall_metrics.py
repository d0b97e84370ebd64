"""Metrics of wall following: the distance error of a pose in the graph's world.

In: the world and the recorded positions (rows, 2) in m. Out: one number, as the mean of
|distance to the nearest wall - 0.5 m| from when the robot first is at 0.5 m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from blocks.core import FloatArray, IntArray, Options, param
from blocks.world import World
from runtime.observation.metric_kinds import ANY, POSITIVE, MetricKind, MetricOptions

REACHED = 0.02  # m; so near to the contour counts as on it
CLEAR = 0.1  # m; of a cylinder's offset circle from all other offsets
NEAR = 0.4  # m; a robot farther from the offset circle follows another wall


def since_reached(world: World, xy: FloatArray, d: float) -> FloatArray:
    """The positions (k, 2) from the first one that is on the contour at distance ``d``.

    On it means within 2 cm, or within twice the smallest error of a robot that stays farther away,
    so that its error counts. A robot that never comes within ``d`` has no such position.
    """
    error = np.abs(world.distance(xy) - d)
    best = float(error.min(initial=math.inf))
    return xy[int(np.argmax(error <= max(REACHED, 2.0 * best))) :] if best <= d else xy[:0]


def distance_mae(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """Mean of |distance to the nearest surface - d| (m), from when the contour is reached."""
    d = float(options["distance"])
    return _mean(np.abs(world.distance(since_reached(world, xy, d)) - d))


def distance_mae_reachable(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """The same, without the positions within a turning radius of a kink of the contour."""
    d = float(options["distance"])
    positions = since_reached(world, xy, d)
    fair = positions[world.reachable(positions, d, float(options["turning_radius"]))]
    return _mean(np.abs(world.distance(fair) - d))


def distance_mae_cylinders(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """Mean of |distance to a cylinder - d| (m), where the robot's projection onto the cylinder's
    offset circle is clear of everything else's offset by 10 cm.

    The projection decides which surface counts, not the nearest one: otherwise a robot that has
    strayed to another surface would not count.
    """
    d = float(options["distance"])
    positions = since_reached(world, xy, d)
    errors = [np.zeros(0)]
    for i, (x, y, r) in enumerate(world.circles.tolist()):
        offset = positions - (x, y)
        away = np.hypot(offset[:, 0], offset[:, 1])
        projected = (x, y) + offset * ((r + d) / np.maximum(away, 1e-12))[:, None]
        others = _others(world, i)
        error = np.abs(away - r - d)
        here = error < NEAR
        if others is not None:
            here &= others.distance(projected) >= d + CLEAR
        errors.append(error[here])
    return _mean(np.concatenate(errors))


def loops(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """Turns around the closed contour that was reached first."""
    positions, contour = first_loop(world, xy, float(options["distance"]))
    if len(positions) < 2:
        return 0.0
    nearest, _ = _on_loop(contour, positions)
    n = len(contour)
    # The shorter way around: past the contour's first point a step is 1, not 1 - n.
    steps = (np.diff(nearest) + n // 2) % n - n // 2
    return float(steps.sum() / n)


def strayed(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """Largest distance (m) from the closed contour that was reached first, from then on."""
    positions, contour = first_loop(world, xy, float(options["distance"]))
    return float(_on_loop(contour, positions)[1].max()) if len(positions) else math.nan


def distance_floor(world: World, xy: FloatArray, options: Mapping[str, Any]) -> float:
    """The smallest possible mean error (m) of a robot with that turning radius."""
    start = (float(xy[-1, 0]), float(xy[-1, 1])) if len(xy) else None
    return world.kink_floor(float(options["distance"]), float(options["turning_radius"]), start)


def first_loop(world: World, xy: FloatArray, d: float) -> tuple[FloatArray, FloatArray]:
    """The positions since the contour was reached, and the closed contour (k, 2) they are on."""
    positions = since_reached(world, xy, d)
    contours = world.offset_contour(d)
    if not len(positions) or not contours:
        return xy[:0], xy[:0]
    # A contour's last point is its first one again.
    return positions, min(contours, key=lambda c: np.hypot(*(c - positions[0]).T).min())[:-1]


def _on_loop(contour: FloatArray, positions: FloatArray) -> tuple[IntArray, FloatArray]:
    """The nearest point of a closed contour to each position, and its distance (m): (m,) both."""
    from scipy.spatial import cKDTree  # scipy would slow the start-up

    away, nearest = cKDTree(contour).query(positions)
    return np.asarray(nearest, dtype=np.intp), np.asarray(away)


def _others(world: World, i: int) -> World | None:
    """The world without one of its circles; None if it is then empty."""
    rest = dict(world.description)
    rest["circles"] = [circle for k, circle in enumerate(rest.get("circles", [])) if k != i]
    description = {key: value for key, value in rest.items() if value}
    return World(description) if description else None


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else math.nan


class DistanceOptions(MetricOptions):
    """The distance to keep."""

    distance: float = param(unit="m", above=0.0, doc="the distance from the walls to keep")


class TurningOptions(DistanceOptions):
    """The distance to keep, and the robot's smallest turning radius."""

    turning_radius: float = param(unit="m", above=0.0, doc="the robot's smallest turning radius")


def _kind(
    formula: Callable[[World, FloatArray, Mapping[str, Any]], float],
    doc: str,
    options: type[Options] = DistanceOptions,
    optional: tuple[str, ...] = ("engaged",),
    unit: str = "m",
    ends: tuple[float, float] = POSITIVE,
) -> MetricKind:
    return MetricKind(
        lambda series, options: None,
        doc,
        options,
        optional=optional,
        forms=("position",),
        in_world=formula,
        unit=unit,
        ends=ends,
    )


WALL_KINDS: Mapping[str, MetricKind] = {
    "distance_mae": _kind(
        distance_mae,
        "mean of abs(distance to the nearest surface - `distance`) (m), from when the contour is "
        "first reached (within 2 cm, or twice the smallest error of a robot that stays farther "
        "away)",
    ),
    "distance_mae_cylinders": _kind(
        distance_mae_cylinders,
        "the same where the robot is along a circle, clear of everything else by 10 cm",
    ),
    "distance_mae_reachable": _kind(
        distance_mae_reachable,
        "the same without the positions within `turning_radius` of a kink of the contour",
        TurningOptions,
    ),
    "distance_floor": _kind(
        distance_floor,
        "the smallest possible mean error of a robot with that `turning_radius` (m)",
        TurningOptions,
        optional=(),
    ),
    "strayed": _kind(
        strayed, "largest distance (m) from the contour that was reached first, from then on"
    ),
    "loops": _kind(
        loops,
        "turns around the contour that was reached first; negative with the wall on the left",
        unit="",
        ends=ANY,
    ),
}
