"""The gallery: every graph runs, and those with a published model agree with scipy's solution."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import integrate

import runtime
from runtime.cli.shipped import shipped

FOLDER = Path(__file__).parent.parent / "graphs" / "gallery"
LONG = {"spa_question"}  # seconds until it runs
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))
Array = npt.NDArray[np.float64]
Rates = Callable[[float, Any], Sequence[float]]


@dataclass(frozen=True)
class Model:
    """A published model as differential equations, and where a graph shows its states.

    shown : probe to the indices of states that it records.
    breaks : times at which the right side jumps.
    """

    rates: Rates
    initial: Sequence[float]
    shown: dict[str, int | list[int]]
    until: float
    within: float
    breaks: tuple[float, ...] = ()

    def at(self, times: Array) -> Array:
        """The states (n, k) at given times."""
        edges = [0.0, *self.breaks, float(times[-1]) + 1e-9]
        state, rows = np.array(self.initial, float), []
        for first, last in pairwise(edges):
            inside = times[(times >= first - 1e-9) & (times < last - 1e-9)]
            if last == edges[-1]:
                inside = times[times >= first - 1e-9]
            solved = integrate.solve_ivp(
                self.rates,
                (first, last),
                state,
                "DOP853",
                dense_output=True,
                rtol=1e-10,
                atol=1e-12,
            )
            rows.append(solved.sol(np.clip(inside, first, last)).T)
            state = solved.y[:, -1]
        return np.vstack(rows)


def wrapped(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))


def car(v: float, steering: float, theta: float) -> list[float]:
    limit = 0.45 * math.pi
    delta = max(-limit, min(limit, steering))
    return [v * math.cos(theta), v * math.sin(theta), v * math.tan(delta)]


def to_point(t: float, x: Any) -> list[float]:
    dx, dy = 5 - x[0], 5 - x[1]
    return car(0.5 * math.hypot(dx, dy), 4 * wrapped(math.atan2(dy, dx) - x[2]), x[2])


def to_line(t: float, x: Any) -> list[float]:
    distance = (x[0] - 2 * x[1] + 4) / math.sqrt(5)
    return car(0.5, wrapped(math.atan2(-1, -2) - x[2]) - 0.5 * distance, x[2])


def lane_change(t: float, x: Any) -> list[float]:
    return car(1.0, 0.5 if 3 <= t < 4 else (-0.5 if 5 <= t < 6 else 0.0), x[2])


def cart(t: float, x: Any) -> list[float]:
    """Tedrake's form, with the angle from the top, as in bdsim's example."""
    _, v, theta, rate = x
    s, c, m, length, g = math.sin(theta), math.cos(theta), 0.1, 0.5, -9.81
    f = (1.0 if 1.0 <= t < 1.2 else 0.0) - 10.0 * v
    d = 1.0 + m * s * s
    turn = -f * c - m * length * rate**2 * c * s - (1.0 + m) * g * s
    return [v, (f + m * s * (length * rate**2 + g * c)) / d, rate, turn / (length * d)]


def loop(t: float, x: Any) -> list[float]:
    """The states: plant, integral, filtered error."""
    e = (0.0 if t < 10 else (1.0 if t < 50 else 0.5)) - 0.3 * x[0]
    slope = 10.0 * (e - x[2])
    return [3 * e + x[1] + 0.1 * slope, 2 * e, slope]


def motor(t: float, x: Any) -> list[float]:
    """The states: current, speed, integral, filtered error."""
    e = 50.0 - x[1]
    slope = 100.0 * (e - x[3])
    v = 8.0 * e + x[2] + 0.2 * slope
    u = max(-24.0, min(24.0, v))
    current = (u - x[0] - 0.1 * x[1]) / 0.001
    return [current, (0.1 * x[0] - 0.001 * x[1]) / 0.01, 15.0 * e + 10.0 * (u - v), slope]


def duffing(t: float, x: Any) -> list[float]:
    return [x[1], -(0.5 * x[1] + x[0] + 1.4 * x[0] ** 3 + 10 * math.sin(2 * t))]


def step_at(time: float, t: float) -> float:
    return 1.0 if t >= time else 0.0


MODELS = {
    "step_feedback": Model(
        lambda t, x: [(5.0 * (step_at(1, t) - x[0]) - x[0]) / 2],
        [0],
        {"levels": [0]},
        5,
        1e-6,
        (1.0,),
    ),
    "van_der_pol": Model(
        lambda t, x: [x[1], -x[0] + 0.3 * (1 - x[0] ** 2) * x[1]],
        [1, 1],
        {"position": 0, "velocity": 1},
        20,
        1e-5,
    ),
    "bicycle_steering": Model(
        lane_change, [0, 0, 0], {"pose": [0, 1, 2]}, 10, 1e-6, (3.0, 4.0, 5.0, 6.0)
    ),
    "drive_to_point": Model(to_point, [5, 2, 0], {"pose": [0, 1, 2]}, 8, 1e-3),
    "drive_to_line": Model(to_line, [5, 2, 0], {"pose": [0, 1, 2]}, 20, 1e-4),
    "cart_pole_push": Model(cart, [0, 0, 0, 0], {"position": 0, "angle": 2}, 4, 1e-5, (1.0, 1.2)),
    "first_order_feedback": Model(
        lambda t, x: [step_at(3, t) - x[0]], [0], {"levels": [0]}, 9, 1e-6, (3.0,)
    ),
    "harmonic_oscillator": Model(
        lambda t, x: [x[1], -(0.2 * x[1] + 1.5 * x[0]) / 0.8],
        [2, 5],
        {"position": 0, "velocity": 1},
        25,
        1e-5,
    ),
    "pendulum": Model(
        lambda t, x: [x[1], -9.81 * math.sin(x[0])],
        [0.9 * math.pi, 0],
        {"angle": 0, "rate": 1},
        25,
        1e-3,
    ),
    "duffing": Model(duffing, [0, 0], {"position": 0, "velocity": 1}, 10, 1e-3),
    "pid_loop": Model(loop, [0, 0, 0], {"levels": [0]}, 70, 1e-4, (10.0, 50.0)),
    "dc_motor": Model(motor, [0, 0, 0, 0], {"speed": [1]}, 2, 1e-2),
    "volterra_lotka": Model(
        lambda t, x: [x[0] - 0.1 * x[0] * x[1], 0.5 * x[0] * x[1] - 1.2 * x[1]],
        [10, 5],
        {"populations": [0, 1]},
        20,
        1e-3,
    ),
    "roessler": Model(
        lambda t, x: [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - 5.7)],
        [1, 1, 1],
        {"spiral": [0, 1, 2]},
        20,
        1e-4,
    ),
    "brusselator": Model(
        lambda t, x: [0.4 - 2.2 * x[0] + x[0] ** 2 * x[1], 1.2 * x[0] - x[0] ** 2 * x[1]],
        [0, 0],
        {"concentrations": [0, 1]},
        50,
        1e-5,
    ),
    "fitzhugh_nagumo": Model(
        lambda t, x: [x[0] - x[0] ** 3 / 3 - x[1] + 0.5, (x[0] + 0.7 - 0.8 * x[1]) / 12.5],
        [0, 0],
        {"neuron": [0, 1]},
        50,
        1e-5,
    ),
}
# Beside a model's states, these probes record its input first.
AFTER = {"step_feedback": 1, "first_order_feedback": 1, "pid_loop": 1, "dc_motor": 1}
SCALES = {"pid_loop": 0.3}


def test_there_are_twenty_with_a_purpose_each() -> None:
    assert len(NAMES) >= 20
    assert {each.name for each in shipped("gallery")} == set(NAMES)
    assert all(len(each.summary) > 20 for each in shipped("gallery"))
    assert sum("bdsim" in text or "PathSim" in text for text in map(_text, NAMES)) >= 12


def _text(name: str) -> str:
    return (FOLDER / f"{name}.yaml").read_text()


@pytest.mark.parametrize(
    ("name", "ticks"),
    [
        pytest.param(name, ticks, marks=pytest.mark.slow if ticks == 2000 or name in LONG else ())
        for name in NAMES
        if name not in MODELS
        for ticks in (300, 2000)
    ],
)
def test_a_graph_runs(name: str, ticks: int) -> None:
    graph = runtime.load(FOLDER / f"{name}.yaml")
    until = min(2.0, ticks * graph.network.dt, graph.network.until)
    result = graph.set("run.until", until).run(engine="python")
    assert all(np.isfinite(np.asarray(result[probe])).all() for probe in result.probes)


@pytest.mark.parametrize("name", MODELS)
def test_a_published_model_agrees_with_scipy(name: str) -> None:
    model = MODELS[name]
    graph = runtime.load(FOLDER / f"{name}.yaml").set("run.until", float(model.until))
    result = graph.run(engine="python")
    for probe, states in model.shown.items():
        recorded = result.probes[probe]
        found = np.asarray(recorded.values)
        expected = model.at(np.asarray(recorded.t))[:, states] * SCALES.get(name, 1.0)
        if name in AFTER:
            found = found[:, AFTER[name] :]
        scale = max(1.0, np.abs(expected).max())
        assert np.abs(found - expected).max() < model.within * scale, probe


def test_the_held_loop_is_its_difference_equation() -> None:
    """With u held, 2 y' + y = u / 2 has y(t + h) = a y + (1 - a) u / 2, with a = exp(-h / 2)."""
    result = runtime.load(FOLDER / "zero_order_hold.yaml").run(engine="python")
    output = np.asarray(result["levels"])[:, 1]
    a, y, expected = math.exp(-0.05), 0.0, []
    for k in range(50):
        expected.append(y)
        y = a * y + (1 - a) * 0.5 * 10.0 * ((1.0 if k >= 10 else 0.0) - y)
    np.testing.assert_allclose(output[::10], expected, atol=1e-9)


def test_the_thermostat_keeps_its_band_and_its_period() -> None:
    result = runtime.load(FOLDER / "thermostat.yaml").run(engine="python")
    temperature, heat = (np.asarray(result[name]) for name in ("temperature", "heat"))
    late = temperature[500:]
    # It switches between two ticks, so that no tick is beyond the band.
    assert 23.0 <= late.min() < 23.05
    assert 24.95 < late.max() <= 25.0
    # T' = 5 - 0.45 (T - 15) from 23 to 25, and T' = -0.45 (T - 15) back.
    settled = 15 + 5 / 0.45
    period = (math.log((settled - 23) / (settled - 25)) + math.log((25 - 15) / (23 - 15))) / 0.45
    ons = np.flatnonzero(np.diff(heat) > 0)
    np.testing.assert_allclose(np.diff(ons) * 0.01, period, atol=0.05)


def test_the_ball_bounces_when_and_as_high_as_it_should() -> None:
    """Against flights that scipy ends exactly at the ground."""

    def flight(t: float, x: Any) -> list[float]:
        return [x[1], -9.81 - 0.2 * x[1] * abs(x[1])]

    def ground(t: float, x: Any) -> float:
        return float(x[0])

    ground.terminal, ground.direction = True, -1  # type: ignore[attr-defined]
    result = runtime.load(FOLDER / "bouncing_ball.yaml").set("run.until", 4.0).run(engine="python")
    found = result.probes["height"]
    times, start, state, expected = np.asarray(found.t), 0.0, [1.0, 5.0], []
    while start < 4.0:
        solved = integrate.solve_ivp(
            flight, (start, 4.0), state, events=ground, dense_output=True, rtol=1e-9, atol=1e-9
        )
        end = float(solved.t[-1])
        inside = times[(times >= start) & (times < end)]
        expected += solved.sol(inside)[0].tolist()
        start, state = end, [0.0, -0.95 * float(solved.y[1, -1])]
    np.testing.assert_allclose(np.asarray(found.values)[: len(expected)], expected, atol=1e-6)


def test_the_filter_finds_the_robot() -> None:
    """It begins 0.57 m off; one distance alone has a standard deviation of 0.1 m."""
    error = runtime.load(FOLDER / "beacons.yaml").run(engine="python")["error"]
    assert error[200:].mean() < 0.05
    assert error[200:].max() < 0.15
