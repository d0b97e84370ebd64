"""Pictures of several runs in one: every probe over time, and the ways gone in the plane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.compare.runs import Run
from runtime.files import slug
from runtime.observation import PlotSpec, Recording
from runtime.plots import (
    THIN_ABOVE,
    THIN_TO,
    WINDOW,
    draw_trajectory,
    equal_scales,
    save_figure,
    style,
    walls,
)

FEW = 6  # columns that have an axes each; more are shown by one number per row
BELOW, BESIDE = 2.0, 1.0  # widths: a line that is covered by the next one shows on both sides


@dataclass(frozen=True)
class _Line:
    """One run's course of what an axes shows."""

    label: str
    t: FloatArray
    y: FloatArray


def overlays(runs: Sequence[Run], probes: Sequence[str]) -> Iterator[tuple[str, Figure]]:
    """Draw runs over each other.

    Parameters
    ----------
    runs : two or more.
    probes : names of the probes to draw over time; what only one run has is left out, and what
        is constant.

    Yields
    ------
    A name for a file, and the figure: the ways of the first run's trajectories and maps, then
    each probe over time.
    """
    ways = {}
    for plot in runs[0].result.plots:
        if plot.kind in ("trajectory", "map"):
            figure = _plane(runs, plot, probes)
            if figure is not None:
                ways[plot.name] = figure
    yield from ways.items()
    for name in probes:
        found = {run.label: run.result.probes.get(name) for run in runs}
        recorded = {label: r for label, r in found.items() if r is not None and len(r.t) > 1}
        shapes = {(r.values.shape[1:], r.units) for r in recorded.values()}
        if len(recorded) > 1 and len(shapes) == 1:
            yield f"{name}_over_time" if name in ways else name, _courses(runs, name, recorded)


def save_overlays(runs: Sequence[Run], probes: Sequence[str], folder: Path) -> list[Path]:
    """Write every overlay as <name>.png into a folder, made if it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in overlays(runs, probes):
        paths.append(folder / f"{slug(name, 'probe')}.png")
        save_figure(figure, paths[-1])
    return paths


def _subtitle(runs: Sequence[Run]) -> str:
    titles = list(dict.fromkeys(run.result.title for run in runs))
    return " and ".join(titles) if len(titles) <= 2 else f"{titles[0]} and {len(titles) - 1} more"


def _courses(runs: Sequence[Run], name: str, recorded: Mapping[str, Recording]) -> Figure:
    """One probe of all runs over time, an axes for each column."""
    panels = _panels(recorded)
    with matplotlib.rc_context(style.STYLE):
        figure = Figure(layout="constrained")
        height = 1.3 + 1.55 * len(panels) + 0.5 * (len(panels) == 1)
        figure.set_size_inches(style.WIDTH, height)
        column = style.stack(figure, len(panels))
        for axes, (label, lines) in zip(column, panels.items(), strict=True):
            axes.set_ylabel(label)
            _draw(axes, lines)
        end = max(style.run_end(run.result) for run in runs)
        style.time_axis(column, list(recorded.values()), end)
        handles, labels = column[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)))
        style.head(column[0], name, _subtitle(runs))
        style.literal(figure)
    return figure


def _draw(axes: Axes, lines: Sequence[_Line]) -> None:
    for i, line in enumerate(lines):
        t, y = line.t, np.where(np.isfinite(line.y), line.y, np.nan)
        if len(y) > THIN_ABOVE:
            t, y = style.thin(t, y, THIN_TO)
        axes.plot(t, y, label=line.label, linewidth=BESIDE if i else BELOW, **style.look(i))
    values = [line.y[np.isfinite(line.y)] for line in lines]
    if min(y.min(initial=0.0) for y in values) < 0.0 < max(y.max(initial=0.0) for y in values):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)


def _panels(recorded: Mapping[str, Recording]) -> dict[str, list[_Line]]:
    """What each axes shows, by the name of its vertical axis."""
    first = next(iter(recorded.values()))
    if "Spikes" in first.kinds:
        return {"mean rate [Hz]": [_Line(n, r.t, _rate(r)) for n, r in recorded.items()]}
    count = int(np.prod(first.values.shape[1:]))
    if count > FEW:
        unit = first.units[0] if len(set(first.units)) == 1 else ""
        label = style.axis_name([f"RMS of {count} columns"], unit)
        return {label: [_Line(n, r.t, _rms(r)) for n, r in recorded.items()]}
    names = style.short_labels(first.labels)
    return {
        style.axis_name([names[i]], first.units[i]): [
            _Line(n, r.t, r.values.reshape(len(r.t), count)[:, i]) for n, r in recorded.items()
        ]
        for i in range(count)
    }


def _rate(recorded: Recording) -> FloatArray:
    """The population's rate (Hz): mean of all neurons in a sliding window."""
    spikes = recorded.values.reshape(len(recorded.t), -1).mean(axis=1)
    step = style.spacing(recorded.t)
    window = np.ones(min(len(spikes), max(1, round(WINDOW / step))))
    within = np.convolve(np.ones(len(spikes)), window, mode="same")
    rate: FloatArray = np.convolve(spikes, window, mode="same") / within
    return rate


def _rms(recorded: Recording) -> FloatArray:
    """Root of the mean square of what is finite in each row; NaN where nothing is."""
    rows = recorded.values.reshape(len(recorded.t), -1)
    squares = np.where(np.isfinite(rows), rows, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        rms: FloatArray = np.sqrt(squares.sum(axis=1) / np.isfinite(rows).sum(axis=1))
    return rms


def _plane(runs: Sequence[Run], plot: PlotSpec, probes: Sequence[str]) -> Figure | None:
    """The ways of all runs in one plane; None where fewer than two recorded one."""
    ways = [
        _named(run.result.probes[name], run.label)
        for name in _poses(runs[0], plot)[:1]
        if name in probes
        for run in runs
        if name in run.result.probes and run.result.probes[name].kinds == ("Pose",)
    ]
    if len(ways) < 2:
        return None
    with matplotlib.rc_context(style.STYLE):
        figure = Figure(layout="constrained")
        if plot.kind == "map" and runs[0].result.world is not None:
            top = _map(figure, runs[0], plot, ways)
        else:
            first = runs[0].result.probes
            paths = [first[n] for n in plot.of if n in first and first[n].kinds == ("Path",)]
            top = draw_trajectory(figure, [*ways, *paths], style.run_end(runs[0].result))
        style.head(top, plot.title, _subtitle(runs))
        style.literal(figure)
        if plot.kind == "trajectory":
            equal_scales(figure, top)
    return figure


def _poses(run: Run, plot: PlotSpec) -> list[str]:
    """The probes of a plot that hold one pose each."""
    known = run.result.probes
    return [name for name in plot.of if name in known and known[name].kinds == ("Pose",)]


def _named(recorded: Recording, label: str) -> Recording:
    """A recorded pose under its run's label, which is what a legend shows."""
    labels = tuple(f"{label}.{component}" for component in ("x", "y", "theta"))
    return replace(recorded, name=label, labels=labels, addresses={label: (0, 3)})


def _map(figure: Figure, run: Run, plot: PlotSpec, ways: Sequence[Recording]) -> Axes:
    """The first run's world, and the ways of all in it."""
    world = walls.world_of(plot, run.result)
    places = np.concatenate([way.values[:, :2] for way in ways])
    low, high = walls.view(world, places)
    ratio = float(np.clip((high[0] - low[0]) / (high[1] - low[1]), 0.6, 2.2))
    width = 4.2 * ratio**0.5
    figure.set_size_inches(width + 2.2, width / ratio + 1.0)
    axes = style.stack(figure, 1)[0]
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", anchor="W")
    walls.draw_world(axes, world)
    handles = walls.draw_contour(axes, world, plot)
    for i, way in enumerate(ways):
        look = style.look(i) | {"linewidth": BESIDE + 0.2 if i else BELOW}
        handles += axes.plot(*way.values[:, :2].T, label=way.name, zorder=2.6, **look)
    figure.legend(handles=handles, loc="outside right upper")
    return axes
