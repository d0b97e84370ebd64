"""Maps: a world with the robot's trajectory in it (the paper's Fig. 6), and its wall distance.

In: a plot of kind ``map`` or ``wall_distance``, and a run with a world. Out: axes in metres, of one
scale, or the error over time in millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path

from blocks.core import BoolArray, FloatArray
from blocks.world import World
from runtime.errors import UsageError
from runtime.observation import PlotSpec, Recording, RunData, since_reached
from runtime.plots import style
from runtime.plots.style import COLOURS

SIDE = 4.2  # inches, of the square that has the map's area
FLATTEST, TALLEST = 2.2, 0.6  # width over height of the axes
SOLID, OUTLINE = "0.88", "0.25"
START, FOLLOWING, TRAJECTORY = "#D62728", "#1F4FD8", COLOURS[2]
REFERENCE, SCANNED, FITTED = COLOURS[4], "0.55", COLOURS[3]
CONTOUR: dict[str, Any] = {"color": "0.3", "linewidth": 0.8, "linestyle": (0, (4, 2.5))}
OUTSIDE = 100.0  # m: how far the solid around a room is drawn
MARGIN, OPEN_MARGIN = 0.03, 0.12  # of the longer side, in a room and without one
CONTACT = "Contact"  # the kind of the recording of positions at which a robot touched something
GAP = 4.0  # times the median distance of fitted points: a larger one separates two walls


def world_of(plot: PlotSpec, result: RunData) -> World:
    """The world that a plot needs.

    Raises
    ------
    UsageError : the run has no world.
    """
    if result.world is None:
        message = f"plot '{plot.name}' needs a world, as in 'world: worlds/paper_room.yaml'"
        raise UsageError(message)
    return result.world


def engagement_time(plot: PlotSpec, result: RunData) -> float | None:
    """When following began (s); None if never, or if the plot has no ``engaged`` option."""
    recording = result.probes.get(str(plot.options.get("engaged")))
    if recording is None:
        return None
    over = recording.values.reshape(-1) > 0.5
    return float(recording.t[over.argmax()]) if over.any() else None


def row_at(recording: Recording, t: float) -> FloatArray | None:
    """A probe's last row up to time ``t``; None if nothing was recorded."""
    if not len(recording.t):
        return None
    values: FloatArray = recording.values[row_index(recording, t)]
    return values


def row_index(recording: Recording, t: float) -> int:
    """The index of the last row up to time ``t``, or the first row; there must be rows."""
    return max(0, int(np.searchsorted(recording.t, t + 1e-9, side="right")) - 1)


def view_limits(world: World, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner of a view of all walls and the positions ``xy``."""
    if world.room is not None:
        low, high = world.room.min(axis=0), world.room.max(axis=0)
    else:
        low, high = world.extent(xy[np.isfinite(xy).all(axis=1)])
    margin = (OPEN_MARGIN if world.room is None else MARGIN) * float((high - low).max())
    return low - margin, high + margin


def draw_world(axes: Axes, world: World) -> None:
    """Fill the solid regions of a world and draw their outlines."""
    shapes = [_polygon(corners) for corners in world.obstacles]
    shapes += [Path.circle((x, y), r) for x, y, r in world.circles.tolist()]
    if world.room is not None:
        low, high = world.room.min(axis=0) - OUTSIDE, world.room.max(axis=0) + OUTSIDE
        # The room is a hole in a large solid: matplotlib fills what lies between two outlines of
        # opposite direction, so the frame runs clockwise and the room counterclockwise.
        frame = np.array([low, (low[0], high[1]), high, (high[0], low[1])])
        shapes.append(Path.make_compound_path(_polygon(frame), _polygon(world.room)))
    for shape in shapes:
        # Outlines are below all fillings, so that none is visible inside another solid.
        axes.add_patch(PathPatch(shape, fill=False, edgecolor=OUTLINE, linewidth=2.0, zorder=1.2))
        axes.add_patch(PathPatch(shape, facecolor=SOLID, edgecolor="none", zorder=1.3))
    axes.grid(False)
    axes.spines[["top", "right"]].set_visible(True)


def _polygon(corners: FloatArray) -> Path:
    return Path(np.vstack((corners, corners[:1])), closed=True)


def draw_contour(axes: Axes, world: World, plot: PlotSpec) -> list[Line2D]:
    """Draw the contour at the plot's ``distance`` from the walls, if it has that option."""
    distance = plot.options.get("distance")
    if distance is None:
        return []
    contours = world.offset_contour(float(distance))
    if not contours:
        return []
    # One line for all contours, so that the legend has one entry; NaN separates them.
    rows = np.vstack([np.vstack((contour, [[np.nan, np.nan]])) for contour in contours])
    label = f"{1e3 * distance:.4g} mm from walls"
    return axes.plot(*rows.T, **CONTOUR, label=label, zorder=2.5)


def touching(plot: PlotSpec, result: RunData, pose: Recording) -> BoolArray:
    """Whether the robot's body touched a surface at each row of its pose (rows,).

    False where there is no world, or the plot does not know the robot's radius.
    """
    radius = plot.options.get("body_radius")
    if result.world is None or radius is None or not len(pose.t):
        return np.zeros(len(pose.t), dtype=bool)
    return result.world.touched(pose.values[:, :2], float(radius))


def contacts(plot: PlotSpec, runs: Sequence[RunData]) -> list[Recording]:
    """The positions at which the robots of some runs touched a surface, as one recording."""
    positions = [
        run.probes[name].values[touching(plot, run, run.probes[name]), :2]
        for run in runs
        for name in plot.of
        if name in run.probes and run.probes[name].kinds == ("Pose",)
    ]
    xy = np.concatenate(positions) if positions else np.empty((0, 2))
    # A recording like those of probes, so that a trajectory draws it without knowing about worlds.
    labels, t = ("contact.x", "contact.y"), np.arange(float(len(xy)))
    span = {"contact": (0, 2)}
    return [Recording("contact", t, xy, labels, ("m", "m"), (CONTACT,), span)] if len(xy) else []


def draw_contacts(
    axes: Axes, plot: PlotSpec, result: RunData, pose: Recording, until: float = math.inf
) -> list[Line2D]:
    """Mark where a robot touched a surface; returns the entry of the legend, if it did."""
    mask = touching(plot, result, pose) & (pose.t <= until + 1e-9)
    return [mark_contacts(axes, pose.values[mask, :2])] if mask.any() else []


def mark_contacts(axes: Axes, xy: FloatArray, is_named: bool = True) -> Line2D:
    """Dots at positions (n, 2), a thick line where they follow each other along a wall.

    ``is_named`` gives them an entry in the legend.
    """
    (marks,) = axes.plot(
        *xy.T,
        linestyle="none",
        marker="o",
        markersize=5.0,
        markeredgewidth=0.0,
        color="black",
        label="contact" if is_named else "_contact",
        zorder=2.8,
    )
    return marks


class Robot:
    """A robot in an axes: a circle for its body and a line for its heading.

    Parameters
    ----------
    axes : what to draw on.
    radius : of the body (m); None for a dot with a short line.
    colour : of its outline.
    """

    def __init__(self, axes: Axes, radius: float | None, colour: str = "black") -> None:
        self.radius = radius or 0.08
        how: dict[str, Any] = {"facecolor": (1.0, 1.0, 1.0, 0.6), "edgecolor": colour}
        size = radius or 0.03
        self.body = Circle((np.nan, np.nan), size, **how, zorder=4.0, gid="robot")
        axes.add_patch(self.body)
        (self.heading,) = axes.plot([], [], color=colour, linewidth=1.4, zorder=4.1)

    def move(self, pose: FloatArray | None) -> None:
        """Move the robot to a pose; None or a pose that is not finite is ignored."""
        if pose is None or not np.isfinite(pose[:3]).all():
            return
        x, y, theta = (float(value) for value in pose[:3])
        self.body.set_center((x, y))
        ahead = (x + self.radius * np.cos(theta), y + self.radius * np.sin(theta))
        self.heading.set_data([x, ahead[0]], [y, ahead[1]])


def scan_points(scan: FloatArray, pose: FloatArray, angles: tuple[float, float]) -> FloatArray:
    """The end points of a scan's beams (m), (m, 2); beams without a hit are omitted.

    Parameters
    ----------
    scan : ranges (m), (n,); the i-th beam points to angles[0] + i (angles[1] - angles[0]) / n.
    pose : x, y, theta of the robot when it scanned.
    angles : bearing of the first beam, and of the beam after the last one (rad).
    """
    bearings = np.linspace(*angles, len(scan), endpoint=False) + pose[2]
    # Infinity is a beam without a hit, and NaN a beam that was not measured.
    hit = np.isfinite(scan)
    directions = np.column_stack((np.cos(bearings[hit]), np.sin(bearings[hit])))
    ends: FloatArray = pose[:2] + scan[hit, None] * directions
    return ends


def split_curves(points: FloatArray) -> FloatArray:
    """Points of several curves in a row, with a row of NaN between two curves."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    # The median, which a few gaps do not move: a mean would grow with the gaps that it has to find.
    typical = float(np.median(steps)) if len(steps) else 0.0
    if typical == 0.0:
        return points
    return np.insert(points, np.flatnonzero(steps > GAP * typical) + 1, np.nan, axis=0)


def draw_map(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw the world, the trajectory of the plot's first pose, and its other poses as points.

    Parameters
    ----------
    figure : what to draw on.
    plot : its option ``distance`` adds the contour at that distance from the walls; ``engaged``
        names the probe that rises above 0.5 when following begins, the start of the points.
    result : the run, with its world.

    Returns
    -------
    Axes : the only one.

    Raises
    ------
    UsageError : the run has no world.
    """
    robot, *others = (result.probes[name] for name in plot.of)
    axes, handles = map_axes(figure, plot, result, robot.values[:, :2])
    since = engagement_time(plot, result)
    never = math.inf if plot.options.get("engaged") in result.probes else 0.0
    handles += _points(axes, others, never if since is None else since)
    handles += _trajectory(axes, robot, since)
    handles += draw_contacts(axes, plot, result, robot)
    if len(robot.t):
        body = Robot(axes, plot.options.get("body_radius"))
        body.move(robot.values[-1])
        handles.append(_dot(axes, np.full(2, np.nan), "robot at the end", "white", "black"))
    figure.legend(handles=handles, loc="outside right upper")
    return axes


def map_axes(
    figure: Figure,
    plot: PlotSpec,
    result: RunData,
    xy: FloatArray,
    side: float = SIDE,
    room: tuple[float, float] = (2.2, 1.0),
) -> tuple[Axes, list[Line2D]]:
    """Axes of one scale with the world, its contour and room for the positions ``xy`` (n, 2).

    ``side`` is that of the square of the map's area, ``room`` what the figure is wider and higher
    than the map (inches). Returns the axes and the entries of their legend.
    """
    world = world_of(plot, result)
    low, high = view_limits(world, np.concatenate((np.zeros((0, 2)), xy)))
    # Every map has the same area on the page, whatever its proportions within these limits.
    ratio = min(FLATTEST, max(TALLEST, float((high[0] - low[0]) / (high[1] - low[1]))))
    width = side * math.sqrt(ratio)
    figure.set_size_inches(width + room[0], width / ratio + room[1])
    axes = style.stacked_axes(figure, 1)[0]
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", anchor="W")
    draw_world(axes, world)
    return axes, draw_contour(axes, world, plot)


def _points(axes: Axes, recordings: list[Recording], since: float) -> list[Line2D]:
    """Draw poses from time ``since`` on as small dots."""
    handles = []
    for recording in recordings:
        xy = recording.values[recording.t >= since - 1e-9, :2]
        how: dict[str, Any] = {"linestyle": "none", "marker": ".", "color": REFERENCE}
        how |= {"markeredgewidth": 0.0, "label": style.short_labels([recording.name])[0]}
        axes.plot(*xy.T, **how, markersize=3.0, zorder=2.4)
        # In the size that they have in the map, the points would be hard to see in the legend.
        handles.append(Line2D([], [], **how, markersize=7.0))
    return handles


def _trajectory(axes: Axes, robot: Recording, since: float | None) -> list[Line2D]:
    """Draw the trajectory, with dots at the start and where following begins."""
    xy = robot.values[:, :2]
    handles = axes.plot(*xy.T, color=TRAJECTORY, linewidth=1.3, label="trajectory", zorder=2.6)
    if len(xy):
        handles.append(_dot(axes, xy[0], "start", START))
    if since is not None:
        pose = row_at(robot, since)
        if pose is not None:
            handles.append(_dot(axes, pose[:2], "following begins", FOLLOWING))
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


def draw_wall_distance(
    figure: Figure, plot: PlotSpec, result: RunData, others: Mapping[str, RunData] | None = None
) -> Axes:
    """Draw the distance to the nearest wall minus ``distance``, over time.

    Parameters
    ----------
    figure : what to draw on.
    plot : its options: ``distance`` (m), and ``engaged`` as for a map.
    result : the run, with its world.
    others : all runs by label, this one first, if several are drawn.

    Returns
    -------
    Axes : the only one.

    Raises
    ------
    UsageError : the run has no world.
    """
    world = world_of(plot, result)
    d = float(plot.options["distance"])
    recording = result.probes[plot.of[0]]
    figure.set_size_inches(style.WIDTH, 2.9)
    axes = style.stacked_axes(figure, 1)[0]
    axes.set_ylabel("distance to wall\nminus reference [mm]")
    style.time_axis([axes], [recording], style.run_end(result))
    if not len(recording.t):
        style.explain_empty(axes)
        return axes
    axes.axhline(0.0, color="0.4", linewidth=0.8, linestyle=(0, (4, 2.5)), zorder=1.5)
    late = []
    for i, (label, run) in enumerate((others or {"error": result}).items()):
        poses = run.probes[plot.of[0]]
        error = 1e3 * (np.abs(world.distance(poses.values[:, :2])) - d)
        how = style.line_style(i) if others else {"color": TRAJECTORY}
        axes.plot(poses.t, error, label=label, zorder=2.5, **how)
        late.append(_late(plot, run, world, error, d))
    _limit(axes, late)
    since = engagement_time(plot, result)
    if not others:
        _shade(axes, world, recording.values[:, :2], recording.t, since or 0.0)
    if since is not None:
        axes.axvline(since, color=FOLLOWING, linewidth=1.0, linestyle=":", label="following begins")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return axes


def _late(plot: PlotSpec, result: RunData, world: World, error: FloatArray, d: float) -> FloatArray:
    """The error after the contour was reached; before, it is metres."""
    recording = result.probes[plot.of[0]]
    following = recording.t >= (engagement_time(plot, result) or 0.0) - 1e-9
    rows = len(since_reached(world, recording.values[following, :2], d))
    return error[len(error) - rows :]


def _limit(axes: Axes, late: Sequence[FloatArray]) -> None:
    """Fit the axis to the runs' errors after they reached the contour, and note the means."""
    if not any(map(len, late)):
        return
    low = min(0.0, *(float(error.min(initial=0.0)) for error in late))
    high = max(0.0, *(float(error.max(initial=0.0)) for error in late))
    margin = 0.08 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
    means = " and ".join(f"{np.abs(e).mean():.1f}" if len(e) else "-" for e in late)
    style.write_note(axes, f"mean absolute error since the contour was reached: {means} mm")


def _shade(axes: Axes, world: World, xy: FloatArray, t: FloatArray, since: float) -> None:
    """Shade the times at which the nearest surface was a circle, where the robot has to turn."""
    if not len(world.circles):
        return
    x, y, r = world.circles.T
    from_circle = (np.hypot(xy[:, :1] - x, xy[:, 1:] - y) - r).min(axis=1)
    beside = (from_circle <= np.abs(world.distance(xy)) + 1e-9) & (t >= since)
    axes.fill_between(
        t,
        0.0,
        1.0,
        where=beside.tolist(),
        step="post",
        transform=axes.get_xaxis_transform(),
        color="0.9",
        linewidth=0.0,
        label="nearest is a cylinder",
        zorder=0.5,
    )
