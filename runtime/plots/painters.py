"""The function that draws each kind of plot of the library; a package's kind names its own.

In: the kind's name, "map". Out: the function that draws it, ``draw_map``. ``observation`` declares
the kinds and must not import matplotlib, so the functions are listed here and not beside the
declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from matplotlib.axes import Axes

from runtime.plots.analysis import draw_spectrum, draw_xy, draw_xyz
from runtime.plots.decoded import draw_decoded, draw_weights
from runtime.plots.map import draw_map, draw_wall_distance
from runtime.plots.raster import draw_raster
from runtime.plots.scans import draw_scans
from runtime.plots.series import draw_heatmap, draw_timeseries
from runtime.plots.trajectory import draw_trajectory
from runtime.plots.tuning import draw_response_curves, draw_tuning_curves

# Called with (figure, recordings, end of the run in s), or (figure, plot, result) for kinds that
# are declared ``in_world`` or ``with_options``; returns the top axes.
PAINTERS: Mapping[str, Callable[..., Axes]] = {
    "timeseries": draw_timeseries,
    "trajectory": draw_trajectory,
    "xy": draw_xy,
    "xyz": draw_xyz,
    "spectrum": draw_spectrum,
    "raster": draw_raster,
    "tuning_curves": draw_tuning_curves,
    "response_curves": draw_response_curves,
    "decoded": draw_decoded,
    "weights": draw_weights,
    "heatmap": draw_heatmap,
    "map": draw_map,
    "wall_distance": draw_wall_distance,
    "scans": draw_scans,
}

# Those that draw the lines of several runs in the same axes: called with the recordings of all
# runs by label as well.
OVERLAID: Mapping[str, Callable[..., Axes]] = {
    "xy": draw_xy,
    "xyz": draw_xyz,
    "spectrum": draw_spectrum,
}
