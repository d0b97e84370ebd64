"""Decoded signals beside what they should be, and weights as they are learnt.

In: a plot of kind ``decoded`` (a decoded signal, the ideal one, and perhaps ``over`` a third) or of
``weights``. Out: mean and standard deviation above the error, or weights above their mean change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style
from runtime.plots.thinning import thin

BINS = 60
FEWEST = 5  # rows of a bin that is shown
MOST_WEIGHTS = 40
IDEAL: dict[str, Any] = style.REFERENCE | {"linewidth": 1.0, "zorder": 2.5}


@dataclass(frozen=True)
class _Pair:
    """A decoded signal and the ideal one, (rows, columns), at the same times; ``over`` (rows,)."""

    t: FloatArray
    value: FloatArray
    ideal: FloatArray
    over: FloatArray | None

    def after(self, start: float) -> _Pair:
        first = int(np.searchsorted(self.t, start - 1e-9))
        over = None if self.over is None else self.over[first:]
        rows = (self.t[first:], self.value[first:], self.ideal[first:])
        return replace(self, t=rows[0], value=rows[1], ideal=rows[2], over=over)


def draw_decoded(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw a decoded signal's mean and standard deviation with the ideal one, and the error."""
    first, second = (result.probes[name] for name in plot.of)
    over = result.probes.get(str(plot.options.get("over")))
    pair = _Pair(first.t, first.columns, _at(first.t, second), None)
    if over is not None:
        pair = replace(pair, over=_at(first.t, over)[:, 0])
    pair = pair.after(float(plot.options.get("after", 0.0)))
    figure.set_size_inches(style.WIDTH, 4.2)
    upper, lower = style.stacked_axes(figure, 2, [2.4, 1.0])
    names = style.short_labels(first.display_names)
    if not len(pair.t):
        style.explain_empty(upper)
        style.explain_empty(lower)
        return upper
    if over is None:
        _over_time(
            upper, lower, pair, names, float(plot.options.get("window", 0.05)), first.time_unit
        )
        style.time_axis([upper, lower], [first], style.run_end(result))
        lower.set_xlim(left=pair.t[0])
    else:
        _over_signal(upper, lower, pair, names)
        lower.set_xlabel(style.axis_label(style.short_labels(over.display_names), over.units[0]))
    unit = first.units[0] if len(set(first.units)) == 1 else ""
    upper.set_ylabel(style.axis_label(names, unit))
    lower.set_ylabel(f"error [{unit}]" if unit else "error")
    lower.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)
    rms = np.sqrt(np.square(pair.value - pair.ideal).sum(axis=1).mean())
    style.write_note(lower, f"rms error {rms:.3g}")
    handles, labels = upper.get_legend_handles_labels()
    upper.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.03), borderaxespad=0.2)
    return upper


def _at(t: FloatArray, recording: Recording) -> FloatArray:
    """The values (rows, columns) of another recording at these times, held between its rows."""
    # 1e-9 s: the times of two probes are k * dt and may differ in the last bit.
    rows = np.searchsorted(recording.t, t + 1e-9, side="right") - 1
    return np.asarray(recording.columns[np.maximum(rows, 0)])


def _over_time(
    upper: Axes, lower: Axes, pair: _Pair, names: Sequence[str], window: float, unit: str
) -> None:
    rows = max(1, min(len(pair.t), round(window / style.row_spacing(pair.t))))
    for i, name in enumerate(names):
        value, ideal = pair.value[:, i], pair.ideal[:, i]
        # The error is averaged, not the value: a mean over time would flatten a curve's peaks.
        error = _sliding(value - ideal, rows)
        scatter = np.sqrt(_sliding(np.square(value - ideal - error), rows))
        _draw_column(upper, pair.t, ideal + error, scatter, i, name)
        lower.plot(pair.t, error, linewidth=0.8, **style.line_style(i))
    upper.plot(pair.t, pair.ideal, label=_ideals(len(names)), **IDEAL)
    style.write_note(upper, f"mean and standard deviation over {style.duration(window, unit)}")


def _ideals(count: int) -> list[str]:
    """Labels of the ideal columns, of which a legend shows one."""
    return ["_"] * (count - 1) + ["ideal"]


def _sliding(values: FloatArray, rows: int) -> FloatArray:
    """Means over a window of so many rows around each, shorter at the ends."""
    window = np.ones(rows)
    within = np.convolve(np.ones(len(values)), window, mode="same")
    return np.asarray(np.convolve(values, window, mode="same") / within)


def _over_signal(upper: Axes, lower: Axes, pair: _Pair, names: Sequence[str]) -> None:
    """Draw means and deviations in bins of another signal."""
    over = pair.t if pair.over is None else pair.over
    edges = np.linspace(over.min(), over.max(), BINS + 1)
    bins = np.clip(np.searchsorted(edges, over, side="right") - 1, 0, BINS - 1)
    counts = np.bincount(bins, minlength=BINS)
    # A mean of few rows says more about noise than about the signal.
    enough = counts >= min(FEWEST, len(over))

    def means(values: FloatArray) -> FloatArray:
        sums = np.bincount(bins, values, BINS)
        return np.asarray(sums[enough] / counts[enough])

    x = means(over)
    for i, name in enumerate(names):
        value, ideal = pair.value[:, i], means(pair.ideal[:, i])
        mean = means(value)
        # E[x^2] - E[x]^2, which rounding can make negative.
        scatter = np.sqrt(np.maximum(means(np.square(value)) - mean**2, 0.0))
        _draw_column(upper, x, mean, scatter, i, name)
        upper.plot(x, ideal, label=_ideals(len(names))[i], **IDEAL)
        lower.plot(x, mean - ideal, linewidth=0.8, **style.line_style(i))
    style.write_note(upper, f"mean and standard deviation in {BINS} bins")


def _draw_column(
    axes: Axes, x: FloatArray, mean: FloatArray, scatter: FloatArray, i: int, name: str
) -> None:
    """One column: its mean, in a band of one standard deviation."""
    how = style.line_style(i)
    axes.fill_between(
        x, mean - scatter, mean + scatter, color=how["color"], alpha=0.25, linewidth=0.0
    )
    axes.plot(x, mean, label=name, **how)


def draw_weights(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw weights over time, and the root mean square of the change of all of them."""
    figure.set_size_inches(style.WIDTH, 1.4 + 2.6 * len(recordings))
    column = style.stacked_axes(figure, 2 * len(recordings), [2.4, 1.0] * len(recordings))
    for recording, upper, lower in zip(recordings, column[::2], column[1::2], strict=True):
        _weights(upper, lower, recording, len(recordings) > 1)
    style.time_axis(column, recordings, end)
    return column[0]


def _weights(upper: Axes, lower: Axes, recording: Recording, with_name: bool) -> None:
    values = recording.columns
    name = style.short_labels([style.signal_of(recording.display_names[0])])[0]
    upper.set_ylabel(f"{name}\nweights" if with_name else "weights")
    lower.set_ylabel("rms change")
    if not values.size:
        style.explain_empty(upper)
        style.explain_empty(lower)
        return
    # Evenly by rank among the last values, so that the extremes and the middle are shown.
    order = np.argsort(values[-1], kind="stable")
    lines = order[np.unique(np.linspace(0, len(order) - 1, MOST_WEIGHTS).astype(int))]
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(lines)))
    for i, colour in zip(lines, shades, strict=True):
        upper.plot(*thin(recording.t, values[:, i], 1000), color=colour, linewidth=0.7)
    change = np.sqrt(np.square(values - values[0]).mean(axis=1))
    lower.plot(*thin(recording.t, change, 4000), color=style.COLOURS[0])
    lower.set_ylim(0.0, None)
    style.write_note(upper, f"{len(lines)} of {values.shape[1]} weights, coloured by last value")
