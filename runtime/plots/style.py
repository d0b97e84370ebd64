"""The common look of all figures: colours, titles, labels of axes, thinned series.

In: axes, labels, series. Out: the same for every kind of plot, so that two figures of a run match::

    short_labels(["plant.pose.x", "plant.pose.y"])     # ["x", "y"]
    axis_label(["x", "y"], "m")                        # "x, y [m]"
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from blocks.core import FloatArray
from runtime.document import SECOND, TIME_UNITS
from runtime.plots.thinning import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

    from runtime.observation import PlotSpec, Recording, RunData

WIDTH = 6.5  # inches, the text width of a one-column paper
GREY = "0.4"
TITLE_SIZE = 10.0  # points
LETTER = 0.55  # mean width of a letter, as a share of the font's size
NOISY = 0.3  # share of steps that go back
MARGIN = 0.05  # of an axis, above and below what it shows
COINCIDENT = 0.01  # of a line's range
LONG_NAME = 20  # characters, about what fits beside the lowest axes
# Okabe and Ito's palette for colour-blind readers, without its yellow, too pale for lines.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
THIN_ABOVE, THIN_TO = 20_000, 4_000  # rows
LINESTYLES = ("-", "--", ":", "-.")
# What the name of a signal says that others should be; drawn as grey dashes.
IS_REFERENCE = re.compile(
    r"(?<![a-z])(reference|setpoint|ideal|exact|target|desired|wanted)(?![a-z])"
)
REFERENCE: Any = {"color": "0.45", "linestyle": (0, (4, 2))}
GREEK = {"theta": "θ", "omega": "ω", "kappa": "κ"}
# Any: the names of the parameters are a literal type in some versions of matplotlib only.
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.6,
    "axes.edgecolor": "0.3",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.useoffset": False,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": "0.3",
    "ytick.color": "0.3",
    "xtick.labelcolor": "black",
    "ytick.labelcolor": "black",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "figure.facecolor": "white",
}


def mark_times(figure: Figure, times: FloatArray) -> None:
    """Mark times as short vertical lines at the bottom of all axes that show lines."""
    for axes in [each for each in figure.axes if each.lines]:
        places = axes.get_xaxis_transform()
        axes.vlines(times, 0.0, 0.04, color="0.3", linewidth=0.8, transform=places, zorder=3.0)


def shade_band(figure: Figure, band: float) -> None:
    """Shade the range from -band to band on all axes that show lines, and say so.

    Where no value is negative, as of a distance, the range begins at 0.
    """
    with_lines = [axes for axes in figure.axes if axes.lines]
    sign = ""
    for axes in with_lines:
        values = [np.asarray(line.get_ydata(), dtype=float) for line in _lines_with_names(axes)]
        low = min(float(np.nanmin(y, initial=0.0)) for y in values)
        sign = "±" if low < 0.0 else sign
        axes.axhspan(
            -band if low < 0.0 else 0.0, band, color="0.5", alpha=0.16, linewidth=0.0, zorder=0.4
        )
    if with_lines:
        write_note(with_lines[0], f"shaded: within {sign}{band:g}")


def mark_levels(axes: Axes, levels: FloatArray) -> None:
    """Draw levels of the vertical axis as dashed lines."""
    for level in levels:
        axes.axhline(float(level), color="0.35", linewidth=0.8, linestyle=(0, (4, 2.5)), zorder=1.5)


def name_lines(figure: Figure, labels: Sequence[str], is_visible: bool) -> None:
    """Give the lines other names, in the order of the axes and of their lines; remove legends."""
    left = iter(labels)
    for legend in figure.legends:
        _rename(legend, left)
    for axes in figure.axes:
        lines = axes.get_legend_handles_labels()[0]
        if (beside := axes.get_legend()) is not None:
            old = [text.get_text() for text in beside.get_texts()]
            _rename(beside, left)
            new = [text.get_text() for text in beside.get_texts()]
            if axes.get_ylabel() == _replace_names(axes.get_ylabel(), *old):
                axes.set_ylabel(_replace_names(axes.get_ylabel(), *new))
        elif len(lines) == 1 and not figure.legends and (name := next(left, "")):
            axes.set_ylabel(_replace_names(axes.get_ylabel(), name))
    if not is_visible:
        for each in [*figure.legends, *(axes.get_legend() for axes in figure.axes)]:
            if each is not None:
                each.remove()


def name_axes(axes: Axes, across: str, up: str) -> None:
    """Give both axes other names, and keep their units."""
    axes.set_xlabel(_replace_names(axes.get_xlabel(), across))
    axes.set_ylabel(_replace_names(axes.get_ylabel(), up))


def _replace_names(label: str, *names: str) -> str:
    """The label of an axis with other names and the same unit."""
    unit = re.search(r"(?:^|\s)\[([^\[\]]*)\]$", label)
    return axis_label(names, unit[1] if unit else "")


def set_limits(figure: Figure, top: Axes, plot: PlotSpec) -> None:
    """Limit the top axes as the plot's options say."""
    if "xlim" in plot.options:
        top.set_xlim(*plot.options["xlim"])
    if "ylim" in plot.options:
        top.set_ylim(*plot.options["ylim"])


def fit_limits(figure: Figure, top: Axes, plot: PlotSpec) -> None:
    """Limit the top axes, and fit the vertical axes to what is seen of their lines."""
    if "xlim" in plot.options:
        top.set_xlim(*plot.options["xlim"])
        for axes in figure.axes:
            rescale(axes)
    set_limits(figure, top, plot)


def line_labels(top: Axes, plot: PlotSpec) -> Sequence[str]:
    """The option ``labels``, which names the lines."""
    labels: Sequence[str] = plot.options.get("labels", ())
    return labels


def rescale(axes: Axes) -> None:
    """Fit the vertical axis to the parts of its lines that the horizontal axis shows."""
    low, high = axes.get_xlim()
    lines = _lines_with_names(axes)
    points = [np.column_stack(np.broadcast_arrays(*line.get_data())) for line in lines]
    visible = [y[(low <= x) & (x <= high) & np.isfinite(y)] for x, y in (p.T for p in points)]
    values = np.concatenate(visible) if visible else np.empty(0)
    if values.size and values.max() > values.min():
        # The margins are equal on the screen, also of a logarithmic axis.
        ends = axes.transData.transform([(low, values.min()), (low, values.max())])
        margin = MARGIN * float(np.ptp(ends[:, 1]))
        ends[:, 1] += (-margin, margin)
        axes.set_ylim(*axes.transData.inverted().transform(ends)[:, 1])


def _lines_with_names(axes: Axes) -> Sequence[Line2D]:
    """The lines of an axes that have a name; all if none has."""
    with_names = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
    return with_names or list(axes.get_lines())


def _rename(legend: Legend, labels: Iterator[str]) -> None:
    for text in legend.get_texts():
        if text.get_text() not in ("start", "end"):
            text.set_text(next(labels, text.get_text()))


def symbol(name: str) -> str:
    """A name whose component is the Greek letter that formulas write: ω for omega."""
    head, dot, last = name.rpartition(".")
    return f"{head}{dot}{GREEK.get(last, last)}"


def display_names(labels: Sequence[str], names: Sequence[str]) -> list[str]:
    """What a figure calls its lines: the given names, unless two lines share one, or short labels.

    Parameters
    ----------
    labels : of the columns, all different.
    names : of the same columns; equal to the label where there is none.
    """
    # A name that a user gave twice cannot tell two lines apart: both get labels instead.
    is_own = [
        name != label and names.count(name) == 1 for label, name in zip(labels, names, strict=True)
    ]
    short = iter(short_labels([each for each, own in zip(labels, is_own, strict=True) if not own]))
    return [symbol(name if own else next(short)) for name, own in zip(names, is_own, strict=True)]


def layers(lines: Sequence[FloatArray]) -> list[float]:
    """The zorder of each line: a noisy one is drawn behind a smooth one, which it would hide.

    Parameters
    ----------
    lines : values over time, or points (rows, columns).
    """
    noisy = [_roughness(values) > NOISY for values in lines]
    return [2.0 if each else 2.2 for each in noisy]


def _roughness(values: FloatArray) -> float:
    """The share of a line's steps that go back: 0 for a smooth line, about 2/3 for noise."""
    rows = values.reshape(len(values), -1)
    steps = np.diff(rows[np.isfinite(rows).all(axis=1)], axis=0)
    steps = steps[steps.any(axis=1)]
    if len(steps) < 2:
        return 0.0
    return float(np.mean((steps[1:] * steps[:-1]).sum(axis=1) < 0.0))


def coincident(lines: Sequence[FloatArray]) -> list[int]:
    """How many earlier lines each one covers: those that differ by less than a hundredth.

    Parameters
    ----------
    lines : values over time, or points (rows, columns).
    """
    counts = []
    for i, values in enumerate(lines):
        finite = values[np.isfinite(values)]
        close = COINCIDENT * float(np.ptp(finite)) if finite.size else 0.0
        earlier = [other for other in lines[:i] if other.shape == values.shape and close > 0.0]
        counts.append(sum(np.allclose(other, values, 0.0, close, True) for other in earlier))
    return counts


def line_style(i: int, covers: int = 0) -> dict[str, Any]:
    """Colour and dashes of the i-th line of an axes, with gaps that show lines that it covers."""
    dashes: Any = LINESTYLES[i // len(COLOURS) % len(LINESTYLES)]
    if covers:
        dashes = (0.0, (4.0, 3.0) if covers == 1 else (1.5, 5.5))
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": dashes}


def is_reference(*names: str) -> bool:
    """Whether a line with these names is what others are compared with, as setpoint.out."""
    return any(IS_REFERENCE.search(name) for name in names)


def run_end(result: RunData) -> float:
    """The time at which the run ended."""
    return float(result.manifest.get("ticks", 0) * result.manifest.get("dt", 0.0))


def row_spacing(t: FloatArray, default: float = 1.0) -> float:
    """The time from one row to the next; ``default`` if there is only one row."""
    return float(t[1] - t[0]) if len(t) > 1 else (default or 1.0)


def draw_series(
    axes: Axes, t: FloatArray, y: FloatArray, held: bool, most: int = 0, **how: Any
) -> None:
    """Draw one column over time: a line, or steps if it keeps its value from row to row.

    Infinity, a ray without a hit, is a gap. The last step ends where the next row would be.

    Parameters
    ----------
    held : whether it is drawn as steps.
    most : about how many points are drawn of a series that is longer; 0: all, up to
        :data:`THIN_ABOVE`, and :data:`THIN_TO` of a longer one.
    how : the look of the line, as matplotlib's ``plot`` takes it.
    """
    y = np.where(np.isfinite(y), y, np.nan)
    last = row_spacing(t)
    if most or len(y) > THIN_ABOVE:
        t, y = thin(t, y, most or THIN_TO)
    if held and len(t) > 1:
        t, y = np.append(t, t[-1] + last), np.append(y, y[-1])
        how["drawstyle"] = "steps-post"
    axes.plot(t, y, **how)


def gaps_at_turns(t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """An angle (rad) that jumps by a turn, with a gap at each jump instead of a vertical line."""
    jumps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1
    # What leaves -pi to pi is not wrapped: its jumps are what happened.
    if not len(jumps) or np.nanmax(np.abs(y)) > np.pi + 1e-6:
        return t, y
    return np.insert(t, jumps, t[jumps]), np.insert(y, jumps, np.nan)


def duration(time: float, unit: str) -> str:
    """A short time in words: that of seconds in ms."""
    return f"{1e3 * time:.3g} ms" if unit == SECOND else f"{time:.3g} {unit}"


def time_unit(recordings: Sequence[Recording]) -> str:
    """What the times of some recordings are in."""
    return recordings[0].time_unit if recordings else SECOND


def frequency_unit(recordings: Sequence[Recording]) -> str:
    """What frequencies of some recordings are in: GHz for ns."""
    return TIME_UNITS[time_unit(recordings)]


def time_axis(column: Sequence[Axes], recordings: Sequence[Recording], end: float) -> None:
    """Label the time axis that a column of axes shares, up to the end of the last row's step."""
    ends = [float(r.t[-1]) + row_spacing(r.t, end) for r in recordings if len(r.t)]
    starts = [float(r.t[0]) for r in recordings if len(r.t)]
    column[-1].set_xlim(min(starts, default=0.0), max(ends, default=end) or 1.0)
    column[-1].xaxis.set_major_locator(MaxNLocator(nbins=10, steps=[1, 2, 5, 10]))
    column[-1].set_xlabel(f"time [{time_unit(recordings)}]")


def explain_empty(axes: Axes, text: str = "nothing recorded") -> None:
    """Write into an empty axes why it is empty, and remove its ticks."""
    axes.set_yticks([])
    axes.grid(False)
    axes.annotate(
        text,
        xy=(0.5, 0.5),
        xycoords="axes fraction",
        ha="center",
        va="center",
        color=GREY,
        style="italic",
    )


def write_note(axes: Axes, text: str) -> None:
    """Write a small note above the right end of an axes."""
    axes.annotate(
        text,
        xy=(1.0, 1.0),
        xytext=(0.0, 2.0),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        fontsize=7.0,
        color=GREY,
        gid="note",
    )


def add_legend(axes: Axes) -> None:
    """Add a legend beside an axes that has more than one line."""
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        axes.legend(
            handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.03), borderaxespad=0.2
        )


def legend_height(count: int) -> float:
    """The height (in) of a legend of so many lines beside an axes."""
    # matplotlib's row: the font's size and half of it between two rows.
    return (1.5 * float(STYLE["legend.fontsize"]) * count + 8.0) / 72.0


def stacked_axes(figure: Figure, count: int, ratios: Sequence[float] | None = None) -> list[Axes]:
    """A column of axes that share their time axis."""
    count = max(1, count)
    column = figure.subplots(count, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    for axes in column:
        place_power(axes)
    return list(column)


def place_power(axes: Axes) -> None:
    """Place the vertical axis' power of ten left of the subtitle, which it would overlap."""
    axes.yaxis.get_offset_text().set(x=-0.01, horizontalalignment="right")


def signal_of(label: str) -> str:
    """The signal of a column's label: plant.pose for plant.pose.x, a.w for a.w[0]."""
    return re.sub(r"(\[\d+\]|\.[^.\[\]]+)$", "", label)


def short_labels(labels: Sequence[str]) -> list[str]:
    """Labels without the parts that all have in common at the front and at the back.

    A single label keeps its last two parts, and a number keeps the name before it.
    """
    parts = [label.split(".") for label in labels]
    if len(set(labels)) < 2:
        return [".".join(p[-2:]) for p in parts]
    shortest = min(map(len, parts))
    front = 0
    while front < shortest - 1 and len({p[front] for p in parts}) == 1:
        front += 1
    while front and any(p[front].isdigit() for p in parts):
        front -= 1
    back = 0
    while back < shortest - front - 1 and len({p[-1 - back] for p in parts}) == 1:
        back += 1
    return [".".join(p[front : len(p) - back]) for p in parts]


def signal_name(labels: Sequence[str]) -> str:
    """The last two parts of the signal that all labels belong to; empty if there is none."""
    for cut in (r"\[\d+\]$", r"\.[^.]+$"):
        signals = {re.sub(cut, "", label) for label in labels}
        if len(signals) == 1:
            return ".".join(signals.pop().split(".")[-2:])
    return ""


def axis_label(labels: Sequence[str], unit: str) -> str:
    """The label of an axis: a few names, or else the signal that they share; and the unit."""
    names = list(dict.fromkeys(labels))
    text = ", ".join(names)
    if len(names) > 3 or (len(names) > 1 and len(text) > LONG_NAME):
        text = signal_name(names) or ("" if unit else "value")
    gap = "\n" if len(text) + len(unit) > LONG_NAME else " "
    return f"{text}{gap}[{unit}]".strip() if unit else text
