"""The extended Kalman filter against a textbook's, written with numpy and slopes by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from runtime import check_block
from tests.blocks.responses import problems, respond

# A robot with the controls v and omega, which measures range and bearing of a beacon at (3, 1), and
# the range of another one at (-1, -2).
DT, Q, R = 0.1, np.diag([1e-4, 1e-4, 4e-4]), np.diag([0.01, 0.0025, 0.01])
ROBOT: dict[str, Any] = {
    "type": "ExtendedKalmanFilter",
    "states": ["x0", "x1", "theta"],
    "transition": ["x0 + h*u[0]*cos(theta)", "x1 + h*u[0]*sin(theta)", "theta + h*u[1]"],
    "observation": [
        "sqrt((3 - x0)**2 + (1 - x1)**2)",
        "atan2(1 - x1, 3 - x0) - theta",
        "sqrt((1 + x0)**2 + (2 + x1)**2)",
    ],
    "constants": {"h": DT},
    "Q": Q.tolist(),
    "R": R.tolist(),
    "x0": [0.2, -0.1, 0.3],
    "P0": [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.2]],
    "angles": [1],
}


def moved(x: Any, u: Any) -> Any:
    return x + DT * np.array([u[0] * math.cos(x[2]), u[0] * math.sin(x[2]), u[1]])


def moved_slope(x: Any, u: Any) -> Any:
    slope = np.eye(3)
    slope[0, 2], slope[1, 2] = -DT * u[0] * math.sin(x[2]), DT * u[0] * math.cos(x[2])
    return slope


def seen(x: Any) -> Any:
    dx, dy = 3 - x[0], 1 - x[1]
    other = math.hypot(1 + x[0], 2 + x[1])
    return np.array([math.hypot(dx, dy), math.atan2(dy, dx) - x[2], other])


def seen_slope(x: Any) -> Any:
    dx, dy = 3 - x[0], 1 - x[1]
    r = math.hypot(dx, dy)
    ex, ey = 1 + x[0], 2 + x[1]
    other = math.hypot(ex, ey)
    near, bearing = [-dx / r, -dy / r, 0.0], [dy / r**2, -dx / r**2, -1.0]
    return np.array([near, bearing, [ex / other, ey / other, 0.0]])


def textbook(measurements: Any, controls: Any) -> Any:
    x, p, rows = np.array(ROBOT["x0"]), np.array(ROBOT["P0"]), []
    for y, u in zip(measurements, controls, strict=True):
        h = seen_slope(x)
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + R)
        error = y - seen(x)
        error[1] = (error[1] + math.pi) % (2 * math.pi) - math.pi
        x, p = x + gain @ error, (np.eye(3) - gain @ h) @ p
        rows.append(x)
        f = moved_slope(x, u)
        x, p = moved(x, u), f @ p @ f.T + Q
    return np.array(rows)


def drive(ticks: int = 300) -> tuple[Any, Any, Any]:
    """Controls, true poses and noisy measurements of a robot that circles the beacon."""
    draw = np.random.default_rng(5)
    controls = np.column_stack([np.full(ticks, 0.8), 0.25 + 0.1 * np.sin(np.arange(ticks) / 20)])
    x, poses, measurements = np.zeros(3), [], []
    for u in controls:
        poses.append(x)
        noisy = seen(x) + draw.multivariate_normal(np.zeros(3), R)
        noisy[1] = (noisy[1] + math.pi) % (2 * math.pi) - math.pi
        measurements.append(noisy)
        x = moved(x, u) + draw.multivariate_normal(np.zeros(3), Q)
    return controls, np.array(poses), np.array(measurements)


def test_a_robot_is_where_the_textbook_says() -> None:
    controls, poses, measurements = drive()
    inputs = {"measurement": measurements, "u": [controls]}
    found = respond(ROBOT, inputs, dt=DT, of="estimate")
    np.testing.assert_allclose(found, textbook(measurements, controls), atol=1e-6)
    # The errors shrink from those of the start to some times the noise.
    late = found[100:, :2] - poses[100:, :2]
    assert np.sqrt((late**2).mean()) < 0.1 < np.linalg.norm(found[0, :2] - poses[0, :2])


def test_of_a_linear_system_it_is_the_kalman_filter() -> None:
    draw = np.random.default_rng(2)
    y, u = draw.standard_normal((2, 100))
    shared = {"Q": [[1e-4, 0], [0, 1e-3]], "R": 0.04, "x0": [1, -1]}
    linear = {"type": "KalmanFilter", "A": [[1, 0.1], [0, 1]], "B": [0.005, 0.1], "C": [1, 0]}
    extended = {
        "type": "ExtendedKalmanFilter",
        "transition": ["x[0] + 0.1*x[1] + 0.005*u[0]", "x[1] + 0.1*u[0]"],
        "observation": "x[0]",
    }
    first = respond({**linear, **shared}, {"measurement": y, "control": u}, of="estimate")
    second = respond({**extended, **shared}, {"measurement": y, "u": [u]}, of="estimate")
    np.testing.assert_allclose(second, first, atol=1e-8)


class Beacon(blocks.ExtendedKalmanFilter):
    """The robot's filter with methods in place of expressions, and slopes by hand.

    measurement, u ─▶ [ Beacon ] ─▶ estimate
    """

    def transition(self, state: Any, t: float, x: Any, u: Any) -> Any:
        out = np.empty(3)
        out[0] = x[0] + DT * u[0] * math.cos(x[2])
        out[1] = x[1] + DT * u[0] * math.sin(x[2])
        out[2] = x[2] + DT * u[1]
        return out

    def observation(self, state: Any, t: float, x: Any) -> Any:
        out = np.empty(3)
        out[0] = math.sqrt((3.0 - x[0]) ** 2 + (1.0 - x[1]) ** 2)
        out[1] = math.atan2(1.0 - x[1], 3.0 - x[0]) - x[2]
        out[2] = math.sqrt((1.0 + x[0]) ** 2 + (2.0 + x[1]) ** 2)
        return out

    def transition_jacobian(self, state: Any, t: float, x: Any, u: Any) -> Any:
        return moved_slope(x, u)


def test_a_subclass_gives_functions_and_slopes(tmp_path: Path) -> None:
    controls, _, measurements = drive()
    given = {name: ROBOT[name] for name in ("Q", "R", "x0", "P0", "angles")}
    times = DT * np.arange(300)
    graph = runtime.load(
        {
            "run": {"dt": DT, "until": 30.0},
            "blocks": {
                name: {
                    "type": "Piecewise",
                    "times": times.tolist(),
                    "values": rows.tolist(),
                }
                for name, rows in (("y", measurements), ("u", controls))
            },
        }
    )
    graph = graph.add("filter", Beacon(**given))
    graph = graph.wire("filter.measurement", "y.out").wire("filter.u", ["u.out"])
    found = graph.probe("estimate", "filter.estimate").run()["estimate"]
    np.testing.assert_allclose(found, textbook(measurements, controls), atol=1e-6)


def test_it_keeps_the_rules_for_blocks() -> None:
    entry = {name: value for name, value in ROBOT.items() if name != "type"}
    linear = {**entry, "transition": ["0.9*x0", "0.9*x1", "0.9*theta"]}
    check_block(blocks.ExtendedKalmanFilter(**linear))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"transition": ["x0", "x1"]}, "expected 3 expression(s), one per state (x0), got 2"),
        ({"transition": None}, "missing; expected 3 expression(s)"),
        ({"observation": ["x0"]}, "expected 3 expression(s), one per measurement (R), got 1"),
        ({"observation": ["x0", "x1", "u[0]"]}, "a measurement cannot depend on u"),
        (
            {"observation": ["x0", "x1", "tehta"]},
            "column 1 of 'tehta': unknown name 'tehta', did you",
        ),
        ({"Q": [[1]]}, "expected 3 x 3 numbers"),
        ({"R": [[1, 0]]}, "numbers, got"),
        ({"angles": [3]}, "expected numbers from 0 to 2, got 3"),
        ({"states": ["a", "a", "b"]}, "given twice"),
        ({"transition": ["x0", "x1 + u[3]", "theta"]}, "nothing is wired to it"),
    ],
)
def test_mistakes_are_refused(change: dict[str, Any], part: str) -> None:
    assert part in problems({**ROBOT, **change}, ["Vector"], "measurement")
