"""Metrics of populations of neurons: errors of decoded values, rates, events of synapses.

In: recorded spikes (rows, neurons), of 1/dt each, or decoded values. Out: one number, as 23.4 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import FloatArray, param
from runtime.observation.metric_kinds import (
    POSITIVE,
    MetricKind,
    MetricOptions,
    Series,
    alike,
)


class ReferenceOptions(MetricOptions):
    """What is done to the reference before it is compared."""

    delay: float = param(0.0, unit="s", at_least=0.0, doc="the reference is compared as it was")
    tau: float = param(0.0, unit="s", at_least=0.0, doc="lowpass that the reference passes first")


class SynapseOptions(MetricOptions):
    """How many synapses a spike reaches."""

    synapses: int = param(1, at_least=1, doc="targets of each neuron")


def rmse(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Root of the mean squared distance between two signals, of equal rows."""
    of, reference = series["of"], series["reference"]
    values = of.values.reshape(len(of.t), -1)
    target = np.broadcast_to(reference.values.reshape(len(reference.t), -1), values.shape)
    step = float(of.t[1] - of.t[0]) if len(of.t) > 1 else math.inf
    if options["tau"] > 0.0:
        target = _lowpass(target, -math.expm1(-step / options["tau"]))
    lag = round(options["delay"] / step)
    if lag:
        # Row k is compared with the reference `delay` earlier; the first rows have none.
        values, target = values[lag:], target[:-lag]
    if not len(values):
        return None
    return math.sqrt(float(np.square(values - target).sum(axis=1).mean()))


def _lowpass(values: FloatArray, share: float) -> FloatArray:
    """The exact response of a lowpass to an input that holds between rows, from its first value."""
    filtered = values.copy()
    for k in range(1, len(values)):
        filtered[k] = filtered[k - 1] + share * (values[k - 1] - filtered[k - 1])
    return filtered


def firing_rate(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """The mean rate of a neuron: spikes of 1/dt each, or rates, averaged over all of them."""
    return float(series["of"].values.mean())


def synaptic_operations(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Spikes per second of all neurons, times the synapses that each reaches."""
    values = series["of"].values
    rows = values.reshape(len(values), -1)
    return float(rows.mean(axis=0).sum() * options["synapses"])


NEURAL_KINDS: dict[str, MetricKind] = {
    "rmse": MetricKind(
        rmse,
        "root of the mean square of the distance from `reference`: the squares of the components "
        "are added, not averaged",
        options=ReferenceOptions,
        inputs=("of", "reference"),
        forms=("columns",),
        agrees=alike,
        unit="of",
        ends=POSITIVE,
    ),
    "firing_rate": MetricKind(
        firing_rate,
        "mean firing rate of the neurons of a probe of spikes or rates",
        options=MetricOptions,
        forms=("columns",),
        unit="Hz",
        ends=POSITIVE,
    ),
    "synaptic_operations": MetricKind(
        synaptic_operations,
        "events at synapses per second: spikes of all neurons times the `synapses` of each",
        options=SynapseOptions,
        forms=("columns",),
        unit="1/s",
        ends=POSITIVE,
    ),
}
