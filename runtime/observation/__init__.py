"""Observation: what a run records, draws and measures.

In: a network and its sections probes, plots and metrics. Out: an :class:`Observation` before the
run, and the :class:`RunData` of a finished one.

    reader          the three sections -> Observation      probes     which columns, in which units
    metrics         the registry of metrics' kinds         plots      the registry of plots' kinds
    *_metrics       the formulas, by subject               run_data   arrays and metrics of a run

How something is drawn is above, in runtime.plots: a run without figures needs no matplotlib.
"""

from runtime.observation.metric_kinds import MetricKind, MetricOptions, NumberOptions
from runtime.observation.metrics import CRASHED, METRIC_KINDS, OF_RUN, Metric, Series, of_run
from runtime.observation.observation import Observation, StopTest
from runtime.observation.plot_options import CHANGES, Figure
from runtime.observation.plots import PLOT_KINDS, PlotKind, plot_keys, plot_kind_names
from runtime.observation.probes import PROBE_KEYS, Signal
from runtime.observation.reader import PlotSpec, Probe, observe
from runtime.observation.run_data import Recording, RunData
from runtime.observation.wall_metrics import since_reached

__all__ = [
    "CHANGES",
    "CRASHED",
    "METRIC_KINDS",
    "OF_RUN",
    "PLOT_KINDS",
    "PROBE_KEYS",
    "Figure",
    "Metric",
    "MetricKind",
    "MetricOptions",
    "NumberOptions",
    "Observation",
    "PlotKind",
    "PlotSpec",
    "Probe",
    "Recording",
    "RunData",
    "Series",
    "Signal",
    "StopTest",
    "observe",
    "of_run",
    "plot_keys",
    "plot_kind_names",
    "since_reached",
]
