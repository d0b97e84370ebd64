"""runtime.observation."""

from runtime.observation.metric_kinds import Common, Kind
from runtime.observation.metrics import METRIC_KINDS, Metric, Series
from runtime.observation.plots import PLOT_KINDS, PlotKind, offered
from runtime.observation.probes import readable_bytes
from runtime.observation.reader import Observation, PlotSpec, Probe, observe
from runtime.observation.run_data import Recording, RunData
from runtime.observation.wall_metrics import since_reached

__all__ = [
    "METRIC_KINDS",
    "PLOT_KINDS",
    "Common",
    "Kind",
    "Metric",
    "Observation",
    "PlotKind",
    "PlotSpec",
    "Probe",
    "Recording",
    "RunData",
    "Series",
    "observe",
    "offered",
    "readable_bytes",
    "since_reached",
]
