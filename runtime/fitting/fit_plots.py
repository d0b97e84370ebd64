"""Figures of a fit: each measured signal with the simulated one, and the differences.

In: a :class:`Fit`. Out: the figure ``fit``, a row of two panels for each signal.
"""

from __future__ import annotations

from collections.abc import Iterator

from matplotlib.figure import Figure

from runtime.experiments.analysis.figures import WIDTH
from runtime.fitting.solving import Fit
from runtime.plots import COLOURS, GREY, LOOKS, headline, styled

HEIGHT = 2.2  # of a row (inches)
MOST = 8  # rows


def fit_figures(fit: Fit, title: str, look: str = "screen") -> Iterator[tuple[str, Figure]]:
    """The figures of a fit with their names; the first signals if there are many."""
    with styled(look):
        yield "fit", _overlay(fit, title, look)


def _overlay(fit: Fit, title: str, look: str) -> Figure:
    series = fit.model.series[:MOST]
    size = (LOOKS[look].width or WIDTH, 0.5 + HEIGHT * len(series))
    figure = Figure(figsize=size, layout="constrained")
    headline(figure, title, "measured and fitted", look)
    rows = figure.subplots(len(series), 2, squeeze=False, sharex="row")
    for (left, right), one, simulated in zip(rows, series, fit.simulated, strict=False):
        unit = f" [{one.unit}]" if one.unit else ""
        left.plot(one.t, one.values, ".", color=GREY, markersize=2.5, label="measured")
        left.plot(one.t, simulated, color=COLOURS[0], label="fitted")
        left.set_ylabel(f"{one.name}{unit}")
        right.plot(one.t, simulated - one.values, ".", color=COLOURS[1], markersize=2.5)
        right.axhline(0.0, color=GREY, linewidth=0.6)
        right.set_ylabel(f"fitted - measured{unit}")
    rows[0][0].legend()
    for axes in rows[-1]:
        axes.set_xlabel("t [s]")
    return figure
