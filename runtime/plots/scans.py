"""Scans: what the robot saw around it, what was fitted to it, and where that leads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style, walls

PANELS = 4
AROUND = 1.0  # m, from the robot to the edges of a panel
EMPTY = np.empty((0, 2))


class Scene:
    """Scan, fitted wall, fitted path and robot in an axes, moved from moment to moment.

    Parameters
    ----------
    axes : what to draw on.
    plot : a plot of kind ``scans``.
    result : the run.
    """

    def __init__(self, axes: Axes, plot: PlotSpec, result: RunData) -> None:
        self.roles = roles(plot, result)
        low, high = plot.options.get("angles", (-math.pi, math.pi))
        self.angles = (float(low), float(high))
        self.lines: dict[str, Line2D] = {}
        for kind, label, how in (
            ("Scan", "scan", {"linestyle": "none", "marker": ".", "color": walls.SCANNED}),
            ("PointCloud", "fitted wall", {"color": walls.FITTED, "linewidth": 2.0}),
            ("Path", "reference path", {"color": style.COLOURS[0], "linewidth": 1.5}),
        ):
            if kind in self.roles:
                order = 2.2 + 0.2 * len(self.lines)
                look: dict[str, Any] = {"markersize": 4.0, "markeredgewidth": 0.0, **how}
                (self.lines[kind],) = axes.plot([], [], **look, label=label, zorder=order)
        self.robot = walls.Robot(axes, plot.options.get("body_radius"))

    def show(self, t: float) -> FloatArray | None:
        """Move everything to what was known at time ``t``; returns the robot's pose."""
        rows = {kind: walls.row_at(recorded, t) for kind, recorded in self.roles.items()}
        pose = rows["Pose"]
        self.robot.put(pose)
        for kind, line in self.lines.items():
            row = rows[kind]
            if row is None:
                continue
            points = row[:, :2] if row.ndim == 2 else EMPTY
            if kind == "Scan":
                points = self._scan(row, t)
            elif kind == "PointCloud":
                points = walls.broken(points)
            line.set_data(*points.T)
        return pose

    def _scan(self, scan: FloatArray, t: float) -> FloatArray:
        """Where the beams ended, from where the robot was when it scanned."""
        taken = self.roles["Scan"]
        pose = walls.row_at(self.roles["Pose"], float(taken.t[walls.seen(taken, t)]))
        return EMPTY if pose is None else walls.scan_points(scan, pose, self.angles)


def roles(plot: PlotSpec, result: RunData) -> Mapping[str, Recording]:
    """The recordings of a plot of scans, by the kind of their signal."""
    return {result.probes[name].kinds[0]: result.probes[name] for name in plot.of}


def moments(plot: PlotSpec, result: RunData) -> list[float]:
    """The times (s) to show: those of ``at``, else some evenly spread over the following."""
    end = style.run_end(result)
    at = plot.options.get("at")
    if at is not None:
        wanted = [float(t) for t in (at if isinstance(at, list) else [at])]
        # Of a run that broke off: what it came to.
        return [t for t in wanted if t <= end] or [end]
    since = walls.engagement(plot, result) or 0.0
    return [since + (end - since) * (i + 0.5) / PANELS for i in range(PANELS)]


def draw_scans(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw what the robot saw and fitted at a few moments, a panel each.

    Parameters
    ----------
    figure : what to draw on.
    plot : its options: ``at`` (s), by default four moments after ``engaged``; ``distance``;
        ``angles`` of the scan's first and last beam.
    result : the run, with its world.

    Returns
    -------
    Axes : the first panel.

    Raises
    ------
    UsageError : the run has no world.
    """
    walls.world_of(plot, result)
    times = moments(plot, result)
    columns = min(len(times), 2 if len(times) <= 4 else 3)
    rows = -(-len(times) // columns)
    side = style.WIDTH / max(2, columns)
    figure.set_size_inches(side * columns, side * rows + 0.8)
    grid = figure.subplots(rows, columns, squeeze=False)
    panels: list[Axes] = list(grid.flat)
    for axes, t in zip(panels, times, strict=False):
        _panel(axes, plot, result, t)
    for axes in panels[len(times) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    for axes in grid[:, 0]:
        axes.set_ylabel("y [m]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return panels[0]


def _panel(axes: Axes, plot: PlotSpec, result: RunData, t: float) -> None:
    """One moment, with the robot in the middle."""
    world = walls.world_of(plot, result)
    walls.draw_world(axes, world)
    walls.draw_contour(axes, world, plot)
    pose = Scene(axes, plot, result).show(t)
    x, y = (0.0, 0.0) if pose is None else pose[:2].tolist()
    axes.set(xlim=(x - AROUND, x + AROUND), ylim=(y - AROUND, y + AROUND))
    axes.set_aspect("equal")
    axes.locator_params(nbins=5)
    box: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 2.0}
    where = axes.transAxes
    axes.text(0.03, 0.96, f"t = {t:.1f} s", transform=where, va="top", bbox=box, zorder=6.0)
