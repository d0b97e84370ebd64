"""Published examples of PathSim and bdsim in our blocks: all run, many agree with scipy."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate, linalg, optimize, signal, special

import runtime

FOLDER = Path(__file__).parents[2] / "graphs" / "gallery" / "published"
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))


def recorded(name: str, until: float | None = None, engine: str = "python") -> tuple[Any, Any]:
    graph = runtime.load(FOLDER / f"{name}.yaml")
    result = (graph if until is None else graph.set("run.until", until)).run(engine=engine)
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


def stiff(t: float, x: Any) -> list[float]:
    return [x[1], 1000 * (1 - x[0] ** 2) * x[1] - x[0]]


def nerve(t: float, x: Any) -> list[float]:
    current = 0.6 * math.cos(t)
    return [x[0] - x[0] ** 3 / 3 - x[1] + current, 0.1 * (x[0] + 0.7 - 0.8 * x[1])]


MODELS = {
    "nerve_impulse": Model(nerve, [0, 0], 100.0),
    "van_der_pol_stiff": Model(stiff, [2, 0], 900.0, 2e-4, method="Radau", shown=(0,)),
    "nested_subsystems": Model(stiff, [2, 0], 100.0, method="Radau", shown=(0,)),
    "glycolysis": Model(glycolysis, [0, 0], 40.0),
    "chlorine_dioxide": Model(iodine, [0, 0], 20.0),
    "bacterial_respiration": Model(respiration, [0, 0], 40.0),
    "thomas": Model(
        lambda t, x: [math.sin(x[(i + 1) % 3]) - 0.2 * x[i] for i in range(3)], [1, 1, -3], 30.0
    ),
    "morse": Model(morse, [2, 3], 10.0),
    "flame": Model(lambda t, x: [x[0] ** 2 - x[0] ** 3], [0.0001], 12000.0, 1e-3, "Radau"),
    "robertson": Model(robertson, [1, 0, 0], 100.0, method="Radau"),
    "reactor": Model(reactor, [1, 0, 300], 10.0),
    "lorenz": Model(lorenz, [1, 1, 1], 5.0, 1e-4),
    "phase_locked_loop": Model(locked, [0, 0, 0, 0], 5.0, 1e-4, shown=(2,)),
    "drive_to_pose": Model(to_pose, [5, 2, 0], 5.0, 1e-3),
}


# A stiff one, a chaotic one, a robot; the others are slow tests.
QUICK = ("robertson", "lorenz", "drive_to_pose")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow]) for name in MODELS],
)
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


def test_ten_bodies_attract_each_other() -> None:
    graph = runtime.load(FOLDER / "solar.yaml").set("run.until", 60)
    masses = np.array(graph.network.entries["bodies"].block.value("constants").values["m"])
    result = graph.run(engine="python")
    times, out = result.time("out"), result["out"]

    def rates(t: float, x: Any) -> Any:
        at = x[:30].reshape(10, 3)
        apart = at[None] - at[:, None]
        cubes = (np.linalg.norm(apart, axis=2) + np.eye(10)) ** 3
        pull = np.einsum("j,ijk->ik", 4 * np.pi**2 / 365**2 * masses, apart / cubes[..., None])
        return np.concatenate((x[30:], pull.ravel()))

    span, tolerances = (0, times[-1]), {"rtol": 1e-11, "atol": 1e-13}
    solved = integrate.solve_ivp(rates, span, out[0], "DOP853", t_eval=times, **tolerances)
    np.testing.assert_allclose(out, solved.y.T, atol=1e-6)
    momentum = masses @ out[:, 30:].reshape(-1, 10, 3)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-17)


def test_a_double_pendulum_is_lagranges() -> None:
    graph = runtime.load("gallery/double_pendulum").set("run.until", 3.0)
    result = graph.run(engine="python")
    m1, m2, l1, l2, g = 1.0, 0.5, 1.0, 0.7, 9.81

    def rates(t: float, x: Any) -> Any:
        a, b, v, w = x
        c, s = math.cos(a - b), math.sin(a - b)
        mass = [[(m1 + m2) * l1**2, m2 * l1 * l2 * c], [m2 * l1 * l2 * c, m2 * l2**2]]
        upper = -m2 * l1 * l2 * s * w**2 - (m1 + m2) * g * l1 * math.sin(a)
        lower = m2 * l1 * l2 * s * v**2 - m2 * g * l2 * math.sin(b)
        return [v, w, *np.linalg.solve(mass, [upper, lower])]

    times, found = result.time("angles"), result["angles"]
    solved = integrate.solve_ivp(
        rates, (0, times[-1]), [2, 1, 0, 0], t_eval=times, rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(found, solved.y[:2].T, atol=1e-5)
    np.testing.assert_allclose(result["energy"], result["energy"][0], rtol=1e-5)


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


def test_a_ball_returns_with_four_fifths_of_its_speed() -> None:
    times, out = recorded("gravity_ball")
    expected, begin, speed = np.empty(len(times)), math.sqrt(20 / 9.81), math.sqrt(20 * 9.81)
    falling = times < begin
    expected[falling] = 10 - 9.81 / 2 * times[falling] ** 2
    while begin < times[-1]:
        speed *= 0.8
        since = times - begin
        expected[since >= 0] = (speed * since - 9.81 / 2 * since**2)[since >= 0]
        begin += 2 * speed / 9.81
    # Each bounce is up to one tick late, at 14 m/s and less.
    np.testing.assert_allclose(out[:, 1], expected, atol=0.02)


def test_the_rlc_circuit_follows_its_matrix_exponential() -> None:
    _, out = recorded("rlc_discrete")
    r, inductance, c, h = 4.7e3, 47e-4, 100e-6, 1 / 18
    a = np.array([[0.0, 1 / c], [-1 / inductance, -r / inductance]])
    step = linalg.expm(h * a)
    given = np.linalg.solve(a, (step - np.eye(2)) @ np.array([0.0, 1 / inductance]))
    state, total, rows = np.zeros(2), 0.0, []
    for _ in range(len(out)):
        measured = round(min(max(state[0], 0.0), 3.6) / (3.6 / 4096)) * (3.6 / 4096)
        duty = min(max(20 * (1 - measured) + total, 0.0), 1.0)
        rows.append((state[0], duty))
        total += h * (1 - measured)
        state = step @ state + given * 3.3 * duty
    np.testing.assert_allclose(out, rows, atol=1e-9)


def test_the_sampled_antenna_is_its_closed_loop() -> None:
    times, out = recorded("antenna_sampled")
    b = np.convolve([9.15, -9.15 * 0.9802], [0.00199, 0.00199 * 0.9934])
    a = np.convolve([1, -0.8187], np.convolve([1, -1], [1, -0.9802]))
    closed = signal.lfilter(np.r_[0.0, b], a + np.r_[0.0, b], (times >= 1 - 1e-9).astype(float))
    np.testing.assert_allclose(out[:, 1], closed, atol=1e-12)


def test_sampled_controllers_and_their_parts_are_sums() -> None:
    times, out = recorded("sampled_pid")
    error = np.maximum(times - 1, 0.0)
    expected = 5 * error + 3 * 0.1 * np.cumsum(error) + 2 * np.diff(error, prepend=0.0) / 0.1
    np.testing.assert_allclose(out[:, 1:], np.column_stack([expected] * 3), atol=1e-10)
    times, out = recorded("sampled_derivative")
    late = times >= 1.1 - 1e-9
    np.testing.assert_allclose(out[:, 1], np.where(late, 2.0, 0.0), atol=1e-11)
    times, out = recorded("sampled_integral")
    sampled = np.floor(times / 0.1 + 1e-6)
    np.testing.assert_allclose(out[:, 1], 0.2 * np.maximum(sampled - 10, 0), atol=1e-12)
    times, out = recorded("two_samplers")
    for column, h in ((1, 0.2), (2, 0.1)):
        at = h * np.floor(times / h + 1e-6)
        np.testing.assert_allclose(out[:, column], np.sin(0.4 * np.pi * at), atol=1e-12)


def test_a_car_pursues_the_polygon_to_its_end() -> None:
    times, out = recorded("pursuit")
    corners = np.array([[10, 10], [10, 60], [80, 80], [50, 10]], float)
    late = out[times > 15.0, :2]
    gaps = []
    for p, q in itertools.pairwise(corners):
        share = np.clip((late - p) @ (q - p) / ((q - p) @ (q - p)), 0.0, 1.0)
        gaps.append(np.hypot(*(late - p - share[:, None] * (q - p)).T))
    # The widest gap is where the path turns by 130 degrees.
    assert np.min(gaps, axis=0).max() < 5.0
    assert np.median(np.min(gaps, axis=0)) < 0.3
    assert np.hypot(*(out[-1, :2] - corners[-1])) < 5.0


def test_converters_quantise_and_hold() -> None:
    times, out = recorded("converters")
    held = 0.02 * np.floor((times - 0.002) / 0.02 + 1e-6)
    late = times > 0.0215
    levels = np.round(np.sin(2 * np.pi * held) * 128) / 128
    np.testing.assert_allclose(out[late, 1], levels[late], atol=1e-12)
    system = ([20 * np.pi], [1, 20 * np.pi])
    expected = signal.lsim(system, out[:, 1], times, interp=False)[1]
    np.testing.assert_allclose(out[:, 2], expected, atol=1e-7)


def test_an_algebraic_chain_is_minus_the_cosine_of_twice_the_time() -> None:
    times, out = recorded("algebraic_chain")
    np.testing.assert_allclose(out[:, 2], -np.cos(2 * times), atol=1e-14)


def test_the_costas_loop_recovers_the_bits() -> None:
    """The oscillator locks: the in-phase arm has half the amplitude, the other next to nothing."""
    times, out = recorded("costas_loop", engine="auto")
    locked = times > 100.0
    assert np.abs(out[locked, 1]).mean() == pytest.approx(0.5, rel=0.1)
    assert np.abs(out[locked, 2]).mean() < 0.15
    # 5 ns of delay, and the filter's
    sent = np.sign(np.sin(2 * np.pi * (times - 5.06) / 4.0))
    agreement = np.mean(np.sign(out[locked, 1]) * sent[locked])
    assert abs(agreement) > 0.95


def test_a_band_recovers_the_sine_in_a_noisy_square_wave() -> None:
    times, out = recorded("noisy_square")
    late = times >= 20.0
    wave = np.exp(-1j * np.pi * times[late])
    amplitude = 2 * abs(np.mean(out[late, 2] * wave))
    # 4/pi is the fundamental of a square wave; noise of density S leaves 2 sqrt(S / T) at most.
    assert amplitude == pytest.approx(4 / np.pi, abs=4 * math.sqrt((0.05 + 0.1 / 0.5) / 40.0))
    residue = out[late, 2] - 2 * np.real(np.mean(out[late, 2] * wave) * np.conj(wave))
    assert residue.std() < 0.6


def test_a_noisy_phase_is_that_of_its_noise() -> None:
    graph = runtime.load(FOLDER / "phase_noise.yaml")
    result = graph.run(engine="python")
    times, out = result.time("out"), np.asarray(result["out"])
    np.testing.assert_allclose(out[:, 0], np.sin(4 * np.pi * times), atol=1e-12)
    # E (sin(x + w) - sin x)^2 = 1 - exp(-sigma^2 / 2) over a turn of x, with sigma = 0.1
    error = np.mean((out[:, 1] - out[:, 0]) ** 2)
    assert error == pytest.approx(-np.expm1(-0.005), rel=0.15)
    steps = np.diff(np.asarray(result["walk"]))
    assert steps.std() == pytest.approx(0.5 * math.sqrt(0.05), rel=0.1)


@pytest.mark.slow
def test_winding_up_reacts_later_than_back_calculation() -> None:
    """Behind its limit the integral grows; the controller without a limit turns round later."""
    times, free = recorded("pid_windup", 140.0)
    graph = runtime.load(FOLDER / "pid_windup.yaml").set("blocks.pid.lower", -20.0)
    graph = graph.set("blocks.pid.upper", 20.0).set("blocks.pid.tracking", 10.0)
    held = np.asarray(graph.set("run.until", 140.0).run(engine="python")["out"])
    assert np.abs(free[times < 2.0, 1]).max() == 0.0
    # Until the step down both actuators are at their limit: y = 10 (1 - exp(-t / 10)), delayed.
    early = (times > 2.0) & (times < 80.0)
    expected = 10 * -np.expm1(-0.1 * (times[early] - 2.0))
    np.testing.assert_allclose(free[early, 1], expected, atol=1e-6)
    turned = [times[np.argmax((out[:, 1] < 9.0) & (times > 80.0))] for out in (free, held)]
    assert turned[0] > turned[1] + 10.0 > 80.0


def test_the_floor_opens_after_thirteen_bounces() -> None:
    _, out = recorded("switched_floor")
    height, speed, bounces = out.T
    opened = int(np.argmax(bounces >= 13))
    assert height[:opened].min() > -0.02
    assert -5.02 < height.min() < -4.9
    energy = 9.81 * height + speed**2 / 2
    assert np.diff(energy).max() < 0.2  # of one late bounce; friction and restitution only take
    assert energy[-1] < energy[0]


def test_spectra_of_a_filter_give_its_frequency_response() -> None:
    times, out = recorded("filter_response")
    f = np.linspace(0.0, 10.0, 41)
    waves = np.exp(-2j * np.pi * np.outer(f, times))
    into, out_of = (waves @ out[:, i] for i in (0, 1))
    expected = signal.freqs(*signal.butter(10, 10 * np.pi, analog=True), 2 * np.pi * f)[1]
    np.testing.assert_allclose(out_of / into, expected, atol=2e-3)


def test_a_short_pulse_is_the_difference_of_two_steps() -> None:
    times, out = recorded("short_pulse")
    answer = signal.step(signal.butter(4, 10 * np.pi, analog=True), T=times)[1]
    rise, fall = np.zeros(len(times)), np.zeros(len(times))
    rise[200:], fall[210:] = answer[:-200], answer[:-210]
    np.testing.assert_allclose(out[:, 1], rise - fall, atol=1e-5)


def test_a_sampled_pid_around_an_integrator_is_its_recursion() -> None:
    times, out = recorded("pid_sampled_and_continuous")
    ticks = times[::50]
    target = np.select([ticks < 20, ticks < 60], [0.0, 1.0], 0.5)
    level, total, last, levels = 0.0, 0.0, 0.0, []
    for wanted in target:
        levels.append(level)
        error = wanted - level
        total += error
        level += 0.4 * (1.5 * error + 0.5 * total + 0.1 * (error - last))
        last = error
    np.testing.assert_allclose(out[::50, 1], levels, atol=1e-9)
    s = np.array([1.0, 0.0])
    pid = np.polyadd(np.polyadd(1.5 * np.polymul(s, [1, 10]), 0.5 * np.array([1, 10])), [1, 0, 0])
    plant = np.polymul(np.polymul(s, [1, 10]), s)
    closed = (0.4 * pid, np.polyadd(plant, 0.4 * pid))
    early = (times >= 20) & (times < 60)
    expected = signal.step(closed, T=times[early] - 20)[1]
    np.testing.assert_allclose(out[early, 0], expected, atol=1e-5)
