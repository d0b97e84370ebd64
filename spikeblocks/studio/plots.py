"""The plots of a graph as a page draws them while the graph runs.

In: what a graph observes. Out: plain data, in which a curve is a column of a stream::

    errors: {kind: timeseries, of: x}
    {"kind": "time", "title": "Errors", "charts": [{"unit": "m", "curves": [...]}]}

What needs a whole run, such as a spectrum, is named in a sentence.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from runtime.network import Network
from runtime.observation import Observation, PlotSpec, Probe
from spikeblocks.studio.streams import Mode

MOST = 12  # curves of one plot
MARGIN = 0.06
OVER_TIME = ("timeseries", "decoded", "weights")
PLANES = ("trajectory", "map", "scans")


@dataclass
class Views:
    """The plots, the streams that they need, and the titles of those that are not drawn."""

    plots: list[dict[str, Any]] = field(default_factory=list)
    modes: dict[str, Mode] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def views_of(observation: Observation, network: Network) -> Views:
    """The plots of a graph."""
    found = Views()
    for plot in observation.all_plots:
        probes = [observation.probes[name] for name in plot.of]
        made, modes = _plot(plot, probes, network)
        if made is None:
            found.left_out.append(plot.title)
            continue
        found.plots.append({"name": plot.name, "title": plain(plot.title), **made})
        for name, mode in modes.items():
            # What is drawn over something else than time needs rows as they are.
            found.modes[name] = mode if found.modes.get(name, mode) == mode else "rows"
    return found


def plain(text: str) -> str:
    """A label without the marks of formulas: ``$e_\\theta$`` is e_θ."""
    text = re.sub(r"\\(alpha|beta|gamma|theta|omega|phi|tau|kappa|delta)\b", _greek, text)
    return re.sub(r"[$\\{}]", "", text)


def _greek(name: re.Match[str]) -> str:
    return unicodedata.lookup(f"GREEK SMALL LETTER {name[1].upper()}")


def _plot(
    plot: PlotSpec, probes: Sequence[Probe], network: Network
) -> tuple[dict[str, Any] | None, dict[str, Mode]]:
    if plot.kind in OVER_TIME:
        return _over_time(plot, probes)
    if plot.kind == "xy":
        return _over_each_other(plot, probes)
    if plot.kind == "raster":
        spikes = next((p for p in probes if p.signals[0].kind == "Spikes"), None)
        if spikes is None:
            return None, {}
        neurons = math.prod(spikes.shape)
        return {"kind": "raster", "probe": spikes.name, "neurons": neurons}, {spikes.name: "events"}
    if plot.kind in PLANES:
        return _in_the_plane(plot, probes, network)
    return None, {}


def _curves(plot: PlotSpec, probes: Sequence[Probe]) -> Iterator[dict[str, Any]]:
    texts = list(map(plain, plot.options.get("labels", ())))
    number = 0
    for probe in probes:
        if any(signal.is_event or signal.publisher for signal in probe.signals):
            continue
        named = zip(probe.names, probe.labels, probe.units, strict=True)
        for column, (name, label, unit) in enumerate(named):
            if number == MOST:
                return
            text = texts[number] if number < len(texts) else plain(name or label)
            number += 1
            yield {"probe": probe.name, "column": column, "label": text, "unit": unit}


def _over_time(
    plot: PlotSpec, probes: Sequence[Probe]
) -> tuple[dict[str, Any] | None, dict[str, Mode]]:
    """One chart for each unit, below each other."""
    curves = list(_curves(plot, probes))
    charts = [
        {"unit": unit, "curves": [c for c in curves if c["unit"] == unit]}
        for unit in dict.fromkeys(c["unit"] for c in curves)
    ]
    if not charts:
        return None, {}
    return {"kind": "time", "charts": charts}, {c["probe"]: "curves" for c in curves}


def _over_each_other(
    plot: PlotSpec, probes: Sequence[Probe]
) -> tuple[dict[str, Any] | None, dict[str, Mode]]:
    """The second curve over the first, and so on."""
    curves = list(_curves(plot, probes))
    pairs = list(zip(curves[::2], curves[1::2], strict=False))
    if not pairs:
        return None, {}
    made = _plane([{"label": up["label"], "x": x, "y": up, "theta": None} for x, up in pairs])
    made |= {"across": _axis(pairs[0][0]), "up": _axis(pairs[0][1]), "equal": False}
    return made, {c["probe"]: "rows" for pair in pairs for c in pair}


def _axis(curve: dict[str, Any]) -> str:
    return f"{curve['label']} [{curve['unit']}]" if curve["unit"] else str(curve["label"])


def _plane(pairs: list[dict[str, Any]]) -> dict[str, Any]:
    made: dict[str, Any] = {"kind": "plane", "pairs": pairs, "across": "x [m]", "up": "y [m]"}
    made |= {"equal": True, "walls": [], "circles": [], "view": None, "clouds": [], "radius": 0.0}
    return made


def _in_the_plane(
    plot: PlotSpec, probes: Sequence[Probe], network: Network
) -> tuple[dict[str, Any] | None, dict[str, Mode]]:
    """Poses among walls, the paths that they follow, and what a scanner sees."""
    pairs: list[dict[str, Any]] = []
    clouds: list[dict[str, Any]] = []
    modes: dict[str, Mode] = {}
    for probe in probes:
        column = 0
        for signal in probe.signals:
            label = plain(signal.name or signal.address)
            if signal.kind == "Pose":
                at = [{"probe": probe.name, "column": column + i} for i in range(3)]
                pairs.append({"label": label, "x": at[0], "y": at[1], "theta": at[2]})
                modes[probe.name] = "rows"
            elif signal.kind in ("Path", "PointCloud", "Scan") and len(probe.signals) == 1:
                clouds.append({"kind": signal.kind, "probe": probe.name, "label": label})
                modes[probe.name] = "rows"
            column += signal.width
    if not pairs and not clouds:
        return None, {}
    if plot.kind == "map":  # of the first pose; others are points
        pairs = [{**pair, "points": i > 0} for i, pair in enumerate(pairs)]
    made = _plane(pairs) | {"clouds": clouds, **_world(network.world)}
    made["radius"] = float(plot.options.get("body_radius", 0.0))
    made["angles"] = list(plot.options.get("angles", (-math.pi, math.pi)))
    return made, modes


def _world(world: Any) -> dict[str, Any]:
    """The walls of a world as closed lines, its round obstacles, and a view of all of them."""
    if world is None:
        return {}
    polygons = [*([] if world.room is None else [world.room]), *world.obstacles]
    walls = [np.vstack([polygon, polygon[:1]]).tolist() for polygon in polygons]
    circles = np.asarray(world.circles).tolist()
    corners = [point for wall in walls for point in wall]
    corners += [[x + r, y + r] for x, y, r in circles] + [[x - r, y - r] for x, y, r in circles]
    (left, low), (right, high) = np.min(corners, axis=0), np.max(corners, axis=0)
    spare = MARGIN * max(right - left, high - low)
    view = [float(left - spare), float(right + spare), float(low - spare), float(high + spare)]
    return {"walls": walls, "circles": circles, "view": view}
