"""Runs that are drawn in the same figures as a run: with one more change, or from before it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands.changes import apply
from runtime.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.graph import Graph
    from runtime.observation import PlotSpec
    from runtime.runs import Result


def rivals(graph: Graph, vs: str | None) -> dict[str, Graph]:
    """The graphs to compare with, by the change that makes them: of ``--vs``, or of the plots.

    Raises
    ------
    GraphError, UsageError : one of them cannot run.
    """
    from runtime.observation import CHANGES

    if vs is None:
        wanted = [plot.options.get("compare", "") for plot in graph.observation.plots]
        return {change: _changed(graph, change) for change in wanted if change}
    kind, equals, _ = vs.partition("=")
    if kind not in CHANGES or not equals:
        known = ", ".join(CHANGES)
        raise UsageError(f"--vs {vs}: expected CHANGE=VALUE with one of {known}")
    return {vs: _changed(graph, vs)}


def _changed(graph: Graph, change: str) -> Graph:
    kind, _, text = change.partition("=")
    return apply(graph, kind, text).check()


def names(change: str, labels: str = "") -> tuple[str, str]:
    """Short names of two runs that differ in one change: 'with snn', 'without snn'.

    Parameters
    ----------
    labels : names in their place, separated by a comma.

    Raises
    ------
    UsageError : there are not two labels.
    """
    if labels:
        first, comma, second = (text.strip() for text in labels.partition(","))
        if not (first and comma and second) or "," in second:
            raise UsageError(f"--labels {labels}: expected two names for --vs, as in 'mine,theirs'")
        return first, second
    kind, _, text = change.partition("=")
    if kind == "with":
        return "as written", f"with {Path(text).stem}"
    return (f"with {text}" if kind == "without" else "as written"), f"{kind} {text}"


def painter(
    result: Result,
    others: Mapping[str, Result],
    folder: Path,
    options: Namespace,
    before: Result | None = None,
) -> Callable[[PlotSpec], Figure] | None:
    """A function that draws a plot with another run in it; None if there is no other run.

    Parameters
    ----------
    others : runs by the change that made them.
    options : ``vs`` is the change that all plots show, without which each shows the one that it
        names itself; ``labels`` are names of both runs, ``style`` is that of the figures.
    before : a run from before the graph was edited, for plots that show no other.
    """
    if not others and before is None:
        return None
    from runtime.compare import Run
    from runtime.compare.overlay import versus
    from runtime.plots import draw

    def drawn(plot: PlotSpec) -> Figure:
        change = options.vs or str(plot.options.get("compare", ""))
        if change in others:
            shown, other = names(change, options.labels), others[change]
        elif before is not None:
            shown, other = ("now", "before"), before
        else:
            return draw(plot, result, options.style)
        first, second = shown
        runs = [Run(first, folder, result, {}), Run(second, folder, other, {})]
        return versus(runs, plot, options.style)

    return drawn
