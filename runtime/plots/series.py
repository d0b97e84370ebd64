"""Columns over time as lines, and arrays over time as colours.

In: recordings of a run, and its end (s). Out: axes on a figure, one per unit::

    plots: {speeds: {kind: timeseries, of: [plant.v, plant.omega]}}    # m/s above rad/s
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.observation import Recording
from runtime.plots import style
from runtime.plots.thinning import block_means

MANY_LINES = 14  # that colours and dashes tell apart; of more, colours show the index
LINE_POINTS = 200_000
HEAT_ROWS = 1_000
FEW_ROWS = 12


@dataclass(frozen=True)
class _Column:
    label: str
    unit: str
    t: FloatArray
    y: FloatArray
    held: bool


def _flat(recording: Recording) -> tuple[FloatArray, list[str], list[str]]:
    """A recording as (rows, columns), with one label and one unit per column."""
    values = recording.columns
    count = values.shape[1]
    if len(recording.labels) == count:
        return values, list(recording.labels), list(recording.units)
    signal = style.signal_of(recording.labels[0]) if recording.labels else recording.name
    units = list(recording.units or ("",))
    return values, [f"{signal}[{i}]" for i in range(count)], (units * count)[:count]


def draw_timeseries(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw columns over time, one axes per unit."""
    groups: dict[str, list[_Column]] = {}
    every: dict[str, str] = {}
    for recording in recordings:
        values, labels, units = _flat(recording)
        display = recording.display_names if len(recording.labels) == len(labels) else labels
        every |= zip(labels, display, strict=True)
        held = recording.held if len(recording.held) == len(labels) else recording.held[:1]
        for i, (label, unit) in enumerate(zip(labels, units, strict=True)):
            # One flag per signal may stand for several columns.
            steps = bool(held) and held[i % len(held)]
            line = _Column(label, unit, recording.t, values[:, i], steps)
            groups.setdefault(unit, []).append(line)
    shown_as = style.display_names(list(every), list(every.values()))
    names = dict(zip(every, shown_as, strict=True))
    # An axes that shows zero alone takes a third of the figure to say what one line of text does.
    groups, silent = _without_zeros(_merge_unitless(groups))
    counts = [len(lines) for lines in groups.values()]
    heights = [max(1.55, style.legend_height(n) if n <= MANY_LINES else 0.0) for n in counts]
    figure.set_size_inches(style.WIDTH, 1.1 + (sum(heights) or 1.55) + 0.5 * (len(groups) == 1))
    column = style.stacked_axes(figure, len(groups), heights or None)
    for axes, (unit, lines) in zip(column, groups.items(), strict=False):
        line_names = [names[line.label] for line in lines]
        _lines(figure, axes, lines, line_names, end)
        # What the legend beside it names is not named again.
        own = (
            line_names
            if not 1 < len(lines) <= MANY_LINES
            else [style.signal_name([i.label for i in lines])]
        )
        axes.set_ylabel(style.axis_label(own, unit) or "value")
    if silent:
        zero = ", ".join(names[label] for label in silent)
        style.write_note(column[-1], f"not shown, since it is 0 throughout: {zero}")
    style.time_axis(column, recordings, end)
    return column[0]


def _merge_unitless(groups: dict[str, list[_Column]]) -> dict[str, list[_Column]]:
    """The groups by unit; lines without a unit join the others, if these have one and the same.

    An estimate in a vector, which has no unit, is then beside the truth, which has one.
    """
    units = [unit for unit in groups if unit]
    if len(units) != 1 or "" not in groups:
        return groups
    return {units[0]: [line for lines in groups.values() for line in lines]}


def _without_zeros(
    groups: dict[str, list[_Column]],
) -> tuple[dict[str, list[_Column]], list[str]]:
    """The groups that are not zero throughout, and the labels of the others; all if none is."""
    zero = [u for u, lines in groups.items() if all(len(i.y) and not i.y.any() for i in lines)]
    if len(zero) == len(groups):
        return groups, []
    others = {unit: lines for unit, lines in groups.items() if unit not in zero}
    return others, [line.label for unit in zero for line in groups[unit]]


def _lines(figure: Figure, axes: Axes, lines: list[_Column], names: list[str], end: float) -> None:
    """Draw one axes of a time series: all columns of one unit."""
    if not any(len(line.y) for line in lines):
        style.explain_empty(axes)
        return
    shown, colours = _looks(lines, names)
    low = high = 0.0
    for line, (name, how) in zip(lines, shown, strict=True):
        is_angle = line.unit == "rad" and not line.held
        t, y = style.gaps_at_turns(line.t, line.y) if is_angle else (line.t, line.y)
        if len(y) == 1:
            # A single row is a constant, or a probe slower than the run: it is marked by a dot.
            is_plain = how["color"] == style.REFERENCE["color"]
            dashes = how["linestyle"] if is_plain else ":"
            axes.plot([t[0], max(t[0], end)], [y[0], y[0]], **{**how, "linestyle": dashes})
            how |= {} if is_plain else {"marker": "o", "markersize": 4.0}
        most = max(400, min(style.THIN_TO, LINE_POINTS // len(lines)))
        is_long = len(y) > style.THIN_ABOVE or len(y) * len(lines) > LINE_POINTS
        style.draw_series(axes, t, y, line.held, most if is_long else 0, label=name, **how)
        finite = y[np.isfinite(y)]
        low, high = min(low, finite.min(initial=0.0)), max(high, finite.max(initial=0.0))
    if low < 0.0 < high:
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)
    if colours is not None:
        scale = ScalarMappable(Normalize(-0.5, len(lines) - 0.5), colours)
        figure.colorbar(scale, ax=axes, label="index", pad=0.01, aspect=14)
    else:
        style.add_legend(axes)


def _looks(
    lines: Sequence[_Column], names: Sequence[str]
) -> tuple[list[tuple[str, dict[str, Any]]], ListedColormap | None]:
    """The name and the look of each line, and the colours of many lines, which have an index.

    References are grey and dashed; the colours are for what is compared with them. Where they are
    many, those of one signal have one name in the legend.
    """
    marks = [style.is_reference(line.label, name) for line, name in zip(lines, names, strict=True)]
    marks = [False] * len(lines) if all(marks) else marks
    layers = style.layers([line.y for line in lines])
    many = marks.count(False)
    if many > MANY_LINES:
        # The bright end of the colour map is too pale for lines on white.
        map_ = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(lines)))
        thin = [{"color": c, "linewidth": 0.5, "linestyle": "-"} for c in map_]
        looks = [how | {"zorder": z} for how, z in zip(thin, layers, strict=True)]
        return list(zip(names, looks, strict=True)), ListedColormap(map_)
    overlaps = style.coincident([line.y for line in lines])
    found: list[tuple[str, dict[str, Any]]] = []
    with_name: set[str] = set()
    for i, (line, name, mark) in enumerate(zip(lines, names, marks, strict=True)):
        signal = style.signal_of(line.label)
        if mark and len(lines) > MANY_LINES and signal in with_name:
            name = "_"
        with_name.add(signal)
        before = i - sum(marks[:i])
        how = style.REFERENCE if mark else style.line_style(before, overlaps[i])
        found.append((name, how | {"zorder": layers[i]}))
    return found, None


def draw_heatmap(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw arrays over time as colours, one axes each."""
    figure.set_size_inches(style.WIDTH, 0.9 + 2.6 * max(1, len(recordings)))
    column = style.stacked_axes(figure, len(recordings))
    for axes, recording in zip(column, recordings, strict=False):
        _heat(figure, axes, recording, end)
    style.time_axis(column, recordings, end)
    return column[0]


def _heat(figure: Figure, axes: Axes, recording: Recording, end: float) -> None:
    """Draw one array: its rows along time, its columns upwards."""
    values, labels, units = _flat(recording)
    axes.grid(False)
    if len(labels) <= FEW_ROWS:
        axes.set_yticks(range(len(labels)), style.short_labels(labels))
    else:
        axes.set_ylabel("index")
    if not values.size:
        style.explain_empty(axes)
        return
    # More rows than pixels: means, and not every n-th row, which would miss short events.
    size = -(-len(values) // HEAT_ROWS)
    means = block_means(values, size)
    step = style.row_spacing(recording.t, end) * size
    name, low, high = _colours(means)
    image = axes.imshow(
        means.T,
        aspect="auto",
        origin="lower",
        interpolation="nearest",
        cmap=matplotlib.colormaps[name].with_extremes(bad="0.8"),
        vmin=low,
        vmax=high,
        extent=(recording.t[0], recording.t[0] + step * len(means), -0.5, len(labels) - 0.5),
    )
    unit = units[0] if len(set(units)) == 1 else "mixed units"
    signal = style.signal_name(labels) or recording.name
    label = f"{signal} [{unit}]" if unit else signal
    figure.colorbar(image, ax=axes, label=label, pad=0.01, aspect=18)


def _colours(values: FloatArray) -> tuple[str, float, float]:
    """A colour map and its limits: symmetric where values have both signs."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if low < 0.0 < high:
        bound = max(-low, high)
        return "RdBu_r", -bound, bound
    return "viridis", low, high if high > low else low + 1.0
