"""Transfer functions, PID and differential equations against closed forms and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import integrate, signal

import runtime
from tests.blocks.responses import problems

T = 0.01 * np.arange(400)


def run(blocks: dict[str, Any], wires: dict[str, Any], of: str, **options: Any) -> Any:
    graph = {
        "run": {"dt": 0.01, "until": 4.0, "engine": "python", **options},
        "blocks": blocks,
        "wires": wires,
        "probes": {"y": of},
    }
    return np.asarray(runtime.load(graph).run()["y"])


def step_response(entry: dict[str, Any]) -> Any:
    made = {"u": {"type": "Step"}, "it": entry}
    return run(made, {"it": {"input": "u.out"}}, "it.out")


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [([2], [1, 3]), ([1, 3], [1, 2, 5]), ([2, 1, 4], [4, 1, 8]), ([5], [2, 3, 4, 1])],
)
def test_a_step_response_is_scipys(numerator: list[float], denominator: list[float]) -> None:
    entry = {"type": "TransferFunction", "numerator": numerator, "denominator": denominator}
    _, expected = signal.step((numerator, denominator), T=T)
    np.testing.assert_allclose(step_response(entry), expected, atol=1e-7)


def test_a_gain_is_a_transfer_function_without_states() -> None:
    entry = {"type": "TransferFunction", "numerator": [6], "denominator": [2]}
    np.testing.assert_array_equal(step_response(entry), np.full(400, 3.0))


def test_zeros_and_poles_are_scipys() -> None:
    entry = {
        "type": "ZeroPoleGain",
        "zeros": [-2],
        "poles": [-1],
        "complex_poles": [[-0.5, 3]],
        "gain": 4,
    }
    _, expected = signal.step(([-2], [-1, -0.5 + 3j, -0.5 - 3j], 4), T=T)
    np.testing.assert_allclose(step_response(entry), expected, atol=1e-6)


def test_a_second_order_system_rings_as_its_closed_form() -> None:
    w, d = 4.0, 0.3
    entry = {"type": "SecondOrder", "natural_frequency": w, "damping": d, "gain": 2}
    damped = w * np.sqrt(1 - d * d)
    ring = np.cos(damped * T) + d / np.sqrt(1 - d * d) * np.sin(damped * T)
    expected = 2 * (1 - np.exp(-d * w * T) * ring)
    np.testing.assert_allclose(step_response(entry), expected, atol=1e-6)


def test_a_filtered_derivative_of_a_sine() -> None:
    made = {"u": {"type": "Sine", "frequency": 0.5}, "it": {"type": "Derivative", "tau": 0.05}}
    found = run(made, {"it": {"input": "u.out"}}, "it.out")
    # x' = (sin(w t) - x) / tau from x(0) = 0, and the output x'.
    w, tau = np.pi, 0.05
    share = w / (1 + (w * tau) ** 2)
    expected = share * (np.cos(w * T) + w * tau * np.sin(w * T) - np.exp(-T / tau))
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_derivative_that_starts_with_its_first_input_has_no_jump(engine: str) -> None:
    made = {
        "u": {"type": "Function", "expression": ["3 + 2 * t", "3 - 2 * t"]},
        "it": {"type": "Derivative", "tau": 0.05, "initial": "first"},
    }
    found = run(
        made, {"it": {"input": "u.out"}}, "it.out", engine=engine, solver="dopri5", rtol=1e-9
    )
    # Of a ramp the filtered slope is 2 (1 - exp(-t/tau)); from x(0) = 0 it would begin at 60.
    slope = 2.0 * (1.0 - np.exp(-T / 0.05))
    np.testing.assert_allclose(found, np.outer(slope, [1.0, -1.0]), atol=1e-6)


def test_a_pid_loop_is_its_transfer_function() -> None:
    """A first-order plant under PID, against the closed loop's rational function."""
    kp, ki, kd, n = 2.0, 3.0, 0.2, 20.0
    made = {
        "r": {"type": "Step"},
        "e": {"type": "Sum", "signs": [1, -1]},
        "pid": {"type": "PID", "kp": kp, "ki": ki, "kd": kd, "n": n},
        "plant": {"type": "TransferFunction", "numerator": [1], "denominator": [0.5, 1]},
    }
    wires = {
        "e": {"terms": ["r.out", "plant.out"]},
        "pid": {"error": "e.out"},
        "plant": {"input": "pid.out"},
    }
    # PID = ((kp + kd n) s^2 + (kp n + ki) s + ki n) / (s (s + n)).
    c, d = [kp + kd * n, kp * n + ki, ki * n], [1.0, n, 0.0]
    closed = (c, np.polyadd(np.polymul(d, [0.5, 1.0]), c))
    _, expected = signal.step(closed, T=T)
    np.testing.assert_allclose(run(made, wires, "plant.out"), expected, atol=3e-5)


def test_back_calculation_leaves_the_limit_soon() -> None:
    """An integral of unit gain on a large error: at the limit, v stays near it."""
    made = {
        "e": {"type": "Piecewise", "times": [0, 2, 4], "values": [10, -1, -1]},
        "free": {"type": "PID", "kp": 1, "ki": 1, "upper": 1, "lower": -1, "tracking": 0},
        "pid": {"type": "PID", "kp": 1, "ki": 1, "upper": 1, "lower": -1, "tracking": 10},
    }
    wires = {name: {"error": "e.out"} for name in ("free", "pid")}
    wound, found = (run(made, wires, f"{name}.out") for name in ("free", "pid"))
    assert (found[T < 2] == 1.0).all()
    assert (found[T > 2.2] == -1.0).all()
    assert (wound[T > 2] == 1.0).all()


def test_equations_are_solved_as_scipy_solves_them() -> None:
    """Van der Pol with a forcing input."""
    entry = {
        "type": "DynamicSystem",
        "states": ["x", "v"],
        "derivative": ["v", "mu*(1 - x**2)*v - x + u[0]"],
        "constants": {"mu": 1.5},
        "initial": [1, 0],
    }
    made = {"u": {"type": "Sine", "frequency": 0.4}, "it": entry}
    expected = integrate.solve_ivp(
        lambda t, y: [y[1], 1.5 * (1 - y[0] ** 2) * y[1] - y[0] + np.sin(0.8 * np.pi * t)],
        (0, 4),
        [1, 0],
        t_eval=T,
        rtol=1e-10,
        atol=1e-12,
    ).y.T
    np.testing.assert_allclose(run(made, {"it": {"u": "u.out"}}, "it.out"), expected, atol=1e-6)


def test_an_event_bounces_a_ball() -> None:
    """Energy falls by the square of the coefficient of restitution at each bounce."""
    entry = {
        "type": "DynamicSystem",
        "states": ["h", "v"],
        "derivative": ["v", "-9.81"],
        "initial": [1, 0],
        "when": "h < 0 and v < 0",
        "then": ["0", "-0.8*v"],
    }
    y = run({"it": entry}, {}, "it.out", dt=0.001, until=1.1)
    assert y[:, 0].min() > -0.006
    energy = 9.81 * y[:, 0] + 0.5 * y[:, 1] ** 2
    assert energy[-1] == pytest.approx(0.64 * 9.81, rel=0.01)


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"type": "TransferFunction", "numerator": [1, 2, 3], "denominator": [1, 2]}, "improper"),
        ({"type": "TransferFunction", "numerator": [1], "denominator": [0, 0]}, "other than 0"),
        ({"type": "ZeroPoleGain", "zeros": [1, 2], "poles": [1]}, "improper"),
        ({"type": "SecondOrder", "natural_frequency": 0}, "above 0 rad/s"),
        ({"type": "Derivative", "tau": 0}, "above 0 s"),
    ],
)
def test_a_wrong_system_is_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems(entry, ["Scalar"])


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"derivative": "-y", "initial": 1}, "column 2 of '-y': unknown name 'y'"),
        ({"derivative": ["1", "2"], "initial": 1}, "expected 2 number(s), one per state, got 1"),
        ({"derivative": "-x[0]", "initial": 1, "when": "1"}, "missing; an event has"),
        (
            {"derivative": "-x[0]", "initial": 1, "states": ["sin"]},
            "'sin' is a function in every expression",
        ),
        ({"derivative": "u[3]", "initial": 1}, "'u' has 1 component"),
    ],
)
def test_wrong_equations_are_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems({"type": "DynamicSystem", **entry}, ["Scalar"], "u")


def test_the_old_name_of_the_path_following_controller_is_explained() -> None:
    message = problems({"type": "PID", "lookahead_time": 1.0}, ["Scalar"], "reference")
    assert "the block with this parameter is a PathPID" in message
    assert "the block with this input is a PathPID" in message


@pytest.mark.parametrize(
    ("band", "cutoff"),
    [("lowpass", 1.5), ("highpass", 1.5), ("bandpass", [1.0, 3.0]), ("bandstop", [1.0, 3.0])],
)
def test_a_butterworth_filter_is_scipys(band: str, cutoff: Any) -> None:
    entry = {"type": "Butterworth", "order": 3, "cutoff": cutoff, "band": band}
    expected = signal.step(signal.butter(3, 2 * np.pi * np.array(cutoff), band, analog=True), T=T)
    np.testing.assert_allclose(step_response(entry), expected[1], atol=1e-4)


def test_difference_equations_are_a_loop_in_python() -> None:
    entry = {
        "type": "DiscreteSystem",
        "states": ["n", "v"],
        "next": ["n + 1 if u[0] > 0.5 else n", "a*v + n - u[1]"],
        "output": ["n", "v + u[1]"],
        "initial": [0, 1],
        "constants": {"a": 0.9},
    }
    made = {
        "a": {"type": "Sine", "frequency": 3.0},
        "b": {"type": "Function", "expression": "cos(5*t)"},
        "it": entry,
    }
    found = run(made, {"it": {"u": ["a.out", "b.out"]}}, "it.out")
    n, v, expected = 0.0, 1.0, []
    for t in T:
        u0, u1 = np.sin(6 * np.pi * t), np.cos(5 * t)
        expected.append([n, v + u1])
        n, v = (n + 1 if u0 > 0.5 else n), 0.9 * v + n - u1
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ({"type": "Butterworth", "cutoff": [1, 2]}, "expected 1 frequencies for a lowpass, got 2"),
        ({"type": "Butterworth", "cutoff": [2, 1], "band": "bandpass"}, "ascending order"),
        ({"type": "DiscreteSystem", "next": ["x[0]", "0"], "initial": 0}, "expected 2 number(s)"),
        ({"type": "DiscreteSystem", "next": "y", "initial": 0}, "unknown name 'y'"),
        (
            {"type": "AlgebraicConstraint", "expression": "z", "low": 1, "high": 0},
            "expected more than low = 1, got 0",
        ),
        (
            {"type": "AlgebraicConstraint", "expression": "y - 1", "low": 0, "high": 2},
            "column 1 of 'y - 1': unknown name 'y'",
        ),
    ],
)
def test_wrong_parameters_are_refused(entry: dict[str, Any], part: str) -> None:
    assert part in problems(entry)


def test_a_constraint_without_a_solution_says_so() -> None:
    entry = {"type": "AlgebraicConstraint", "expression": "z*z + 1", "low": -1, "high": 1}
    with pytest.raises(runtime.SimulationError, match=r"same sign at low = -1 and at high = 1"):
        run({"it": entry}, {}, "it.out")
