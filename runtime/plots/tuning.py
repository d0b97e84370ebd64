"""The tuning of neurons: their steady rates over what they represent.

In: recordings of the kind Tuning, one row each: encoders (n, d) and rates (n, places) beside each
other. Out: curves over each dimension (``tuning_curves``), or over the input along each neuron's
own encoder, with histograms of intercepts and largest rates (``response_curves``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

from blocks.core import FloatArray
from blocks.neural import PLACES
from runtime.observation import Recording
from runtime.plots import style

MOST_LINES = 250
MOST_DIMENSIONS = 3
BINS = 20
SUFFIX = ".tuning"


@dataclass(frozen=True)
class Tuning:
    """The neurons of one ensemble: encoders (n, d), rates (n, places) along their encoders."""

    name: str
    encoders: FloatArray
    rates: FloatArray
    unit: str

    @property
    def dimensions(self) -> int:
        return int(self.encoders.shape[1])

    @cached_property
    def directions(self) -> FloatArray:
        """Encoders of length 1, (n, d)."""
        lengths = np.sqrt(np.square(self.encoders).sum(axis=1, keepdims=True))
        return np.asarray(self.encoders / np.where(lengths > 0.0, lengths, 1.0))

    @cached_property
    def intercepts(self) -> FloatArray:
        """Where each neuron begins to fire along its encoder, in radii; NaN if it never does."""
        active = self.rates > 0.0
        places = PLACES[active.argmax(axis=1)]
        return np.where(active.any(axis=1), places, np.nan)

    def along(self, axis: int) -> FloatArray:
        """Rates (n, places) over one dimension, the others 0."""
        # A neuron sees an input along an axis as its part along the encoder, and the rates along
        # encoders are known.
        places = self.directions[:, axis, None] * PLACES
        return np.array(
            [np.interp(at, PLACES, r) for at, r in zip(places, self.rates, strict=True)]
        )

    def order(self) -> npt.NDArray[np.intp]:
        """Neurons by preferred direction: in one dimension by encoder and intercept, in several
        by the angle in the plane of the first two.
        """
        if self.dimensions > 1:
            return np.argsort(self.angles, kind="stable")
        sign = np.sign(self.encoders[:, 0])
        return np.lexsort((sign * np.nan_to_num(self.intercepts, nan=2.0), sign))

    @property
    def angles(self) -> FloatArray:
        """Angles (rad) of the encoders in the plane of the first two dimensions."""
        return np.arctan2(self.encoders[:, 1], self.encoders[:, 0])


def tuning_of(recording: Recording) -> Tuning:
    """The tuning that a probe of the kind Tuning has recorded."""
    table = recording.values[0]
    d = table.shape[1] - len(PLACES)
    name = recording.labels[0].removesuffix(SUFFIX)
    return Tuning(name, table[:, :d], table[:, d:], recording.units[0])


def draw_tuning_curves(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw rates over each of the first three dimensions of what ensembles represent."""
    tunings = [tuning_of(recording) for recording in recordings]
    rows, columns = len(tunings), max(min(each.dimensions, MOST_DIMENSIONS) for each in tunings)
    figure.set_size_inches(style.WIDTH, 0.6 + 2.6 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey="row")
    for each, row in zip(tunings, grid, strict=True):
        dimensions = min(each.dimensions, MOST_DIMENSIONS)
        for axis, axes in enumerate(row):
            if axis >= dimensions:
                axes.set_axis_off()
                continue
            _curves(axes, each.along(axis), *_by_direction(each, axis))
            name = "x" if each.dimensions == 1 else f"x[{axis}]"
            axes.set_xlabel(f"{name} / radius")
        _rates_axis(row[0], each, rows > 1)
        _note_sample(row[dimensions - 1], each)
    top: Axes = grid[0, 0]
    return top


def draw_response_curves(figure: Figure, recordings: Sequence[Recording], end: float) -> Axes:
    """Draw rates over the input along each neuron's own encoder, with histograms at the edges."""
    tunings = [tuning_of(recording) for recording in recordings]
    figure.set_size_inches(style.WIDTH, 0.4 + 3.4 * len(tunings))
    grid = figure.add_gridspec(
        2 * len(tunings), 2, width_ratios=(5.0, 1.0), height_ratios=(1.0, 4.0) * len(tunings)
    )
    tops = [_response(figure, grid, i, each, len(tunings)) for i, each in enumerate(tunings)]
    return tops[0]


def _response(figure: Figure, grid: GridSpec, i: int, each: Tuning, count: int) -> Axes:
    """One ensemble's responses; returns the axes above them."""
    main = figure.add_subplot(grid[2 * i + 1, 0])
    above = figure.add_subplot(grid[2 * i, 0], sharex=main)
    right = figure.add_subplot(grid[2 * i + 1, 1], sharey=main)
    shades = matplotlib.colormaps["viridis"]
    colours = shades(0.9 * (np.nan_to_num(each.intercepts, nan=1.0) + 1.0) / 2.0)
    _curves(main, each.rates, colours, np.argsort(each.intercepts))
    main.set_xlabel("input along the encoder / radius")
    _rates_axis(main, each, count > 1)
    above.hist(each.intercepts[np.isfinite(each.intercepts)], BINS, range=(-1.0, 1.0), **_bars())
    largest = each.rates.max(axis=1)
    span = (0.0, max(1.0, float(largest.max(initial=0.0))))
    right.hist(largest, BINS, range=span, orientation="horizontal", **_bars())
    above.set_ylabel("neurons")
    right.set_xlabel("neurons")
    for axes in (above, right):
        axes.grid(False)
        axes.tick_params(labelbottom=axes is right, labelleft=axes is above)
        for tick in (axes.xaxis if axes is above else axes.yaxis).get_major_ticks():
            tick.tick1line.set_visible(False)
    _note_sample(above, each)
    return above


def _bars() -> dict[str, Any]:
    return {"color": "0.75", "edgecolor": "white"}


def _curves(
    axes: Axes, rates: FloatArray, colours: FloatArray, order: npt.NDArray[np.intp]
) -> None:
    """Draw the rates of neurons from back to front, evenly chosen if there are many."""
    neurons = order[np.unique(np.linspace(0, len(rates) - 1, MOST_LINES).astype(int))]
    width = 0.9 if len(neurons) <= 50 else 0.6
    for i in neurons:
        axes.plot(PLACES, rates[i], color=tuple(colours[i]), linewidth=width)
    axes.set_xlim(-1.0, 1.0)


def _by_direction(each: Tuning, axis: int) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Colours by the component of the preferred directions along an axis, the largest in front."""
    component = each.directions[:, axis]
    ends: Colormap = matplotlib.colormaps["coolwarm"]
    return np.asarray(ends(0.5 + 0.5 * component)), np.argsort(np.abs(component), kind="stable")


def _rates_axis(axes: Axes, each: Tuning, with_name: bool) -> None:
    rate = f"rate [{each.unit}]"
    axes.set_ylabel(f"{each.name}\n{rate}" if with_name else rate)
    axes.set_ylim(min(0.0, 1.05 * float(each.rates.min())), None)


def _note_sample(axes: Axes, each: Tuning) -> None:
    count = len(each.rates)
    more = f", {MOST_LINES} shown" if count > MOST_LINES else ""
    style.write_note(axes, f"{count} neurons{more}")


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], dict[str, Tuning]]:
    """Recordings of signals, and the tuning behind those whose tuning was recorded, by address."""
    signals = [recording for recording in recordings if recording.kinds != ("Tuning",)]
    tunings = (tuning_of(recording) for recording in recordings if recording.kinds == ("Tuning",))
    return signals, {each.name: each for each in tunings}


def name_angles(axes: Axes, angles: Iterator[float] | FloatArray) -> None:
    """Label the vertical axis, on which neurons are sorted by these angles (rad), in degrees."""
    degrees = np.sort(np.degrees(np.asarray(angles)))
    marks = np.arange(-180, 181, 90)
    axes.set_yticks(
        np.searchsorted(degrees, marks) - 0.5,
        [f"{mark}°".replace("-", "\N{MINUS SIGN}") for mark in marks],
    )
