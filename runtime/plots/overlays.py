"""Several runs in one figure: how each kind of plot that can do so draws them.

In: an empty figure, a plot and the runs by label, the plot's own first. Out: the top axes; None
where too few runs recorded its signals, so that each has a part of the figure::

    overlay_curves(draw_xy, figure, plot, {"baseline": first, "without adaptive": second})
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import style
from runtime.plots.map import contacts, draw_wall_distance, map_axes, mark_contacts
from runtime.plots.raster import mean_rate
from runtime.plots.trajectory import draw_trajectory

Runs = Mapping[str, RunData]
FEW = 6  # columns that have an axes each; of more, the RMS is shown
FIRST, LATER = 2.0, 1.0  # widths: a line that another one covers is visible on both sides


@dataclass(frozen=True)
class OverlaidLine:
    """One run's values over time in an axes."""

    label: str
    t: FloatArray
    y: FloatArray
    held: bool = False


# The lines of each axes, by the label of its vertical axis; what follows NUL is left out.
Panels = Mapping[str, Sequence[OverlaidLine]]


def complete_runs(plot: PlotSpec, runs: Runs) -> Runs:
    """The runs that recorded all signals of a plot."""
    return {label: run for label, run in runs.items() if all(n in run.probes for n in plot.of)}


def overlay_curves(
    painter: Callable[..., Axes], figure: Figure, plot: PlotSpec, runs: Runs
) -> Axes | None:
    """The curves of all runs in the same axes."""
    shown, first = complete_runs(plot, runs), next(iter(runs.values()))
    if len(shown) < 2:
        return None
    recorded = {label: [run.probes[name] for name in plot.of] for label, run in shown.items()}
    own = [first.probes[name] for name in plot.of]
    return painter(figure, own, style.run_end(first), recorded)


def overlay_wall_distance(figure: Figure, plot: PlotSpec, runs: Runs) -> Axes | None:
    """The distance of each run's robot to the nearest wall."""
    shown = complete_runs(plot, runs)
    if len(shown) < 2:
        return None
    return draw_wall_distance(figure, plot, next(iter(runs.values())), shown)


def overlay_timeseries(figure: Figure, plot: PlotSpec, runs: Runs) -> Axes | None:
    """The columns of a plot over time, an axes for each; None where nothing was recorded."""
    panels: dict[str, Sequence[OverlaidLine]] = {}
    shown: list[Recording] = []
    for name in plot.of:
        recordings = {label: run.probes.get(name) for label, run in runs.items()}
        recorded = {label: r for label, r in recordings.items() if r is not None and len(r.t)}
        if recorded:
            panels |= {f"{label}\0{name}": own for label, own in panels_of(recorded).items()}
            shown += recorded.values()
    return draw_panels(figure, panels, shown, [*runs.values()]) if panels else None


def draw_panels(
    figure: Figure, panels: Panels, recorded: Sequence[Recording], runs: Sequence[RunData]
) -> Axes:
    """Lines over time, an axes for each label of a vertical axis, and a legend of the runs."""
    moving = {k: lines for k, lines in panels.items() if any(line.y.any() for line in lines)}
    # What is zero throughout in all runs is left out, unless all is.
    shown = moving or panels
    figure.set_size_inches(style.WIDTH, 1.3 + 1.55 * len(shown) + 0.5 * (len(shown) == 1))
    column = style.stacked_axes(figure, len(shown))
    for axes, (label, lines) in zip(column, shown.items(), strict=True):
        axes.set_ylabel(label.partition("\0")[0])
        _draw(axes, lines)
    style.time_axis(column, recorded, max(map(style.run_end, runs)))
    handles, labels = column[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)))
    return column[0]


def overlay_trajectory(figure: Figure, plot: PlotSpec, runs: Runs) -> Axes | None:
    """The trajectories of all runs in one plane, with the paths of the first."""
    poses, first = _poses(plot, runs), next(iter(runs.values())).probes
    if len(poses) < 2:
        return None
    labels = dict(zip(plot.of, plot.options.get("labels", ()), strict=False))
    paths = [
        _relabel_path(first[n], labels.get(n, ""))
        for n in plot.of
        if n in first and first[n].kinds == ("Path",)
    ]
    touched = contacts(plot, [*runs.values()])
    return draw_trajectory(figure, [*poses, *paths, *touched])


def overlay_map(figure: Figure, plot: PlotSpec, runs: Runs) -> Axes | None:
    """The first run's world, with the trajectories of all runs."""
    poses, first = _poses(plot, runs), next(iter(runs.values()))
    if len(poses) < 2:
        return None
    if first.world is None:
        return overlay_trajectory(figure, plot, runs)
    xy = np.concatenate([recorded.values[:, :2] for recorded in poses])
    axes, handles = map_axes(figure, plot, first, xy)
    hidden = _count_covered([recorded.values[:, :2] for recorded in poses])
    for i, recorded in enumerate(poses):
        look = style.line_style(i, hidden[i]) | {"linewidth": LATER + 0.2 if i else FIRST}
        handles += axes.plot(*recorded.values[:, :2].T, label=recorded.name, zorder=2.6, **look)
    for contact in contacts(plot, [*runs.values()]):
        handles.append(mark_contacts(axes, contact.values))
    figure.legend(handles=handles, loc="outside right upper")
    return axes


def _poses(plot: PlotSpec, runs: Runs) -> list[Recording]:
    """The first pose of a plot in each run that recorded it, with the run's label."""
    first = next(iter(runs.values())).probes
    names = [name for name in plot.of if name in first and first[name].kinds == ("Pose",)]
    return [
        _relabel_pose(run.probes[name], label)
        for name in names[:1]
        for label, run in runs.items()
        if name in run.probes and run.probes[name].kinds == ("Pose",)
    ]


def _relabel_path(recorded: Recording, name: str) -> Recording:
    """A recorded path with the name that the plot gives it, if any."""
    names = tuple(f"{name}.{label.rpartition('.')[2]}" for label in recorded.labels)
    return replace(recorded, names=names) if name else recorded


def _relabel_pose(recorded: Recording, label: str) -> Recording:
    """A recorded pose with its run's label, for the legend."""
    labels = tuple(f"{label}.{component}" for component in ("x", "y", "theta"))
    return replace(recorded, name=label, labels=labels, names=(), addresses={label: (0, 3)})


def _count_covered(lines: Sequence[FloatArray]) -> list[int]:
    """How many lines each one covers, without one: the first is wider and stays visible."""
    return [max(0, count - 1) for count in style.coincident(lines)]


def _draw(axes: Axes, lines: Sequence[OverlaidLine]) -> None:
    order = style.layers([line.y for line in lines])
    hidden = _count_covered([line.y for line in lines])
    for i, line in enumerate(lines):
        style.draw_series(
            axes,
            line.t,
            line.y,
            line.held,
            label=line.label,
            linewidth=LATER if i or len(lines) == 1 else FIRST,
            zorder=order[i],
            **style.line_style(i, hidden[i]),
        )
    values = [line.y[np.isfinite(line.y)] for line in lines]
    if min(y.min(initial=0.0) for y in values) < 0.0 < max(y.max(initial=0.0) for y in values):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=1.0)


def panels_of(recorded: Mapping[str, Recording]) -> dict[str, list[OverlaidLine]]:
    """The lines of each axes, by the label of its vertical axis."""
    first = next(iter(recorded.values()))
    if "Spikes" in first.kinds:
        rates = {n: mean_rate(r.columns, style.row_spacing(r.t)) for n, r in recorded.items()}
        label = f"mean rate [{style.frequency_unit([first])}]"
        return {label: [OverlaidLine(n, recorded[n].t, rate) for n, rate in rates.items()]}
    count = first.columns.shape[1]
    if count > FEW:
        unit = first.units[0] if len(set(first.units)) == 1 else ""
        label = style.axis_label([f"RMS of {count} columns"], unit)
        return {
            label: [
                OverlaidLine(n, r.t, _rms(r), bool(r.held) and all(r.held))
                for n, r in recorded.items()
            ]
        }
    names = style.display_names(first.labels, first.display_names)
    return {
        style.axis_label([names[i]], first.units[i]): [
            OverlaidLine(n, r.t, r.columns[:, at], at < len(r.held) and r.held[at])
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
