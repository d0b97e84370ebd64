"""Maps: a room, and how the robot went in it (the paper's Fig. 6); and its distance to walls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from blocks.world import World
from runtime.observation import PlotSpec, Recording, RunData, since_reached
from runtime.plots import style, walls

SIDE = 4.2  # inches, of the square that has the map's area
FLATTEST, TALLEST = 2.2, 0.6


def draw_map(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw the world, the way of the plot's first pose in it, and the others as points.

    Parameters
    ----------
    figure : what to draw on.
    plot : its options: ``distance`` adds the contour that far from the walls, ``engaged`` names
        the probe that rises above 0.5 when following begins; points are shown from then on.
    result : the run, with its world.

    Returns
    -------
    Axes : the only one.

    Raises
    ------
    UsageError : the run has no world.
    """
    world = walls.world_of(plot, result)
    robot, *others = (result.probes[name] for name in plot.of)
    low, high = walls.view(world, np.concatenate((np.zeros((0, 2)), robot.values[:, :2])))
    ratio = min(FLATTEST, max(TALLEST, float((high[0] - low[0]) / (high[1] - low[1]))))
    width = SIDE * math.sqrt(ratio)
    figure.set_size_inches(width + 2.2, width / ratio + 1.0)
    axes = style.stack(figure, 1)[0]
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", anchor="W")
    walls.draw_world(axes, world)
    handles = walls.draw_contour(axes, world, plot)
    since = walls.engagement(plot, result)
    never = math.inf if plot.options.get("engaged") in result.probes else 0.0
    handles += _points(axes, others, never if since is None else since)
    handles += _way(axes, robot, since)
    if len(robot.t):
        body = walls.Robot(axes, plot.options.get("body_radius"))
        body.put(robot.values[-1])
        handles.append(_dot(axes, np.full(2, np.nan), "robot at the end", "white", "black"))
    figure.legend(handles=handles, loc="outside right upper")
    return axes


def _points(axes: Axes, recordings: list[Recording], since: float) -> list[Line2D]:
    """Poses as small dots, from a time on."""
    handles = []
    for recorded in recordings:
        xy = recorded.values[recorded.t >= since - 1e-9, :2]
        how: dict[str, Any] = {"linestyle": "none", "marker": ".", "color": walls.REFERENCE}
        how |= {"markeredgewidth": 0.0, "label": style.short_labels([recorded.name])[0]}
        axes.plot(*xy.T, **how, markersize=3.0, zorder=2.4)
        # At their size in the map, points would be lost in the legend.
        handles.append(Line2D([], [], **how, markersize=7.0))
    return handles


def _way(axes: Axes, robot: Recording, since: float | None) -> list[Line2D]:
    """The way gone, and the paper's dots on it."""
    xy = robot.values[:, :2]
    handles = axes.plot(*xy.T, color=walls.WAY, linewidth=1.3, label="trajectory", zorder=2.6)
    if len(xy):
        handles.append(_dot(axes, xy[0], "start", walls.START))
    if since is not None:
        place = walls.row_at(robot, since)
        if place is not None:
            handles.append(_dot(axes, place[:2], "following begins", walls.FOLLOWING))
    return handles


def _dot(axes: Axes, xy: FloatArray, label: str, colour: str, edge: str = "white") -> Line2D:
    (dot,) = axes.plot(
        *xy[:, None],
        linestyle="none",
        marker="o",
        markersize=7.5,
        markerfacecolor=colour,
        markeredgecolor=edge,
        markeredgewidth=0.8,
        label=label,
        zorder=4.5,
    )
    return dot


def draw_wall_distance(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw how much farther than ``distance`` the nearest wall was, over time.

    Parameters
    ----------
    figure : what to draw on.
    plot : its options: ``distance`` (m), and ``engaged`` as for a map.
    result : the run, with its world.

    Returns
    -------
    Axes : the only one.

    Raises
    ------
    UsageError : the run has no world.
    """
    world = walls.world_of(plot, result)
    d = float(plot.options["distance"])
    recorded = result.probes[plot.of[0]]
    figure.set_size_inches(style.WIDTH, 2.9)
    axes = style.stack(figure, 1)[0]
    axes.set_ylabel("distance to wall\nminus reference [mm]")
    style.time_axis([axes], [recorded], style.run_end(result))
    xy = recorded.values[:, :2]
    if not len(xy):
        style.say(axes)
        return axes
    error = 1e3 * (np.abs(world.distance(xy)) - d)
    axes.axhline(0.0, color="0.4", linewidth=0.8, linestyle=(0, (4, 2.5)), zorder=1.5)
    axes.plot(recorded.t, error, color=walls.WAY, label="error", zorder=2.5)
    since = walls.engagement(plot, result)
    following = recorded.t >= (since or 0.0) - 1e-9
    _limit(axes, world, xy[following], error[following], d)
    _shade(axes, world, xy, recorded.t, since or 0.0)
    if since is not None:
        axes.axvline(
            since, color=walls.FOLLOWING, linewidth=1.0, linestyle=":", label="following begins"
        )
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return axes


def _limit(axes: Axes, world: World, xy: FloatArray, error: FloatArray, d: float) -> None:
    """Let the axis hold what came after the contour was reached; exploring is metres away."""
    reached = len(since_reached(world, xy, d))
    if not reached:
        return
    late = error[-reached:]
    low, high = min(0.0, float(late.min())), max(0.0, float(late.max()))
    margin = 0.08 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
    message = (
        f"mean of its absolute value since the contour was reached: {np.abs(late).mean():.1f} mm"
    )
    style.note(axes, message)


def _shade(axes: Axes, world: World, xy: FloatArray, t: FloatArray, since: float) -> None:
    """Shade when the nearest surface was a circle: there the robot has to turn."""
    if not len(world.circles):
        return
    x, y, r = world.circles.T
    away = (np.hypot(xy[:, :1] - x, xy[:, 1:] - y) - r).min(axis=1)
    beside = (away <= np.abs(world.distance(xy)) + 1e-9) & (t >= since)
    axes.fill_between(
        t,
        *(0.0, 1.0),
        where=beside.tolist(),
        step="post",
        transform=axes.get_xaxis_transform(),
        color="0.9",
        linewidth=0.0,
        label="nearest is a cylinder",
        zorder=0.5,
    )
