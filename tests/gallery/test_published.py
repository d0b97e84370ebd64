"""Published examples of PathSim and bdsim in our blocks: all run, many agree with scipy."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate, optimize, signal, special

import runtime

FOLDER = Path(__file__).parents[2] / "graphs" / "gallery" / "published"
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))


def recorded(name: str, until: float | None = None) -> tuple[Any, Any]:
    graph = runtime.load(FOLDER / f"{name}.yaml")
    result = (graph if until is None else graph.set("run.until", until)).run(engine="python")
    return result.time("out"), result["out"]


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_and_says_where_it_comes_from(name: str) -> None:
    graph = runtime.load(FOLDER / f"{name}.yaml")
    result = graph.set("run.until", 40 * graph.network.dt).run(engine="python")
    assert result.manifest["status"] == "complete"
    text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    assert re.search(r"^# After \S+\.py of (PathSim|bdsim)[.:,;]", text, re.MULTILINE)


@dataclass(frozen=True)
class Model:
    """Differential equations; ``shown`` picks the states that a graph records."""

    rates: Callable[[float, Any], Sequence[float]]
    initial: Sequence[float]
    until: float
    within: float = 1e-5
    method: str = "DOP853"
    shown: tuple[int, ...] | None = None


def reactor(t: float, x: Any) -> list[float]:
    a, b, temperature = x
    feed, warm = 2 + math.sin(0.5 * t), 280 * (1 - 0.8 * math.exp(-0.6 * t))
    first = 1e4 * math.exp(-5e4 / (8.314 * temperature)) * a
    second = 1e3 * math.exp(-5.5e4 / (8.314 * temperature)) * b
    heat = (5e4 * first + 5.2e4 * second) / 4184 - 1e3 * 0.1 / 0.1 / 4184 * (temperature - 280)
    return [feed - a - first, -b + first - second, warm - temperature + heat]


def lorenz(t: float, x: Any) -> list[float]:
    return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]


def robertson(t: float, x: Any) -> list[float]:
    slow, fast = 0.04 * x[0] - 1e4 * x[1] * x[2], 3e7 * x[1] ** 2
    return [-slow, slow - fast, fast]


def respiration(t: float, x: Any) -> list[float]:
    used = x[0] * x[1] / (1 + 6.5 * x[0] ** 2)
    return [3 - x[0] - used, 2 - used]


def glycolysis(t: float, x: Any) -> list[float]:
    made = 0.08 * x[1] + x[0] ** 2 * x[1]
    return [made - x[0], 0.6 - made]


def iodine(t: float, x: Any) -> list[float]:
    share = x[1] / (1 + x[0] ** 2)
    return [10 - x[0] - 4 * x[0] * share, x[0] * (1 - share)]


def morse(t: float, x: Any) -> list[float]:
    spring = 8 * (1 - math.exp(-x[0])) * math.exp(-x[0])
    return [x[1], 2.5 * math.cos(4.171 * t) - 0.8 * x[1] - spring]


LOOP_FILTER = signal.butter(2, 4 * math.pi, analog=True)[1].tolist()


def locked(t: float, x: Any) -> list[float]:
    _, a1, a2 = LOOP_FILTER
    mixed = 0.3 * math.sin(20 * math.pi * t) * math.sin(x[3])
    turning = 2 * math.pi * (9.5 + 2 * x[2])
    return [mixed - a1 * x[0] - a2 * x[1], x[0], a2 * x[1], turning]


def to_pose(t: float, x: Any) -> list[float]:
    dx, dy = 5 - x[0], 5 - x[1]
    rho, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
    alpha = max(-math.pi / 2, min(math.pi / 2, bearing - x[2]))
    steer = math.atan((5 * alpha - 2 * (math.pi / 2 - bearing)) / max(rho, 1e-6))
    steer = max(-0.45 * math.pi, min(0.45 * math.pi, steer))
    return [rho * math.cos(x[2]), rho * math.sin(x[2]), rho * math.tan(steer)]


MODELS = {
    "glycolysis": Model(glycolysis, [0, 0], 40.0),
    "chlorine_dioxide": Model(iodine, [0, 0], 20.0),
    "bacterial_respiration": Model(respiration, [0, 0], 40.0),
    "thomas": Model(
        lambda t, x: [math.sin(x[(i + 1) % 3]) - 0.2 * x[i] for i in range(3)], [1, 1, -3], 30.0
    ),
    "morse": Model(morse, [2, 3], 10.0),
    "flame": Model(lambda t, x: [x[0] ** 2 - x[0] ** 3], [0.001], 1200.0, 1e-3, "Radau"),
    "robertson": Model(robertson, [1, 0, 0], 1.0, method="Radau"),
    "reactor": Model(reactor, [1, 0, 300], 10.0),
    "lorenz": Model(lorenz, [1, 1, 1], 5.0, 1e-4),
    "phase_locked_loop": Model(locked, [0, 0, 0, 0], 5.0, 1e-4, shown=(2,)),
    "drive_to_pose": Model(to_pose, [5, 2, 0], 5.0, 1e-3),
}


@pytest.mark.parametrize("name", MODELS)
def test_it_agrees_with_scipy(name: str) -> None:
    model = MODELS[name]
    times, out = recorded(name, model.until)
    span, tolerances = (0, model.until), {"rtol": 1e-9, "atol": 1e-11}
    solved = integrate.solve_ivp(
        model.rates, span, model.initial, model.method, t_eval=times, **tolerances
    )
    expected = solved.y[slice(None) if model.shown is None else list(model.shown)].T
    found = out.reshape(len(times), -1)[:, : expected.shape[1]]
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-9)
    assert (np.abs(found - expected).max(axis=0) / scale).max() < model.within


CLOSED = {
    "antenna": (([10, 1], [10, 11, 11, 1]), 1.0, 1),
    "pi_controller": (([5, 1.5], [2, 6, 1.5]), 1.0, 1),
    "transfer_function": (None, 5.0, 0),
    "continuous_and_discrete": (([1], [1, 2, 4]), 0.0, 0),
}


@pytest.mark.parametrize("name", CLOSED)
def test_a_step_response_is_that_of_the_closed_loop(name: str) -> None:
    system, begin, column = CLOSED[name]
    times, out = recorded(name, 10.0 if name == "transfer_function" else None)
    out = out.reshape(len(times), -1)
    if system is None:
        poles = [-0.3, -0.05 + 0.4j, -0.05 - 0.4j, -0.1 + 2j, -0.1 - 2j]
        late = np.maximum(times - begin, 0.0)
        terms = zip([-0.2, -0.2j, 0.2j, 0.3, 0.3], poles, strict=True)
        expected = sum(r / p * (np.exp(p * late) - 1) for r, p in terms).real
    else:
        moment = times[times >= begin - 1e-9] - begin
        answer = signal.step(system, T=moment)[1]
        expected = np.concatenate([np.zeros(len(times) - len(moment)), answer])
    np.testing.assert_allclose(out[:, column], expected, atol=1e-5)
    if name == "continuous_and_discrete":
        np.testing.assert_allclose(out[:, 1], expected, atol=1e-9)


def test_the_diode_has_the_voltage_of_lamberts_function() -> None:
    times, out = recorded("diode", 0.4)
    source, r, i0, vt = 5 * np.sin(2 * np.pi * times), 1000.0, 1e-12, 0.026
    # The clipped exponent is not reached: 23 vt = 0.598 V.
    inner = r * i0 / vt * np.exp((source + r * i0) / vt)
    expected = source + r * i0 - vt * special.lambertw(inner).real
    np.testing.assert_allclose(out[:, 0], expected, atol=1e-9)


def test_the_algebraic_loop_is_solved() -> None:
    times, out = recorded("algebraic_loop")
    np.testing.assert_allclose(out, 2 * np.cos(times) / 1.2, atol=1e-12)


def test_converters_follow_their_input() -> None:
    times, out = recorded("sar_converter")
    held, converted = out[:, 0], out[:, 1]
    # The result of a conversion appears when the next one begins.
    later = converted[16::8]
    np.testing.assert_array_less(np.abs(later - held[8:-8:8]), 2 / 256 + 1e-9)
    times, out = recorded("delta_sigma")
    assert set(np.unique(out[300:, 1] * 20).round(6)) <= set(range(-20, 21, 2))
    lag = optimize.minimize_scalar(
        lambda d: float(np.mean((out[300:, 1] - np.sin(2 * np.pi * (times[300:] - d))) ** 2)),
        bounds=(0.0, 0.3),
        method="bounded",
    )
    assert lag.fun < 0.01


def test_brakes_keep_the_slip_near_its_best_value() -> None:
    times, out = recorded("abs_braking", 2.0)
    slip = out[times > 0.2, 2]
    assert slip.min() > 0.11
    assert slip.max() < 0.19
    # M v' = -F_z mu with the friction of a slip between the limits
    slowed = 30.0 - out[-1, 0]
    least, most = (9.81 / 4 * math.sin(1.9 * math.atan(10 * s)) for s in (0.13, 0.17))
    assert 0.9 * least * times[-1] < slowed < 1.1 * max(most, 9.81 / 4) * times[-1]
