"""Metrics of control against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.observation.metrics import METRIC_KINDS, Metric, Series

T = np.arange(2000) * 0.005  # ten whole seconds


def value(kind: str, values: Any, t: Any = T, **options: Any) -> float | None:
    series = Series(np.asarray(t, dtype=float), np.asarray(values, dtype=float))
    return Metric("m", kind, {"of": "p"}, options).value({"p": series})


def test_the_effort_of_a_sine_and_of_its_changes() -> None:
    """Of a sin(w t): a / sqrt 2, and of its changes that times 2 sin(w h / 2)."""
    w, h = 2.0 * math.pi, 0.005
    sine = 3.0 * np.sin(w * T)
    assert value("effort", sine) == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-12)
    change = 3.0 / math.sqrt(2.0) * 2.0 * math.sin(0.5 * w * h)
    assert value("effort_change", sine) == pytest.approx(change, rel=1e-3)
    # 40 quarter periods of 3 each, in ten seconds.
    assert value("smoothness", sine) == pytest.approx(40 * 3.0 / 10.0, rel=2e-3)


def test_columns_are_taken_together_each_in_its_own_unit() -> None:
    rows = [[3.0, 40.0], [3.0, 40.0], [6.0, 80.0]]
    t = [0.0, 1.0, 2.0]
    assert value("effort", rows, t, scale=[1, 10]) == pytest.approx(math.sqrt((25 + 25 + 100) / 3))
    assert value("effort_change", rows, t, scale=[1, 10]) == pytest.approx(math.sqrt(25 / 2))
    assert value("smoothness", rows, t, scale=[1, 10]) == pytest.approx((3 + 4) / 2)
    assert value("saturation", rows, t, limit=[6.0, 100.0]) == pytest.approx(1 / 3)
    assert value("saturation", rows, t, limit=[7.0, 80.0]) == pytest.approx(1 / 3)
    assert value("saturation", rows, t, limit=3.0) == 1.0


@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_scale_is_a_unit(size: float, scale: float) -> None:
    for kind in ("effort", "effort_change", "smoothness"):
        plain, scaled = value(kind, size * np.sin(T)), value(kind, size * np.sin(T), scale=scale)
        assert plain is not None and scaled == pytest.approx(plain / scale, rel=1e-12)


def test_a_single_row_has_an_effort_but_no_change() -> None:
    assert value("effort", [2.0], [0.0]) == 2.0
    assert value("effort_change", [2.0], [0.0]) is None
    assert value("smoothness", [2.0], [0.0]) is None


def test_recovery_from_a_step() -> None:
    """exp(-(t - 4)) after 4 s is within 0.1 after ln 10 = 2.302... s: the next row is 2.305."""
    error = np.where(T < 4.0, 0.0, np.exp(-(T - 4.0)))
    assert value("recovery_time", error, at=4.0, band=0.1) == pytest.approx(2.305)
    assert value("recovery_time", error, at=4.0, band=0.1, until=8.0) == pytest.approx(2.305)
    assert value("recovery_time", error, at=4.0, band=0.1, until=7.0) is None
    assert value("recovery_time", error, at=4.0, band=0.1, until=7.0, hold=0.5) is not None
    assert value("recovery_time", error, at=4.0, band=2.0) == 0.0
    assert value("recovery_time", error, at=50.0, band=2.0) is None


def test_what_happens_after_the_next_step_does_not_count() -> None:
    error = np.where((T >= 4.0) & (T < 5.0), 1.0, 0.0) + np.where(T >= 8.0, 1.0, 0.0)
    assert value("recovery_time", error, at=4.0, band=0.1, until=8.0) == pytest.approx(1.0)
    assert value("recovery_time", error, at=4.0, band=0.1) is None


def test_bad_options() -> None:
    kind = METRIC_KINDS["recovery_time"]
    [(key, message)] = kind.check({"at": 4.0, "until": 4.0, "band": 0.1}, {})
    assert (key, message) == ("until", "must lie after at = 4 s, got 4.0")
    [(key, message)] = METRIC_KINDS["saturation"].check({"limit": 0.0}, {})
    assert key == "limit" and message.startswith("expected a number")
