"""A plot of several runs, one below the other, for kinds whose pictures cannot lie on each other.

In: a plot and the runs by their labels. Out: a part of the figure for each, with the same limits
and colours: two rasters, ``with adaptive`` above ``without adaptive``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.image import AxesImage

from blocks.core import FloatArray
from runtime.observation import PlotSpec, RunData
from runtime.plots.figures import arrange, paint
from runtime.plots.style import WIDTH


class _Part(SubFigure):
    """A part that functions of kinds draw on as on a figure: it has a size, which they set."""

    size: tuple[float, float] = (WIDTH, 3.0)

    def set_size_inches(self, width: Any, height: float | None = None) -> None:
        self.size = tuple(width) if height is None else (width, height)

    def get_size_inches(self) -> FloatArray:
        return np.array(self.size)


def draw_parts(
    figure: Figure, plot: PlotSpec, results: Mapping[str, RunData], is_narrow: bool = False
) -> list[Axes]:
    """Draw a plot of each run, and return the top axes of each part.

    Parameters
    ----------
    figure : empty; it gets the size that the parts need, unless the plot says one.
    results : the runs by label, each with all signals of the plot.
    is_narrow : whether the figure is for a column of a page, where nothing lies beside another.
    """
    # Panels around the robot are square and many: such parts lie beside each other.
    is_row = plot.definition.in_world and not is_narrow
    count = len(results)
    grid = figure.add_gridspec(*((1, count) if is_row else (count, 1)))
    own = {key: value for key, value in plot.options.items() if key != "size"}
    parts, tops = [], []
    for i, result in enumerate(results.values()):
        part: Any = _Part(figure, grid[i])  # Any: functions of kinds take a Figure
        figure.subfigs.append(part)
        tops.append(paint(part, plot, result))
        arrange(part, tops[-1], replace(plot, options=own))
        parts.append(part)
    sizes = np.array([part.size for part in parts])
    size = sizes.max(axis=0)
    size[0 if is_row else 1] = sizes[:, 0 if is_row else 1].sum()
    figure.set_size_inches(*plot.options.get("size", size))
    if not plot.definition.in_world:  # where limits follow the robot
        _share(parts)
    return tops


def _share(parts: Sequence[SubFigure]) -> None:
    """Give the axes in the same place of each part the same limits, and images the same colours."""
    places = [part.axes for part in parts]
    if len({len(axes) for axes in places}) > 1:
        return  # a part has other axes: none belongs to another
    for group in zip(*places, strict=True):
        _share_colours([image for axes in group for image in axes.get_images()])
        if any(axes.get_label() == "<colorbar>" or not axes.has_data() for axes in group):
            continue
        for get, put in (("get_xlim", "set_xlim"), ("get_ylim", "set_ylim")):
            ends = [getattr(axes, get)() for axes in group]
            low, high = min(min(each) for each in ends), max(max(each) for each in ends)
            for axes in group:
                getattr(axes, put)(low, high)


def _share_colours(images: Sequence[AxesImage]) -> None:
    """Give images one colour map; that of both signs is symmetric, and goes before the other."""
    limits = [image.get_clim() for image in images]
    low, high = min((i for i, _ in limits), default=0.0), max((i for _, i in limits), default=0.0)
    low = min(low, -high) if low < 0.0 else low
    for image in images:
        image.set_cmap(images[int(np.argmin([i for i, _ in limits]))].get_cmap())
        image.set_clim(low, -low if low < 0.0 else high)
