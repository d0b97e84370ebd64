"""Fits as a function: ``runtime.fit(graph, vary, data)``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from blocks.core import FloatArray
from runtime.engine import silent
from runtime.errors import UsageError
from runtime.experiments.design import (
    Experiment,
    GraphVariant,
    Measurement,
    Range,
    Request,
    read_experiment,
)
from runtime.experiments.execution import Note
from runtime.files import slug
from runtime.fitting.model import Model
from runtime.fitting.solving import Fit, fit_model
from runtime.graph import Graph, load

Arrays = tuple[FloatArray, FloatArray]
Data = Mapping[str, "Mapping[str, str] | Arrays"]


def fit(
    graph: Graph | str | Path | Mapping[str, Any],
    vary: Mapping[str, str] | None = None,
    data: Data | None = None,
    *,
    weights: Mapping[str, float] | None = None,
    starts: int = 4,
) -> Fit:
    """Find numbers of a graph with which its signals reproduce recorded data, by least squares.

    Parameters
    ----------
    graph : a graph, or the file or name of one or of an experiment with ``data``.
    vary : for each path into the graph its range, as ``"0..1"`` or ``"log(1e-3..1)"``.
    data : for each signal its times (s) and values; or for each file (csv, npz) the signals by
        column, as ``{"push.csv": {"angle": "arm.angle"}}``.
    weights : of signals; how much the difference counts, 1 by default.
    starts : of the search; the first is the graph itself.

    Raises
    ------
    GraphError, UsageError : the graph, a range or the data are invalid.

    Examples
    --------
    >>> import numpy as np
    >>> import runtime
    >>> t = np.linspace(0.0, 9.0, 91)
    >>> answer = np.where(t > 3.0, 2.0 - 2.0 * np.exp(-(t - 3.0)), 0.0)
    >>> fit = runtime.fit(
    ...     "gallery/first_order_feedback", {"step.after": "0.1..10"}, {"state.out": (t, answer)}
    ... )
    >>> f"{fit.values['step.after']:.4f}"
    '2.0000'
    """
    request = Request.of({}, vary=(vary or {}).items())
    if isinstance(graph, (str, Path)):
        base = read_experiment(str(graph))
    else:
        loaded = graph if isinstance(graph, Graph) else load(graph)
        base = Experiment(slug(loaded.title), loaded)
    experiment = request.apply_to(base)
    extra = tuple(_measurements(experiment.graph, data or {}, weights or {}))
    return fit_model(model_of(experiment, extra), starts)


def model_of(
    experiment: Experiment, extra: tuple[Measurement, ...] = (), note: Note = silent
) -> Model:
    """The model of an experiment's graph, ranges and data, and of further data.

    Raises
    ------
    UsageError : there is nothing to vary or no data, or a factor is not a range of numbers.
    """
    experiment.check_used("fit")
    ranges = []
    for factor in experiment.entries.factors:
        if not isinstance(factor, Range) or factor.scale == "int":
            raise UsageError(
                f"{factor.path}={factor.written}: a fit needs a range of numbers, as 0..1 or "
                "log(1e-3..1)"
            )
        ranges.append(factor)
    if not ranges:
        raise UsageError("there is nothing to fit; add --vary PATH=LOW..HIGH")
    measurements = (*experiment.data, *extra)
    if not measurements:
        raise UsageError("there are no data to fit to; add --to FILE:COLUMN=SIGNAL")
    return Model.of(ranges, measurements, note)


def _measurements(graph: Graph, data: Data, weights: Mapping[str, float]) -> list[Measurement]:
    arrays = {name: each for name, each in data.items() if not isinstance(each, Mapping)}
    found = [
        Measurement(
            GraphVariant(Path(name).stem, graph),
            Path(name),
            dict(each),
            {column: weights[signal] for column, signal in each.items() if signal in weights},
        )
        for name, each in data.items()
        if isinstance(each, Mapping)
    ]
    if arrays:
        signals = {name: name for name in arrays}
        found.append(
            Measurement(GraphVariant("data", graph), Path("data"), signals, dict(weights), arrays)
        )
    return found
