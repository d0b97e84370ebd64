"""Closed loops over separate blocks converge at the order of the solver."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime
from blocks import Block, FloatArray, Input, Output, Pose, Scalar, State, param
from runtime.graph import Graph

ORDERS = {"euler": 1, "heun": 2, "rk4": 4}
UNTIL = 4.0
MU = 1.5


class Bicycle(Block):
    """The kinematic bicycle at constant speed (Corke, Robotics, Vision and Control, section 4.1).

    steer ─▶ [ Bicycle ] ─▶ pose
    """

    steer = Input(Scalar, unit="rad", doc="steering angle")
    pose = Output(Pose, doc="of the rear axle")

    length: float = param(1.0, unit="m", above=0.0, doc="between the axles")
    x0: FloatArray = param((5.0, 2.0, 1.0), shape=(3,), doc="initial pose")

    q = State(3, continuous=True)

    def start(self, state: Any) -> None:
        state.q[:] = self.x0

    def output(self, state: Any, t: float) -> tuple[float, float, float]:
        x, y, theta = state.q.tolist()
        return x, y, theta

    def derivative(self, state: Any, t: float, steer: float) -> tuple[float, float, float]:
        theta = state.q[2]
        return math.cos(theta), math.sin(theta), math.tan(steer) / self.length


def van_der_pol() -> Graph:
    """x'' = mu (1 - x^2) x' - x through a Function and two Integrators."""
    bend = {"type": "Function", "names": ["x", "v"], "constants": {"mu": MU}}
    return runtime.load(
        {
            "blocks": {
                "bend": {**bend, "expression": "mu*(1 - x*x)*v - x"},
                "x": {"type": "Integrator", "initial": 2.0},
                "v": {"type": "Integrator"},
            },
            "wires": {
                "bend": {"u": ["x.out", "v.out"]},
                "x": {"input": "v.out"},
                "v": {"input": "bend.out"},
            },
            "probes": {"x": "x.out"},
        }
    )


def controlled() -> Graph:
    """A PID law over separate blocks around y'' + y' + y = u, with a reference of 1."""
    plant = {"type": "StateSpace", "A": [[0, 1], [-1, -1]], "B": [0, 1], "C": [[1, 0], [0, 1]]}
    terms = {"names": ["integral", "y", "v"], "expression": "3*(1 - y) + 2*integral - v"}
    return runtime.load(
        {
            "blocks": {
                "plant": plant,
                "error": {"type": "Function", "names": ["y", "v"], "expression": "1 - y"},
                "integral": {"type": "Integrator"},
                "control": {"type": "Function", **terms},
            },
            "wires": {
                "error": {"u": ["plant.out"]},
                "integral": {"input": "error.out"},
                "control": {"u": ["integral.out", "plant.out"]},
                "plant": {"input": "control.out"},
            },
            "probes": {"x": "plant.out"},
        }
    )


def driven() -> Graph:
    """A bicycle that steers towards the origin with half the error of its heading."""
    names = {"names": ["x", "y", "theta"]}
    graph = runtime.load(
        {
            "blocks": {
                "steer": {
                    "type": "Function",
                    **names,
                    "expression": "0.5*wrap(atan2(-y, -x) - theta)",
                }
            },
            "probes": {"x": "bicycle.pose"},
        }
    )
    graph = graph.add("bicycle", Bicycle())
    return graph.wire("steer.u", ["bicycle.pose"]).wire("bicycle.steer", "steer.out")


def swing(t: float, x: Any) -> list[float]:
    return [x[1], MU * (1.0 - x[0] ** 2) * x[1] - x[0]]


def closed(t: float, x: Any) -> list[float]:
    y, v, integral = x
    return [v, 3.0 * (1.0 - y) + 2.0 * integral - v - v - y, 1.0 - y]


def ride(t: float, q: Any) -> list[float]:
    x, y, theta = q
    steer = 0.5 * math.remainder(math.atan2(-y, -x) - theta, 2.0 * math.pi)
    return [math.cos(theta), math.sin(theta), math.tan(steer)]


LOOPS: dict[str, tuple[Callable[[], Graph], Callable[..., list[float]], list[float], int]] = {
    "van der Pol": (van_der_pol, swing, [2.0, 0.0], 1),
    "PID": (controlled, closed, [0.0, 0.0, 0.0], 2),
    "bicycle": (driven, ride, [5.0, 2.0, 1.0], 3),
}


def recorded(graph: Graph, dt: float, **run: Any) -> np.ndarray:
    """The probe x, with a column per component."""
    graph = graph.overlay({"run": {"dt": dt, "until": UNTIL, "engine": "python", **run}})
    rows = np.asarray(graph.run()["x"])
    return rows.reshape(len(rows), -1)


def exact(loop: str, dt: float) -> np.ndarray:
    _, rates, start, columns = LOOPS[loop]
    t = dt * np.arange(round(UNTIL / dt))
    made = solve_ivp(rates, (0.0, UNTIL), start, "DOP853", t, rtol=1e-13, atol=1e-13)
    return np.asarray(made.y.T[:, :columns])


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize(("solver", "expected"), ORDERS.items())
def test_the_error_shrinks_at_the_order_of_the_solver(
    loop: str, solver: str, expected: int
) -> None:
    steps = {"euler": (0.0025, 0.00125), "heun": (0.01, 0.005), "rk4": (0.02, 0.01)}[solver]
    errors = [
        abs(recorded(LOOPS[loop][0](), dt, solver=solver) - exact(loop, dt)).max() for dt in steps
    ]
    assert abs(math.log2(errors[0] / errors[1]) - expected) < 0.2, errors


@pytest.mark.parametrize("loop", LOOPS)
def test_dopri5_is_as_accurate_as_scipys_solver_of_that_order(loop: str) -> None:
    _, rates, start, columns = LOOPS[loop]
    options = {"solver": "dopri5", "rtol": 1e-8, "atol": 1e-10}
    found = recorded(LOOPS[loop][0](), 0.25, **options)
    t = 0.25 * np.arange(len(found))
    peer = solve_ivp(rates, (0.0, UNTIL), start, "RK45", t, rtol=1e-8, atol=1e-10)
    error = abs(found - exact(loop, 0.25)).max()
    assert error < max(1e-8, 2.0 * abs(peer.y.T[:, :columns] - exact(loop, 0.25)).max())


def forced(t: float, x: Any) -> list[float]:
    return [x[1], MU * (1.0 - x[0] ** 2) * x[1] - x[0] + math.sin(3.0 * t)]


def driven_oscillator() -> Graph:
    """Van der Pol's equation with a force: its right side depends on the time."""
    graph = van_der_pol()
    force = "mu*(1 - x*x)*v - x + sin(3*t)"
    return graph.set("blocks.bend.expression", force).set("probes.x", ["x.out", "v.out"])


def against(rates: Any, start: list[float], found: np.ndarray, dt: float) -> float:
    t = dt * np.arange(len(found))
    made = solve_ivp(rates, (0.0, t[-1]), start, "Radau", t, rtol=1e-12, atol=1e-13)
    return float(abs(found - made.y.T).max())


@pytest.mark.slow
def test_rodas4_is_of_order_4() -> None:
    errors = []
    for step in (0.025, 0.0125):
        loose = {"solver": "rodas4", "rtol": 10.0, "atol": 10.0, "max_step": step}
        found = recorded(driven_oscillator(), 0.1, **loose)
        errors.append(against(forced, [2.0, 0.0], found, 0.1))
    assert abs(math.log2(errors[0] / errors[1]) - 4.0) < 0.2, errors


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.slow
def test_rodas4_meets_its_tolerance_on_a_stiff_system(engine: str) -> None:
    """Rates of 1 and 1e6 per second, and a slow input: an explicit method needs 1e6 steps."""
    matrix = [[-1e6, 1e6 - 2.0], [0.0, -1.0]]
    graph = runtime.load(
        {
            "blocks": {
                "input": {"type": "Function", "expression": "cos(t)"},
                "plant": {"type": "StateSpace", "A": matrix, "B": [0, 1], "C": [[1, 0], [0, 1]]},
            },
            "wires": {"plant": {"input": "input.out"}},
            "probes": {"x": "plant.out"},
        }
    )
    found = recorded(graph, 0.1, solver="rodas4", rtol=1e-8, atol=1e-10, engine=engine)

    def rates(t: float, x: Any) -> Any:
        return np.array(matrix) @ x + [0.0, math.cos(t)]

    assert against(rates, [0.0, 0.0], found, 0.1) < 1e-7
