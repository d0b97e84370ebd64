"""The figure of an ablation: metrics by variant with intervals, and trajectories.

In: the folder of an ablation that is complete. Out: one figure. A mark is filled where the variant
differs significantly from the baseline, hollow where it does not; what was never reached is a word
at the large end of the axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.experiments.analysis.comparison import ComparisonLine
from runtime.experiments.analysis.figures import MARK, NARROW, WIDTH
from runtime.experiments.analysis.groups import sample_of
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep
from runtime.experiments.analysis.words import (
    FAILED,
    NEVER,
    SAME,
    SAME_RUNS,
    TOO_FEW,
    each_mean,
    lost,
    too_few,
)
from runtime.experiments.design import BASELINE
from runtime.experiments.execution import RUNS, TABLE, TRAJECTORY_PLOTS, Row
from runtime.files import read_json
from runtime.observation import Recording, RunData
from runtime.plots import (
    COLOURS,
    GREY,
    LINESTYLES,
    LOOKS,
    coincident,
    draw_world,
    explain_empty,
    headline,
    line_style,
    styled,
    view_limits,
)
from runtime.runs import read_run
from runtime.terminal import with_unit

COLUMNS = 2
SEEDS_BELOW = 0.25  # of the distance between two variants
MAX_PLANE = 5.5  # inches
LEGEND_COLUMNS = 4
SMALL: Any = {"xycoords": ("axes fraction", "data"), "fontsize": 7.0, "va": "center"}
PATH: dict[str, Any] = {"color": "0.35", "linestyle": (0, (5, 2)), "linewidth": 1.0}


def ablation_figure(folder: Path, look: str = "screen") -> Figure:
    """Metrics by variant above, and trajectories with the first seed, if there are any, below.

    Parameters
    ----------
    folder : of an ablation that is complete.
    look : of the figure, a name in :data:`runtime.plots.LOOKS`.

    Raises
    ------
    UsageError : its files cannot be read.
    """
    facts, data = read_facts(folder), read_sweep(folder, math.inf)
    trajectories = list(_trajectories(folder, facts["variants"]))
    width = LOOKS[look].width or WIDTH
    columns = COLUMNS if width > NARROW else 1
    rows = math.ceil(len(facts["metrics"]) / columns)
    above = rows * (0.75 + 0.23 * len(facts["variants"]))
    below = _plane_height(trajectories, width)
    with styled(look):
        figure = Figure(figsize=(width, above + below + 0.4), layout="constrained")
        headline(figure, facts["experiment"], _caption(facts, data), look)
        if trajectories:
            top, bottom = figure.subfigures(2, 1, height_ratios=[above, below], squeeze=False)[:, 0]
            _metrics(top, data, facts, (rows, columns))
            _plane(bottom, trajectories, f"Trajectories with seed {facts['seeds'][0]}")
        else:
            _metrics(figure, data, facts, (rows, columns))
    return figure


def _caption(facts: dict[str, Any], data: SweepData) -> str:
    """What the marks of an ablation's figure mean."""
    table = overall(facts)
    if all(line.own.is_same for line in table if not line.is_removed):
        return f"{SAME}: {SAME_RUNS}"
    unit = "setting" if data.is_sampled else "seed"
    settings = len(data.groups) // max(1, len(facts["variants"]))
    others = (data.seeds, "seed") if data.is_sampled else (settings, "setting")
    sentences = [
        f"{settings if data.is_sampled else data.seeds} {unit}s: mean and 95 % interval; a dot: "
        f"one {unit}{each_mean(*others)}; pairs: with the baseline on the same {unit}"
    ]
    verdicts = {line.verdict for line in table}
    hollow = "hollow: no significant difference to the baseline"
    sentences.append(hollow + f", or {too_few()}" * (TOO_FEW in verdicts))
    if any(line.own.is_same for line in table):
        sentences.append(f"a square: {SAME}, the seed changes nothing")
    return "; ".join(sentences)


def read_facts(folder: Path) -> dict[str, Any]:
    """The contents of ablation.json.

    Raises
    ------
    UsageError : it cannot be read.
    """
    path = folder / TABLE
    try:
        facts: dict[str, Any] = read_json(path)
    except (OSError, ValueError) as error:
        raise UsageError(f"cannot read '{path}': {error}") from None
    return facts


def overall(facts: dict[str, Any]) -> list[ComparisonLine]:
    """The lines of each variant beside the baseline, over all settings of the factors."""
    lines = map(ComparisonLine.from_dict, facts["table"])
    return [
        line
        for line in lines
        if not line.place and line.reference in (None, BASELINE) and line.metric in facts["metrics"]
    ]


def _metrics(
    figure: Figure | SubFigure, data: SweepData, facts: dict[str, Any], shape: tuple[int, int]
) -> None:
    """One axes per metric, with a dot for each observation of its estimate."""
    names = [variant["name"] for variant in facts["variants"]]
    rows: dict[str, list[Sequence[Row]]] = {name: [] for name in names}
    for group in data.groups:
        rows[group.cells[0]].append(group.rows)
    dots = {
        metric: [sample_of(rows[name], i, is_sampled=data.is_sampled).values for name in names]
        for i, metric in enumerate(facts["metrics"])
    }
    draw_intervals(figure, facts, overall(facts), names, dots, shape)


def draw_intervals(
    figure: Figure | SubFigure,
    facts: dict[str, Any],
    table: Sequence[ComparisonLine],
    names: Sequence[str],
    dots: Mapping[str, Sequence[Sequence[float | None]]],
    shape: tuple[int, int],
) -> None:
    """One axes per metric, all with the variants (or contestants) at the same heights.

    Parameters
    ----------
    facts : with the ``units`` of the metrics, and what infinite values mean (``never``).
    table : a line for each metric and name, in their order.
    dots : of each metric, for each name the values below its interval.
    shape : rows and columns of axes.
    """
    grid = figure.subplots(*shape, squeeze=False, sharey=True)
    for unused in grid.flat[len(dots) :]:
        unused.set_visible(False)
    for axes, (metric, values) in zip(grid.flat, dots.items(), strict=False):
        axes.set_title(with_unit(metric, facts.get("units") or {}))
        lines = [line for line in table if line.metric == metric]
        _metric(axes, lines, values, (facts.get("never") or {}).get(metric, NEVER))
    grid[0][0].set_yticks(range(len(names)), names)
    grid[0][0].set_ylim(len(names) - 0.5, -0.5)


def _metric(
    axes: Axes,
    lines: Sequence[ComparisonLine],
    values: Sequence[Sequence[float | None]],
    never: str,
) -> None:
    if not any(line.own.n for line in lines):
        if not any(_lost(line, never) for line in lines):
            explain_empty(axes, "no run has a value")
            return
        axes.set_xticks([])
    if lines[0].own.n:
        look: dict[str, Any] = {"color": "0.5", "linewidth": 0.8, "linestyle": (0, (4, 2))}
        axes.axvline(lines[0].own.mean, **look, zorder=1.0)
    for y, (line, own) in enumerate(zip(lines, values, strict=True)):
        finite = [value for value in own if value is not None and math.isfinite(value)]
        if _lost(line, never):
            _mark_lost(axes, y, line, never)
        if line.own.is_same:
            finite = finite[:1]
        # Below the interval, which would hide them.
        axes.plot(finite, [y + SEEDS_BELOW] * len(finite), ".", color="0.55", markersize=3.0)
        if not finite or not line.own.n:
            if not _lost(line, never):
                message = "removed" if line.is_removed else "no value"
                axes.annotate(message, (0.02, y), **SMALL, color=GREY)
            continue
        _estimate(axes, y, line)
        if not line.own.is_over(line.runs):
            at: dict[str, Any] = {"xytext": (4, 3), "textcoords": "offset points"}
            message = f"{line.own.n}/{line.runs}"
            axes.annotate(message, (line.own.mean, y), **at, fontsize=7.0, color=GREY)


def _lost(line: ComparisonLine, never: str) -> str:
    """What became of the runs without a finite value: they failed, or never settled."""
    return lost(line.own.never, line.own.failed, never)


def _mark_lost(axes: Axes, y: int, line: ComparisonLine, never: str) -> None:
    """Mark runs without a finite value at the large end of the axis, mostly the bad one."""
    own, word = line.own, _lost(line, never)
    message = f"{word}, 0 of {line.runs}"
    if own.n:
        counts = {FAILED: own.failed, never: own.never}
        message = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    message = f"{word} ({SAME})" if own.is_same else message
    look: dict[str, Any] = {"color": MARK, "ha": "right"}
    look["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    axes.annotate(f"{message} ▸", (0.99, y), **SMALL, **look)


def _estimate(axes: Axes, y: int, line: ComparisonLine) -> None:
    own = line.own
    # Of a single run nothing is tested, and the difference is exact.
    is_filled = line.difference is None or line.verdict.startswith("yes") or line.verdict == SAME
    axes.errorbar(
        own.mean,
        y,
        xerr=None if math.isnan(own.low) else [[own.mean - own.low], [own.high - own.mean]],
        fmt="s" if own.is_same else "o",
        color=_colour(y),
        markerfacecolor=_colour(y) if is_filled else "white",
        markersize=4.5,
        capsize=2.5,
        linewidth=1.4,
        zorder=3.0,
    )


def _colour(i: int) -> str:
    """Black for the baseline, and a colour for each variant; colours repeat when used up."""
    return "black" if i == 0 else COLOURS[(i - 1) % (len(COLOURS) - 1)]


def _dashes(i: int) -> str:
    """A line style; when the colours are used up, they repeat with other dashes."""
    turn = max(0, i - 1) // (len(COLOURS) - 1)
    return LINESTYLES[turn % len(LINESTYLES)]


def _trajectories(
    folder: Path, variants: Sequence[dict[str, Any]]
) -> Iterator[tuple[int, str, RunData, FloatArray]]:
    """The runs that were kept, with x and y of the first pose in their plots."""
    for i, variant in enumerate(variants):
        run = folder / RUNS / str(variant["slug"])
        result = read_run(run) if run.is_dir() else None
        shown = None if result is None else next(_recordings(result, "Pose"), None)
        if result is not None and shown is not None:
            yield i, str(variant["name"]), result, shown[1].values[:, :2]


def _recordings(result: RunData, kind: str) -> Iterator[tuple[str, Recording]]:
    """The recordings of a kind in a run's trajectory plots, with what the plots call them."""
    for plot in result.plots:
        labels = [*plot.options.get("labels", ()), *plot.of[len(plot.options.get("labels", ())) :]]
        for name, label in zip(plot.of, labels, strict=False):
            recorded = result.probes.get(name) if plot.kind in TRAJECTORY_PLOTS else None
            if recorded is not None and recorded.kinds == (kind,) and len(recorded.t):
                yield label, recorded


def _plane_extent(
    trajectories: Sequence[tuple[int, str, RunData, FloatArray]],
) -> tuple[FloatArray, FloatArray]:
    """The lower left and the upper right corner of what is shown of the plane (m)."""
    world = trajectories[0][2].world
    everything = np.concatenate([xy for *_, xy in trajectories])
    if world is not None:
        return view_limits(world, everything)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.06 * max(float((high - low).max()), 0.5)
    return low - margin, high + margin


def _plane_height(
    trajectories: Sequence[tuple[int, str, RunData, FloatArray]], width: float
) -> float:
    """The height (inches) in which the plane fills the width of the figure; at most the width."""
    if not trajectories:
        return 0.0
    low, high = _plane_extent(trajectories)
    wide, tall = map(float, high - low)
    rows = math.ceil((len(trajectories) + 1) / _legend_columns(width))
    return min(MAX_PLANE, (width - 0.8) * tall / wide) + 0.9 + 0.22 * rows


def _legend_columns(width: float) -> int:
    return LEGEND_COLUMNS if width > NARROW else 2


def _plane(
    figure: Figure | SubFigure,
    trajectories: Sequence[tuple[int, str, RunData, FloatArray]],
    title: str,
) -> None:
    """All trajectories in one plane, over the path and the world of the first run."""
    axes = figure.subplots()
    handles: list[Line2D] = []
    result = trajectories[0][2]
    low, high = _plane_extent(trajectories)
    if result.world is not None:
        draw_world(axes, result.world)
    hidden = coincident([xy for *_, xy in trajectories])
    for (i, name, _, xy), count in zip(trajectories, hidden, strict=True):
        # The baseline is below and wider, so that a variant that coincides with it is visible; a
        # variant that covers another one has gaps.
        look: dict[str, Any] = {"color": _colour(i), "linewidth": 1.2 if i else 2.8}
        gaps = line_style(i, max(0, count - 1))["linestyle"]
        look["linestyle"] = gaps if count > 1 else _dashes(i)
        handles += axes.plot(*xy.T, label=name, **look)
    for label, path in _recordings(result, "Path"):
        handles += axes.plot(*path.values[-1][:, :2].T, label=label, **PATH)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    columns = min(len(handles), _legend_columns(float(figure.bbox.width / figure.dpi)))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
