"""Charts below a run's figures, in which a reader zooms and reads values.

In: a plot of kind ``timeseries`` and the run. Out: an element with the values, which the page's
script turns into charts when it is opened. Of all scripts, a page allows this one alone::

    <details class="zoom" data-charts="[{names: [v], unit: m/s, data: [[0, 0.1], [1, 2]]}]">
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import display_names, thin
from runtime.tables import Html, element

POINTS = 800  # of a column, about
MOST = 14  # columns of a chart
DIGITS = 6


@cache
def script() -> str:
    """The script of pages with charts: uPlot, and what makes charts of the elements."""
    return f"{chart_script()}\n{_asset('zoom.js')}"


@cache
def chart_script() -> str:
    """uPlot, which draws charts, with its license."""
    return f"/*\n{_asset('uplot.LICENSE')}*/\n{_asset('uplot.js')}"


@cache
def chart_style() -> str:
    """What its charts look like."""
    return _asset("uplot.css")


def _asset(file: str) -> str:
    return Path(__file__).with_name(file).read_text(encoding="utf-8")


def charts(plot: PlotSpec, result: RunData) -> Html:
    """The element with a plot's charts, one for each unit of a signal; '' where there is none."""
    if plot.kind != "timeseries":
        return Html("")
    specs = [spec for name in plot.of for spec in _specs(result.probes[name])]
    if not specs:
        return Html("")
    hint = "Drag to zoom, double-click to go back, point to read values."
    return element(
        "details",
        element("summary", "Zoom and read values"),
        element("p", hint, class_="soft small"),
        class_="zoom",
        data_charts=json.dumps(specs, ensure_ascii=False),
    )


def _specs(recorded: Recording) -> list[dict[str, Any]]:
    values, labels = recorded.columns, recorded.labels
    if len(recorded.t) < 2 or len(labels) != values.shape[1]:
        return []
    names = display_names(labels, recorded.display_names)
    groups: dict[str, list[int]] = {}
    for i, unit in enumerate(recorded.units):
        groups.setdefault(unit, []).append(i)
    return [
        {
            "names": [names[i] for i in columns],
            "unit": f"[{unit}]" if unit else "",
            "time": f"time [{recorded.time_unit}]",
            "data": _rows(recorded.t, values[:, columns]),
        }
        for unit, columns in groups.items()
        if len(columns) <= MOST
    ]


def _rows(t: FloatArray, values: FloatArray) -> list[list[float | None]]:
    """The time and each column, at the rows that thinning any of the columns would keep."""
    kept = np.unique(np.concatenate([thin(t, column, POINTS)[0] for column in values.T]))
    rows = np.searchsorted(t, kept)
    columns = [t[rows], *values[rows].T]
    return [
        [float(f"{x:.{DIGITS}g}") if np.isfinite(x) else None for x in column] for column in columns
    ]
