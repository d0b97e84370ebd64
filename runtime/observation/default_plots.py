"""The plots of a graph that has no section ``plots``: one for each probe.

In: the probes. Out: a plot of the kind that suits each: spikes as a raster, a pose as a trajectory.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from runtime.observation.plots import PLOT_KINDS, PlotSpec, title_of
from runtime.observation.probes import Probe

# So many figures are drawn within some seconds, and so many lines can be told apart.
MOST_PLOTS, MOST_LINES = 12, 12


def default_plots(probes: Iterable[Probe]) -> list[PlotSpec]:
    """A plot for each probe that changes, of the kind that fits what it records."""
    drawable = [probe for probe in probes if not probe.auto and not probe.constant and probe.labels]
    return [
        PlotSpec(probe.name, _kind(probe), (probe.name,), title_of(probe.name))
        for probe in drawable[:MOST_PLOTS]
    ]


def _kind(probe: Probe) -> str:
    """Spikes as a raster, one pose or path as a trajectory, few columns over time, all else as
    a heat map."""
    alone = probe.signals[0].kind if len(probe.signals) == 1 else ""
    if alone in ("Pose", "Path", "PointCloud") and not PLOT_KINDS["trajectory"].each(probe):
        return "trajectory"
    if alone == "Spikes" and not PLOT_KINDS["raster"].each(probe):
        return "raster"
    if len(probe.shape) <= 1 and math.prod(probe.shape) <= MOST_LINES:
        return "timeseries"
    return "heatmap"
