"""Spike rasters: the spikes of each neuron over time, and the population's mean rate.

In: a plot of kind ``raster`` with probes of spikes (rows, neurons), and of tuning if neurons are
sorted by it. Out: one axes per ensemble, with a mark for each spike, above their mean rates in Hz.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from blocks.core import FloatArray
from runtime.document import SECOND, TIME_UNITS
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style
from runtime.plots.thinning import block_means
from runtime.plots.tuning import Tuning, name_angles, split

MANY_SPIKES = 20_000
BINS, SORTING_BINS = 400, 50
ITERATIONS = 50
WINDOW = 0.05  # s: several interspike intervals at 200-400 Hz, shorter than a robot's motions


@dataclass(frozen=True)
class _Train:
    """The spikes of one ensemble, (rows, neurons): 1/dt where a neuron fired.

    With ``tuning``, neurons are sorted by preferred direction.
    """

    name: str
    t: FloatArray
    spikes: FloatArray
    tuning: Tuning | None = None
    time_unit: str = SECOND

    def binned_rates(self, most: int) -> tuple[FloatArray, int]:
        """Rates (Hz) in at most ``most`` bins of time, and the number of rows per bin."""
        size = -(-len(self.t) // most) or 1
        return (block_means(self.spikes, size) if self.spikes.size else self.spikes), size

    def order(self) -> npt.NDArray[np.intp]:
        """Neurons by preferred direction, or by the first principal component of their rates.

        By the latter, neurons of opposite encoders are at opposite ends, silent ones between them;
        sorted by mean rate, the two kinds would be mixed.
        """
        if self.tuning is not None:
            return self.tuning.order()
        rates = self.binned_rates(SORTING_BINS)[0]
        if not rates.any():
            return np.arange(rates.shape[1])
        rates = rates - rates.mean(axis=0)
        # Power iteration: threaded LAPACK can take seconds for a matrix this small.
        products = rates @ rates.T
        course = products[products.diagonal().argmax()]
        # Converges as the ratio of the two largest variances to the power of the iterations; where
        # these are equal, either direction sorts as well.
        for _ in range(ITERATIONS):
            course = products @ (course / (np.linalg.norm(course) or 1.0))
        weights = course @ rates
        # The sign of a component is arbitrary: the neuron of the largest weight is on top.
        return np.argsort(weights * np.sign(weights[np.abs(weights).argmax()]), kind="stable")


def draw_raster(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw spikes, one axes per ensemble, above the ensembles' mean rates.

    Up to 20,000 spikes per ensemble are drawn one by one; more would be a solid block, and are
    drawn as rates in bins of time.

    Parameters
    ----------
    figure : what to draw on.
    plot : of probes of spikes, and of the tuning behind them if it sorts neurons by that.
    result : the run.

    Returns
    -------
    Axes : the topmost.
    """
    recordings, tuning = split([result.probes[name] for name in plot.of])
    end = style.run_end(result)
    trains = list(_trains(recordings, tuning))
    count = max(1, len(trains))
    figure.set_size_inches(style.WIDTH, 2.2 + 2.1 * count)
    *upper, lower = style.stacked_axes(figure, count + 1, [*[2.1] * count, 1.2])
    # All ensembles in the same way, so that they can be compared.
    if sum(np.count_nonzero(train.spikes) for train in trains) > MANY_SPIKES * count:
        _images(figure, upper, trains, end)
    else:
        for axes, train in zip(upper, trains, strict=False):
            _marks(axes, train)
    names = style.short_labels([train.name for train in trains])
    for axes, train, name in zip(upper, trains, names, strict=False):
        message = _order_label(axes, train)
        axes.set_ylabel(f"{name}\n{message}" if count > 1 else message)
        axes.set_ylim(-0.5, max(1, train.spikes.shape[1]) - 0.5)
        axes.grid(False)
    _rates(lower, trains, names, end)
    style.time_axis([*upper, lower], recordings, end)
    return upper[0]


def _order_label(axes: Axes, train: _Train) -> str:
    """How the neurons are sorted, for the label of their axis."""
    if train.tuning is None:
        return "neuron, sorted by 1st PC"
    if train.tuning.dimensions == 1:
        return "neuron, sorted by tuning"
    name_angles(axes, train.tuning.angles)
    return "preferred direction"


def _trains(recordings: Sequence[Recording], tuning: Mapping[str, Tuning]) -> Iterator[_Train]:
    for recording in recordings:
        whole = {recording.name: (0, len(recording.labels))}
        for address, (start, stop) in (recording.addresses or whole).items():
            spikes = recording.columns[:, start:stop]
            name = style.signal_of(recording.display_names[start])
            yield _Train(name, recording.t, spikes, tuning.get(address), recording.time_unit)


def _marks(axes: Axes, train: _Train) -> None:
    """Mark every spike."""
    row, neuron = np.nonzero(train.spikes[:, train.order()])
    if not len(row):
        style.explain_empty(axes, "no spikes" if len(train.t) else "nothing recorded")
        return
    axes.plot(
        train.t[row],
        neuron,
        linestyle="none",
        marker="|",
        color="black",
        markersize=min(8.0, max(1.2, 150.0 / train.spikes.shape[1])),
        markeredgewidth=1.0 if len(row) < MANY_SPIKES // 10 else 0.5,
        label=train.name,
    )


def _images(figure: Figure, column: Sequence[Axes], trains: Sequence[_Train], end: float) -> None:
    """Draw rates in bins of time, on one grey scale for all ensembles."""
    images = [train.binned_rates(BINS) for train in trains]
    fastest = max(float(rates.max(initial=0.0)) for rates, _ in images)
    for axes, train, (rates, size) in zip(column, trains, images, strict=True):
        width = size * style.row_spacing(train.t, end)
        image = axes.imshow(
            rates[:, train.order()].T,
            aspect="auto",
            origin="lower",
            interpolation="nearest",
            cmap="Greys",
            vmin=0.0,
            vmax=fastest,
            extent=(train.t[0], train.t[0] + width * len(rates), -0.5, rates.shape[1] - 0.5),
        )
        label = (
            f"rate in {style.duration(width, train.time_unit)} bins [{TIME_UNITS[train.time_unit]}]"
        )
        figure.colorbar(image, ax=axes, label=label, pad=0.01, aspect=16)


def mean_rate(spikes: FloatArray, step: float) -> FloatArray:
    """The mean rate (Hz) of all neurons in a sliding window of :data:`WINDOW`.

    Parameters
    ----------
    spikes : (rows, neurons), 1/dt where a neuron fired.
    step : time between two rows (s).
    """
    window = np.ones(min(len(spikes), max(1, round(WINDOW / step))))
    # Divided by the part of the window within the run, so that the rate does not drop at its ends.
    within = np.convolve(np.ones(len(spikes)), window, mode="same")
    rate: FloatArray = np.convolve(spikes.mean(axis=1), window, mode="same") / within
    return rate


def _rates(axes: Axes, trains: Sequence[_Train], names: Sequence[str], end: float) -> None:
    """Draw each ensemble's mean rate."""
    unit = trains[0].time_unit if trains else SECOND
    axes.set_ylabel(f"mean rate [{TIME_UNITS[unit]}]")
    notes = [f"mean of all neurons, {style.duration(WINDOW, unit)} window"]
    for i, (train, name) in enumerate(zip(trains, names, strict=True)):
        if not train.spikes.size:
            continue
        step = style.row_spacing(train.t, end)
        rate = mean_rate(train.spikes, step)
        axes.plot(train.t, rate, label=name, linewidth=0.8, **style.line_style(i))
        # A spike is 1/dt high; with a step of several ticks, a row shows only one of them.
        ticks = round(step * float(train.spikes.max()))
        if ticks > 1 and len(train.t) > 1:
            notes.append(f"1 tick in {ticks} recorded")
    if not axes.lines:
        style.explain_empty(axes)
        return
    axes.set_ylim(0.0, max(1.0, axes.get_ylim()[1]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4))
    style.write_note(axes, "; ".join(dict.fromkeys(notes)))
    if len(trains) > 1:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 0.98),
            ncols=4,
            borderaxespad=0.0,
            borderpad=0.1,
        )
