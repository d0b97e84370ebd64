"""Metrics of populations against their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest

import runtime
from runtime.observation.metric_kinds import Series
from runtime.observation.neural_metrics import NEURAL_KINDS

T = np.arange(0.0, 1.0, 0.001)


def value(kind: str, written: dict[str, float], **signals: np.ndarray) -> float | None:
    series = {role: Series(T, values) for role, values in signals.items()}
    return NEURAL_KINDS[kind].value(series, written)


def test_rmse_of_a_sine_against_its_cosine() -> None:
    sine, cosine = np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)
    assert value("rmse", {}, of=sine, reference=cosine) == pytest.approx(1.0)
    late = np.sin(2 * np.pi * (T - 0.1))
    assert value("rmse", {"delay": 0.1}, of=late, reference=sine) == pytest.approx(0.0, abs=1e-12)
    pair = np.stack([sine, cosine], axis=1)
    assert value("rmse", {}, of=pair, reference=0.0 * pair) == pytest.approx(1.0)


def test_rmse_of_a_step_through_a_lowpass() -> None:
    step = np.where(T > 0.0, 1.0, 0.0)
    answer = 1.0 - np.exp(-np.maximum(T - 0.001, 0.0) / 0.1)
    found = value("rmse", {"tau": 0.1}, of=answer, reference=step)
    assert found == pytest.approx(0.0, abs=1e-12)


def test_rates_and_events() -> None:
    spikes = np.zeros((1000, 2))
    spikes[::10, 0] = 1000.0  # 100 Hz
    spikes[::50, 1] = 1000.0  # 20 Hz
    assert value("firing_rate", {}, of=spikes) == pytest.approx(60.0)
    assert value("synaptic_operations", {"synapses": 5}, of=spikes) == pytest.approx(600.0)


GRAPH = """
graph: metrics
run: {dt: 0.001, until: 0.2}
blocks:
  x: {type: Function, expression: "sin(8*t)"}
  snn: {type: Ensemble, neurons: 50}
  out: {type: Decoder}
wires:
  snn: {input: x.out}
  out: {spikes: snn.spikes}
metrics:
  miss: {kind: rmse, of: out.value, reference: x.out, delay: 0.005, after: 0.05}
  rate: {kind: firing_rate, of: snn.spikes}
  events: {kind: synaptic_operations, of: snn.spikes, synapses: 1}
"""


def test_in_a_graph() -> None:
    found = runtime.load(runtime.document.parse_yaml(GRAPH, "text").plain()).run()
    assert 0.0 < found.metrics["miss"] < 0.3
    assert found.metrics["events"] == pytest.approx(50 * found.metrics["rate"])
    assert math.isclose(found["snn.spikes"].mean(), found.metrics["rate"])


def test_columns_that_differ_are_an_error() -> None:
    text = GRAPH.replace("reference: x.out", "reference: snn.spikes")
    with pytest.raises(runtime.GraphError, match="has 50 columns and 'of' has 1"):
        runtime.load(runtime.document.parse_yaml(text, "text").plain()).check()
