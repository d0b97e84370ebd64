"""What the figures of sweeps, ablations and tunings share: a grid of panels, and their files.

In: figures by name. Out: the files that they were written to::

    save_figures(folder, sweep_figures(folder))  ->  [folder/plots/curves.png]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime.files import own_folder, slug, system_errors
from runtime.plots import LOOKS, headline, save_figure

WIDTH, NARROW = 9.0, 5.0  # inches: of a page on the screen; a column of paper is narrower
MARK = "tab:red"  # what has no finite value, or fewer values than its neighbours


def panels(
    count: int,
    title: str,
    facts: str = "",
    *,
    columns: int,
    height: float,
    least: int = 1,
    look: str = "screen",
) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for each of ``count`` metrics or factors.

    Parameters
    ----------
    title, facts : above them, except on paper.
    columns : the most panels in a row, which have the width of a page together; on a narrow one
        there is one in a row.
    height : of a row (inches), where a panel has its width on the screen.
    least : the figure is at least as wide as so many panels.
    """
    page = LOOKS[look].width or WIDTH
    if page < NARROW:
        height *= min(1.0, page * columns / WIDTH)
        columns = least = 1
    across = min(columns, count)
    rows = math.ceil(count / across)
    width = page / columns * max(least, across)
    figure = Figure(figsize=(width, 0.5 + height * rows), layout="constrained")
    headline(figure, title, facts, look)
    axes = list(figure.subplots(rows, across, squeeze=False).flat)
    for unused in axes[count:]:
        unused.set_visible(False)
    return figure, axes[:count]


def beyond(axes: Axes) -> dict[str, Any]:
    """How to draw crosses of what is infinite: at the upper end of the axes, which is the bad one.

    A point outside of the axes would have no place in the layout if it were the only one.
    """
    return {"transform": axes.get_xaxis_transform(), "clip_on": False, "color": MARK}


def save_figures(
    folder: Path, figures: Iterable[tuple[str, Figure]], formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write figures as ``plots/<name>.png`` into an experiment's folder; returns the files.

    Raises
    ------
    UsageError : they cannot be written.
    """
    target = folder / "plots"
    files = []
    with system_errors(f"write '{target}'"):
        own_folder(target)
        for name, figure in figures:
            for kind in formats:
                files.append(target / f"{slug(name, 'figure')}.{kind}")
                save_figure(figure, files[-1])
    return files
