"""A graph as a function of some of its numbers: simulated minus measured signals.

In: ranges of numbers, and measurements. Out: :class:`Model`, whose ``residuals`` runs the graph::

    model = Model.of((Range("arm.damping", ...),), measurements)
    model.residuals({"arm.damping": 0.3})          # one row for each measured value
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from blocks import FromFile
from blocks.core import FloatArray, ParameterError
from runtime.document import Value
from runtime.engine import silent
from runtime.errors import GraphError, UsageError
from runtime.experiments.design import Measurement, Range
from runtime.experiments.execution import Note, engine_for
from runtime.graph import Graph, RepeatedRuns

PROBE = "fitted_{}"
RUNS = 30  # of a search, for each number that is looked for; only the choice of an engine needs it


@dataclass(frozen=True)
class Series:
    """A measured signal.

    Parameters
    ----------
    t, values : times (s) and values, (n,) each.
    scale : what a difference is divided by: the standard deviation of the values over the weight,
        so that signals in different units count alike.
    unit : of the graph's signal.
    """

    run: str
    address: str
    t: FloatArray
    values: FloatArray
    scale: float
    unit: str

    @property
    def name(self) -> str:
        return f"{self.run}: {self.address}" if self.run else self.address


@dataclass(frozen=True)
class Run:
    """One run of the graph, and what was measured in it; probe ``fitted_i`` is of series i."""

    graph: Graph
    series: tuple[Series, ...]

    @cached_property
    def repeated(self) -> RepeatedRuns:
        """The runs with other values."""
        return RepeatedRuns(self.graph)


@dataclass
class Model:
    """Graphs that depend on a few numbers, and the measurements that they shall reproduce."""

    ranges: tuple[Range, ...]
    runs: tuple[Run, ...]
    count: int = 0  # runs that were simulated

    @classmethod
    def of(
        cls, ranges: Sequence[Range], measurements: Sequence[Measurement], note: Note = silent
    ) -> Model:
        """Read the data, and prepare the graphs.

        All runs have the same engine, the one that is faster for as many as a search may take.

        Raises
        ------
        UsageError : a file cannot be read or has no such column, or its times do not fit.
        GraphError : there is no such signal, or it is not a scalar.
        """
        is_alone = len(measurements) == 1
        runs = [_run(each, is_alone) for each in measurements]
        engine = engine_for(runs[0].graph, RUNS * (len(ranges) + 1) * len(runs), note)
        return cls(tuple(ranges), tuple(_with_engine(run, engine) for run in runs))

    @property
    def series(self) -> list[Series]:
        return [series for run in self.runs for series in run.series]

    def simulate(self, values: Mapping[str, float]) -> list[FloatArray]:
        """Each signal at the times at which it was measured, in the order of :attr:`series`.

        Between two ticks a signal is interpolated linearly.

        Raises
        ------
        SimulationError, GraphError : the graph cannot run with these values.
        """
        found = []
        for run in self.runs:
            result = run.repeated.run(values, run.graph.network.seed, whole=False)
            self.count += 1
            for i, series in enumerate(run.series):
                probe = PROBE.format(i)
                found.append(np.interp(series.t, result.time(probe), result[probe]))
        return found

    def residuals(self, values: Mapping[str, float]) -> FloatArray:
        """Simulated minus measured values, each divided by its signal's scale."""
        pairs = zip(self.simulate(values), self.series, strict=True)
        return np.concatenate([(y - series.values) / series.scale for y, series in pairs])


def _with_engine(run: Run, engine: str) -> Run:
    if run.graph.network.engine != "auto":
        return run
    return replace(run, graph=run.graph.set("run.engine", engine, origin="fit"))


def _run(measurement: Measurement, is_alone: bool) -> Run:
    columns = [_column(measurement, column) for column in measurement.signals]
    graph, addresses = measurement.variant.graph, list(measurement.signals.values())
    dt = graph.network.dt
    last = max(float(t[-1]) for t, _ in columns)
    first = min(float(t[0]) for t, _ in columns)
    if first < -1e-9 * dt:
        raise UsageError(f"'{measurement.file}' begins at {first:g} s; a run begins at 0 s")
    # What a run records besides costs time; the graph's own probes may be what is measured.
    probes: dict[str, Value] = {
        PROBE.format(i): {"of": each, "every": 1} for i, each in enumerate(addresses)
    }
    for section in ("plots", "metrics"):
        graph = graph.set(section, {}, origin="fit")
    graph = graph.set("probes", probes, origin="--to")
    # The last row of a run is one tick before its end.
    graph = graph.set("run.until", (math.ceil(last / dt - 1e-9) + 1) * dt, origin="fit")
    try:
        known = graph.check().observation.probes
    except GraphError as error:
        wrong = [each for each in error.problems if each.address.startswith("probes.")]
        if not wrong:
            raise
        raise UsageError("; ".join(f"data: {each.text}" for each in wrong)) from None
    series = []
    for i, ((t, values), column) in enumerate(zip(columns, measurement.signals, strict=True)):
        probe = known[PROBE.format(i)]
        if probe.shape:
            raise UsageError(
                f"'{addresses[i]}' has {math.prod(probe.shape)} components; "
                f"name one, as {probe.labels[0]}"
            )
        spread = float(np.std(values))
        # Of a constant signal, its size; of zeros, 1.
        scale = spread or float(np.abs(values).max()) or 1.0
        scale /= measurement.weights.get(column, 1.0)
        name = "" if is_alone else measurement.variant.name
        series.append(Series(name, addresses[i], t, values, scale, probe.signals[0].units[0]))
    return Run(graph, tuple(series))


def _column(measurement: Measurement, column: str) -> tuple[FloatArray, FloatArray]:
    """Times and values of a column, read and checked as the block FromFile does."""
    if column in measurement.arrays:
        return _arrays(column, *measurement.arrays[column])
    try:
        block = FromFile(file=str(measurement.file), columns=[column])
        t, values = block.rows
        return t, values
    except ParameterError as error:
        text = "; ".join(text for _, text in error.problems)
        raise UsageError(f"{measurement.file}: {text}") from None


def _arrays(name: str, t: object, values: object) -> tuple[FloatArray, FloatArray]:
    times, numbers = np.asarray(t, dtype=float), np.asarray(values, dtype=float)
    if times.ndim != 1 or times.shape != numbers.shape or len(times) < 2:
        raise UsageError(
            f"{name}: expected times and as many values, got {times.shape} and {numbers.shape}"
        )
    if not (np.isfinite(times).all() and np.isfinite(numbers).all() and (np.diff(times) > 0).all()):
        raise UsageError(f"{name}: expected finite values at ascending times")
    return times, numbers
