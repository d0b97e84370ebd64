"""More published examples in our blocks, beside scipy's solutions and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import integrate, signal

import runtime
from tests.gallery.test_published import FOLDER, recorded

ENGINES = ["python", "compiled"]
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def late_step(system: Any, times: Any, begin: float = 1.0, power: int = 1) -> Any:
    """The response to a step, or to a ramp with ``power`` 2, that begins late."""
    numerator, denominator = system
    later = times[times >= begin - 1e-9] - begin
    ramp = (numerator, [*denominator, 0]) if power == 2 else (numerator, denominator)
    answer = signal.step(ramp, T=later)[1]
    return np.concatenate([np.zeros(len(times) - len(later)), answer])


def test_an_integral_and_a_derivative_of_a_sine() -> None:
    _, out = recorded("integral_and_derivative")
    np.testing.assert_allclose(out[:, 0], out[:, 2], atol=1e-7)
    # The filter's pole is at 100 Hz: 1 % less, 0.6 degrees late, after it has settled.
    w, tau = 2 * math.pi, 1 / (200 * math.pi)
    times, out = recorded("integral_and_derivative")
    expected = w / (1 + (w * tau) ** 2) * (np.cos(w * times) + w * tau * np.sin(w * times))
    np.testing.assert_allclose(out[50:, 1], expected[50:], atol=1e-5)


def test_a_loop_that_is_settled_stays_there() -> None:
    times, out = recorded("settled")
    before = times <= 3.0
    expected = 2 * (1 - np.exp(-0.5 * np.maximum(times - 1.5, 0.0)))
    np.testing.assert_allclose(out[before, 1], expected[before], atol=1e-8)
    np.testing.assert_allclose(out[times > 3.0 + 1e-9, 1], 2.0, atol=1e-9)


def test_a_box_on_a_belt_with_a_smooth_friction() -> None:
    times, out = recorded("stick_slip_smooth", 40.0)

    def rates(t: float, x: Any) -> list[float]:
        slip = x[1] - 3 * math.sin(2 * math.pi * t / 50)
        return [x[1], -(70 * x[0] + 10 * x[1] + 294.3 * math.tanh(1000 * slip)) / 20]

    solved = integrate.solve_ivp(rates, (0, 40), [0, 0], "Radau", times, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(out[:, :2], solved.y.T, atol=2e-3)


def test_a_stiff_oscillator_as_a_part() -> None:
    times, out = recorded("van_der_pol_part", 100.0)

    def rates(t: float, x: Any) -> list[float]:
        return [x[1], 1000 * (1 - x[0] ** 2) * x[1] - x[0]]

    solved = integrate.solve_ivp(rates, (0, 100), [2, 0], "Radau", times, **TIGHT)
    np.testing.assert_allclose(out, solved.y[0], atol=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ball_with_drag_bounces_where_scipy_finds_the_floor(engine: str) -> None:
    times, out = recorded("ball_with_friction", 5.0, engine)

    def rates(t: float, x: Any) -> list[float]:
        return [x[1], -9.81 - 0.2 * abs(x[1]) * x[1]]

    def floor(t: float, x: Any) -> float:
        return float(x[0])

    floor.terminal, floor.direction = True, -1  # type: ignore[attr-defined]
    begin, state, expected = 0.0, [1.0, 5.0], np.empty((len(times), 2))
    while begin < times[-1]:
        piece = integrate.solve_ivp(
            *(rates, (begin, times[-1]), state, "DOP853"), dense_output=True, events=floor, **TIGHT
        )
        inside = (times >= begin) & (times <= piece.t[-1])
        expected[inside] = piece.sol(times[inside]).T
        begin, state = piece.t[-1], [0.0, -0.95 * piece.y[1, -1]]
    # The fifth bounce is at 4.4 s; each multiplies what the one before was off by.
    np.testing.assert_allclose(out, expected, atol=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_two_populations_until_one_rises_through_a_level(engine: str) -> None:
    result = runtime.load(FOLDER / "populations_until.yaml").run(engine=engine)
    times, out = result.time("out"), result["out"]

    def rates(t: float, x: Any) -> list[float]:
        return [x[0] * (1 - 0.1 * x[1]), x[1] * (0.5 * x[0] - 1.2)]

    def rises(t: float, x: Any) -> float:
        return float(x[1] - 4)

    rises.terminal, rises.direction = True, 1  # type: ignore[attr-defined]
    solved = integrate.solve_ivp(
        *(rates, (0, 20), [5, 10], "DOP853"), dense_output=True, events=rises, **TIGHT
    )
    np.testing.assert_allclose(out, solved.sol(times).T, atol=1e-6)
    assert result.manifest["stopped_at"] == pytest.approx(solved.t[-1], abs=1e-6)
    assert solved.t[-1] == pytest.approx(5.20, abs=1e-2)
    assert solved.t[-1] - 0.1 < times[-1] <= solved.t[-1] + 1e-9


@pytest.mark.parametrize(
    ("name", "system", "power"),
    [
        ("feedback_formula", ([5], [2, 6]), 1),
        ("step_integral", ([1], [1, 0]), 1),
        ("ramp_derivative", ([5, 0], [1, 5]), 2),
        ("ramp_second_order", ([25, 0], [1, 7.071, 25]), 2),
    ],
)
def test_a_linear_example_is_its_transfer_function(name: str, system: Any, power: int) -> None:
    times, out = recorded(name)
    np.testing.assert_allclose(out[:, 1], late_step(system, times, power=power), atol=1e-6)


def test_three_structures_are_one_controller() -> None:
    times, out = recorded("pid_structures")
    n = 100.0
    system = ([5 + 2 * n, 5 * n + 3, 3 * n], [1, n, 0])
    np.testing.assert_allclose(out[:, 1], late_step(system, times, power=2), atol=1e-5)
    np.testing.assert_allclose(out[:, 2], out[:, 1], atol=1e-9)
    # In series, the filter of the derivative acts on the integral, too: 1 % of it, while e rises.
    np.testing.assert_allclose(out[:, 3], out[:, 1], rtol=0.011, atol=1e-9)
