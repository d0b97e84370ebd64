"""Trajectories of poses in the plane, with paths and point clouds.

In: recordings of the types Pose, Path and PointCloud. Out: one axes in metres, of one scale::

    plots: {trajectory: {kind: trajectory, of: [plant.pose, track.path]}}
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style
from runtime.plots.map import CONTACT, contacts, mark_contacts

ARROWS = 10
MARGIN = 0.06  # of the longer side
STATIONARY = 0.5  # m, shown around a robot that never moves
FLATTEST, TALLEST = 4.5, 0.55  # width over height of the axes
TRIANGLE = 0.02  # length, in widths of the axes: not taller than the marks of start and end
ROBOT = 0.013  # radius of a robot without a body, in widths of the axes
MATCHED, PATH_POINTS = 400, 5_000
DASHES = ((0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
CLOUD: dict[str, Any] = {"marker": ".", "markersize": 2.0, "color": "0.6", "linestyle": "none"}


@dataclass(frozen=True)
class _Track:
    """A signal in the plane: rows of (x, y, theta) over time, or the points of a path or cloud."""

    name: str
    kind: str
    points: FloatArray

    @property
    def xy(self) -> FloatArray:
        return self.points[:, :2]


def draw_trajectory(figure: Figure, recordings: Sequence[Recording]) -> Axes:
    """Draw trajectories, with headings, over the paths that they follow.

    The view shows all poses and the part of each path that is nearest to them.

    Parameters
    ----------
    figure : what to draw on.
    recordings : of poses, paths and point clouds; other signals are ignored.

    Returns
    -------
    Axes : the only one.
    """
    return _draw_view(figure, [track for recording in recordings for track in _tracks(recording)])


def paint_trajectory(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw the trajectories of a run, and where its robots touched something."""
    recordings = [result.probes[name] for name in plot.of]
    return draw_trajectory(figure, [*recordings, *contacts(plot, [result])])


def scale_equally(figure: Figure, top: Axes, plot: PlotSpec) -> None:
    """Give both axes the same scale, unless the plot has limits of its own."""
    if not {"xlim", "ylim"} & plot.options.keys():
        equal_scales(figure, top)


def draw_paths(figure: Figure, ways: Sequence[Recording], others: Sequence[Recording]) -> Axes:
    """Draw what poses follow, in a view that has room for the poses, but not the poses."""
    poses = [track for recording in ways for track in _tracks(recording)]
    paths = [track for each in others for track in _tracks(each) if track.kind != "Pose"]
    return _draw_view(figure, [*poses, *paths], paths, legend=False)


def robot_size(axes: Axes) -> float:
    """The radius (m) with which a robot without a body is seen in an axes."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    return ROBOT * max(right - left, top - bottom)


def _draw_view(
    figure: Figure,
    tracks: Sequence[_Track],
    visible: Sequence[_Track] | None = None,
    legend: bool = True,
) -> Axes:
    """Draw tracks, or some of them (``shown``), in a view of all."""
    low, high = _view(tracks)
    ratio = min(FLATTEST, max(TALLEST, (high[0] - low[0]) / (high[1] - low[1])))
    width = min(5.7, 4.2 * math.sqrt(ratio))
    wide = ratio > 1.3
    # Room for the labels, the title, and the legend: below a wide picture, beside a tall one.
    figure.set_size_inches(width + (0.8 if wide else 2.0), width / ratio + (1.3 if wide else 1.0))
    axes = style.stacked_axes(figure, 1)[0]
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    handles = _draw(axes, tracks if visible is None else visible)
    if not legend:
        return axes
    if not handles:
        style.explain_empty(axes)
        axes.set_xticks([])
    elif wide:
        figure.legend(handles=handles, loc="outside lower center", ncols=min(5, len(handles)))
    else:
        figure.legend(handles=handles, loc="outside right upper")
    return axes


def equal_scales(figure: Figure, axes: Axes) -> None:
    """Give both axes the same scale by widening the limits of one of them.

    Called last, since the size of the axes depends on titles and legends. Matplotlib's own
    ``adjustable="datalim"`` overrides the limits at every drawing, with a warning.
    """
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)  # sizes only; draw_without_rendering would do all but the pixels
    box = axes.get_window_extent()
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    metres = max((right - left) / box.width, (top - bottom) / box.height)
    x, y = 0.5 * (left + right), 0.5 * (bottom + top)
    half_width, half_height = 0.5 * metres * box.width, 0.5 * metres * box.height
    axes.set_xlim(x - half_width, x + half_width)
    axes.set_ylim(y - half_height, y + half_height)
    axes.set_aspect("equal")


def _tracks(recording: Recording) -> list[_Track]:
    """The signals of a recording that are poses, paths or point clouds."""
    tracks = []
    spans = recording.addresses.values() or [(0, len(recording.labels))]
    for kind, (start, stop) in zip(recording.kinds, spans, strict=False):
        if kind in ("Pose", CONTACT):
            points = recording.values[:, start:stop]
        elif kind in ("Path", "PointCloud"):
            # Paths and clouds change over time; the last row is shown.
            points = recording.values[-1] if len(recording.values) else np.empty((0, 2))
        else:
            continue
        finite = points[np.isfinite(points).all(axis=1)]
        tracks.append(_Track(style.signal_of(recording.display_names[start]), kind, finite))
    return tracks


def _view(tracks: Sequence[_Track]) -> tuple[FloatArray, FloatArray]:
    """The lower left and the upper right corner of the view."""
    poses_xy = [track.xy for track in tracks if track.kind == "Pose" and len(track.xy)]
    others = [track for track in tracks if track.kind != "Pose" and len(track.xy)]
    if not poses_xy:
        poses_xy = [track.xy for track in others] or [np.zeros((1, 2))]
        others = []
    poses = np.concatenate(poses_xy)
    # A path may be much longer than the run (a line of 40 m): only what the robot came near is in
    # view.
    reach = max(STATIONARY, float(np.ptp(poses, axis=0).max()))
    for track in others:
        if track.kind == "Path":
            poses_xy.append(_nearest(poses, track.xy))
        else:
            inside = np.abs(track.xy - poses.mean(axis=0)).max(axis=1) < reach
            poses_xy.append(track.xy[inside])
    everything = np.concatenate(poses_xy)
    low, high = everything.min(axis=0), everything.max(axis=0)
    span = float((high - low).max())
    margin = MARGIN * span if span > 0.0 else STATIONARY
    return low - margin, high + margin


def _nearest(poses: FloatArray, path: FloatArray) -> FloatArray:
    """The points of a path that are nearest to the poses, of which some are looked at."""
    # All distances between 20,000 poses and a path of 5,000 points would take 800 MB.
    some = poses[:: -(-len(poses) // MATCHED)]
    path = path[:: -(-len(path) // PATH_POINTS)]
    distances = np.hypot(*(some[:, None, :] - path[None, :, :]).transpose(2, 0, 1))
    nearest: FloatArray = path[distances.argmin(axis=1)]
    return nearest


def _draw(axes: Axes, tracks: Sequence[_Track]) -> list[Line2D]:
    """Draw all tracks that have points; returns the entries of the legend."""
    with_points = [track for track in tracks if len(track.points)]
    layers = style.layers([track.xy for track in with_points])
    handles: list[Line2D] = []
    paths = poses = 0
    for track, layer in zip(with_points, layers, strict=True):
        if track.kind == "Pose":
            colour = style.COLOURS[poses % len(style.COLOURS)]
            handles += _pose_track(axes, track, colour, 0.3 + layer)
            poses += 1
        elif track.kind == "Path":
            how: dict[str, Any] = {"linestyle": DASHES[paths % len(DASHES)], "color": "0.35"}
            handles += axes.plot(*track.xy.T, **how, linewidth=1.0, label=track.name, zorder=2.6)
            paths += 1
        elif track.kind == CONTACT:
            handles.append(mark_contacts(axes, track.xy))
        else:
            handles += axes.plot(*track.xy.T, **CLOUD, label=track.name, zorder=1.5)
    if poses:
        handles += [_mark(np.empty((0, 2)), label) for label in ("start", "end")]
    return handles


def _mark(xy: FloatArray, label: str, colour: str = "0.35") -> Line2D:
    """A hollow circle for the start, a full square for the end."""
    start = label == "start"
    return Line2D(
        xy[:, 0],
        xy[:, 1],
        linestyle="none",
        label=label,
        marker="o" if start else "s",
        markersize=6.0,
        markerfacecolor="white" if start else colour,
        markeredgecolor=colour if start else "white",
        markeredgewidth=1.0 if start else 0.6,
        zorder=4.0,
    )


def _pose_track(axes: Axes, track: _Track, colour: str, layer: float) -> list[Line2D]:
    """Draw one pose's trajectory, with triangles that point along its heading."""
    x, y = track.xy.T
    lines = axes.plot(x, y, color=colour, label=track.name, linewidth=1.4, zorder=layer)
    axes.add_line(_mark(track.xy[:1], "start", colour))
    axes.add_line(_mark(track.xy[-1:], "end", colour))
    distance = np.concatenate([[0.0], np.hypot(np.diff(x), np.diff(y)).cumsum()])
    # Evenly spaced along the path; in time for a robot that only turns.
    measure = distance if distance[-1] > 0.0 else np.arange(len(x), dtype=np.float64)
    even = np.linspace(0.0, measure[-1], ARROWS + 2)[1:-1]
    at = np.unique(np.searchsorted(measure, even).clip(max=len(x) - 1))
    _triangles(axes, track.points[at], colour)
    _triangles(axes, track.points[[0, -1]], colour, pivot="tail")
    return lines


def _triangles(
    axes: Axes, poses: FloatArray, colour: str, pivot: Literal["mid", "tail"] = "mid"
) -> None:
    """Draw triangles at poses, as arrows without a shaft."""
    x, y, theta = poses.T
    head: dict[str, Any] = {"headlength": 3.0, "headaxislength": 3.0, "headwidth": 2.2}
    axes.quiver(
        x,
        y,
        np.cos(theta),
        np.sin(theta),
        **head,
        color=colour,
        units="width",
        width=TRIANGLE / 3.0,
        scale_units="width",
        scale=1.0 / TRIANGLE,
        pivot=pivot,
        minlength=0.0,
        zorder=3.0,
    )
