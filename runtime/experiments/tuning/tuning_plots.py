"""Figures of a tuning: its history, which factors matter, the front, and slices along factors.

In: the folder of a tuning. Out: figures by name, ``history``, ``importance``, ``slices``, and
``front`` with two objectives or more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.experiments.analysis import NEVER
from runtime.experiments.analysis.figures import WIDTH, beyond, panels
from runtime.experiments.tuning.plan import TUNING
from runtime.files import read_json
from runtime.plots import COLOURS, GREY, label_log, styled
from runtime.terminal import with_unit

COLUMNS = 3
BINS = 5
NOTE: Any = {"ha": "center", "va": "center", "color": GREY, "style": "italic"}
MARKS = {"complete": "o", "stopped": "x", "no value": "1"}


@dataclass(frozen=True)
class _Data:
    """A tuning read for drawing; the arrays have one entry per configuration but the baseline."""

    name: str
    stored: dict[str, Any]
    candidates: list[dict[str, Any]]

    @property
    def metrics(self) -> list[str]:
        """The objectives."""
        return [*self.stored.get("minimize", []), *self.stored.get("maximize", [])]

    @property
    def factors(self) -> list[str]:
        return list(self.stored["vary"])

    def values(self, metric: str) -> FloatArray:
        """NaN where there is none."""
        return np.array([_float(one["metrics"].get(metric)) for one in self.candidates])

    def baseline(self, metric: str) -> float:
        return _float(self.stored["configurations"][0]["metrics"].get(metric))

    def label(self, metric: str) -> str:
        return with_unit(metric, self.stored.get("units") or {})

    def positions(self, factor: str) -> tuple[FloatArray, list[str]]:
        """Where each configuration lies along a factor; names if values are not numbers."""
        values = [one["values"][factor] for one in self.candidates]
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
            return np.array(values, dtype=float), []
        names = list(dict.fromkeys(map(str, values)))
        return np.array([names.index(str(v)) for v in values], dtype=float), names


def _float(value: Any) -> float:
    return math.nan if value is None else float(value)


def _read(folder: Path) -> _Data:
    try:
        stored = read_json(folder / TUNING)
        return _Data(str(stored["experiment"]), stored, stored["configurations"][1:])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"cannot read the tuning in '{folder}': {error}") from None


def tuning_figures(folder: Path, look: str = "screen") -> Iterator[tuple[str, Figure]]:
    """The figures of a tuning with their names, in a look of :data:`runtime.plots.LOOKS`."""
    data = _read(folder)
    if not any(np.isfinite(data.values(metric)).any() for metric in data.metrics):
        return
    with styled(look):
        yield "history", _history(data, look)
        yield "importance", _importance(data, look)
        if len(data.metrics) > 1:
            yield "front", _front(data, look)
        yield "slices", _slices(data, look)


def _panels(count: int, data: _Data, facts: str, look: str) -> tuple[Figure, list[Axes]]:
    name = data.name
    return panels(count, name, facts, columns=COLUMNS, height=2.6, least=2, look=look)


def _scatter(axes: Any, data: _Data, x: FloatArray, y: FloatArray, metric: str = "") -> None:
    """The configurations by status; those that violate a constraint are grey.

    Those in which the metric is infinite (never settled) are at the upper end, which is the bad
    one.
    """
    infinite = np.array([metric in one.get("never", ()) for one in data.candidates])
    if infinite.any():
        words = (data.stored.get("never") or {}).get(metric, NEVER)
        axes.plot(
            x[infinite], np.ones(infinite.sum()), "x", markersize=4, label=words, **beyond(axes)
        )
    feasible = np.array([one["feasible"] for one in data.candidates])
    status = np.array([one["status"] for one in data.candidates])
    for kind, mark in MARKS.items():
        for holds, colour in ((True, COLOURS[0]), (False, GREY)):
            chosen = (status == kind) & (feasible == holds)
            if chosen.any():
                label = kind if holds else f"{kind}, violates a constraint"
                axes.scatter(x[chosen], y[chosen], s=16, marker=mark, color=colour, label=label)


def _history(data: _Data, look: str) -> Figure:
    """Each configuration in the order tried, and the best so far."""
    figure, panels = _panels(len(data.metrics), data, "history of the training runs", look)
    numbers = np.array([one["number"] for one in data.candidates])
    own = data.stored["configurations"][0]
    for axes, metric in zip(panels, data.metrics, strict=True):
        values = data.values(metric)
        _scatter(axes, data, numbers, values, metric)
        good = np.array(
            [o["feasible"] and o["status"] == "complete" for o in data.candidates], dtype=bool
        )
        sign = 1.0 if metric in data.stored.get("minimize", []) else -1.0
        # It starts from the graph's own values, which compete.
        baseline = data.baseline(metric)
        competes = own.get("feasible", True) and math.isfinite(baseline)
        costs = np.where(good & np.isfinite(values), sign * values, np.inf)
        costs = np.concatenate([[sign * baseline if competes else np.inf], costs])
        best = sign * np.minimum.accumulate(costs)
        best[~np.isfinite(best)] = np.nan
        axes.step(
            [own["number"], *numbers], best, where="post", color=COLOURS[1], label="best so far"
        )
        if metric in own.get("never", ()):
            words = f"baseline: {(data.stored.get('never') or {}).get(metric, NEVER)}"
            own_style = beyond(axes) | {"color": "black"}
            axes.plot([own["number"]], [1.0], "x", label=words, **own_style)
        if math.isfinite(baseline):
            axes.axhline(baseline, color=GREY, linestyle=":", label="baseline")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("configuration")
        axes.set_ylabel(data.label(metric))
    _legend(figure, panels)
    return figure


def _legend(figure: Figure, panels: list[Any]) -> None:
    by_label: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        by_label |= dict(zip(labels, handles, strict=True))
    columns = max(1, round(4 * figure.get_figwidth() / WIDTH))
    figure.legend(
        list(by_label.values()),
        list(by_label),
        loc="outside lower center",
        ncols=columns,
        fontsize=8.0,
    )


def importance(positions: FloatArray, values: FloatArray) -> float:
    """Share of the variance of a metric's rank that a factor explains, from 0 to 1.

    The correlation ratio over at most five bins of equal counts, less what chance alone explains
    (epsilon squared; Kelley, 1935).
    """
    finite = np.isfinite(values) & np.isfinite(positions)
    ranks = np.argsort(np.argsort(values[finite])).astype(float)
    n = len(ranks)
    places = np.unique(positions[finite], return_inverse=True)[1]
    order = np.argsort(np.argsort(places, kind="stable"), kind="stable")
    bins = places if places.max(initial=0) < BINS else order * BINS // max(n, 1)
    groups = [ranks[bins == b] for b in np.unique(bins)]
    if n <= len(groups) or len(groups) < 2 or not np.ptp(ranks):
        return 0.0
    within = sum(float(((g - g.mean()) ** 2).sum()) for g in groups)
    total = float(((ranks - ranks.mean()) ** 2).sum())
    return max(0.0, 1.0 - within / (n - len(groups)) / (total / (n - 1)))


def _importance(data: _Data, look: str) -> Figure:
    figure, panels = _panels(len(data.metrics), data, "which factors matter", look)
    for axes, metric in zip(panels, data.metrics, strict=True):
        shares = [importance(data.positions(f)[0], data.values(metric)) for f in data.factors]
        axes.barh(data.factors[::-1], shares[::-1], color=COLOURS[0], height=0.5)
        axes.set(xlim=(0.0, 1.0), title=metric, xlabel="share of the variance of the rank")
        if not any(shares):
            axes.text(0.5, 0.5, "none beyond chance", transform=axes.transAxes, **NOTE)
    return figure


def _front(data: _Data, look: str) -> Figure:
    """The first two objectives against each other, with the winners on training and held out."""
    first, second = data.metrics[:2]
    figure, (axes,) = _panels(1, data, "front", look)
    _scatter(axes, data, data.values(first), data.values(second))
    for key, colour, label in (
        ("training", COLOURS[1], "front, training"),
        ("held_out", COLOURS[2], "front, held out"),
    ):
        means = {(r["configuration"], r["metric"]): r[key]["over"] for r in data.stored["table"]}
        points = [
            (_float(means.get((n, first))), _float(means.get((n, second))))
            for n in data.stored["front"]
        ]
        if points:
            axes.plot(*zip(*points, strict=True), "D-", color=colour, label=label, markersize=5)
    own = (data.baseline(first), data.baseline(second))
    axes.plot(*own, "*", color="black", markersize=10, label="baseline")
    axes.set_xlabel(data.label(first))
    axes.set_ylabel(data.label(second))
    _legend(figure, [axes])
    return figure


def _slices(data: _Data, look: str) -> Figure:
    """The first objective along each factor."""
    metric = data.metrics[0]
    figure, panels = _panels(len(data.factors), data, "each factor, training runs", look)
    for axes, factor in zip(panels, data.factors, strict=True):
        positions, names = data.positions(factor)
        _scatter(axes, data, positions, data.values(metric), metric)
        if str(data.stored["vary"][factor]).startswith("log("):
            axes.set_xscale("log")
            label_log(axes.xaxis)
        if names:
            axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
        axes.set_xlabel(factor)
        axes.set_ylabel(data.label(metric))
    _legend(figure, panels)
    return figure
