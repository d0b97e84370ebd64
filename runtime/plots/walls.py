"""The room and the robot in it, as all pictures of a world show them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path

from blocks.core import FloatArray
from blocks.world import World
from runtime.errors import UsageError
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots.style import COLOURS

SOLID, OUTLINE = "0.88", "0.25"
START, FOLLOWING, WAY = "#D62728", "#1F4FD8", COLOURS[2]
REFERENCE, SCANNED, FITTED = COLOURS[4], "0.55", COLOURS[3]
CONTOUR: dict[str, Any] = {"color": "0.3", "linewidth": 0.8, "linestyle": (0, (4, 2.5))}
BEYOND = 100.0  # m: how far the solid outside of a room is drawn
MARGIN, OPEN = 0.03, 0.12  # of the longer side, in a room and without one
GAP = 4.0  # times the usual distance of fitted points: from there on it is another wall


def world_of(plot: PlotSpec, result: RunData) -> World:
    """The world that a plot cannot do without.

    Raises
    ------
    UsageError : the run has none.
    """
    if result.world is None:
        message = f"plot '{plot.name}' needs a world, as in 'world: worlds/paper_room.yaml'"
        raise UsageError(message)
    return result.world


def engagement(plot: PlotSpec, result: RunData) -> float | None:
    """When following began (s); None if never, or if the plot does not say what tells."""
    recorded = result.probes.get(str(plot.options.get("engaged")))
    if recorded is None:
        return None
    over = recorded.values.reshape(-1) > 0.5
    return float(recorded.t[over.argmax()]) if over.any() else None


def row_at(recorded: Recording, t: float) -> FloatArray | None:
    """What a probe last saw at time ``t``; None if nothing was recorded."""
    if not len(recorded.t):
        return None
    values: FloatArray = recorded.values[seen(recorded, t)]
    return values


def seen(recorded: Recording, t: float) -> int:
    """The last row not later than ``t``, but for the first; the probe holds some."""
    return max(0, int(np.searchsorted(recorded.t, t + 1e-9, side="right")) - 1)


def view(world: World, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner of what holds all walls, and the places ``xy``."""
    corners = [xy[np.isfinite(xy).all(axis=1)], *world.obstacles]
    for x, y, r in world.circles.tolist():
        corners.append(np.array([[x - r, y - r], [x + r, y + r]]))
    if world.room is not None:
        corners = [world.room]
    everything = np.concatenate(corners)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = (OPEN if world.room is None else MARGIN) * float((high - low).max())
    return low - margin, high + margin


def draw_world(axes: Axes, world: World) -> None:
    """Fill what is solid and outline it."""
    shapes = [_closed(corners) for corners in world.obstacles]
    shapes += [Path.circle((x, y), r) for x, y, r in world.circles.tolist()]
    if world.room is not None:
        low, high = world.room.min(axis=0) - BEYOND, world.room.max(axis=0) + BEYOND
        frame = np.array([low, (low[0], high[1]), high, (high[0], low[1])])
        shapes.append(Path.make_compound_path(_closed(frame), _closed(world.room)))
    for shape in shapes:
        # All outlines lie below all fillings: what is buried in another solid has none.
        axes.add_patch(PathPatch(shape, fill=False, edgecolor=OUTLINE, linewidth=2.0, zorder=1.2))
        axes.add_patch(PathPatch(shape, facecolor=SOLID, edgecolor="none", zorder=1.3))
    axes.grid(False)
    axes.spines[["top", "right"]].set_visible(True)


def _closed(corners: FloatArray) -> Path:
    return Path(np.vstack((corners, corners[:1])), closed=True)


def draw_contour(axes: Axes, world: World, plot: PlotSpec) -> list[Line2D]:
    """Draw where the walls are as far away as the plot's ``distance``, if it names one."""
    distance = plot.options.get("distance")
    if distance is None:
        return []
    loops = world.offset_contour(float(distance))
    if not loops:
        return []
    # One line for all loops, so that a legend and a test see one; NaN lifts the pen.
    rows = np.vstack([np.vstack((loop, [[np.nan, np.nan]])) for loop in loops])
    label = f"{1e3 * distance:.4g} mm from walls"
    return axes.plot(*rows.T, **CONTOUR, label=label, zorder=2.5)


class Robot:
    """A robot in an axes: its body where the radius is known, and a line to where it heads.

    Parameters
    ----------
    axes : what to draw on.
    radius : of the body (m); None if unknown, for a dot with a short line.
    """

    def __init__(self, axes: Axes, radius: float | None) -> None:
        self.radius = radius or 0.08
        how: dict[str, Any] = {"facecolor": (1.0, 1.0, 1.0, 0.6), "edgecolor": "black"}
        size = radius or 0.03
        self.body = Circle((np.nan, np.nan), size, **how, zorder=4.0, gid="robot")
        axes.add_patch(self.body)
        (self.heading,) = axes.plot([], [], color="black", linewidth=1.4, zorder=4.1)

    def put(self, pose: FloatArray | None) -> None:
        """Move it to a pose; None leaves it where it is."""
        if pose is None or not np.isfinite(pose[:3]).all():
            return
        x, y, theta = (float(value) for value in pose[:3])
        self.body.set_center((x, y))
        ahead = (x + self.radius * np.cos(theta), y + self.radius * np.sin(theta))
        self.heading.set_data([x, ahead[0]], [y, ahead[1]])


def scan_points(scan: FloatArray, pose: FloatArray, angles: tuple[float, float]) -> FloatArray:
    """Where the beams of a scan ended (m), (m, 2); misses are left out.

    Parameters
    ----------
    scan : ranges (m), (n,); the i-th beam points to angles[0] + i (angles[1] - angles[0]) / n.
    pose : x, y, theta of the robot when it scanned.
    angles : bearing of the first beam, and of the one that would follow the last (rad).
    """
    bearings = np.linspace(*angles, len(scan), endpoint=False) + pose[2]
    hit = np.isfinite(scan)
    ways = np.column_stack((np.cos(bearings[hit]), np.sin(bearings[hit])))
    ends: FloatArray = pose[:2] + scan[hit, None] * ways
    return ends


def broken(points: FloatArray) -> FloatArray:
    """Points of several curves, one after the other, with a row of NaN between two curves."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual == 0.0:
        return points
    return np.insert(points, np.flatnonzero(steps > GAP * usual) + 1, np.nan, axis=0)
