"""Figures of a sweep: curves for one factor, heat maps for two, parallel coordinates for more.

In: the folder of a sweep. Out: figures by name::

    vary {a: 0..1:5}               ->  "curves", a panel per metric
    the same with variants         ->  "curves", with a curve for each variant
    vary {a: 0..1:5, b: [1, 2]}    ->  "maps"
    vary {a: .., b: .., c: ..}     ->  "parallel_error", a figure per metric
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from blocks.core import FloatArray
from runtime.experiments.analysis.figures import MARK, beyond, panels
from runtime.experiments.analysis.sweep_data import Axis, SweepData, read_sweep, spread
from runtime.experiments.analysis.words import NEVER, SAME, mean_of
from runtime.experiments.design import Objective
from runtime.plots import COLOURS, GREY, LINESTYLES, label_log, power_text, styled

COLUMNS = 2
MARKERS = "os^Dv<>P*X"
MAP = "viridis"
FEW_CELLS = 60  # up to this many, a heat map shows its numbers
MANY_TICKS = 12
CROWD = 25  # up to this many, each point of a curve has a marker
NOTHING = "0.85"  # the colour of a cell without a value
BEYOND = 1.05  # where lines end, on an axis from 0 to 1, that have no finite value
PARTIAL = "n/N or red: only n of the N seeds have a value"


def sweep_figures(folder: Path, look: str = "screen") -> Iterator[tuple[str, Figure]]:
    """The figures of a sweep with their names: one for all metrics, or one per metric.

    Parameters
    ----------
    folder : of a sweep, complete or not.
    look : of the figures, a name in :data:`runtime.plots.LOOKS`.
    """
    data = read_sweep(folder)
    shown = [
        name
        for name in data.metrics
        if np.isfinite(data.means(name)).any() or any(each.never for each in data.metrics[name])
    ]
    if not shown or not data.axes or not len(data.axes[0].positions):
        return
    parts = data.by_variant
    axes = len(next(iter(parts.values())).axes)
    with styled(look):
        if axes == 1:
            yield "curves", _curves(data, parts, shown, look)
        elif axes == 2:
            yield "maps", _maps(data, parts, shown, look)
        else:
            for metric in shown:
                yield f"parallel_{metric}", _parallel(data, metric, look)


def _curves(
    data: SweepData, parts: Mapping[str, SweepData], metrics: list[str], look: str
) -> Figure:
    """An axes per metric, with a curve for each variant."""
    words = data.name, _facts(data, metrics)
    figure, grid = panels(len(metrics), *words, columns=COLUMNS, height=3.0, look=look)
    for axes, metric in zip(grid, metrics, strict=True):
        axes.set_title(data.label(metric))
        for i, (name, part) in enumerate(parts.items()):
            curve(axes, part, metric, variant_style(i) | {"label": name or None})
    if len(parts) > 1:
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)))
    return figure


def _maps(data: SweepData, parts: Mapping[str, SweepData], metrics: list[str], look: str) -> Figure:
    """An axes per metric and variant, all of a metric with the same colours."""
    words = data.name, _facts(data, metrics)
    columns = COLUMNS if len(parts) == 1 else min(len(parts), 3)
    count = len(metrics) * len(parts)
    figure, grid = panels(count, *words, columns=columns, height=3.0, look=look)
    places = iter(grid)
    for metric in metrics:
        scale = scale_of(data.means(metric))
        for name, part in parts.items():
            axes = next(places)
            axes.set_title(", ".join(filter(None, (data.label(metric), name))))
            (_heat if data.method == "grid" else _scatter)(figure, axes, part, metric, scale)
    return figure


def variant_style(i: int) -> dict[str, Any]:
    """The colour, mark and dashes of a variant, which tell it from others in print, too."""
    turn = i // len(COLOURS) % len(LINESTYLES)
    marker = MARKERS[i % len(MARKERS)]
    return {"color": COLOURS[i % len(COLOURS)], "marker": marker, "linestyle": LINESTYLES[turn]}


def _facts(data: SweepData, metrics: list[str]) -> str:
    over = "one seed"
    if data.seeds > 1:
        bars = ", bars: 95 % intervals of the mean" * (
            len(next(iter(data.by_variant.values())).axes) == 1
        )
        over = f"means over {data.seeds} seeds{bars}"
    if data.seeds > 1 and data.is_same(metrics):
        over = f"{SAME}, the seed changes nothing"
    if any(data.is_partial(metric).any() for metric in metrics):
        over += f" ({PARTIAL})"
    words = dict.fromkeys(word for name in metrics for word in data.words_of_lost(name))
    over += f"; a red cross: {', '.join(words)}" * bool(words)
    left = f", {data.skipped} configurations not drawn" if data.skipped else ""
    return f"{len(data.axes[0].positions)} configurations, {over}{left}"


def curve(axes: Axes, data: SweepData, metric: str, look: dict[str, Any]) -> None:
    """The means along a factor, with their intervals."""
    axis = data.axes[0]
    order = np.argsort(axis.positions, kind="stable")
    estimates = [data.metrics[metric][i] for i in order]
    x = axis.positions[order]
    mean = np.array([estimate.mean for estimate in estimates])
    ends = np.array([spread(estimate) for estimate in estimates])
    if axis.names or len(x) <= CROWD:
        bars = np.abs(ends - mean[:, None]).T
        look = look | {"markersize": 4.0} | ({"linestyle": "none"} if axis.names else {})
        axes.errorbar(x, mean, yerr=bars, capsize=2.5, **look)
    else:
        look = {key: value for key, value in look.items() if key != "marker"}
        axes.fill_between(x, *ends.T, color=look["color"], alpha=0.2, linewidth=0.0)
        axes.plot(x, mean, **look)
        some = data.is_partial(metric)[order]
        axes.plot(x[some], mean[some], ".", color=MARK, markersize=3.0)
    # The axis covers all configurations, also those without a value.
    level = mean[np.isfinite(mean)][0] if np.isfinite(mean).any() else 0.0
    axes.update_datalim(np.column_stack([x, np.full(len(x), level)]))
    axes.autoscale_view()
    where: Any = ("data", "axes fraction")
    infinite = data.is_lost(metric)[order]
    if infinite.any():  # without a point, a line that is not clipped has no place in the layout
        axes.plot(x[infinite], np.ones(infinite.sum()), "x", **beyond(axes))
    if infinite.all():
        axes.set_yticks([])
    small: dict[str, Any] = {"fontsize": 7.0, "va": "top", "ha": "center"}
    small |= {"xytext": (0, -5), "textcoords": "offset points", "xycoords": where}
    for place, estimate, is_infinite in zip(x, estimates, infinite, strict=True):
        if len(x) > CROWD or (estimate.n and estimate.is_over(data.seeds)):
            continue
        message = f"{estimate.n}/{data.seeds}"
        if is_infinite:
            message = str(mean_of(estimate, data.seeds, data.never.get(metric, NEVER)))
        # Upright, the words of neighbours do not overlap.
        how = {"color": MARK, "rotation": 90} if is_infinite else {"color": GREY}
        axes.annotate(message, (place, 1.0), **small, **how)
    _label(axes, axis, "x")


def _label(axes: Axes, axis: Axis, side: str) -> None:
    """Label a factor's axis, and its ticks if they are names."""
    axes.set(**{f"{side}label": axis.path, f"{side}scale": "log" if axis.is_log else "linear"})
    label_log(axes.xaxis if side == "x" else axes.yaxis, at=axis.positions.tolist())
    if axis.names and len(axis.names) <= MANY_TICKS:
        _name_ticks(axes, side, range(len(axis.names)), axis.names)


def _name_ticks(axes: Axes, side: str, ticks: Sequence[int], names: Sequence[str]) -> None:
    """Label ticks; names that are too wide to stand side by side are turned."""
    is_wide = side == "x" and max(map(len, names)) * len(names) > 40
    how: dict[str, Any] = {"rotation": 20, "ha": "right"} if is_wide else {}
    (axes.set_xticks if side == "x" else axes.set_yticks)(ticks, names, **how)


def _heat(figure: Figure, axes: Axes, data: SweepData, metric: str, scale: Normalize) -> None:
    """The means over two factors; each cell is a configuration."""
    first, second = data.axes
    columns, rows = first.distinct, second.distinct
    grid = np.full((len(rows), len(columns)), np.nan)
    at = np.searchsorted(rows, second.positions), np.searchsorted(columns, first.positions)
    grid[at] = data.means(metric)
    axes.grid(False)
    colours = matplotlib.colormaps[MAP].with_extremes(bad=NOTHING)
    image = axes.imshow(grid, origin="lower", aspect="auto", cmap=colours, norm=scale)
    figure.colorbar(image, ax=axes, pad=0.01, aspect=18)
    for axis, positions, side in ((first, columns, "x"), (second, rows, "y")):
        names = [axis.names[int(p)] if axis.names else power_text(p) for p in positions]
        ticks = range(0, len(names), -(-len(names) // MANY_TICKS))
        _name_ticks(axes, side, ticks, [names[i] for i in ticks])
        axes.set(**{f"{side}label": axis.path})
    few = grid.size <= FEW_CELLS
    mark_lost(axes, data, metric, at[1].astype(float), at[0].astype(float), is_written=few)
    if few:
        seeds = np.full(grid.shape, data.seeds)
        seeds[at] = [
            data.seeds if estimate.n and estimate.is_over(data.seeds) else estimate.n
            for estimate in data.metrics[metric]
        ]
        _numbers(axes, grid, seeds, data.seeds, scale)


def mark_lost(
    axes: Axes,
    data: SweepData,
    metric: str,
    x: FloatArray,
    y: FloatArray,
    *,
    is_written: bool = False,
) -> None:
    """Mark cells of a map: a red cross without a finite value, a red dot with only some.

    Parameters
    ----------
    x, y : where each configuration is.
    is_written : the numbers of seeds are written into the cells, which need no dots.
    """
    kinds = [("x", 4.0, data.is_lost(metric)), (".", 3.0, data.is_partial(metric))]
    for marker, size, which in kinds[: 1 if is_written else 2]:
        axes.plot(x[which], y[which], marker, color=MARK, markersize=size, linestyle="none")


def scale_of(means: FloatArray) -> Normalize:
    """The colours of a map, over the means that are finite."""
    return Normalize(*_range(means[np.isfinite(means)]))


def _numbers(
    axes: Axes, grid: FloatArray, seeds: NDArray[np.int_], most: int, scale: Normalize
) -> None:
    """Write each cell's mean, and the number of seeds if it is not all of them."""
    middle = 0.5 * (float(scale.vmin or 0.0) + float(scale.vmax or 0.0))
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7.0}
    for (row, column), value in np.ndenumerate(grid):
        if np.isfinite(value):
            colour = "white" if value < middle else "black"
            n = seeds[row, column]
            share = f"\n{n}/{most}" if n < most else ""
            axes.text(column, row, f"{value:.3g}{share}", color=colour, **look)
        else:
            axes.text(column, row - 0.3, f"{seeds[row, column]}/{most}", color=GREY, **look)


def _scatter(figure: Figure, axes: Axes, data: SweepData, metric: str, scale: Normalize) -> None:
    """Samples of two factors, coloured by the mean; hollow where no trial has a value."""
    first, second = data.axes
    means = data.means(metric)
    finite = np.isfinite(means)
    look: dict[str, Any] = {"s": 22.0, "zorder": 2.0}
    hollow: dict[str, Any] = {"facecolors": "none", "edgecolors": "0.5", "linewidths": 0.8}
    infinite = data.is_lost(metric)
    cross: dict[str, Any] = {"marker": "x", "c": MARK, "linewidths": 1.0}
    none = ~finite & ~infinite
    axes.scatter(first.positions[none], second.positions[none], **look, **hollow)
    if infinite.any():
        axes.scatter(first.positions[infinite], second.positions[infinite], **look, **cross)
    look |= {"c": means[finite], "cmap": MAP, "norm": scale}
    edges = [MARK if some else "none" for some in data.is_partial(metric)[finite]]
    points = axes.scatter(
        first.positions[finite], second.positions[finite], edgecolors=edges, **look
    )
    figure.colorbar(points, ax=axes, pad=0.01, aspect=18)
    _label(axes, first, "x")
    _label(axes, second, "y")


def _parallel(data: SweepData, metric: str, look: str) -> Figure:
    """One vertical axis per factor and one for the metric; each line is a configuration."""
    facts = _facts(data, [metric])
    figure, (axes,) = panels(1, data.name, facts, columns=1, height=3.7, look=look)
    means = data.means(metric)
    finite = np.isfinite(means)
    value = Axis(data.label(metric), np.where(finite, means, np.nan), (), False)
    verticals = [*data.axes, value]
    heights = np.column_stack([_height(axis) for axis in verticals])
    x = np.arange(len(verticals), dtype=float)
    never = data.is_lost(metric)
    no_value = [np.column_stack([x[:-1], row[:-1]]) for row in heights[~finite & ~never]]
    axes.add_collection(LineCollection(no_value, colors="0.8", linewidths=0.6, zorder=1.0))
    # Beyond the upper end of the axis, which is the bad one of what may be infinite.
    worst = [np.column_stack([x, [*row[:-1], BEYOND]]) for row in heights[never]]
    if worst:
        thin: dict[str, Any] = {"linewidths": 0.6, "alpha": 0.7, "zorder": 1.5}
        axes.add_collection(LineCollection(worst, colors=MARK, **thin))
        axes.plot(x[-1], BEYOND, "x", color=MARK)
    order = _best_last(means, finite, data.objective if _is_goal(data, metric) else None)
    lines = [np.column_stack([x, heights[i]]) for i in order]
    low, high = _range(means[finite])
    scale = Normalize(low, high)
    colours = matplotlib.colormaps[MAP](scale(means[order]))
    collection = LineCollection(lines, colors=colours, linewidths=0.9, alpha=0.85, zorder=2.0)
    axes.add_collection(collection)
    some = data.is_partial(metric)
    axes.plot(np.full(some.sum(), x[-1]), heights[some, -1], ".", color=MARK, markersize=4.0)
    _vertical_axes(axes, verticals)
    figure.colorbar(
        ScalarMappable(scale, MAP), ax=axes, label=data.label(metric), pad=0.02, aspect=22
    )
    return figure


def _range(values: FloatArray) -> tuple[float, float]:
    """The smallest and the largest value; 0 and 1 if there is none."""
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)


def _is_goal(data: SweepData, metric: str) -> bool:
    return data.objective is not None and data.objective.metric == metric


def _best_last(means: FloatArray, finite: Any, objective: Objective | None) -> Any:
    """The order of drawing: the best on top."""
    index = np.flatnonzero(finite)
    ordered = index[np.argsort(-means[index], kind="stable")]
    is_reversed = objective is not None and objective.goal == "maximize"
    return ordered[::-1] if is_reversed else ordered


def _height(axis: Axis) -> FloatArray:
    """Positions of configurations on a vertical axis, from 0 to 1."""
    positions = np.log10(axis.positions) if axis.is_log else axis.positions
    low, high = _range(positions[np.isfinite(positions)])
    heights: FloatArray = (
        (positions - low) / (high - low) if high > low else np.full(len(positions), 0.5)
    )
    return heights


def _vertical_axes(axes: Axes, verticals: list[Axis]) -> None:
    """Draw the vertical axes, labelled at their ends."""
    axes.grid(False)
    axes.set_xlim(-0.35, len(verticals) - 0.65)
    axes.set_ylim(-0.08, 1.08)
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.set_xticks(range(len(verticals)), [axis.path for axis in verticals])
    axes.tick_params(axis="x", length=0.0)
    small: dict[str, Any] = {"fontsize": 7.0, "va": "center", "zorder": 4.0}
    small["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    small |= {"xytext": (4, 0), "textcoords": "offset points"}
    for x, axis in enumerate(verticals):
        axes.axvline(x, color="0.3", linewidth=0.8, zorder=3.0)
        heights = _height(axis)
        finite = axis.positions[np.isfinite(axis.positions)]
        ends = [*_range(finite)] if len(finite) else []
        for place in axis.distinct if axis.names else ends:
            height = float(heights[np.nanargmin(np.abs(axis.positions - place))])
            message = axis.names[int(place)] if axis.names else power_text(place)
            axes.annotate(message, (x, height), **small)
