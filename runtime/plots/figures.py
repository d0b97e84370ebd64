"""Figures of a run: every kind of plot is drawn and saved here.

In: a plot of a graph and the run. Out: a figure, or files::

    draw(result.plots[0], result).savefig("errors.pdf")

Figures are made without pyplot, which takes a second to import and keeps every figure in memory.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from runtime.errors import UsageError, one_line, text_of
from runtime.files import slug, write_whole
from runtime.observation import PLOT_KINDS, PlotSpec, RunData, plot_kind_names
from runtime.plots import formulas, looks, style, titles
from runtime.plots.painters import drawing_of, is_ours

DPI = 150
NOTEBOOK_DPI = 110
FORMATS = ("png", "pdf", "svg")


class ShownFigure(Figure):
    """A figure that a notebook shows, also where matplotlib's inline mode is not switched on."""

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, dpi=NOTEBOOK_DPI, format="png")
        return content.getvalue()


def draw(plot: PlotSpec, result: RunData, look: str = "screen") -> Figure:
    """Draw one plot of a run.

    Parameters
    ----------
    plot : the figure's kind, title and the names of the probes that it shows.
    result : the run; an interrupted run is drawn up to where it ended.
    look : screen, or paper or paper2 for one or two columns of a page.

    Returns
    -------
    Figure : not tied to pyplot; ``figure.savefig("x.pdf")`` writes it.

    Raises
    ------
    UsageError : no such kind of plot, a probe was not recorded, or the run has no world to show.
    """
    if plot.own is None and plot.kind not in PLOT_KINDS:
        kinds = ", ".join(plot_kind_names(plot.kind, result.world is not None))
        raise UsageError(f"plot '{plot.name}': expected one of {kinds}, got '{plot.kind}'")
    missing = [name for name in plot.of if name not in result.probes]
    if missing:
        raise UsageError(f"plot '{plot.name}' shows '{missing[0]}', which was not recorded")
    with looks.styled(look):
        figure = ShownFigure(layout="constrained")
        top = paint(figure, plot, result)
        if plot.options.get("events") in result.probes:
            style.mark_times(figure, result.probes[plot.options["events"]].t)
        arrange(figure, top, plot)
        drawing = drawing_of(plot)
        # Each of these steps needs what the one before did: titles need the axes' final labels,
        # formulas all texts, the look all sizes, the notes the width, and equal scales the space
        # that all this leaves.
        titles.set_title(top, plot.title, result)
        formulas.disable_math(figure)
        if "size" not in plot.options:
            looks.fit(figure, looks.LOOKS[look])
        titles.separate_notes(figure)
        if drawing.finish:
            drawing.finish(figure, top, plot)
    return figure


def paint(figure: Figure, plot: PlotSpec, result: RunData) -> Axes:
    """Draw a plot on an empty figure as its kind does, without titles and options of all kinds."""
    drawing = drawing_of(plot)
    if plot.definition.in_world or plot.definition.with_options:
        return drawing.painter(figure, plot, result)
    recordings = [result.probes[name] for name in plot.of]
    return drawing.painter(figure, recordings, style.run_end(result))


def arrange(figure: Figure, top: Axes, plot: PlotSpec, names_lines: bool = True) -> None:
    """Apply the options that every kind of plot takes, and mark the levels of a time series.

    Where lines are of several runs and have their names, ``names_lines`` is false.
    """
    options, drawing = plot.options, drawing_of(plot)
    if "band" in options:
        style.shade_band(figure, float(options["band"]))
    if "limits" in options:
        style.mark_levels(top, np.atleast_1d(options["limits"]))
    drawing.limits(figure, top, plot)
    if "size" in options:
        figure.set_size_inches(*options["size"])
    labels = drawing.labels(top, plot)
    is_visible = bool(options.get("legend", True))
    style.name_lines(figure, labels if names_lines else (), is_visible)


def save_plots(
    result: RunData,
    folder: Path,
    note: Callable[[str], None] | None = None,
    formats: Sequence[str] = ("png",),
    look: str = "screen",
    draw_plot: Callable[[PlotSpec], Figure] | None = None,
    progress: Callable[[int, int], None] | None = None,
    share: bool = False,
) -> list[Path]:
    """Write every plot of a run as <name>.png, or in other formats.

    Parameters
    ----------
    result : the run.
    folder : created if it does not exist.
    note : called with a message for each plot that cannot be drawn or written; without it, the
        first such plot raises what matplotlib or the system raised.
    formats : of the files, among :data:`FORMATS`.
    look : of the figures, a name in :data:`runtime.plots.LOOKS`.
    draw_plot : draws a plot in place of :func:`draw`.
    progress : called with the number of plots that are done, and of all.
    share : draw in two processes where that is safe, which needs ``note``.

    Returns
    -------
    list of Path : the files, in the order of the graph's plots.
    """
    files = [[folder / f"{slug(p.name, 'plot')}.{kind}" for kind in formats] for p in result.plots]

    def reason(i: int) -> str:
        """Why plot i cannot be drawn or written; '' once its files are there."""
        plot = result.plots[i]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            figure = draw_plot(plot) if draw_plot is not None else draw(plot, result, look)
            for path in files[i]:
                save_figure(figure, path)
        except BaseException as error:
            if note is None or isinstance(error, KeyboardInterrupt):
                raise
            text = " ".join((text_of(error) or type(error).__name__).split())
            return f"plot '{plot.name}' is not drawn: {one_line(text[:200])}"
        return ""

    paths = []
    for path, why in zip(files, _each(reason, result.plots, progress, share), strict=True):
        if note is not None and why:
            note(why)
        else:
            paths += path
    return paths


def _each(
    work: Callable[[int], str],
    plots: Sequence[PlotSpec],
    progress: Callable[[int, int], None] | None,
    share: bool,
) -> list[str]:
    """What a function returns for each plot, shared with a fork where it is allowed and safe."""
    # What a painter of others does in two processes nobody knows.
    own = all(is_ours(plot) for plot in plots)
    # macOS ends a process that forked after its system libraries were used.
    if share and own and len(plots) > 1 and sys.platform == "linux":
        from runtime.plots.sharing import can_share, share_work

        if can_share():
            return share_work(work, len(plots), progress)
    done = []
    for i in range(len(plots)):
        if progress is not None:
            progress(i, len(plots))
        done.append(work(i))
    return done


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as its file's suffix says, complete or not at all."""
    content, kind = BytesIO(), path.suffix.lstrip(".")
    # Without dates, the same figure is the same file.
    date_key = {"pdf": "CreationDate", "svg": "Date"}.get(kind)
    about: dict[str, Any] = {} if date_key is None else {date_key: None}
    with matplotlib.rc_context({"svg.hashsalt": "spikeblocks", "pdf.fonttype": 42}):
        if kind == "png":
            _write_png(figure, content)
        else:
            figure.savefig(content, dpi=DPI, format=kind, metadata=about)
    write_whole(path, content.getvalue())


def _write_png(figure: Figure, file: BytesIO) -> None:
    """The same bytes as of ``savefig``, which draws the figure twice: first to lay it out."""
    canvas, dpi = figure.canvas, figure.dpi
    figure.dpi = DPI
    own: Any = FigureCanvasAgg(figure)
    try:
        own.print_png(file, metadata={})
    finally:
        figure.set_canvas(canvas)
        figure.dpi = dpi
