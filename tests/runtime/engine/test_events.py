"""Events between ticks: located to rounding, in order of time, by both engines alike."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime
from runtime.errors import SimulationError

ENGINES = ("python", "compiled")
GALLERY = Path(__file__).parents[3] / "graphs" / "gallery"


def recorded(blocks: dict[str, Any], wires: dict[str, Any], of: str, **run: Any) -> np.ndarray:
    document = {"run": run, "blocks": blocks, "wires": wires, "probes": {"y": of}}
    result = runtime.load(document).run()
    assert run["engine"] == "python" or result.manifest["engine"] == "compiled"
    return np.asarray(result["y"])


def falling(t: np.ndarray, g: float, height: float, share: float) -> np.ndarray:
    """The height of a ball dropped from rest that keeps a share of its speed at each bounce."""
    at, speed = math.sqrt(2.0 * height / g), share * math.sqrt(2.0 * height * g)
    y = height - 0.5 * g * t**2
    while at < t[-1]:
        since = t - at
        y = np.where(since >= 0.0, speed * since - 0.5 * g * since**2, y)
        at, speed = at + 2.0 * speed / g, share * speed
    return y


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["rk4", "dopri5", "rodas4"])
def test_a_ball_bounces_as_in_the_closed_form(engine: str, solver: str) -> None:
    graph = runtime.load(str(GALLERY / "published" / "gravity_ball.yaml")).set("run.dt", 0.01)
    y = np.asarray(graph.set("run.solver", solver).run(engine=engine)["out"])[:, 1]
    expected = falling(0.01 * np.arange(len(y)), 9.81, 10.0, 0.8)
    np.testing.assert_allclose(y, expected, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["euler", "heun", "rk4", "dopri5"])
@pytest.mark.slow
def test_integrate_and_reset_loses_nothing(engine: str, solver: str) -> None:
    """x' = pi, back to 0 at 1: 314 resets in 100 s, and 100 pi - 314 left; events in a chain of
    blocks, where one makes the next one happen, as well."""
    one = {
        "x": {
            "type": "DynamicSystem",
            "states": ["x", "n"],
            "derivative": ["pi", "0"],
            "initial": [0, 0],
            "events": [{"when": "x >= 1", "then": ["0", "n + 1"]}],
        }
    }
    run = {"dt": 0.1, "until": 100.1, "engine": engine, "solver": solver}
    x, n = recorded(one, {}, "x.out", **run)[-1]
    assert (n, x) == (314.0, pytest.approx(100.0 * math.pi - 314.0, abs=1e-9))
    chain = {
        "pi": {"type": "Constant", "value": math.pi},
        "x": {"type": "Integrator"},
        "full": {"type": "Compare", "operator": ">=", "value": 1.0},
        "hits": {"type": "HitCrossing", "level": 0.5, "direction": "rising"},
    }
    wires = {
        "x": {"input": "pi.value", "reset": "full.out"},
        "full": {"input": "x.out"},
        "hits": {"input": "full.out"},
    }
    assert recorded(chain, wires, "hits.count", **run)[-1] == 314.0
    assert recorded(chain, wires, "x.out", **run)[-1] == pytest.approx(x, abs=1e-9)


def by_scipy(
    rates: Any, events: list[tuple[Any, float, Any]], x: list[float], times: np.ndarray
) -> np.ndarray:
    """The states at some times: an event is (condition's number, direction, the states after)."""
    found, begin, at = [np.empty((0, len(x)))], 0.0, np.array(x)
    conditions = []
    for number, direction, _ in events:
        condition = lambda t, x, number=number: number(t, x)  # noqa: E731 -- it takes attributes
        condition.terminal, condition.direction = True, direction  # type: ignore[attr-defined]
        conditions.append(condition)
    while True:
        wanted = times[(times >= begin) & (times <= times[-1])]
        run = solve_ivp(
            *(rates, (begin, times[-1]), at, "DOP853", None, True, conditions),
            **{"rtol": 1e-12, "atol": 1e-13, "max_step": 0.05},
        )
        end = run.t[-1]
        part = wanted[wanted < end] if run.status == 1 else wanted
        found.append(run.sol(part).T.reshape(len(part), len(x)))
        if run.status != 1:
            return np.concatenate(found)
        met = next(i for i, each in enumerate(run.t_events) if len(each))
        begin, at = end, np.array(events[met][2](end, run.y[:, -1]))


def friction(t: float, x: np.ndarray) -> list[float]:
    return [x[1], -9.81 - 0.2 * x[1] * abs(x[1])]


def slides(t: float, x: np.ndarray) -> list[float]:
    """A box on a belt, of which the third state is 1 while it sticks."""
    u = 3.0 * math.sin(2.0 * math.pi * 0.02 * t)
    if x[2] > 0.5:
        return [u, 0.0, 0.0]
    force = -70.0 * x[0] - 10.0 * x[1] + 294.3 * math.copysign(1.0, u - x[1])
    return [x[1], force / 20.0, 0.0]


def belt(t: float) -> float:
    return 3.0 * math.sin(2.0 * math.pi * 0.02 * t)


def breaks_away(t: float, x: np.ndarray) -> float:
    if x[2] > 0.5:
        return abs(70.0 * x[0] + 10.0 * belt(t)) - 294.3
    return -1.0


def catches(t: float, x: np.ndarray) -> float:
    if x[2] > 0.5:
        return -1.0
    return min(0.02 - abs(x[1] - belt(t)), 294.3 - abs(70.0 * x[0] + 10.0 * belt(t)))


CASES: dict[str, tuple[str, float, Any, list[tuple[Any, float, Any]], list[float]]] = {
    "bouncing_ball": (
        "bouncing_ball",
        8.0,
        friction,
        [(lambda t, x: x[0], -1.0, lambda t, x: [abs(x[0]), -0.95 * x[1]])],
        [1.0, 5.0],
    ),
    "bouncing_pendulum": (
        "published/bouncing_pendulum",
        15.0,
        lambda t, x: [x[1], -9.81 * math.sin(x[0])],
        [(lambda t, x: x[0], -1.0, lambda t, x: [abs(x[0]), -0.9 * x[1]])],
        [3.110176727053895, 0.0],
    ),
    "stick_slip": (
        "published/stick_slip",
        40.0,
        slides,
        [
            (breaks_away, 1.0, lambda t, x: [x[0], belt(t), 0.0]),
            (catches, 1.0, lambda t, x: [x[0], belt(t), 1.0]),
        ],
        [0.0, 0.0, 1.0],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_systems_with_events_agree_with_scipy(case: str, engine: str) -> None:
    name, until, rates, events, x = CASES[case]
    graph = runtime.load(str(GALLERY / f"{name}.yaml")).set("run.until", until)
    for key, value in {"dt": 0.01, "solver": "dopri5", "rtol": 1e-8, "atol": 1e-10}.items():
        graph = graph.set(f"run.{key}", value)
    block = next(each for each in graph.names if each != "belt")
    result = graph.overlay({"probes": {"all": f"{block}.out"}}).run(engine=engine)
    assert result.manifest["engine"] == engine
    times = 0.01 * np.arange(len(result["all"]))
    expected = by_scipy(rates, events, x, times)
    error = np.abs(result["all"] - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert error.max() < 1e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_a_thermostat_follows_the_exponentials_of_its_two_modes(engine: str) -> None:
    result = runtime.load(str(GALLERY / "thermostat.yaml")).run(engine=engine)
    y = np.ravel(result["temperature"])
    times, expected = 0.01 * np.arange(len(y)), np.zeros(len(y))
    begin, now, heat = 0.0, 15.0, 5.0
    while begin < times[-1]:
        rest, goal = 15.0 + heat / 0.45, 25.0 if heat else 23.0
        lasts = math.log((now - rest) / (goal - rest)) / 0.45
        inside = (times >= begin) & (times < begin + lasts)
        expected[inside] = rest + (now - rest) * np.exp(-0.45 * (times[inside] - begin))
        begin, now, heat = begin + lasts, goal, 5.0 - heat
    np.testing.assert_allclose(y, expected, atol=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stop_waits_for_a_crossing_in_its_direction(engine: str) -> None:
    """The population is above 5 at first, falls below, and rises again."""
    graph = runtime.load(str(GALLERY / "volterra_lotka.yaml")).set("run.solver", "dopri5")
    graph = graph.set("run.rtol", 1e-9).set("run.atol", 1e-11)
    stop = {"when": "populations.out.0", "crosses": 5.0, "direction": "rising"}
    at = graph.set("run.stop", stop).run(engine=engine).manifest["stopped_at"]

    def rates(t: float, x: np.ndarray) -> list[float]:
        return [x[0] - 0.1 * x[0] * x[1], 0.5 * x[0] * x[1] - 1.2 * x[1]]

    def level(t: float, x: np.ndarray) -> float:
        return float(x[0] - 5.0)

    level.direction = 1.0  # type: ignore[attr-defined]
    found = solve_ivp(rates, (0.0, 20.0), [10.0, 5.0], "DOP853", None, False, [level],
                      rtol=1e-11, atol=1e-12)  # fmt: skip
    assert at == pytest.approx(found.t_events[0][0], abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["rk4", "dopri5"])
def test_edges_are_where_they_are(engine: str, solver: str) -> None:
    run = {"dt": 0.1, "until": 2.0, "engine": engine, "solver": solver}
    for source, area in (
        ({"type": "Step", "time": 0.9137}, 1.9 - 0.9137),
        ({"type": "Pulse", "period": 0.77, "width": 0.001, "start": 0.05}, 0.003),
        ({"type": "Piecewise", "times": [0.0, 0.333, 1.0], "values": [0.0, 2.0, 1.0]}, 2.234),
        ({"type": "Ramp", "start": 0.55, "stop": 1.23, "slope": 2.0}, 0.68**2 + 1.36 * 0.67),
    ):
        blocks = {
            "source": source,
            "gain": {"type": "Gain", "gain": 2.0},
            "x": {"type": "Integrator"},
        }
        wires = {"gain": {"input": "source.out"}, "x": {"input": "gain.out"}}
        assert recorded(blocks, wires, "x.out", **run)[-1] == pytest.approx(2.0 * area, abs=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("start", [0.0, 0.0371])
def test_saw_teeth_are_seen_from_the_left_before_they_fall(engine: str, start: float) -> None:
    teeth = {"type": "Pulse", "period": 1.0, "rise": 1.0, "width": 0.0, "start": start}
    blocks = {"teeth": teeth, "x": {"type": "Integrator"}}
    run = {"dt": 0.1, "until": 5.0, "engine": engine}
    area = 4 / 2 + (4.9 - start - 4.0) ** 2 / 2
    found = recorded(blocks, {"x": {"input": "teeth.out"}}, "x.out", **run)[-1]
    assert found == pytest.approx(area, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_limits_are_left_as_soon_as_the_input_turns(engine: str) -> None:
    """The integral of sin from 0 to 1.1 and back down to -0.7: 1.1 is met and left exactly."""
    blocks = {
        "wave": {"type": "Sine", "frequency": 0.1},
        "x": {"type": "Integrator", "lower": -0.7, "upper": 1.1},
    }
    run = {"dt": 0.1, "until": 10.0, "engine": engine, "solver": "dopri5", "rtol": 1e-10}
    y = recorded(blocks, {"x": {"input": "wave.out"}}, "x.out", **run, atol=1e-12)
    t, w = 0.1 * np.arange(100), 0.2 * math.pi
    met = math.acos(1.0 - 1.1 * w) / w
    rising = (1.0 - np.cos(w * t)) / w
    after = np.maximum(1.1 - (np.cos(w * 5.0) - np.cos(w * t)) * -1.0 / w, -0.7)
    expected = np.where(t < met, rising, np.where(t < 5.0, 1.1, after))
    np.testing.assert_allclose(y, expected, atol=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_events_without_end_are_an_error_that_names_the_block(engine: str) -> None:
    blocks = {
        "push": {"type": "Relay", "low": -1.0, "high": 1.0},
        "rate": {"type": "Function", "expression": "0.3 - u[0]"},
        "x": {"type": "Integrator", "initial": 0.25},
    }
    wires = {"push": {"input": "x.out"}, "rate": {"u": "push.out"}, "x": {"input": "rate.out"}}
    run = {"dt": 0.1, "until": 2.0, "engine": engine}
    with pytest.raises(SimulationError, match=r"block 'push'.*more than 1000 events.*hysteresis"):
        recorded(blocks, wires, "x.out", **run)
    ticks = recorded(blocks, wires, "x.out", **run, events="ticks")
    assert abs(ticks[10:]).max() < 0.2  # chatters about 0, once a tick
    band = {"push": {"type": "Relay", "low": -1.0, "high": 1.0, "switch_on": 0.01}}
    slides = recorded(blocks | band, wires, "x.out", **run)
    assert slides[10:].min() > -1e-12 and slides[10:].max() < 0.01 + 1e-12


def ball(when: str, then: list[str], level: float = 0.0, **run: Any) -> dict[str, Any]:
    block = {
        "type": "DynamicSystem",
        "states": ["h", "v"],
        "derivative": ["v", "-9.81"],
        "initial": [1.0 + level, 0.0],
        "when": when,
        "then": then,
    }
    return {"run": {"dt": 0.01, **run}, "blocks": {"b": block}, "probes": {"x": "b.out"}}


SLOW = pytest.mark.slow


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "solver", ["rk4", pytest.param("dopri5", marks=SLOW), pytest.param("rodas4", marks=SLOW)]
)
@pytest.mark.parametrize(
    ("when", "then", "level", "share"),
    [
        ("h < 0", ["h", "-0.5*v"], 0.0, 0.5),
        ("h < 0", ["0", "-0.5*v"], 0.0, 0.5),
        pytest.param("h <= 0", ["0", "-0.5*v"], 0.0, 0.5, marks=SLOW),
        pytest.param("h < 0", ["abs(h)", "-0.5*v"], 0.0, 0.5, marks=SLOW),
        pytest.param("h < 0 and v < 0", ["h", "-0.5*v"], 0.0, 0.5, marks=SLOW),
        pytest.param("h < 1.5", ["h", "-0.3*v"], 1.5, 0.3, marks=SLOW),
        pytest.param("h < 1.5", ["1.5", "-0.3*v"], 1.5, 0.3, marks=SLOW),
        pytest.param("h < 0", ["h", "-0.01*v"], 0.0, 0.01, marks=SLOW),
        pytest.param("h < 0", ["0", "0"], 0.0, 0.0, marks=SLOW),
    ],
)
def test_a_ball_that_comes_to_rest_is_an_error_at_that_time(
    when: str, then: list[str], level: float, share: float, solver: str, engine: str
) -> None:
    """The flights are a geometric series: sqrt(2 h / g) (1 + 2 r / (1 - r)) in all."""
    end = math.sqrt(2.0 / 9.81) * (1.0 + 2.0 * share / (1.0 - share))
    graph = runtime.load(ball(when, then, level, solver=solver, until=3.0))
    with pytest.raises(SimulationError, match="block 'b'.*ever faster") as caught:
        graph.run(engine=engine)
    found = re.search(r"the last at t = ([0-9.]+) s", str(caught.value))
    assert found is not None and float(found[1]) == pytest.approx(end, abs=2e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ball_of_blocks_does_not_fall_through_the_floor_either(engine: str) -> None:
    """Compare finds the floor and resets the speed: its output changes back as the ball leaves."""
    blocks = {
        "g": {"type": "Constant", "value": -9.81},
        "v": {"type": "Integrator"},
        "h": {"type": "Integrator", "initial": 1.0},
        "floor": {"type": "Compare", "operator": "<", "value": 0.0},
        "turned": {"type": "Gain", "gain": -0.5},
    }
    wires = {
        "v": {"input": "g.value", "reset": "floor.out", "initial_input": "turned.out"},
        "h": {"input": "v.out"},
        "floor": {"input": "h.out"},
        "turned": {"input": "v.out"},
    }
    for solver in ("rk4", "dopri5"):
        run = {"dt": 0.01, "until": 3.0, "engine": engine, "solver": solver}
        with pytest.raises(SimulationError, match=r"t = 1\.3545[67].* s: they follow each other"):
            recorded(blocks, wires, "h.out", **run)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ball_rests_as_the_documentation_shows(engine: str) -> None:
    document = ball(
        "h < 0 and v < 0", ["0", "-0.5*v if v < -0.01 else 0", "1 if v < -0.01 else 0"], until=3.0
    )
    document["blocks"]["b"] |= {
        "states": ["h", "v", "up"],
        "derivative": ["v", "-9.81*up", "0"],
        "initial": [1, 0, 1],
    }
    result = runtime.load(document).set("run.solver", "dopri5").run(engine=engine)
    assert not result.notes
    h, v, up = np.asarray(result["x"]).T
    t = 0.01 * np.arange(len(h))
    early = t < 1.3
    np.testing.assert_allclose(h[early], falling(t[early], 9.81, 1.0, 0.5), atol=1e-9)
    assert not np.any(h[t > 1.36]) and not np.any(v[t > 1.36]) and not np.any(up[t > 1.36])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["rk4", "dopri5"])
def test_an_event_that_leaves_its_condition_acts_once(solver: str, engine: str) -> None:
    """It counts, and x goes on above the level."""
    counted = {
        "run": {"dt": 0.1, "until": 3.0, "engine": engine, "solver": solver},
        "blocks": {
            "x": {
                "type": "DynamicSystem",
                "states": ["x", "n"],
                "derivative": ["1", "0"],
                "initial": [0.0, 0.0],
                "when": "x > 0.7315",
                "then": ["x", "n + 1"],
            }
        },
        "probes": {"y": "x.out", "at": {"events": "x"}},
    }
    once = runtime.load(counted).run()
    assert once["y"][-1, 1] == 1.0 and once.time("at").tolist() == pytest.approx([0.7315])
    (note,) = once.notes
    assert "condition of event 0 held to the end since t = 0.7315 s, when it acted last" in note


@pytest.mark.parametrize("engine", ENGINES)
def test_a_condition_that_holds_from_the_start_to_the_end_is_noted(engine: str) -> None:
    document = ball("h < 5", ["h", "-v"], until=0.5)
    (note,) = runtime.load(document).run(engine=engine).notes
    assert "block 'b': the condition of event 0 held to the end since the start" in note
    stopped = ball("h < 0", ["h", "0"], until=1.0)  # falls on, from rest
    (note,) = runtime.load(stopped).run(engine=engine).notes
    assert "since t = 0.451524 s, when it acted last" in note


@pytest.mark.parametrize("engine", ENGINES)
def test_the_times_of_events_are_recorded(engine: str, tmp_path: Path) -> None:
    graph = runtime.load(str(GALLERY / "thermostat.yaml")).overlay(
        {"probes": {"switches": {"events": "heater"}}}
    )
    result = graph.run(engine=engine)
    first = math.log((15.0 - 15.0 - 5.0 / 0.45) / (25.0 - 15.0 - 5.0 / 0.45)) / 0.45
    assert result.time("switches")[0] == pytest.approx(first, abs=1e-7)
    assert len(result.time("switches")) == 18
    assert not np.any(result["switches"])  # all of them are of the first guard
    saved = runtime.runs.open_run(result.save(tmp_path / "run"))
    np.testing.assert_array_equal(saved.time("switches"), result.time("switches"))


PART = """
graph: part
inputs: {x: Scalar}
blocks:
  on: {type: Trigger}
  clock: {type: Clock}
  stored: {type: Gain, gain: 1.0}
  count: {type: DiscreteSystem, next: ["n + 1"], states: [n], initial: 0}
wires:
  on: {input: inputs.x}
  stored: {input: clock.time}
outputs: {t: stored.out, n: count.out}
"""
WHOLE = """
graph: whole
run: {dt: 0.1, until: 12, solver: dopri5, rtol: 1.0e-9}
blocks:
  x: {type: DynamicSystem, states: [x, v], derivative: [v, -x], initial: [0, -1], output: [x]}
  part: {graph: part.yaml}
wires: {part: {x: x.out}}
probes: {t: part.t, n: part.n}
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_triggered_part_runs_where_the_sign_changes(engine: str, tmp_path: Path) -> None:
    """x = -sin(t) rises through zero at pi and 3 pi; states inside are updated there, too."""
    (tmp_path / "part.yaml").write_text(PART)
    (tmp_path / "whole.yaml").write_text(WHOLE)
    result = runtime.load(str(tmp_path / "whole.yaml")).run(engine=engine)
    assert result.manifest["engine"] == engine
    times = np.unique(np.ravel(result["t"]))
    np.testing.assert_allclose(times, [0.0, math.pi, 3.0 * math.pi], atol=1e-7)
    assert np.ravel(result["n"])[-1] == 1.0  # the second run of the part shows one update


def test_a_pulse_shorter_than_a_tick_is_noted_where_nothing_is_continuous() -> None:
    pulse = {"type": "Pulse", "period": 0.1, "width": 0.001}
    blocks = {"pulse": pulse, "gain": {"type": "Gain", "gain": 1.0}}
    document = {"run": {"dt": 0.01, "until": 1.0}, "blocks": blocks}
    document["wires"] = {"gain": {"input": "pulse.out"}}
    (note,) = [note for note in runtime.load(document).network.notes if "pulse" in note]
    assert "0.001 s at dt = 0.01 s" in note
    document["blocks"] = blocks | {"x": {"type": "Integrator"}}
    document["wires"] = {"gain": {"input": "pulse.out"}, "x": {"input": "gain.out"}}
    assert not [note for note in runtime.load(document).network.notes if "shorter" in note]


SINE: dict[str, Any] = {"wave": {"type": "Sine", "amplitude": 1.0, "frequency": 0.5}}
HITS: dict[str, Any] = {"hits": {"type": "HitCrossing", "level": 0.5, "direction": "rising"}}


@pytest.mark.parametrize("engine", ENGINES)
def test_hits_are_recorded_in_one_direction(engine: str) -> None:
    """sin(pi t) rises through one half at t = 1/6 and 13/6, and falls through it in between."""
    document = {
        "run": {"dt": 0.01, "until": 3.0, "engine": engine},
        "blocks": {**SINE, **HITS, "x": {"type": "Integrator"}},
        "wires": {"hits": {"input": "wave.out"}, "x": {"input": "wave.out"}},
        "probes": {"at": {"events": "hits"}, "count": "hits.count"},
    }
    result = runtime.load(document).run()
    np.testing.assert_allclose(result.time("at"), [1.0 / 6.0, 13.0 / 6.0], atol=1e-10)
    assert result["count"][-1] == 2.0 and not result.notes


def test_a_full_log_of_events_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.plan.building.MOST_EVENTS", 2)
    document = {
        "run": {"dt": 0.01, "until": 9.0, "engine": "python"},
        "blocks": {**SINE, **HITS, "x": {"type": "Integrator"}},
        "wires": {"hits": {"input": "wave.out"}, "x": {"input": "wave.out"}},
        "probes": {"at": {"events": "hits"}, "count": "hits.count"},
    }
    result = runtime.load(document).run()
    assert len(result["at"]) == 2 and result["count"][-1] == 5.0
    assert result.notes == ["probes of events are full after 2 events, the last at t = 2.16667"]


def test_a_probe_of_events_that_act_on_ticks_is_noted() -> None:
    document = {
        "run": {"dt": 0.01, "until": 3.0},
        "blocks": {**SINE, **HITS},
        "wires": {"hits": {"input": "wave.out"}},
        "probes": {"at": {"events": "hits"}, "count": "hits.count"},
    }
    result = runtime.load(document).run()
    assert not len(result["at"]) and result["count"][-1] == 2.0
    (note,) = result.notes
    assert note.startswith("probe 'at': no event of 'hits' is between two ticks here")
