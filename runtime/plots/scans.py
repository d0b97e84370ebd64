"""Scans: what the robot saw and fitted, at a few times in panels.

In: a plot of kind ``scans`` with probes of a scan, a point cloud, a path and the pose. Out: four
panels of 2 m by 2 m with the robot in the middle, at the times ``at: [2.0, 4.5]`` or evenly spaced.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from runtime.observation import PlotSpec, RunData
from runtime.plots import map as maps
from runtime.plots import style

PANELS = 4
HALF_WIDTH = 1.0  # m, from the robot to the edges of a panel
EMPTY = np.empty((0, 2))


class Scene:
    """Scan, fitted wall, fitted path and robot in an axes, as they were at a time.

    Parameters
    ----------
    axes : what to draw on.
    plot : a plot of kind ``scans``.
    result : the run.
    """

    def __init__(self, axes: Axes, plot: PlotSpec, result: RunData) -> None:
        self.recordings = {result.probes[name].kinds[0]: result.probes[name] for name in plot.of}
        low, high = plot.options.get("angles", (-math.pi, math.pi))
        self.angles = (float(low), float(high))
        self.lines: dict[str, Line2D] = {}
        for kind, label, how in (
            ("Scan", "scan", {"linestyle": "none", "marker": ".", "color": maps.SCANNED}),
            ("PointCloud", "fitted wall", {"color": maps.FITTED, "linewidth": 2.0}),
            ("Path", "reference path", {"color": style.COLOURS[0], "linewidth": 1.5}),
        ):
            if kind in self.recordings:
                order = 2.2 + 0.2 * len(self.lines)
                look: dict[str, Any] = {"markersize": 4.0, "markeredgewidth": 0.0, **how}
                (self.lines[kind],) = axes.plot([], [], **look, label=label, zorder=order)
        self.robot = maps.Robot(axes, plot.options.get("body_radius"))

    def show(self, t: float) -> FloatArray | None:
        """Show the last values up to time ``t``; returns the robot's pose."""
        rows = {kind: maps.row_at(recording, t) for kind, recording in self.recordings.items()}
        pose = rows["Pose"]
        self.robot.move(pose)
        for kind, line in self.lines.items():
            row = rows[kind]
            if row is None:
                continue
            points = row[:, :2] if row.ndim == 2 else EMPTY
            if kind == "Scan":
                points = self._scan(row, t)
            elif kind == "PointCloud":
                points = maps.split_curves(points)
            line.set_data(*points.T)
        return pose

    def _scan(self, scan: FloatArray, t: float) -> FloatArray:
        """The end points of the beams, from the pose at the time of the scan."""
        scans = self.recordings["Scan"]
        # The robot has moved since its last scan, by some centimetres at 10 Hz: from its present
        # pose, the beams would end beside the walls.
        pose = maps.row_at(self.recordings["Pose"], float(scans.t[maps.row_index(scans, t)]))
        return EMPTY if pose is None else maps.scan_points(scan, pose, self.angles)


def panel_times(plot: PlotSpec, result: RunData) -> list[float]:
    """The times (s) to show: those of ``at``, else evenly spaced from when following begins."""
    end = style.run_end(result)
    at = plot.options.get("at")
    if at is not None:
        times = [float(t) for t in (at if isinstance(at, list) else [at])]
        # A run that was interrupted has only the earlier ones.
        return [t for t in times if t <= end] or [end]
    since = maps.engagement_time(plot, result) or 0.0
    return [since + (end - since) * (i + 0.5) / PANELS for i in range(PANELS)]


def draw_scans(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw what the robot saw and fitted at a few times, one panel each.

    Parameters
    ----------
    figure : what to draw on.
    plot : its options: ``at`` (s), by default four times after ``engaged``; ``distance``;
        ``angles`` of the scan's first and last beam.
    result : the run, with its world.

    Returns
    -------
    Axes : the first panel.

    Raises
    ------
    UsageError : the run has no world.
    """
    maps.world_of(plot, result)
    times = panel_times(plot, result)
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
    """Draw one time, with the robot in the middle."""
    world = maps.world_of(plot, result)
    maps.draw_world(axes, world)
    maps.draw_contour(axes, world, plot)
    scene = Scene(axes, plot, result)
    pose = scene.show(t)
    maps.draw_contacts(axes, plot, result, scene.recordings["Pose"], until=t)
    x, y = (0.0, 0.0) if pose is None else pose[:2].tolist()
    axes.set(xlim=(x - HALF_WIDTH, x + HALF_WIDTH), ylim=(y - HALF_WIDTH, y + HALF_WIDTH))
    axes.set_aspect("equal")
    axes.locator_params(nbins=5)
    box: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 2.0}
    where = axes.transAxes
    axes.text(
        0.03,
        0.96,
        f"t = {t:.1f} {result.time_unit}",
        transform=where,
        va="top",
        bbox=box,
        zorder=6.0,
    )
