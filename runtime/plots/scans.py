"""Scans: what the robot saw and fitted, at a few times in panels, or as an animated gif."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from blocks.world import World
from runtime.errors import UsageError
from runtime.files import system_errors
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import map as maps
from runtime.plots import style, titles

PANELS = 4
HALF_WIDTH = 1.0  # m, from the robot to the edges of a panel
EMPTY = np.empty((0, 2))
FRAMES, RATE = 100, 11  # frames, and frames per second: 9 s
DPI, SIDE = 90, 5.0
TRAIL = 2_000  # points at most


class Scene:
    """Scan, fitted wall, fitted path and robot in an axes, as they were at a time.

    Parameters
    ----------
    axes : what to draw on.
    plot : a plot of kind ``scans``.
    result : the run.
    """

    def __init__(self, axes: Axes, plot: PlotSpec, result: RunData) -> None:
        self.recordings = recordings_by_kind(plot, result)
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
        rows = {kind: maps.row_at(recorded, t) for kind, recorded in self.recordings.items()}
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
        pose = maps.row_at(self.recordings["Pose"], float(scans.t[maps.row_index(scans, t)]))
        return EMPTY if pose is None else maps.scan_points(scan, pose, self.angles)


def recordings_by_kind(plot: PlotSpec, result: RunData) -> Mapping[str, Recording]:
    """The recordings of a plot of scans, by the type of their signal."""
    return {result.probes[name].kinds[0]: result.probes[name] for name in plot.of}


def panel_times(plot: PlotSpec, result: RunData) -> list[float]:
    """The times (s) to show: those of ``at``, else evenly spaced from when following begins."""
    end = style.run_end(result)
    at = plot.options.get("at")
    if at is not None:
        wanted = [float(t) for t in (at if isinstance(at, list) else [at])]
        # A run that was interrupted has only the earlier ones.
        return [t for t in wanted if t <= end] or [end]
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
    pose = Scene(axes, plot, result).show(t)
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


def animated(plots: Sequence[PlotSpec], world: World | None) -> PlotSpec:
    """The plot that is animated: the first of kind ``scans``.

    Parameters
    ----------
    plots : the plots of a graph.
    world : its world.

    Returns
    -------
    PlotSpec : the plot to animate.

    Raises
    ------
    UsageError : there is no such plot, or no world.
    """
    if world is None:
        raise UsageError("nothing to animate: the graph has no world; give it a world: section")
    for plot in plots:
        if plot.kind == "scans":
            return plot
    message = "nothing to animate: the graph has no plot of kind scans; add one, as in "
    raise UsageError(message + "'plots: {scans: {kind: scans, of: [plant.pose, lidar.scan]}}'")


def animate(
    result: RunData, file: str | Path, progress: Callable[[int, int], None] | None = None
) -> Path:
    """Write a run as a gif of about nine seconds.

    Parameters
    ----------
    result : the run, with a world and a plot of kind ``scans``; an interrupted run is shown up to
        where it ended.
    file : the file to write; its folder is created if it does not exist.
    progress : called with the number of frames that are done, and of all.

    Returns
    -------
    Path : the file.

    Raises
    ------
    UsageError : no world, no such plot, nothing recorded, or the file cannot be written.
    """
    file = Path(file)
    plot = animated(result.plots, result.world)
    missing = [name for name in plot.of if name not in result.probes]
    if missing:
        raise UsageError(f"plot '{plot.name}' shows '{missing[0]}', which was not recorded")
    end = style.run_end(result)
    times = np.linspace(0.0, end, FRAMES if end > 0.0 else 1).tolist()
    with system_errors(f"write '{file}'"), matplotlib.rc_context(style.STYLE):
        file.parent.mkdir(parents=True, exist_ok=True)
        _write(plot, result, file, times, progress)
    return file


def _write(
    plot: PlotSpec,
    result: RunData,
    file: Path,
    times: list[float],
    progress: Callable[[int, int], None] | None,
) -> None:
    """Draw and write frame by frame."""
    figure = Figure(layout="constrained", dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    axes = _world_axes(figure, plot, result)
    (trail,) = axes.plot(
        [], [], color=maps.TRAJECTORY, linewidth=1.3, label="trajectory", zorder=2.1
    )
    scene = Scene(axes, plot, result)
    clock = titles.write_title(axes, " ", titles.subtitle(result))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    # The layout is computed once; computing it again would double the cost of a frame.
    canvas.draw()  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")
    writer = PillowWriter(fps=RATE)
    robot = scene.recordings["Pose"]
    speed = times[-1] * RATE / len(times)
    with writer.saving(figure, str(file), DPI):
        for i, t in enumerate(times):
            if progress is not None:
                progress(i, len(times))
            scene.show(t)
            trail.set_data(*_trail(robot, t).T)
            clock.set_text(f"t = {t:5.1f} s, {speed:.2g} × real time")
            writer.grab_frame()


def _world_axes(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """The axes of an animation: the world without the robot."""
    xy = recordings_by_kind(plot, result)["Pose"].values[:, :2]
    axes, _ = maps.map_axes(figure, plot, result, xy, SIDE, (0.0, 0.6))
    return axes


def _trail(robot: Recording, t: float) -> FloatArray:
    """The trajectory up to time ``t``, of at most :data:`TRAIL` points."""
    rows = robot.values[: int(np.searchsorted(robot.t, t + 1e-9, side="right")), :2]
    thinned = rows[:: -(-len(rows) // TRAIL) or 1]
    return np.vstack((thinned, rows[-1:]))
