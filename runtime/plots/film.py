"""A run as an animated gif, or two runs in one: robots on their way, in a room or in the plane.

In: one or several runs. Out: a gif of 100 frames at times evenly spaced over the longest run::

    animate(result, "run.gif")      # 9 s, whatever the length of the run
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from blocks.world import World
from runtime.document import SECOND
from runtime.errors import UsageError
from runtime.files import system_errors
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import map as maps
from runtime.plots import style, titles
from runtime.plots.looks import styled
from runtime.plots.scans import Scene
from runtime.plots.trajectory import draw_paths, equal_scales, robot_size

FRAMES, RATE = 100, 11  # frames, and frames per second: 9 s
DPI, SIDE = 90, 5.0
TRAIL = 2_000  # points at most
PALETTE = 63  # colours of a gif; one more stands for "as in the frame before"
Progress = Callable[[int, int], None]


class _Actor:
    """One robot of a film: its body, and the way that it has come with its contacts.

    Parameters
    ----------
    label : what the legend calls the trail; the i-th robot has the i-th colour.
    radius : of the body (m); size : of a robot without a body.
    """

    def __init__(
        self, axes: Axes, plot: PlotSpec, run: RunData, label: str, i: int, size: float | None
    ) -> None:
        self.pose = _pose(plot, run)
        radius = plot.options.get("body_radius")
        colour = maps.TRAJECTORY if i == 0 and not label else style.COLOURS[i % len(style.COLOURS)]
        (self.trail,) = axes.plot(
            [], [], color=colour, linewidth=1.3, label=label or "trajectory", zorder=2.1
        )
        self.robot = maps.Robot(axes, radius or size, "black" if not label else colour)
        self.touching = maps.touching(plot, run, self.pose)
        self.contacts = maps.mark_contacts(
            axes, self.pose.values[:0, :2], bool(self.touching.any())
        )

    def show(self, t: float) -> None:
        """Show the robot at a time."""
        self.robot.move(maps.row_at(self.pose, t))
        count = int(np.searchsorted(self.pose.t, t + 1e-9, side="right"))
        rows = self.pose.values[:count, :2]
        # Drawing a trail takes time by its points, in each frame again. The last row is added, so
        # that the trail ends at the robot.
        points = rows[:: -(-len(rows) // TRAIL) or 1]
        self.trail.set_data(*np.vstack((points, rows[-1:])).T)
        self.contacts.set_data(*rows[self.touching[:count]].T)


def animated_plot(plots: Sequence[PlotSpec], world: World | None) -> PlotSpec:
    """The plot that is animated: the first of scans, else of a map, else of a trajectory.

    Raises
    ------
    UsageError : there is no such plot.
    """
    for kind in ("scans", "map", "trajectory"):
        for plot in plots:
            if plot.kind == kind and (world is not None or kind == "trajectory"):
                return plot
    message = "nothing to animate: the graph has no plot of kind trajectory, map or scans; add one"
    raise UsageError(f"{message}, as in 'plots: {{path: {{kind: trajectory, of: plant.pose}}}}'")


def animate(
    result: RunData,
    file: str | Path,
    progress: Progress | None = None,
    others: Mapping[str, RunData] | None = None,
) -> Path:
    """Write a run as a gif of about nine seconds.

    Parameters
    ----------
    result : the run, with a plot of kind ``scans``, ``map`` or ``trajectory``; an interrupted run
        is shown up to where it ended.
    file : the file to write; its folder is created if it does not exist.
    progress : called with the number of frames that are done, and of all.
    others : all runs by label, this one first, if several are shown.

    Returns
    -------
    Path : the file.

    Raises
    ------
    UsageError : no such plot, nothing recorded, or the file cannot be written.
    """
    file = Path(file)
    plot = animated_plot(result.plots, result.world)
    runs = dict(others or {"": result})
    for run in runs.values():
        missing = [name for name in plot.of if name not in run.probes]
        if missing and (run is result or _pose_name(plot, result) in missing):
            raise UsageError(f"plot '{plot.name}' shows '{missing[0]}', which was not recorded")
    end = max(style.run_end(run) for run in runs.values())
    times = np.linspace(0.0, end, FRAMES if end > 0.0 else 1).tolist()
    with system_errors(f"write '{file}'"), styled("screen"):
        file.parent.mkdir(parents=True, exist_ok=True)
        _write(plot, runs, file, times, progress)
    return file


def _write(
    plot: PlotSpec,
    runs: Mapping[str, RunData],
    file: Path,
    times: list[float],
    progress: Progress | None,
) -> None:
    """Draw and write frame by frame."""
    figure = Figure(layout="constrained", dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    first = next(iter(runs.values()))
    axes, size = _stage(figure, plot, runs)
    actors = [_Actor(axes, plot, run, n, i, size) for i, (n, run) in enumerate(runs.items())]
    # The scans of two robots in one room could not be told apart.
    scene = Scene(axes, plot, first) if plot.kind == "scans" and len(runs) == 1 else None
    clock = titles.write_title(axes, " ", titles.subtitle(first))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    # The layout is computed once; computing it again would double the cost of a frame.
    canvas.draw()  # type: ignore[no-untyped-call]
    if first.world is None:
        equal_scales(figure, axes)
    figure.set_layout_engine("none")
    speed = _speed(times[-1] * RATE / len(times), first.time_unit)
    frames = []
    for i, t in enumerate(times):
        if progress is not None:
            progress(i, len(times))
        for actor in actors:
            actor.show(t)
        if scene is not None:
            scene.show(t)
        clock.set_text(f"t = {t:5.1f} {first.time_unit}, {speed}")
        frames.append(_frame(figure, canvas))
    _save(frames, file)


def _frame(figure: Figure, canvas: FigureCanvasAgg) -> Image.Image:
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return Image.fromarray(pixels).convert("RGB")


def _save(frames: Sequence[Image.Image], file: Path) -> None:
    """Write frames as a gif; a frame holds what differs from the one before.

    A room of 130 s takes 0.4 MB so, and 1.6 MB with every frame in full.
    """
    # Everything that is ever drawn is on the last frame, except what moves, which is on the first.
    both = Image.new("RGB", (frames[0].width, 2 * frames[0].height))
    both.paste(frames[0])
    both.paste(frames[-1], (0, frames[0].height))
    palette = both.quantize(PALETTE, dither=Image.Dither.NONE)
    # The background is averaged with what is nearly white.
    colours = [255 if c > 250 else c for c in (palette.getpalette() or [])[: 3 * PALETTE]]
    images, before = [], None
    for frame in frames:
        now = np.asarray(frame.quantize(palette=palette, dither=Image.Dither.NONE))
        image = Image.fromarray(now if before is None else np.where(now == before, PALETTE, now))
        image.putpalette([*colours, *([0] * (768 - len(colours)))])
        images.append(image)
        before = now
    images[0].save(
        file,
        "GIF",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / RATE),
        loop=0,
        transparency=PALETTE,
        disposal=1,
        optimize=False,
    )


def _speed(rate: float, unit: str) -> str:
    return f"{rate:.2g} × real time" if unit == SECOND else f"{rate:.2g} {unit} a second"


def _stage(
    figure: Figure, plot: PlotSpec, runs: Mapping[str, RunData]
) -> tuple[Axes, float | None]:
    """The axes of a film without the robots, and the size of a robot that has no body."""
    first = next(iter(runs.values()))
    ways = [_pose(plot, run) for run in runs.values()]
    if first.world is not None:
        xy = np.concatenate([way.values[:, :2] for way in ways])
        return maps.map_axes(figure, plot, first, xy, SIDE, (0.0, 0.6))[0], None
    others = [first.probes[name] for name in plot.of if first.probes[name] is not ways[0]]
    axes = draw_paths(figure, ways, others)
    return axes, robot_size(axes)


def _pose_name(plot: PlotSpec, run: RunData) -> str:
    """The first probe of a plot that holds a pose.

    Raises
    ------
    UsageError : none does.
    """
    for name in plot.of:
        if name in run.probes and run.probes[name].kinds == ("Pose",):
            return name
    raise UsageError(
        f"plot '{plot.name}' has no robot to animate: none of its probes is a Pose; "
        "add one to its 'of', as in 'of: [plant.pose]'"
    )


def _pose(plot: PlotSpec, run: RunData) -> Recording:
    return run.probes[_pose_name(plot, run)]
