"""What a page shows: the graph's plots as columns of numbers that a step hands out.

In go the plots that a run of the graph would have, and the outputs of the exported step; out come
the columns of a row and, for each plot, which of them it draws::

    errors: {kind: timeseries, of: x}   {"kind": "time", "columns": [1, 2], "labels": [...]}

Of the kinds, ``timeseries``, ``xy``, ``trajectory`` and ``map`` are drawn while the simulation
runs; others need a whole run, and are named in a note.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from runtime.graph import Graph
from runtime.network import first_column
from runtime.observation import PlotSpec, Signal
from runtime.plan import Port

AREAL = ("trajectory", "map")
MOST_CURVES = 12  # of one plot; more are those of an array, of which the first ones are drawn
POINTS = 400  # of a path that is drawn
MARGIN = 0.06


@dataclass
class Shown:
    """The columns of a row after the time, the plots, and the names of those that are left out."""

    columns: list[tuple[Port, int]] = field(default_factory=list)
    plots: list[dict[str, Any]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def column(self, port: Port, index: int) -> int:
        """The column of a number of an output."""
        if (port, index) not in self.columns:
            self.columns.append((port, index))
        return 1 + self.columns.index((port, index))


@dataclass(frozen=True)
class Curve:
    """A number that is drawn over time: its column, label and unit."""

    column: int
    label: str
    unit: str


def shown(
    graph: Graph, outputs: Sequence[Port], constants: Mapping[Port, np.ndarray[Any, Any]]
) -> Shown:
    """The plots of a graph.

    Parameters
    ----------
    outputs : what the step hands out. constants : the values of outputs that never change.
    """
    found = Shown()
    observation, network = graph.program().observation, graph.network

    def curves(signals: Sequence[Signal]) -> Iterator[Curve]:
        for signal in signals:
            port = signal.end.block, signal.end.port
            if port not in outputs or signal.is_state or signal.publisher:
                continue
            first = first_column(network.types[port], signal.end.component)
            named = zip(signal.names, signal.labels, signal.units, strict=True)
            for i, (name, label, unit) in enumerate(list(named)[:MOST_CURVES]):
                yield Curve(found.column(port, first + i), plain(name or label), unit)

    for plot in observation.all_plots:
        texts = list(map(plain, plot.options.get("labels", ())))
        signals = [s for name in plot.of for s in observation.probes[name].signals]
        if plot.kind == "timeseries":
            made = _over_time(plot, _named(curves(signals), texts))
        elif plot.kind == "xy":
            made = _over_each_other(plot, _named(curves(signals), texts))
        elif plot.kind in AREAL:
            poses = [s for s in signals if s.kind == "Pose"]
            paths = [s for s in signals if s.kind == "Path" and s.constant]
            order = [s for s in signals if s.kind in ("Pose", "Path", "PointCloud")]
            names = {s: texts[i] if i < len(texts) else "" for i, s in enumerate(order)}
            fixed = _fixed(paths, [names[s] for s in paths], constants)
            given = [names[s] or s.address for s in poses]
            made = _in_the_plane(plot, given, list(curves(poses)), fixed, network.world)
        else:
            made = []
        found.plots += made
        if not made:
            found.left_out.append(plot.title)
    return found


def plain(text: str) -> str:
    """A label without the marks of formulas: ``$e_\\theta$`` is e_θ."""
    text = re.sub(r"\\(alpha|beta|gamma|theta|omega|phi|tau|kappa|delta)\b", _greek, text)
    return re.sub(r"[$\\{}]", "", text)


def _greek(name: re.Match[str]) -> str:
    return unicodedata.lookup(f"GREEK SMALL LETTER {name[1].upper()}")


def _named(curves: Iterable[Curve], texts: Sequence[str]) -> list[Curve]:
    """Curves with the labels of their plot, as far as it has some."""
    return [
        replace(curve, label=texts[i]) if i < len(texts) else curve
        for i, curve in enumerate(curves)
    ]


def _over_time(plot: PlotSpec, curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """One chart for each unit, below each other."""
    charts = []
    for unit in dict.fromkeys(curve.unit for curve in curves):
        ours = [curve for curve in curves if curve.unit == unit]
        columns, labels = [c.column for c in ours], [c.label for c in ours]
        charts.append({"unit": unit, "columns": columns, "labels": labels})
    return [{"kind": "time", "title": plot.title, "charts": charts}] if charts else []


def _over_each_other(plot: PlotSpec, curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """The second curve over the first, and so on."""
    pairs = list(zip(curves[::2], curves[1::2], strict=False))
    return _plane(
        plot,
        [_pair(f"{up.label} over {across.label}", across, up) for across, up in pairs],
        across=_axis(pairs[0][0]) if pairs else "",
        up=_axis(pairs[0][1]) if pairs else "",
    )


def _in_the_plane(
    plot: PlotSpec,
    names: Sequence[str],
    curves: Sequence[Curve],
    fixed: list[dict[str, Any]],
    world: Any,
) -> list[dict[str, Any]]:
    """Poses among walls, and the paths that they follow."""
    pairs = [
        _pair(name, *curves[i : i + 3])
        for name, i in zip(names, range(0, len(curves) - 2, 3), strict=False)
    ]
    walls, circles, view = _walls(world)
    others = {"equal": True, "fixed": fixed, "walls": walls, "circles": circles, "view": view}
    return [made | others for made in _plane(plot, pairs, "x [m]", "y [m]")]


def _plane(
    plot: PlotSpec, pairs: list[dict[str, Any]], across: str, up: str
) -> list[dict[str, Any]]:
    made: dict[str, Any] = {"kind": "plane", "title": plot.title, "pairs": pairs}
    made |= {"across": across, "up": up, "equal": False, "fixed": [], "walls": [], "circles": []}
    return [made | {"view": None}] if pairs else []


def _pair(label: str, x: Curve, y: Curve, theta: Curve | None = None) -> dict[str, Any]:
    heading = None if theta is None else theta.column
    return {"label": label, "x": x.column, "y": y.column, "theta": heading}


def _axis(curve: Curve) -> str:
    return f"{curve.label} [{curve.unit}]" if curve.unit else curve.label


def _fixed(
    paths: Sequence[Signal], names: Sequence[str], constants: Mapping[Port, np.ndarray[Any, Any]]
) -> list[dict[str, Any]]:
    """Reference paths that never change, as points."""
    found = []
    for signal, name in zip(paths, names, strict=True):
        values = constants.get((signal.end.block, signal.end.port))
        if values is None:
            continue
        points = values[np.isfinite(values).all(axis=1)][:, :2]
        points = points[:: max(1, math.ceil(len(points) / POINTS))]
        label = name or signal.name or signal.address
        found.append({"label": label, "points": np.round(points, 4).tolist()})
    return found


def _walls(
    world: Any,
) -> tuple[list[list[list[float]]], list[list[float]], tuple[float, float, float, float] | None]:
    """The walls of a world as closed lines, its round obstacles, and a view of all of them."""
    if world is None:
        return [], [], None
    polygons = [*([] if world.room is None else [world.room]), *world.obstacles]
    walls = [np.vstack([polygon, polygon[:1]]).tolist() for polygon in polygons]
    circles = np.asarray(world.circles).tolist()
    corners = [point for wall in walls for point in wall]
    corners += [[x + r, y + r] for x, y, r in circles] + [[x - r, y - r] for x, y, r in circles]
    (left, low), (right, high) = np.min(corners, axis=0), np.max(corners, axis=0)
    spare = MARGIN * max(right - left, high - low)
    view = (float(left - spare), float(right + spare), float(low - spare), float(high + spare))
    return walls, circles, view
