"""Nonlinear elements against closed forms and scipy's interpolants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import interpolate

from tests.blocks.responses import problems, respond

X = np.linspace(-2.0, 2.0, 201)
WAVE = np.sin(0.05 * np.arange(300)) * np.linspace(0.2, 2.0, 300)


def test_static_elements() -> None:
    clip = respond({"type": "Clip", "low": -0.5, "high": 1.5}, {"input": X})
    np.testing.assert_array_equal(clip, np.clip(X, -0.5, 1.5))
    zone = respond({"type": "DeadZone", "low": -0.5, "high": 0.25}, {"input": X})
    np.testing.assert_allclose(zone, X - np.clip(X, -0.5, 0.25), atol=1e-15)
    steps = respond({"type": "Quantizer", "step": 0.3, "offset": 0.1}, {"input": X})
    np.testing.assert_allclose(steps, 0.3 * np.round((X - 0.1) / 0.3) + 0.1, atol=1e-15)


def test_each_component_may_have_its_own_limit() -> None:
    pair = np.column_stack((X, -X))
    found = respond({"type": "Clip", "low": [-1, 0], "high": [1, 0.5]}, {"input": pair})
    np.testing.assert_array_equal(found, np.clip(pair, [-1, 0], [1, 0.5]))


def test_a_rate_limiter_follows_at_its_rates() -> None:
    step = np.repeat([0.0, 1.0, 0.0], 100)
    found = respond({"type": "RateLimiter", "rising": 2.0, "falling": -4.0}, {"input": step})
    k = np.arange(300)
    expected = np.where(k < 100, 0.0, np.minimum(1.0, 0.02 * (k - 99)))
    expected = np.where(k < 200, expected, np.maximum(0.0, 1.0 - 0.04 * (k - 199)))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_backlash_keeps_within_half_its_width_and_moves_only_at_its_ends() -> None:
    found = respond({"type": "Backlash", "width": 0.4}, {"input": WAVE})
    gap = WAVE - found
    assert np.abs(gap).max() <= 0.2 + 1e-12
    moved = np.diff(found, prepend=0.0)
    np.testing.assert_allclose(gap[moved > 0], 0.2, atol=1e-12)
    np.testing.assert_allclose(gap[moved < 0], -0.2, atol=1e-12)


def test_a_relay_has_hysteresis() -> None:
    entry = {"type": "Relay", "switch_on": 0.5, "switch_off": -0.5, "low": -3.0, "high": 2.0}
    found = respond(entry, {"input": WAVE})
    on, expected = False, []
    for x in WAVE:
        on = x >= 0.5 or (on and x > -0.5)
        expected.append(2.0 if on else -3.0)
    first = int(np.flatnonzero(np.abs(WAVE) >= 0.5)[0])
    np.testing.assert_array_equal(found[first:], expected[first:])


POINTS = {"x": [-1.5, -0.5, 0.0, 1.5], "y": [1.0, 2.0, -1.0, 3.0]}


@pytest.mark.parametrize("outside", ["hold", "extrapolate"])
@pytest.mark.parametrize("method", ["hold", "linear", "cubic", "pchip"])
def test_a_lookup_table_is_scipys_interpolant(method: str, outside: str) -> None:
    entry = {"type": "LookupTable", **POINTS, "method": method, "outside": outside}
    at = np.clip(X, -1.5, 1.5) if outside == "hold" else X
    xs, ys = POINTS["x"], POINTS["y"]
    if method in ("cubic", "pchip"):
        kind = {"cubic": interpolate.CubicSpline, "pchip": interpolate.PchipInterpolator}
        expected = kind[method](xs, ys)(at)
    elif method == "linear":
        expected = interpolate.interp1d(xs, ys, fill_value="extrapolate")(at)
    else:
        pieces = np.clip(np.searchsorted(xs, at, "right") - 1, 0, 3)
        expected = np.array(ys)[pieces]
    np.testing.assert_allclose(respond(entry, {"input": X}), expected, atol=1e-12)


def test_a_table_of_two_variables_is_scipys() -> None:
    grid = np.array([[1.0, 2.0, 0.0], [3.0, -1.0, 4.0]])
    entry = {"type": "LookupTable2D", "x": [-1, 1], "y": [-1, 0, 2], "values": grid.tolist()}
    y = 1.7 * np.cos(5.0 * X)
    of = interpolate.RegularGridInterpolator(([-1, 1], [-1, 0, 2]), grid)
    expected = of(np.column_stack((np.clip(X, -1, 1), np.clip(y, -1, 2))))
    np.testing.assert_allclose(respond(entry, {"x": X, "y": y}), expected, atol=1e-12)
    of = interpolate.RegularGridInterpolator(
        ([-1, 1], [-1, 0, 2]), grid, bounds_error=False, fill_value=None
    )
    expected = of(np.column_stack((X, y)))
    found = respond({**entry, "outside": "extrapolate"}, {"x": X, "y": y})
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_table_may_refuse_what_lies_outside() -> None:
    entry = {"type": "LookupTable", **POINTS, "outside": "error"}
    with pytest.raises(
        Exception, match="not finite: nan; the input is outside of x, .* 'outside: hold'"
    ):
        respond(entry, {"input": X})


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"type": "Clip", "low": 1, "high": 0}, "expected at least low = 1"),
        ({"type": "Clip", "low": [1, 2]}, "expected a number for Scalar"),
        ({"type": "DeadZone", "low": 1, "high": 0}, "expected at least low = 1"),
        ({"type": "Relay", "switch_on": 0, "switch_off": 1}, "expected at most switch_on = 0"),
        ({"type": "LookupTable", "x": [0, 0], "y": [1, 2]}, "ascending order"),
        ({"type": "LookupTable", "x": [0, 1], "y": [1]}, "expected 2 values"),
    ],
)
def test_a_wrong_element_is_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems(entry, ["Scalar"])
