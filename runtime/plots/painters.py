"""The functions that draw each kind of plot of the library; a package's kind names its own.

In: a plot. Out: its :class:`Drawing`. ``observation`` declares the kinds and must not import
matplotlib, so the functions of ours are listed here and not in the declarations::

    drawing_of(plot).painter      # draw_map
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from importlib import import_module
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime.observation import PlotSpec
from runtime.plots.analysis import (
    draw_spectrum,
    draw_xy,
    draw_xyz,
    label_axes,
    label_spectrum,
    limit_space,
)
from runtime.plots.decoded import draw_decoded, draw_weights
from runtime.plots.map import draw_map, draw_wall_distance
from runtime.plots.overlays import (
    overlay_curves,
    overlay_map,
    overlay_timeseries,
    overlay_trajectory,
    overlay_wall_distance,
)
from runtime.plots.raster import draw_raster
from runtime.plots.scans import draw_scans
from runtime.plots.series import draw_heatmap, draw_timeseries
from runtime.plots.style import fit_limits, line_labels, set_limits
from runtime.plots.trajectory import paint_trajectory, scale_equally
from runtime.plots.tuning import draw_response_curves, draw_tuning_curves


@dataclass(frozen=True)
class Drawing:
    """How plots of a kind are drawn; the fields are those of :class:`PlotKind`."""

    painter: Callable[..., Axes]
    overlay: Callable[..., Axes | None] | None = None
    limits: Callable[[Figure, Axes, PlotSpec], None] = set_limits
    labels: Callable[[Axes, PlotSpec], Sequence[str]] = line_labels
    finish: Callable[[Figure, Axes, PlotSpec], None] | None = None


OURS: Mapping[str, Drawing] = {
    "timeseries": Drawing(
        draw_timeseries,
        overlay=overlay_timeseries,
        limits=fit_limits,
    ),
    "trajectory": Drawing(
        paint_trajectory,
        overlay=overlay_trajectory,
        finish=scale_equally,
    ),
    "xy": Drawing(
        draw_xy,
        overlay=partial(overlay_curves, draw_xy),
        labels=label_axes,
    ),
    "xyz": Drawing(
        draw_xyz,
        overlay=partial(overlay_curves, draw_xyz),
        limits=limit_space,
    ),
    "spectrum": Drawing(
        draw_spectrum,
        overlay=partial(overlay_curves, draw_spectrum),
        limits=fit_limits,
        labels=label_spectrum,
    ),
    "raster": Drawing(draw_raster),
    "tuning_curves": Drawing(draw_tuning_curves),
    "response_curves": Drawing(draw_response_curves),
    "decoded": Drawing(draw_decoded),
    "weights": Drawing(draw_weights),
    "heatmap": Drawing(draw_heatmap),
    "map": Drawing(draw_map, overlay=overlay_map),
    "wall_distance": Drawing(draw_wall_distance, overlay=overlay_wall_distance),
    "scans": Drawing(draw_scans),
}


def drawing_of(plot: PlotSpec) -> Drawing:
    """How a plot is drawn: by the functions of the library, or by those that its kind names."""
    if is_ours(plot):
        return OURS[plot.kind]
    given = {each.name: getattr(plot.definition, each.name) for each in fields(Drawing)}
    return Drawing(**{name: _function(value) for name, value in given.items() if value})


def is_ours(plot: PlotSpec) -> bool:
    """Whether a plot is drawn by the library's own functions."""
    return not plot.definition.painter


def _function(function: Any) -> Any:
    """A function, or the one of a name ``module:function``."""
    if not isinstance(function, str):
        return function
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)
