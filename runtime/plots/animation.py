"""Animations: the robot, what it saw and what it fitted, as a gif."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from blocks.core import FloatArray
from blocks.world import World
from runtime.errors import UsageError
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style, walls
from runtime.plots.scans import Scene

FRAMES, RATE = 100, 11  # frames, and frames per second: 9 s
DPI, SIDE = 90, 5.0
TRAIL = 2_000  # points at most


def animated(plots: Sequence[PlotSpec], world: World | None) -> PlotSpec:
    """The plot that an animation shows over time: the first of kind ``scans``.

    Parameters
    ----------
    plots : those of the graph.
    world : its walls.

    Returns
    -------
    PlotSpec : what to animate.

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


def animate(result: RunData, file: str | Path) -> Path:
    """Write a run as a gif of about nine seconds.

    Parameters
    ----------
    result : the run, with a world and a plot of kind ``scans``; a run that broke off is shown as
        far as it came.
    file : what to write; its folder is made if it is not there.

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
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with matplotlib.rc_context(style.STYLE):
            _write(plot, result, file, np.linspace(0.0, end, FRAMES if end > 0.0 else 1).tolist())
    except OSError as error:
        raise UsageError(f"cannot write '{file}': {error.strerror or error}") from None
    return file


def _write(plot: PlotSpec, result: RunData, file: Path, times: list[float]) -> None:
    """Draw and write frame by frame."""
    figure = Figure(layout="constrained", dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    axes = _stage(figure, plot, result)
    (trail,) = axes.plot([], [], color=walls.WAY, linewidth=1.3, label="trajectory", zorder=2.1)
    scene = Scene(axes, plot, result)
    clock = axes.set_title(" ", loc="right", fontweight="normal", fontsize=9.0)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    # Everything keeps its place from here on; laying out anew would double the cost of a frame.
    canvas.draw()  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")
    writer = PillowWriter(fps=RATE)
    robot = scene.roles["Pose"]
    with writer.saving(figure, str(file), DPI):
        for t in times:
            scene.show(t)
            trail.set_data(*_gone(robot, t).T)
            clock.set_text(f"t = {t:5.1f} s")
            writer.grab_frame()


def _stage(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """The world without the robot."""
    world = walls.world_of(plot, result)
    robot = result.probes[next(n for n in plot.of if result.probes[n].kinds[0] == "Pose")]
    low, high = walls.view(world, np.concatenate((np.zeros((0, 2)), robot.values[:, :2])))
    ratio = min(2.2, max(0.6, float((high[0] - low[0]) / (high[1] - low[1]))))
    figure.set_size_inches(SIDE * math.sqrt(ratio), SIDE / math.sqrt(ratio) + 0.6)
    axes = figure.subplots()
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal")
    axes.set_title(style.subtitle(result), fontsize=9.0)
    walls.draw_world(axes, world)
    walls.draw_contour(axes, world, plot)
    return axes


def _gone(robot: Recording, t: float) -> FloatArray:
    """The way up to a time."""
    rows = robot.values[: int(np.searchsorted(robot.t, t + 1e-9, side="right")), :2]
    thinned = rows[:: -(-len(rows) // TRAIL) or 1]
    return np.vstack((thinned, rows[-1:]))
