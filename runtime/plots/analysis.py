"""Signals against each other, and over frequency.

In: recordings. Out: the second column over the first (``xy``), a curve in space through three
(``xyz``), or the power density of each column (``spectrum``): a sine of amplitude 2 m at 5 Hz is a
peak at 5 Hz with an area of 2 m².
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording
from runtime.plots import style
from runtime.plots.log_axes import label_log

# Segments of Welch's method: so many, or as many as are this long (rows).
SEGMENTS, SHORTEST = 8, 256
TICKS, ZOOM = 6, 0.95  # of the longest axis in space, and of its picture
# The layout takes lines in space that are not clipped to be where their coordinates are in a plane.
FREE: dict[str, Any] = {"clip_on": False, "in_layout": False}
SHADOW: dict[str, Any] = {"color": "0.8", "linewidth": 0.8, "zorder": 0.5, **FREE}
THINNEST = 0.2  # extent of an axis in space, as a share of the longest


def draw_xy(
    figure: Figure,
    recordings: Sequence[Recording],
    end: float,
    others: Mapping[str, Sequence[Recording]] | None = None,
) -> Axes:
    """Draw the second signal over the first, the fourth over the third, and so on.

    The start of each curve is marked by a dot.

    Parameters
    ----------
    others : the recordings of all runs by label, these ones first, if several are drawn.
    """
    figure.set_size_inches(style.WIDTH, 0.75 * style.WIDTH)
    axes = figure.add_subplot()
    style.place_power(axes)
    curves = _curves(recordings)
    for label, how, (x, y) in _looks(curves, others):
        if len(x):
            axes.plot(x, y, label=label, **how)
            axes.plot(x[:1], y[:1], "o", color=how["color"], markersize=4.0)
    if not axes.lines:
        style.explain_empty(axes)
    writers: tuple[Callable[[str], object], ...] = (axes.set_xlabel, axes.set_ylabel)
    for i, write in enumerate(writers):
        write(_axis_label(curves, i))
    if {unit for curve in curves for unit in curve.units} == {"m"}:
        axes.set_aspect("equal")  # a plane: a circle is one
    style.add_legend(axes)
    return axes


def _axis_label(curves: Sequence[_Curve], i: int) -> str:
    units = {curve.units[i] for curve in curves}
    names = list(dict.fromkeys(curve.names[i] for curve in curves))
    return style.axis_label(names, units.pop() if len(units) == 1 else "")


def draw_xyz(
    figure: Figure,
    recordings: Sequence[Recording],
    end: float,
    others: Mapping[str, Sequence[Recording]] | None = None,
) -> Axes:
    """Draw three columns as a curve in space, the next three as another, and so on.

    The start of each curve is marked by a dot, and its shadow is drawn on the ground, without which
    a picture of space does not tell what is near from what is high.

    Parameters
    ----------
    others : the recordings of all runs by label, these ones first, if several are drawn.
    """
    figure.set_size_inches(style.WIDTH, 0.75 * style.WIDTH)
    axes: Any = figure.add_subplot(projection="3d")
    curves = _curves(recordings, 3)
    shown = [(name, how, np.array(points)) for name, how, points in _looks(curves, others)]
    places = np.concatenate([points for *_, points in shown], axis=1)
    places = places[:, np.isfinite(places).all(axis=0)]
    if places.size:
        low, high = places.min(axis=1), places.max(axis=1)
        is_equal = len({unit for curve in curves for unit in curve.units}) == 1
        # An axis without extent, as of a flight at one height, would have no room for its labels.
        least = THINNEST * float((high - low).max()) if is_equal else 0.0
        room = np.maximum(0.0, least - (high - low)) / 2.0 + np.where(high > low, 0.0, 1e-9)
        low, high = low - room, high + room
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        for label, how, points in shown:
            ground = np.full(points.shape[1], axes.get_zlim()[0])
            axes.plot(*points[:2], ground, **SHADOW)
            axes.plot(*points, label=label, **how, **FREE)
            axes.plot(*points[:, :1], "o", color=how["color"], markersize=4.0, **FREE)
        if is_equal:
            axes.set_aspect("equal")
    else:
        style.explain_empty(axes)
    in_metres = {unit for curve in curves for unit in curve.units} == {"m"}
    for i, name in enumerate("xyz"):
        axes.set(**{f"{name}label": f"{name} [m]" if in_metres else _axis_label(curves, i)})
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    top: Axes = axes
    return top


def limit_space(figure: Figure, top: Axes, plot: PlotSpec) -> None:
    """Limit the axes of a curve in space, and turn it as the option ``view`` says."""
    style.set_limits(figure, top, plot)
    space: Any = top
    space.set(zlim=plot.options.get("zlim", space.get_zlim()))
    space.view_init(*plot.definition.options.read(plot.options)["view"])
    fit_space(space)


def label_axes(top: Axes, plot: PlotSpec) -> Sequence[str]:
    """Two labels of two signals against each other name the axes, which leaves none for lines."""
    labels = style.line_labels(top, plot)
    if not len(labels) == len(plot.of) == 2:
        return labels
    style.name_axes(top, *labels)
    return ()


def label_spectrum(top: Axes, plot: PlotSpec) -> Sequence[str]:
    """The labels of the lines; one curve has no legend, and its axis is called power density."""
    return () if len(top.lines) == 1 else style.line_labels(top, plot)


def fit_space(axes: Any) -> None:
    """Give three axes of equal scales the proportions of their limits, and ticks with room."""
    ends = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    extents = np.abs(np.diff(ends)[:, 0])
    if axes.get_aspect() != "equal":
        extents = np.array([4.0, 4.0, 3.0])
    axes.set_box_aspect(extents, zoom=ZOOM)
    axes.xaxis.labelpad = axes.yaxis.labelpad = 7.0
    axes.zaxis.labelpad = 0.0
    for axis, extent in zip((axes.xaxis, axes.yaxis, axes.zaxis), extents, strict=True):
        bins = max(2, round(TICKS * float(extent / extents.max())))
        axis.set_major_locator(MaxNLocator(bins, steps=[1, 2, 5, 10]))


@dataclass(frozen=True)
class _Curve:
    """Columns against each other: a label, name, unit and array (rows,) per direction."""

    labels: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    points: tuple[FloatArray, ...]

    @property
    def label(self) -> str:
        """What it is called beside others: y over x, or plant.position."""
        if len(self.names) == 2:
            return " over ".join(reversed(self.names))
        return style.signal_name(self.labels) or ", ".join(self.names)


def _curves(recordings: Sequence[Recording], size: int = 2) -> list[_Curve]:
    """The columns in groups; in space, the names of each group are short by themselves."""
    columns = list(_columns(recordings))
    labels = [label for label, *_ in columns]
    names = style.short_labels(labels)
    groups = [slice(i, i + size) for i in range(0, len(columns) - size + 1, size)]
    return [
        _Curve(
            tuple(labels[at]),
            tuple(names[at] if size == 2 else style.short_labels(labels[at])),
            tuple(unit for _, unit, *_ in columns[at]),
            tuple(values for *_, values in columns[at]),
        )
        for at in groups
    ]


def _looks(
    curves: Sequence[_Curve], others: Mapping[str, Sequence[Recording]] | None
) -> Iterator[tuple[str, dict[str, Any], tuple[FloatArray, ...]]]:
    """Label, look and points of each curve of each run.

    The colour tells runs apart, or with several curves per run the curves, and dashes the runs.
    """
    if others is None:
        for i, curve in enumerate(curves):
            yield curve.label, style.line_style(i), curve.points
        return
    for i, (run, recordings) in enumerate(others.items()):
        # Of a removed block nothing is recorded: the names are those of the first run.
        own = _curves(recordings, len(curves[0].names))
        for k, (curve, name) in enumerate(zip(own, curves, strict=False)):
            if len(curves) == 1:
                yield run, _run_style(i), curve.points
            else:
                dashes = style.LINESTYLES[i % len(style.LINESTYLES)]
                how = _run_style(i) | {"color": style.line_style(k)["color"], "linestyle": dashes}
                yield f"{name.label}, {run}", how, curve.points


def _run_style(i: int) -> dict[str, Any]:
    """The look of the i-th run; the first is wider, so that it is seen where others cover it."""
    return style.line_style(i) | {"linewidth": 1.0 if i else 2.0}


def draw_spectrum(
    figure: Figure,
    recordings: Sequence[Recording],
    end: float,
    others: Mapping[str, Sequence[Recording]] | None = None,
) -> Axes:
    """Draw the power spectral density of each column, one axes per unit, or per column of runs.

    Welch's method with Hann windows, means removed: the area under a curve is the variance.

    Parameters
    ----------
    others : the recordings of all runs by label, these ones first, if several are drawn.
    """
    panels: dict[tuple[str, str], list[tuple[str, FloatArray, FloatArray]]] = {}
    for run, each in (others or {"": recordings}).items():
        columns = list(_columns(each))
        for label, unit, t, values in columns:
            line = (run or label, *density(values, style.row_spacing(t, end)))
            panels.setdefault((unit, label if run else ""), []).append(line)
    figure.set_size_inches(style.WIDTH, 1.1 + 2.2 * max(1, len(panels)))
    column = style.stacked_axes(figure, max(1, len(panels)))
    titles = style.short_labels([label for _, label in panels])
    for axes, ((unit, _), lines), title in zip(column, panels.items(), titles, strict=False):
        labels = [label for label, *_ in lines]
        if others:
            _densities(axes, lines, labels, _run_style)
        else:
            _densities(axes, lines, style.short_labels(labels), style.line_style)
        name = f"{title}\n" if len(panels) > 1 and others else ""
        axes.set_ylabel(f"{name}power density [{_density_unit(unit, recordings)}]")
    column[-1].set_xlabel(f"frequency [{style.frequency_unit(recordings)}]")
    return column[0]


def _densities(
    axes: Axes,
    lines: Sequence[tuple[str, FloatArray, FloatArray]],
    names: Sequence[str],
    look: Callable[[int], dict[str, Any]],
) -> None:
    """Draw one axes of a spectrum."""
    for i, ((_, frequencies, power), name) in enumerate(zip(lines, names, strict=True)):
        shown = np.where(power > 0.0, power, np.nan)[1:]
        if np.isfinite(shown).any():
            axes.loglog(frequencies[1:], shown, label=name, **look(i))
    if axes.lines:
        label_log(axes.xaxis, axes.yaxis)
        style.add_legend(axes)
    else:
        style.explain_empty(axes, "constant, or too few rows")


def _density_unit(unit: str, recordings: Sequence[Recording]) -> str:
    """m²/Hz of m; 1/Hz without a unit."""
    hertz = style.frequency_unit(recordings)
    hertz = f"({hertz})" if "/" in hertz else hertz
    unit = f"({unit})" if "/" in unit else unit
    return f"{unit}²/{hertz}" if unit else f"1/{hertz}"


def density(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Frequencies (Hz) and the one-sided power spectral density of a column.

    Parameters
    ----------
    values : (rows,). step : time between two rows (s).
    """
    from scipy import signal

    values = values[np.isfinite(values)]
    if len(values) < 2:
        return np.zeros(1), np.zeros(1)
    # Longer segments resolve lower frequencies, more of them give a smoother curve.
    length = min(len(values), max(SHORTEST, len(values) // SEGMENTS))
    frequencies, power = signal.welch(values, 1.0 / step, "hann", length, detrend="constant")
    return np.asarray(frequencies), np.asarray(power)


def _columns(recordings: Sequence[Recording]) -> Iterator[tuple[str, str, FloatArray, FloatArray]]:
    """Every column of some recordings: label, unit, times, values."""
    for recording in recordings:
        values = recording.columns
        for i, (label, unit) in enumerate(
            zip(recording.display_names, recording.units, strict=False)
        ):
            yield label, unit, recording.t, values[:, i]
