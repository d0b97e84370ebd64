"""Sources against closed forms, scipy and the statistics of noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import interpolate, signal, stats

from tests.blocks.responses import problems, respond

T = 0.01 * np.arange(500)


def test_the_clock_tells_the_time() -> None:
    np.testing.assert_array_equal(respond({"type": "Clock"}, ticks=500, of="time"), T)


def test_a_sine() -> None:
    entry = {"type": "Sine", "amplitude": 2, "frequency": 3, "phase": "30°", "offset": 1}
    expected = 1.0 + 2.0 * np.sin(2 * np.pi * 3 * T + np.pi / 6)
    np.testing.assert_allclose(respond(entry, ticks=500), expected, atol=1e-12)


@pytest.mark.parametrize("time", [0.0, 0.29, 0.57, 1.1, 4.99])
def test_a_step_happens_on_its_tick(time: float) -> None:
    found = respond({"type": "Step", "time": time, "before": -1, "after": 3}, ticks=500)
    np.testing.assert_array_equal(found, np.where(np.arange(500) >= round(time * 100), 3.0, -1.0))


def test_a_ramp_ends() -> None:
    entry = {"type": "Ramp", "slope": -2, "start": 1, "stop": 3, "initial": 5}
    expected = np.interp(T, [1, 3], [5, 1])
    np.testing.assert_allclose(respond(entry, ticks=500), expected, atol=1e-12)


@pytest.mark.parametrize("period", [0.3, 0.7, 1.0])
def test_pulses_are_scipys_square_wave(period: float) -> None:
    found = respond({"type": "Pulse", "period": period, "width": 0.4 * period}, ticks=500)
    expected = signal.square(2 * np.pi * (T + 1e-6) / period, duty=0.4) > 0
    np.testing.assert_array_equal(found, expected)


def test_edges_make_a_triangle_and_a_count_ends_it() -> None:
    entry = {"type": "Pulse", "period": 1, "rise": 0.5, "fall": 0.5, "low": -1, "count": 3}
    expected = np.where(T < 3 - 1e-9, signal.sawtooth(2 * np.pi * T, 0.5), -1)
    np.testing.assert_allclose(respond(entry, ticks=500), expected, atol=1e-7)


@pytest.mark.parametrize("method", ["linear", "logarithmic"])
def test_a_chirp_is_scipys(method: str) -> None:
    entry = {"type": "Chirp", "f0": 0.5, "f1": 5, "duration": 4, "method": method}
    expected = signal.chirp(T, 0.5, 4, 5, method, phi=-90)
    np.testing.assert_allclose(respond(entry, ticks=500), expected, atol=1e-9)


TIMES, VALUES = [0.5, 1.0, 2.0, 3.5], [[1.0, 5.0], [3.0, -1.0], [2.0, 0.0], [4.0, 2.0]]


@pytest.mark.parametrize("method", ["hold", "linear", "cubic"])
def test_piecewise_is_scipys_interpolant(method: str) -> None:
    entry = {"type": "Piecewise", "times": TIMES, "values": VALUES, "method": method}
    at = np.clip(T, 0.5, 3.5)
    if method == "cubic":
        expected = interpolate.CubicSpline(TIMES, VALUES)(at)
    else:
        kind = "previous" if method == "hold" else "linear"
        expected = interpolate.interp1d(TIMES, VALUES, kind, axis=0)(at)
    np.testing.assert_allclose(respond(entry, ticks=500), expected, atol=1e-12)


@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_the_power_of_noise_does_not_depend_on_the_step(dt: float) -> None:
    """The spectral density is flat, and the integral's variance is density * t."""
    n = 20_000
    found = respond({"type": "WhiteNoise", "density": 0.5, "mean": 2.0}, ticks=n, dt=dt)
    noise = found - 2.0
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], n) / n
    assert low < noise.var() * dt / 0.5 < high
    _, density = signal.welch(noise, 1.0 / dt, nperseg=256, return_onesided=False)
    assert density[1:].mean() == pytest.approx(0.5, rel=0.06)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4.0 / math.sqrt(n)


@pytest.mark.slow
def test_the_density_of_pink_noise_falls_with_the_frequency() -> None:
    dt, n = 0.01, 40_000
    entry = {"type": "PinkNoise", "density": [0.3, 1.2], "lowest": 0.01}
    noise = respond(entry, ticks=n, dt=dt)
    f, density = signal.welch(noise, 1.0 / dt, nperseg=2048, axis=0, return_onesided=False)
    for low, high in ((0.2, 1.6), (1.6, 12.8)):
        inside = (f > low) & (f < high)
        scaled = (density[inside] * f[inside, None]).mean(axis=0)
        np.testing.assert_allclose(scaled, [0.3, 1.2], rtol=0.12)
    assert abs(np.corrcoef(np.diff(noise, axis=0).T)[0, 1]) < 0.02


def test_a_white_signal_is_even_below_its_highest_frequency() -> None:
    entry = {"type": "WhiteSignal", "period": 20.0, "high": 10.0, "rms": [0.5, 2.0]}
    found = respond(entry, ticks=5000, dt=0.01)
    np.testing.assert_array_equal(found[2000:4000], found[:2000])
    spectrum = np.abs(np.fft.rfft(found[:2000], axis=0) / 2000) ** 2
    assert spectrum[201:].max() < 1e-25
    assert spectrum[0].max() < 1e-25
    # Each of the 200 lines has a power of (a^2 + b^2) / 2, chi-squared with two degrees.
    for column, rms in ((0, 0.5), (1, 2.0)):
        powers = 2 * spectrum[1:201, column] / (rms**2 / 200 / 2)
        assert stats.kstest(powers, stats.chi2(2).cdf).pvalue > 1e-3
        low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], 400) / 400
        assert low < np.mean(found[:2000, column] ** 2) / rms**2 < high
    message = problems({"type": "WhiteSignal", "period": 0.1, "high": 5.0})
    assert "high: expected at least 1 / period = 10 Hz, got 5" in message


def test_a_random_walk_spreads_with_the_root_of_time() -> None:
    found = respond({"type": "RandomWalk", "density": 0.5, "initial": 3.0}, ticks=20_000)
    steps = np.diff(found)
    assert found[0] == 3.0
    assert stats.kstest(steps / math.sqrt(0.5 * 0.01), "norm").pvalue > 1e-4


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"type": "Ramp", "start": 2, "stop": 1}, "expected a time from start = 2 s on"),
        ({"type": "Pulse", "period": 1, "width": 2}, "expected a pulse that fits into period"),
        ({"type": "Pulse", "rise": 0.7, "fall": 0.7}, "expected edges that fit"),
        ({"type": "Chirp", "f0": 0, "method": "logarithmic"}, "above 0 Hz"),
        ({"type": "Piecewise", "times": [1, 1], "values": [0, 0]}, "ascending order, got 1 s"),
        ({"type": "Piecewise", "times": [1], "values": [0]}, "at least two times"),
        ({"type": "Piecewise", "times": [0, 1], "values": [0]}, "expected 2 values"),
        (
            {"type": "Piecewise", "times": [0, 1], "values": [0, 1], "signal": "Twist"},
            "expected a type of 1 component(s)",
        ),
        (
            {"type": "WhiteNoise", "density": [1, 2], "signal": "Scalar"},
            "expected a number for Scalar",
        ),
        ({"type": "WhiteNoise", "density": 1, "signal": "Vector"}, "expected a type with its"),
        ({"type": "RandomWalk", "density": [1, 2], "initial": [1, 2, 3]}, "expected a number or"),
        ({"type": "WhiteNoise", "density": 1, "signal": "Path(3)"}, "expected a number, a record"),
    ],
)
def test_a_wrong_source_is_refused(entry: dict[str, object], part: str) -> None:
    assert part in problems(entry)
