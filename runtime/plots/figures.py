"""Figures of a run: every kind of plot is drawn and saved here; time series and heat maps.

Figures are made without pyplot, which takes a second to import and keeps every figure in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.errors import UsageError, one_line
from runtime.files import slug, write_whole
from runtime.observation import PLOT_KINDS, PlotSpec, Recording, RunData, offered
from runtime.plots import looks, style, titles
from runtime.plots.map import contacts
from runtime.plots.trajectory import equal_scales

DPI = 150
NOTEBOOK_DPI = 110
FORMATS = ("png", "pdf", "svg")
MANY_LINES = 10
LINE_POINTS = 200_000
HEAT_ROWS = 1_000
FEW_ROWS = 12


class ShownFigure(Figure):
    """A figure that a notebook shows, also where matplotlib's inline mode is not switched on."""

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, dpi=NOTEBOOK_DPI, format="png")
        return content.getvalue()


def draw(plot: PlotSpec, result: RunData, look: str = "screen") -> Figure:
    """Draw one plot of a run.

    Parameters
    ----------
    plot : the figure's kind, title and the names of the probes that it shows.
    result : the run; an interrupted run is drawn up to where it ended.
    look : screen, or paper or paper2 for one or two columns of a page.

    Returns
    -------
    Figure : not tied to pyplot; ``figure.savefig("x.pdf")`` writes it.

    Raises
    ------
    UsageError : no such kind of plot, a probe was not recorded, or the run has no world to show.
    """
    if plot.own is None and plot.kind not in PLOT_KINDS:
        known = ", ".join(offered(plot.kind, result.world is not None))
        raise UsageError(f"plot '{plot.name}': expected one of {known}, got '{plot.kind}'")
    missing = [name for name in plot.of if name not in result.probes]
    if missing:
        raise UsageError(f"plot '{plot.name}' shows '{missing[0]}', which was not recorded")
    with matplotlib.rc_context({**style.STYLE, **looks.LOOKS[look].settings}):
        figure = ShownFigure(layout="constrained")
        painter = plot.declared.painter
        if isinstance(painter, str):
            module, _, function = painter.partition(":")
            painter = getattr(import_module(module), function)
        if plot.declared.in_world or plot.declared.with_options:
            top = painter(figure, plot, result)
        else:
            shown = [result.probes[name] for name in plot.of]
            if plot.kind == "trajectory":
                shown += contacts(plot, [result])
            top = painter(figure, shown, style.run_end(result))
        arrange(figure, top, plot)
        titles.set_title(top, plot.title, result)
        style.disable_math(figure)
        if "size" not in plot.options:
            looks.fit(figure, looks.LOOKS[look])
        titles.separate_notes(figure)
        if plot.kind == "trajectory" and not {"xlim", "ylim"} & plot.options.keys():
            equal_scales(figure, top)
    return figure


def arrange(figure: Figure, top: Axes, plot: PlotSpec) -> None:
    """Apply the options that every kind of plot takes, and mark the levels of a time series."""
    options = plot.options
    if "band" in options:
        style.shade_band(figure, float(options["band"]))
    if "limits" in options:
        style.mark_levels(top, np.atleast_1d(options["limits"]))
    if "xlim" in options:
        top.set_xlim(*options["xlim"])
        for axes in figure.axes if plot.kind in ("timeseries", "spectrum") else ():
            style.rescale(axes)
    if "ylim" in options:
        top.set_ylim(*options["ylim"])
    if "size" in options:
        figure.set_size_inches(*options["size"])
    labels = options.get("labels", ())
    if plot.kind == "xy" and len(labels) == len(plot.of) == 2:
        style.name_axes(top, *labels)
        labels = ()
    if plot.kind == "spectrum" and len(top.lines) == 1:
        labels = ()  # one curve has no legend, and its axis is called power density
    style.name_lines(figure, labels, bool(options.get("legend", True)))


def save_plots(
    result: RunData,
    folder: Path,
    note: Callable[[str], None] | None = None,
    formats: Sequence[str] = ("png",),
    look: str = "screen",
    made: Callable[[PlotSpec], Figure] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write every plot of a run as <name>.png, or in other formats.

    Parameters
    ----------
    result : the run.
    folder : created if it does not exist.
    note : called with a message for each plot that cannot be drawn or written; without it, the
        first such plot raises what matplotlib or the system raised.
    formats : of the files, among :data:`FORMATS`.
    look : of the figures, a name in :data:`runtime.plots.LOOKS`.
    made : draws a plot in place of :func:`draw`.
    progress : called with the number of plots that are done, and of all.

    Returns
    -------
    list of Path : the files, in the order of the graph's plots.
    """
    paths = []
    for i, plot in enumerate(result.plots):
        if progress is not None:
            progress(i, len(result.plots))
        name = slug(plot.name, "plot")
        files = [folder / f"{name}.{kind}" for kind in formats]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            figure = made(plot) if made is not None else draw(plot, result, look)
            for path in files:
                save_figure(figure, path)
        except Exception as error:
            if note is None:
                raise
            text = " ".join((str(error) or type(error).__name__).split())
            note(f"plot '{plot.name}' is not drawn: {one_line(text[:200])}")
        else:
            paths += files
    return paths


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as its file's suffix says, complete or not at all."""
    content, kind = BytesIO(), path.suffix.lstrip(".")
    # Without dates, the same figure is the same file.
    dated = {"pdf": "CreationDate", "svg": "Date"}.get(kind)
    about: dict[str, Any] = {} if dated is None else {dated: None}
    with matplotlib.rc_context({"svg.hashsalt": "spikeblocks", "pdf.fonttype": 42}):
        figure.savefig(content, dpi=DPI, format=kind, metadata=about)
    write_whole(path, content.getvalue())


@dataclass(frozen=True)
class _Column:
    label: str
    unit: str
    t: FloatArray
    y: FloatArray
    held: bool


def _flat(recorded: Recording) -> tuple[FloatArray, list[str], list[str]]:
    """A recording as (rows, columns), with one label and one unit per column."""
    values = recorded.columns
    count = values.shape[1]
    if len(recorded.labels) == count:
        return values, list(recorded.labels), list(recorded.units)
    named = style.signal_of(recorded.labels[0]) if recorded.labels else recorded.name
    units = list(recorded.units or ("",))
    return values, [f"{named}[{i}]" for i in range(count)], (units * count)[:count]


def draw_timeseries(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw columns over time, one axes per unit."""
    groups: dict[str, list[_Column]] = {}
    every: dict[str, str] = {}
    for recorded in recordings:
        values, labels, units = _flat(recorded)
        given = recorded.shown if len(recorded.labels) == len(labels) else labels
        every |= zip(labels, given, strict=True)
        held = recorded.held if len(recorded.held) == len(labels) else recorded.held[:1]
        for i, (label, unit) in enumerate(zip(labels, units, strict=True)):
            steps = bool(held) and held[i % len(held)]
            line = _Column(label, unit, recorded.t, values[:, i], steps)
            groups.setdefault(unit, []).append(line)
    shown_as = style.display_names(list(every), list(every.values()))
    names = dict(zip(every, shown_as, strict=True))
    groups, silent = _without_zeros(_shared(groups))
    figure.set_size_inches(style.WIDTH, 1.1 + 1.55 * max(1, len(groups)) + 0.5 * (len(groups) == 1))
    column = style.stacked_axes(figure, len(groups))
    for axes, (unit, lines) in zip(column, groups.items(), strict=False):
        shown = [names[line.label] for line in lines]
        _lines(figure, axes, lines, shown, end)
        axes.set_ylabel(style.axis_label(shown, unit))
    if silent:
        zero = ", ".join(names[label] for label in silent)
        style.write_note(column[-1], f"not shown, since it is 0 throughout: {zero}")
    style.time_axis(column, recordings, end)
    return column[0]


def _shared(groups: dict[str, list[_Column]]) -> dict[str, list[_Column]]:
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
    shown = {unit: lines for unit, lines in groups.items() if unit not in zero}
    return shown, [line.label for unit in zero for line in groups[unit]]


def _lines(figure: Figure, axes: Axes, lines: list[_Column], names: list[str], end: float) -> None:
    """Draw one axes of a time series: all columns of one unit."""
    if not any(len(line.y) for line in lines):
        style.explain_empty(axes)
        return
    many = len(lines) > MANY_LINES
    # The bright end of the colour map is too pale for lines on white.
    colours = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(lines))))
    low = high = 0.0
    layers = style.layers([line.y for line in lines])
    covered = [0] * len(lines) if many else style.coincident([line.y for line in lines])
    for i, (line, name) in enumerate(zip(lines, names, strict=True)):
        t, y = line.t, line.y
        how: dict[str, Any] = (
            {"color": colours(i), "linewidth": 0.5} if many else style.line_style(i, covered[i])
        )
        how["zorder"] = layers[i]
        if len(y) == 1:
            # A single row is a constant, or a probe slower than the run: it is marked by a dot.
            axes.plot([t[0], max(t[0], end)], [y[0], y[0]], **{**how, "linestyle": ":"})
            how |= {"marker": "o", "markersize": 4.0}
        most = max(400, min(style.THIN_TO, LINE_POINTS // len(lines)))
        is_long = len(y) > style.THIN_ABOVE or len(y) * len(lines) > LINE_POINTS
        style.draw_series(axes, t, y, line.held, most if is_long else 0, label=name, **how)
        finite = y[np.isfinite(y)]
        low, high = min(low, finite.min(initial=0.0)), max(high, finite.max(initial=0.0))
    if low < 0.0 < high:
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)
    if many:
        scale = ScalarMappable(Normalize(-0.5, len(lines) - 0.5), colours)
        figure.colorbar(scale, ax=axes, label="index", pad=0.01, aspect=14)
    else:
        style.add_legend(axes)


def draw_heatmap(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw arrays over time as colours, one axes each."""
    figure.set_size_inches(style.WIDTH, 0.9 + 2.6 * max(1, len(recordings)))
    column = style.stacked_axes(figure, len(recordings))
    for axes, recorded in zip(column, recordings, strict=False):
        _heat(figure, axes, recorded, end)
    style.time_axis(column, recordings, end)
    return column[0]


def _heat(figure: Figure, axes: Axes, recorded: Recording, end: float) -> None:
    """Draw one array: its rows along time, its columns upwards."""
    values, labels, units = _flat(recorded)
    axes.grid(False)
    if len(labels) <= FEW_ROWS:
        axes.set_yticks(range(len(labels)), style.short_labels(labels))
    else:
        axes.set_ylabel("index")
    if not values.size:
        style.explain_empty(axes)
        return
    size = -(-len(values) // HEAT_ROWS)
    shown = style.block_means(values, size)
    step = style.row_spacing(recorded.t, end) * size
    name, low, high = _colours(shown)
    image = axes.imshow(
        shown.T,
        aspect="auto",
        origin="lower",
        interpolation="nearest",
        cmap=matplotlib.colormaps[name].with_extremes(bad="0.8"),
        vmin=low,
        vmax=high,
        extent=(recorded.t[0], recorded.t[0] + step * len(shown), -0.5, len(labels) - 0.5),
    )
    unit = units[0] if len(set(units)) == 1 else "mixed units"
    signal = style.signal_name(labels) or recorded.name
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
