"""What the sections probes, plots and metrics of a graph amount to.

In: probes, plots and metrics, as the reader makes them. Out: questions about all of them: the
metrics' units, the plots to draw, or what of it a sweep needs that draws no plots.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace

from blocks.messages import Note
from runtime.document import SECOND
from runtime.observation.metric_kinds import ANY
from runtime.observation.metrics import Metric
from runtime.observation.plots import PlotSpec
from runtime.observation.probes import Probe, Signal


@dataclass(frozen=True)
class StopTest:
    """The signal that ends a run early: see :class:`runtime.document.Stop`."""

    signal: Signal
    direction: float
    level: float


@dataclass
class Observation:
    """What a run records, draws and measures, and what ends it early.

    ``notes`` lists what was left out, and why; ``defaults`` are the plots of a graph that says
    nothing about plots. ``events`` are the blocks whose events are recorded, by probe.
    ``time_unit`` is what times are in. ``files`` has the content of the Python files that were run
    for kinds of metrics and plots, by resolved path.
    """

    probes: dict[str, Probe] = field(default_factory=dict)
    plots: list[PlotSpec] = field(default_factory=list)
    metrics: list[Metric] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    stop: StopTest | None = None
    events: dict[str, tuple[str, ...]] = field(default_factory=dict)
    defaults: list[PlotSpec] = field(default_factory=list)
    time_unit: str = SECOND
    files: dict[str, bytes] = field(default_factory=dict)

    @property
    def all_plots(self) -> list[PlotSpec]:
        """The plots of a run."""
        return self.plots or self.defaults

    def metric_example(self, name: str = "largest") -> str:
        """What to write into a graph that has no metric, to have one."""
        probe = next(iter(self.probes), "PROBE")
        return f"add one, as in metrics: {{{name}: {{kind: max_abs, of: {probe}}}}}"

    @property
    def metric_units(self) -> dict[str, str]:
        """The units of the metrics that have one."""
        columns = {name: probe.units for name, probe in self.probes.items()}
        units = {metric.name: metric.unit(columns, self.time_unit) for metric in self.metrics}
        return {name: unit for name, unit in units.items() if unit}

    @property
    def metric_ends(self) -> dict[str, tuple[float, float]]:
        """The least and the largest possible value of the metrics that have one."""
        ends_of_kind = {metric.name: metric.definition.ends for metric in self.metrics}
        return {name: ends for name, ends in ends_of_kind.items() if ends != ANY}

    @property
    def metric_never(self) -> dict[str, str]:
        """What no value of a metric means, of those where it is worse than any value."""
        return {metric.name: metric.never for metric in self.metrics if metric.never}

    def only_for(self, kinds: Container[str]) -> Observation:
        """Only the probes that metrics and plots of these kinds need."""
        plots = [plot for plot in self.plots if plot.kind in kinds]
        used = {name for plot in plots for name in plot.uses}
        used |= {name for metric in self.metrics for name in metric.inputs.values() if name}
        probes = {name: probe for name, probe in self.probes.items() if name in used}
        return replace(self, probes=probes, plots=plots, defaults=[], events={})
