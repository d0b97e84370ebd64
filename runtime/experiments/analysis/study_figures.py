"""The figures that an experiment names itself, in the style of a paper.

In: the plan of a sweep or an ablation, and its folder. Out: figures by name. A metric over one
factor has a curve with 95 % intervals for each variant, over two factors a map; a signal over time
is its mean over the seeds with its 95 % interval::

    figures: {error: {metric: miss, over: wind.speed}}  ->  "error"
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.experiments.analysis.estimates import (
    ANY,
)
from runtime.experiments.analysis.groups import sample_of
from runtime.experiments.analysis.statistics import (
    estimate,
)
from runtime.experiments.analysis.sweep_data import Axis, SweepData, read_sweep
from runtime.experiments.analysis.sweep_plots import (
    MAP,
    NOTHING,
    curve,
    mark_lost,
    scale_of,
    variant_style,
)
from runtime.experiments.design import FigureSpec, shown_probe
from runtime.experiments.execution import INDEX, ExperimentPlan, Row, read_rows, read_series
from runtime.plots import LOOKS, label_log, styled
from runtime.terminal import with_unit

HEIGHT = 0.72  # of a figure, as a share of its width
ENDS = ("mean", "low", "high")
COUNT = "n/N"  # marks how many runs are left
ROOM = 0.08  # of the width of the axes, that a count needs
LIGHT = 0.18  # how dark the interval of a curve is


def study_figures(plan: ExperimentPlan, folder: Path) -> Iterator[tuple[str, Figure]]:
    """The figures of a plan with their names.

    Raises
    ------
    UsageError : no trial has recorded a signal, or files cannot be read.
    """
    if not plan.figures:
        return
    data = read_sweep(folder, math.inf)
    rows = sorted(read_rows(folder / INDEX, plan.columns), key=lambda row: row.trial)
    for figure in plan.figures:
        with styled(figure.style):
            if figure.signal:
                yield figure.name, _over_time(figure, plan, folder, rows)
            elif len(figure.over) == 1:
                yield figure.name, _over_factor(figure, data)
            else:
                yield figure.name, _map(figure, data)


def _page(figure: FigureSpec, columns: int = 1) -> tuple[Figure, list[Axes]]:
    width = LOOKS[figure.style].width or 6.4
    page = Figure(figsize=(width, HEIGHT * width / columns**0.5), layout="constrained")
    return page, list(page.subplots(1, columns, squeeze=False, sharey=True).flat)


def _finish(
    figure: FigureSpec, page: Figure, axes: Axes, x: str, y: str, *swept: FloatArray
) -> Figure:
    """Scales, labels and the legend; ``swept`` are the values of the factors along the axes."""
    axes.set(xlabel=figure.x or x, ylabel=figure.y or y)
    for side in figure.log:
        getattr(axes, f"set_{side}scale")("log")
    for axis, values in zip((axes.xaxis, axes.yaxis), swept, strict=False):
        label_log(axis, at=values)
    label_log(*(axes.xaxis, axes.yaxis)[len(swept) :])
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        widest = max(map(len, labels))
        columns = max(1, min(len(labels), int(14 * page.get_figwidth() / (widest + 6))))
        page.legend(handles, labels, loc="outside upper center", ncols=columns)
    return page


def _parts(figure: FigureSpec, data: SweepData) -> dict[str, SweepData]:
    """Each variant that is shown, at the values of ``at``, over the factors of ``over`` alone."""
    parts = {}
    for name, part in data.by_variant.items():
        if figure.variants and name not in figure.variants:
            continue
        chosen = np.full(len(part.axes[0].positions), True)
        for axis in part.axes:
            if axis.path in figure.at:
                wanted = _position(axis, figure.at[axis.path], figure.name)
                chosen &= np.isclose(axis.positions, wanted)
        parts[name] = _along(figure, part, np.flatnonzero(chosen))
    return parts


def _position(axis: Axis, value: str, figure: str) -> float:
    if axis.names:
        return float(axis.names.index(value)) if value in axis.names else -1.0
    try:
        return float(value)
    except ValueError:
        raise UsageError(f"figures.{figure}: '{axis.path}' has no value {value}") from None


def _along(figure: FigureSpec, part: SweepData, chosen: Any) -> SweepData:
    """The estimates at each place along the figure's factors, as a table has them.

    Where further factors have several values there, each seed is averaged over their settings
    first, and the interval is that over the seeds.
    """
    axes = [axis for path in figure.over for axis in part.axes if axis.path == path]
    places: dict[tuple[float, ...], list[int]] = {}
    for i in chosen:
        places.setdefault(tuple(axis.positions[i] for axis in axes), []).append(int(i))
    column, ends = list(part.metrics).index(figure.metric), part.ends.get(figure.metric, ANY)
    samples = [
        sample_of([part.groups[i].rows for i in own], column, is_sampled=part.is_sampled)
        for own in places.values()
    ]
    firsts = [own[0] for own in places.values()]
    shown = tuple(replace(axis, positions=axis.positions[firsts]) for axis in axes)
    return replace(
        part,
        axes=shown,
        groups=(),
        metrics={figure.metric: [sample.estimate(ends) for sample in samples]},
        seeds=max((len(sample.values) for sample in samples), default=0),
    )


def _over_factor(figure: FigureSpec, data: SweepData) -> Figure:
    page, (axes,) = _page(figure)
    for i, (name, part) in enumerate(_parts(figure, data).items()):
        look = variant_style(i) | {"label": figure.label(name) or None}
        curve(axes, part, figure.metric, look)
    parts = _parts(figure, data).values()
    for part in parts:
        _name_values(axes, part.axes[0], "x", figure)
    swept = np.concatenate([part.axes[0].positions for part in parts])
    words = figure.label(figure.over[0]), _metric_label(figure, data)
    return _finish(figure, page, axes, *words, swept)


def _metric_label(figure: FigureSpec, data: SweepData) -> str:
    """What the metric is called, with its unit unless the label has one."""
    label = figure.label(figure.metric)
    return label if "[" in label else with_unit(label, {label: data.units.get(figure.metric, "")})


def _name_values(axes: Axes, axis: Axis, side: str, figure: FigureSpec) -> None:
    """Write the values of a factor that are no numbers at their places."""
    if axis.names:
        names = [figure.label(name) for name in axis.names]
        getattr(axes, f"set_{side}ticks")(range(len(names)), names)


def _map(figure: FigureSpec, data: SweepData) -> Figure:
    """A map per variant, all with the same colours, and contours."""
    parts = _parts(figure, data)
    page, grid = _page(figure, len(parts))
    scale = scale_of(np.concatenate([part.means(figure.metric) for part in parts.values()]))
    image = None
    for axes, (name, part) in zip(grid, parts.items(), strict=True):
        columns, rows = (axis.distinct for axis in part.axes)
        table = np.full((len(rows), len(columns)), np.nan)
        at = (np.searchsorted(a.distinct, a.positions) for a in part.axes)
        table[tuple(at)[::-1]] = part.means(figure.metric)
        axes.grid(False)
        axes.set_facecolor(NOTHING)
        image = axes.pcolormesh(columns, rows, table, cmap=MAP, norm=scale, shading="nearest")
        mark_lost(axes, part, figure.metric, *(axis.positions for axis in part.axes))
        for axis, side in zip(part.axes, "xy", strict=True):
            _name_values(axes, axis, side, figure)
        has_numbers = not any(axis.names for axis in part.axes)
        if figure.contours and has_numbers and min(table.shape) > 1:
            levels = np.linspace(scale.vmin or 0.0, scale.vmax or 1.0, figure.contours + 2)[1:-1]
            lines = axes.contour(columns, rows, table, levels, colors="white", linewidths=0.8)
            axes.clabel(lines, fontsize=6.0, fmt=lambda level: f"{level:.3g}")
        axes.set_title(figure.label(name))
        words = figure.label(figure.over[0]), figure.label(figure.over[1])
        _finish(figure, page, axes, *words, columns, rows)
    for axes in grid[1:]:
        axes.set_ylabel("")
    if image is not None:
        page.colorbar(image, ax=grid, label=_metric_label(figure, data))
    return page


def _over_time(
    figure: FigureSpec, plan: ExperimentPlan, folder: Path, rows: Sequence[Row]
) -> Figure:
    """A curve for each variant, or for each value of the factor ``over``."""
    page, (axes,) = _page(figure)
    curves = _runs(figure, plan, folder, rows)
    if not curves:
        message = f"no trial recorded '{figure.signal}'; run the experiment again with --name"
        raise UsageError(f"figures.{figure.name}: {message}")
    for i, (name, runs) in enumerate(curves.items()):
        _band(axes, *_at_common_times(runs), i, figure.label(name))
    _mark_ends(axes)
    probe = plan.graph.observation.probes.get(shown_probe(figure.signal))
    unit = probe.units[0] if probe is not None else ""
    label = figure.label(figure.signal)
    y = f"{label} [{unit}]" if unit and "[" not in label else label
    seconds = plan.graph.network.time_unit
    axes.margins(x=0.0)
    return _finish(figure, page, axes, f"time [{seconds}]", y)


def _runs(
    figure: FigureSpec, plan: ExperimentPlan, folder: Path, rows: Sequence[Row]
) -> Mapping[str, list[tuple[FloatArray, FloatArray]]]:
    """The recordings of each curve, over the seeds; other factors have the first value."""
    columns = plan.columns.factors
    fixed = dict(figure.at)
    for row in rows[:1]:
        fixed = {
            path: cell
            for path, cell in zip(columns, row.cells, strict=True)
            if path != columns[0] or not plan.variants
            if path not in figure.over
        } | fixed
    curves: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for row in rows:
        cells = dict(zip(columns, row.cells, strict=True))
        variant = row.cells[0] if plan.variants else ""
        if any(cells[path] != value for path, value in fixed.items()):
            continue
        if figure.variants and variant not in figure.variants:
            continue
        over = [f"{figure.label(path)} = {figure.label(cells[path])}" for path in figure.over]
        run = read_series(folder, row.trial, figure.signal)
        if run is not None:
            label = ", ".join(filter(None, [figure.label(variant), *over]))
            curves.setdefault(label, []).append(run)
    return curves


def _at_common_times(
    runs: Sequence[tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray]:
    """The times (k,) of the run that lasts longest, and every run there: (runs, k).

    A run that ended before is NaN from then on. Each run has rows of its own: a short one is stored
    with more of them.
    """
    times = max((t for t, _ in runs), key=lambda t: float(t[-1]) if len(t) else -math.inf)
    values = np.full((len(runs), len(times)), np.nan)
    for row, (t, own) in zip(values, runs, strict=True):
        if len(t):
            # Half a row beyond its end still shows its last value.
            margin = 0.5 * float(np.diff(t).max(initial=0.0))
            during = (times >= t[0] - margin) & (times <= t[-1] + margin)
            row[during] = np.interp(times[during], t, own)
    return times, values


def _band(axes: Axes, t: FloatArray, values: FloatArray, i: int, label: str) -> None:
    """The mean over the runs that still go on, and its 95 % interval; n/N where one ends."""
    estimates = [estimate(column) for column in values.T.tolist()]
    mean, low, high = (np.array([getattr(e, end) for e in estimates]) for end in ENDS)
    look = variant_style(i)
    del look["marker"]
    look["linestyle"] = ("-", "--", "-.", ":")[i % 4]
    axes.plot(t, mean, label=label or None, linewidth=1.2, **look)
    axes.fill_between(t, low, high, color=look["color"], alpha=LIGHT, lw=0.0)
    n = np.array([each.n for each in estimates])
    ends = np.flatnonzero(np.diff(n) < 0)
    axes.plot(t[ends], mean[ends], "|", color=look["color"], markersize=5.0)
    for k in ends:
        how: dict[str, Any] = {"xytext": (2, 3), "textcoords": "offset points", "gid": COUNT}
        how |= {"fontsize": 6.0, "color": look["color"]}
        axes.annotate(f"{n[k + 1]}/{len(values)}", (t[k], mean[k]), **how)


def _mark_ends(axes: Axes) -> None:
    """Leave out counts that would be written over others, the earlier ones first."""
    low, high = axes.dataLim.intervalx
    counts = [text for text in axes.texts if text.get_gid() == COUNT]
    last = math.inf
    for text in sorted(counts, key=lambda text: -float(text.xy[0])):  # type: ignore[attr-defined]
        x = float(text.xy[0])  # type: ignore[attr-defined]
        if last - x < ROOM * (high - low):
            text.remove()
        else:
            last = x
