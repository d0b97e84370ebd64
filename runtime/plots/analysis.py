"""Signals against each other, and over frequency.

In: recordings. Out: the second column over the first (``xy``), or the power density of each column
(``spectrum``): a sine of amplitude 2 m at 5 Hz is a peak at 5 Hz with an area of 2 m².
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.observation import Recording
from runtime.plots import style

# Segments of Welch's method: so many, or as many as are this long (rows).
SEGMENTS, SHORTEST = 8, 256


def draw_xy(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw the second signal over the first, the fourth over the third, and so on.

    The start of each curve is marked by a dot.
    """
    figure.set_size_inches(style.WIDTH, 0.75 * style.WIDTH)
    axes = figure.add_subplot()
    style.place_power(axes)
    columns = list(_columns(recordings))
    names = style.short_labels([label for label, *_ in columns])
    pairs = list(zip(columns[::2], columns[1::2], names[::2], names[1::2], strict=False))
    for i, (across, up, name, other) in enumerate(pairs):
        x, y = across[3], up[3]
        if len(x):
            how = style.line_style(i)
            axes.plot(x, y, label=f"{other} over {name}", **how)
            axes.plot(x[:1], y[:1], "o", color=how.get("color"), markersize=4.0)
    if not axes.lines:
        style.explain_empty(axes)
    for labels, units, write in (
        (names[::2], [pair[0][1] for pair in pairs], axes.set_xlabel),
        (names[1::2], [pair[1][1] for pair in pairs], axes.set_ylabel),
    ):
        unit = units[0] if len(set(units)) == 1 else ""
        write(style.axis_label(list(dict.fromkeys(labels)), unit))
    if pairs and {column[1] for pair in pairs for column in pair[:2]} == {"m"}:
        axes.set_aspect("equal")  # a plane: a circle is one
    if len(pairs) > 1:
        style.add_legend(axes)
    return axes


def draw_spectrum(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw the power spectral density of each column, one axes per unit.

    Welch's method with Hann windows, means removed: the area under a curve is the variance.
    """
    groups: dict[str, list[tuple[str, FloatArray, FloatArray]]] = {}
    for label, unit, t, values in _columns(recordings):
        frequencies, power = density(values, style.row_spacing(t, end))
        groups.setdefault(unit, []).append((label, frequencies, power))
    figure.set_size_inches(style.WIDTH, 1.1 + 2.2 * max(1, len(groups)))
    column = style.stacked_axes(figure, max(1, len(groups)))
    hertz = style.frequency_unit(recordings)
    hertz = f"({hertz})" if "/" in hertz else hertz
    for axes, (unit, lines) in zip(column, groups.items(), strict=False):
        names = style.short_labels([label for label, *_ in lines])
        for i, ((_, frequencies, power), name) in enumerate(zip(lines, names, strict=True)):
            positive = power > 0.0
            if positive[1:].any():
                style_of = style.line_style(i)
                axes.loglog(
                    frequencies[1:], np.where(positive, power, np.nan)[1:], label=name, **style_of
                )
        if not axes.lines:
            style.explain_empty(axes, "constant, or too few rows")
        else:
            style.add_legend(axes)
        density_unit = f"({unit})²/{hertz}" if "/" in unit else f"{unit}²/{hertz}"
        density_unit = density_unit if unit else f"1/{hertz}"
        axes.set_ylabel(f"power density [{density_unit}]")
    column[-1].set_xlabel(f"frequency [{style.frequency_unit(recordings)}]")
    return column[0]


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
