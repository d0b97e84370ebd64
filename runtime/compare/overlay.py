"""Overlays: figures that show every probe over time, and the trajectories, of several runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime.compare.runs import Run
from runtime.files import slug
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import (
    LOOKS,
    arrange,
    complete_runs,
    disable_math,
    draw,
    draw_panels,
    draw_parts,
    drawing_of,
    facts,
    fit,
    panels_of,
    save_figure,
    separate_notes,
    styled,
    write_note,
    write_title,
)

PAGE = 9.0  # inches, the highest figure of a page


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
        if plot.definition.compared and any(name in probes for name in plot.of):
            figure = _overlaid(runs, plot, look)
            if figure is not None:
                planes[plot.name] = figure
    yield from planes.items()
    for name in probes:
        recordings = {run.label: run.result.probes.get(name) for run in runs}
        recorded = {label: r for label, r in recordings.items() if r is not None and len(r.t) > 1}
        shapes = {(r.values.shape[1:], r.units) for r in recorded.values()}
        if len(recorded) > 1 and len(shapes) == 1:
            figure = _over_time(runs, name, recorded, look)
            yield f"{name}_over_time" if name in planes else name, figure


def versus(runs: Sequence[Run], plot: PlotSpec, look: str = "screen") -> Figure:
    """Draw a plot of the first run with the other runs in it, as its kind overlays them.

    Of kinds whose pictures cannot lie on each other, the figure has a part for each run. Runs
    without a signal of the plot are left out, with a note.
    """
    figure = _overlaid(runs, plot, look)
    if figure is not None:
        return figure
    shown = complete_runs(plot, {run.label: run.result for run in runs})
    if len(shown) >= 2:
        return _parts(plot, look, shown)
    figure = draw(plot, runs[0].result, look)
    missing = ", ".join(run.label for run in runs if run.label not in shown)
    write_note(figure.axes[0], f"not recorded: {missing}")
    separate_notes(figure)
    return figure


def _overlaid(runs: Sequence[Run], plot: PlotSpec, look: str) -> Figure | None:
    """The runs in one figure; None where the kind of plot cannot, or too few recorded it."""
    drawing = drawing_of(plot)
    if not drawing.overlay:
        return None
    with styled(look):
        figure = Figure(layout="constrained")
        top = drawing.overlay(figure, plot, {run.label: run.result for run in runs})
        if top is None:
            return None
        # Lines have the names of their runs.
        arrange(figure, top, plot, names_lines=False)
        _finish(figure, top, plot.title, runs, look)
        if drawing.finish:
            drawing.finish(figure, top, plot)
    return figure


def _over_time(
    runs: Sequence[Run], name: str, recorded: Mapping[str, Recording], look: str
) -> Figure:
    """The columns of a probe of all runs over time."""
    with styled(look):
        figure = Figure(layout="constrained")
        own, results = [*recorded.values()], [run.result for run in runs]
        top = draw_panels(figure, panels_of(recorded), own, results)
        _finish(figure, top, name, runs, look)
    return figure


def _finish(figure: Figure, top: Axes, title: str, runs: Sequence[Run], look: str) -> None:
    """Write the title, and give the figure its size."""
    write_title(top, title, _subtitle(runs))
    disable_math(figure)
    fit(figure, LOOKS[look])
    separate_notes(figure)


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
