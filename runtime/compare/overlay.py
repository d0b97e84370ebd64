"""Overlays: figures that show every probe over time, and the trajectories, of several runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.compare.runs import Run
from runtime.files import slug
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import (
    LOOKS,
    OVERLAID,
    WIDTH,
    arrange,
    axis_label,
    coincident,
    contacts,
    disable_math,
    display_names,
    draw,
    draw_parts,
    draw_series,
    draw_trajectory,
    draw_wall_distance,
    equal_scales,
    facts,
    fit,
    frequency_unit,
    layers,
    line_style,
    map_axes,
    mark_contacts,
    mean_rate,
    row_spacing,
    run_end,
    save_figure,
    separate_notes,
    stacked_axes,
    styled,
    time_axis,
    write_note,
    write_title,
)

FEW = 6  # columns that have an axes each; of more, the RMS is shown
PAGE = 9.0  # inches, the highest figure of a page
FIRST, LATER = 2.0, 1.0  # widths: a line that another one covers is visible on both sides


@dataclass(frozen=True)
class _Line:
    """One run's values over time in an axes."""

    label: str
    t: FloatArray
    y: FloatArray
    held: bool = False


def overlays(
    runs: Sequence[Run], probes: Sequence[str], look: str = "screen"
) -> Iterator[tuple[str, Figure]]:
    """Draw several runs in the same figures.

    Parameters
    ----------
    runs : two or more.
    probes : names of the probes to draw over time; those that only one run has, or that are
        constant, are left out.

    Yields
    ------
    A name for a file, and the figure: the first run's trajectory plots and maps, then each probe
    over time.
    """
    planes = {}
    for plot in runs[0].result.plots:
        if plot.kind in ("trajectory", "map"):
            figure = _plane(runs, plot, probes, look)
            if figure is not None:
                planes[plot.name] = figure
    yield from planes.items()
    for name in probes:
        recordings = {run.label: run.result.probes.get(name) for run in runs}
        recorded = {label: r for label, r in recordings.items() if r is not None and len(r.t) > 1}
        shapes = {(r.values.shape[1:], r.units) for r in recorded.values()}
        if len(recorded) > 1 and len(shapes) == 1:
            panels, own = _panels(recorded), list(recorded.values())
            figure = _columns(runs, name, panels, own, look)
            yield f"{name}_over_time" if name in planes else name, figure


def versus(runs: Sequence[Run], plot: PlotSpec, look: str = "screen") -> Figure:
    """Draw a plot of the first run with the other runs in it.

    Trajectories and maps show the path of each run, wall distances the error of each, curves
    against each other and spectra a curve of each, time series an axes for each column. Of other
    kinds, whose pictures cannot lie on each other, the figure has a part for each run. Runs
    without a signal of the plot are left out, with a note.
    """
    figure: Figure | None = None
    if plot.kind in ("trajectory", "map"):
        figure = _plane(runs, plot, list(runs[0].result.probes), look)
    elif plot.kind == "timeseries":
        figure = _timeseries(runs, plot, look)
    if figure is not None:
        return figure
    shown = {r.label: r.result for r in runs if all(n in r.result.probes for n in plot.of)}
    if len(shown) < 2:
        figure = draw(plot, runs[0].result, look)
        missing = ", ".join(run.label for run in runs if run.label not in shown)
        write_note(figure.axes[0], f"not recorded: {missing}")
        separate_notes(figure)
        return figure
    if plot.kind in OVERLAID or plot.kind == "wall_distance":
        return _overlaid(runs, plot, look, shown)
    return _parts(plot, look, shown)


def _timeseries(runs: Sequence[Run], plot: PlotSpec, look: str) -> Figure | None:
    """The columns of a plot over time, an axes for each; None where nothing was recorded."""
    panels: dict[str, Sequence[_Line]] = {}
    shown: list[Recording] = []
    for name in plot.of:
        recordings = {run.label: run.result.probes.get(name) for run in runs}
        recorded = {label: r for label, r in recordings.items() if r is not None and len(r.t)}
        if recorded:
            panels |= {f"{label}\0{name}": own for label, own in _panels(recorded).items()}
            shown += recorded.values()
    return _columns(runs, plot.title, panels, shown, look, plot) if panels else None


def save_overlays(
    runs: Sequence[Run],
    probes: Sequence[str],
    folder: Path,
    formats: Sequence[str] = ("png",),
    look: str = "screen",
) -> list[Path]:
    """Write every overlay as <name>.png, or so, into a folder, created if it does not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in overlays(runs, probes, look):
        for kind in formats:
            paths.append(folder / f"{slug(name, 'probe')}.{kind}")
            save_figure(figure, paths[-1])
    return paths


def _subtitle(runs: Sequence[Run]) -> str:
    """The graphs, and what all runs have in common: conditions, seed."""
    titles = list(dict.fromkeys(run.result.title for run in runs))
    text = " and ".join(titles) if len(titles) <= 2 else f"{titles[0]} and {len(titles) - 1} more"
    first, *others = ([*facts(run.result)][1:] for run in runs)
    return "  ·  ".join([text, *(fact for fact in first if all(fact in o for o in others))])


def _columns(
    runs: Sequence[Run],
    title: str,
    panels: Mapping[str, Sequence[_Line]],
    recorded: Sequence[Recording],
    look: str = "screen",
    plot: PlotSpec | None = None,
) -> Figure:
    """Lines over time, an axes for each label of a vertical axis (what follows NUL is left out)."""
    panels = _moving(panels)
    with styled(look):
        figure = Figure(layout="constrained")
        height = 1.3 + 1.55 * len(panels) + 0.5 * (len(panels) == 1)
        figure.set_size_inches(WIDTH, height)
        column = stacked_axes(figure, len(panels))
        for axes, (label, lines) in zip(column, panels.items(), strict=True):
            axes.set_ylabel(label.partition("\0")[0])
            _draw(axes, lines)
        end = max(run_end(run.result) for run in runs)
        time_axis(column, recorded, end)
        if plot is not None:
            arrange(figure, column[0], replace(plot, options={**plot.options, "labels": ()}))
        handles, labels = column[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)))
        write_title(column[0], title, _subtitle(runs))
        disable_math(figure)
        fit(figure, LOOKS[look])
        separate_notes(figure)
    return figure


def _moving(panels: Mapping[str, Sequence[_Line]]) -> Mapping[str, Sequence[_Line]]:
    """The panels without those that are zero throughout in all runs; all if none is left."""
    shown = {k: lines for k, lines in panels.items() if any(line.y.any() for line in lines)}
    return shown or panels


def _count_covered(lines: Sequence[FloatArray]) -> list[int]:
    """How many lines each one covers, without one: the first is wider and stays visible."""
    return [max(0, count - 1) for count in coincident(lines)]


def _draw(axes: Axes, lines: Sequence[_Line]) -> None:
    order = layers([line.y for line in lines])
    hidden = _count_covered([line.y for line in lines])
    for i, line in enumerate(lines):
        draw_series(
            *(axes, line.t, line.y, line.held),
            label=line.label,
            linewidth=LATER if i or len(lines) == 1 else FIRST,
            zorder=order[i],
            **line_style(i, hidden[i]),
        )
    values = [line.y[np.isfinite(line.y)] for line in lines]
    if min(y.min(initial=0.0) for y in values) < 0.0 < max(y.max(initial=0.0) for y in values):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)


def _panels(recorded: Mapping[str, Recording]) -> dict[str, list[_Line]]:
    """The lines of each axes, by the label of its vertical axis."""
    first = next(iter(recorded.values()))
    if "Spikes" in first.kinds:
        rates = {n: mean_rate(r.columns, row_spacing(r.t)) for n, r in recorded.items()}
        label = f"mean rate [{frequency_unit([first])}]"
        return {label: [_Line(n, recorded[n].t, rate) for n, rate in rates.items()]}
    count = first.columns.shape[1]
    if count > FEW:
        unit = first.units[0] if len(set(first.units)) == 1 else ""
        label = axis_label([f"RMS of {count} columns"], unit)
        return {
            label: [
                _Line(n, r.t, _rms(r), bool(r.held) and all(r.held)) for n, r in recorded.items()
            ]
        }
    names = display_names(first.labels, first.display_names)
    return {
        axis_label([names[i]], first.units[i]): [
            _Line(n, r.t, r.columns[:, at], at < len(r.held) and r.held[at])
            for n, r in recorded.items()
            if label in r.labels
            for at in (r.labels.index(label),)
        ]
        for i, label in enumerate(first.labels)
    }


def _rms(recorded: Recording) -> FloatArray:
    """Root mean square of the finite values of each row; NaN where there are none."""
    rows = recorded.columns
    squares = np.where(np.isfinite(rows), rows, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        rms: FloatArray = np.sqrt(squares.sum(axis=1) / np.isfinite(rows).sum(axis=1))
    return rms


def _plane(
    runs: Sequence[Run], plot: PlotSpec, probes: Sequence[str], look: str = "screen"
) -> Figure | None:
    """The trajectories of all runs in one plane; None where fewer than two recorded one."""
    poses = [
        _relabel_pose(run.result.probes[name], run.label)
        for name in _poses(runs[0], plot)[:1]
        if name in probes
        for run in runs
        if name in run.result.probes and run.result.probes[name].kinds == ("Pose",)
    ]
    if len(poses) < 2:
        return None
    with styled(look):
        figure = Figure(layout="constrained")
        if plot.kind == "map" and runs[0].result.world is not None:
            top = _map(figure, runs, plot, poses)
        else:
            first = runs[0].result.probes
            labels = dict(zip(plot.of, plot.options.get("labels", ()), strict=False))
            paths = [
                _relabel_path(first[n], labels.get(n, ""))
                for n in plot.of
                if n in first and first[n].kinds == ("Path",)
            ]
            contact_points = contacts(plot, [run.result for run in runs])
            top = draw_trajectory(
                figure, [*poses, *paths, *contact_points], run_end(runs[0].result)
            )
        _finish(figure, top, runs, plot, look)
        if plot.kind == "trajectory" and not {"xlim", "ylim"} & plot.options.keys():
            equal_scales(figure, top)
    return figure


def _finish(figure: Figure, top: Axes, runs: Sequence[Run], plot: PlotSpec, look: str) -> None:
    """Apply the plot's own options and the title, without labels of one run."""
    options = dict(plot.options)
    if plot.kind != "xy" or len(plot.of) > 2:  # there, they are names of its two axes
        options["labels"] = ()
    arrange(figure, top, replace(plot, options=options))
    write_title(top, plot.title, _subtitle(runs))
    disable_math(figure)
    fit(figure, LOOKS[look])
    separate_notes(figure)


def _overlaid(
    runs: Sequence[Run], plot: PlotSpec, look: str, shown: Mapping[str, RunData]
) -> Figure:
    """The lines of all runs in the same axes."""
    first = runs[0].result
    with styled(look):
        figure = Figure(layout="constrained")
        if plot.kind == "wall_distance":
            top = draw_wall_distance(figure, plot, first, shown)
        else:
            recorded = {n: [run.probes[p] for p in plot.of] for n, run in shown.items()}
            own = [first.probes[name] for name in plot.of]
            top = OVERLAID[plot.kind](figure, own, run_end(first), recorded)
        _finish(figure, top, runs, plot, look)
    return figure


def _parts(plot: PlotSpec, look: str, shown: Mapping[str, RunData]) -> Figure:
    """A part of the figure for each run, with its label above it."""
    with styled(look):
        figure = Figure(layout="constrained")
        page = LOOKS[look]
        tops = draw_parts(figure, plot, shown, page.width is not None)
        fit(figure, replace(page, height=min(PAGE, page.height * len(shown))))
        for top, (label, result) in zip(tops, shown.items(), strict=True):
            # On paper, titles are left to the caption; the labels are needed all the same.
            if page.width is None:
                write_title(top, f"{plot.title}: {label}", "  ·  ".join(facts(result)))
            else:
                top.set_title(label)
        disable_math(figure)
        separate_notes(figure)
    return figure


def _poses(run: Run, plot: PlotSpec) -> list[str]:
    """The probes of a plot that hold one pose each."""
    known = run.result.probes
    return [name for name in plot.of if name in known and known[name].kinds == ("Pose",)]


def _relabel_path(recorded: Recording, name: str) -> Recording:
    """A recorded path with the name that the plot gives it, if any."""
    names = tuple(f"{name}.{label.rpartition('.')[2]}" for label in recorded.labels)
    return replace(recorded, names=names) if name else recorded


def _relabel_pose(recorded: Recording, label: str) -> Recording:
    """A recorded pose with its run's label, for the legend."""
    labels = tuple(f"{label}.{component}" for component in ("x", "y", "theta"))
    return replace(recorded, name=label, labels=labels, names=(), addresses={label: (0, 3)})


def _map(figure: Figure, runs: Sequence[Run], plot: PlotSpec, poses: Sequence[Recording]) -> Axes:
    """The first run's world, with the trajectories of all runs."""
    xy = np.concatenate([recorded.values[:, :2] for recorded in poses])
    axes, handles = map_axes(figure, plot, runs[0].result, xy)
    hidden = _count_covered([recorded.values[:, :2] for recorded in poses])
    for i, recorded in enumerate(poses):
        look = line_style(i, hidden[i]) | {"linewidth": LATER + 0.2 if i else FIRST}
        handles += axes.plot(*recorded.values[:, :2].T, label=recorded.name, zorder=2.6, **look)
    for contact in contacts(plot, [run.result for run in runs]):
        handles.append(mark_contacts(axes, contact.values))
    figure.legend(handles=handles, loc="outside right upper")
    return axes
