"""Parts that run only at times: what holds, what is reset, in which order, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime
from runtime.cli import run
from runtime.errors import GraphError
from runtime.graph import Graph

ENGINES = ("python", "compiled")
PART: dict[str, Any] = {
    "inputs": {"signal": "Scalar", "enable": "Scalar"},
    "outputs": {"out": "twice.out", "kept": "delay.out", "sum": "total.out"},
    "blocks": {
        "enable": {"type": "Enable"},
        "twice": {"type": "Gain", "gain": 2.0},
        "delay": {"type": "UnitDelay", "initial": 7.0},
        "total": {"type": "DiscreteIntegrator", "initial": 1.0},
        "slow": {"type": "Gain", "gain": 3.0, "dt": 0.2},
    },
    "wires": {
        "enable": {"input": "inputs.enable"},
        "twice": {"input": "inputs.signal"},
        "delay": {"input": "inputs.signal"},
        "total": {"input": "inputs.signal"},
        "slow": {"input": "inputs.signal"},
    },
}


def switched(**changes: Any) -> Graph:
    """The part, fed with the time, switched by a square wave of 1 s that begins at 0.25 s."""
    graph = {
        "run": {"dt": 0.1, "until": 3.0},
        "blocks": {
            "clock": {"type": "Clock"},
            "wave": {"type": "Pulse", "period": 1.0, "width": 0.5, "start": 0.25},
            "part": {**PART, **changes},
        },
        "wires": {"part": {"signal": "clock.time", "enable": "wave.out"}},
        "probes": {
            "seen": ["part.out", "part.kept", "part.sum", "part.slow.out", "part.enable.on"],
        },
    }
    return runtime.load(graph)


def stepped(ticks: int, on: Any, resets: bool) -> np.ndarray:
    """What :func:`switched` records, from the rules in plain Python."""
    rows, dt = [], 0.1
    out, slow, kept, total = 0.0, 0.0, 7.0, 1.0
    for k in range(ticks):
        t, runs = k * dt, on(k)
        if runs:
            out = 2.0 * t
            slow = 3.0 * t if k % 2 == 0 else slow
        elif resets:
            out = slow = 0.0
        rows.append([out, kept, total, slow, float(runs)])
        if runs:
            kept, total = t, total + dt * t
        elif resets:
            kept, total = 7.0, 1.0
    return np.array(rows)


def is_day(k: int) -> bool:
    return k >= 3 and (k * 0.1 - 0.25) % 1.0 < 0.5


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("how", ["hold", "reset"])
def test_outputs_and_states_hold_or_are_reset_while_a_part_is_off(how: str, engine: str) -> None:
    graph = switched().set("part.blocks.enable.while_off", how).set("run.engine", engine)
    seen = graph.run()["seen"]
    np.testing.assert_allclose(seen, stepped(30, is_day, how == "reset"), atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("edge", ["rising", "falling", "either"])
def test_a_triggered_part_runs_once_per_change_of_the_sign(edge: str, engine: str) -> None:
    graph = switched().set("part.blocks.enable", {"type": "Trigger", "edge": edge})

    def on(k: int) -> bool:
        after, before = is_day(k), k > 0 and is_day(k - 1)
        rises, falls = after and not before, before and not after
        return (rises and edge != "falling") or (falls and edge != "rising")

    seen = graph.set("run.engine", engine).run()["seen"]
    np.testing.assert_allclose(seen, stepped(30, on, False), atol=1e-12)


def test_without_the_block_that_switches_it_a_part_always_runs() -> None:
    graph = switched().without("part.enable")
    seen = graph.run()["seen"]
    np.testing.assert_allclose(seen, stepped(30, lambda k: True, False)[:, :4], atol=1e-12)


def test_a_part_inside_a_part_that_is_off_is_off() -> None:
    inner = {**PART, "outputs": {"out": "twice.out"}}
    outer = {
        "inputs": {"signal": "Scalar", "enable": "Scalar", "second": "Scalar"},
        "outputs": {"out": "inner.out"},
        "blocks": {"enable": {"type": "Enable"}, "inner": inner},
        "wires": {
            "enable": {"input": "inputs.enable"},
            "inner": {"signal": "inputs.signal", "enable": "inputs.second"},
        },
    }
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 4.0},
            "blocks": {
                "clock": {"type": "Clock"},
                "long": {"type": "Pulse", "period": 2.0, "width": 1.0, "start": 0.5},
                "short": {"type": "Pulse", "period": 0.4, "width": 0.2},
                "outer": outer,
            },
            "wires": {
                "outer": {"signal": "clock.time", "enable": "long.out", "second": "short.out"}
            },
            "probes": {"seen": ["outer.out", "long.out", "short.out"]},
        }
    )
    out, long, short = graph.run()["seen"].T
    expected, held = [], 0.0
    for k in range(40):
        held = 0.2 * k if long[k] > 0 and short[k] > 0 else held
        expected.append(held)
    assert np.count_nonzero(np.diff(expected)) > 5
    np.testing.assert_allclose(out, expected, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_room_of_the_gallery_agrees_with_scipy(engine: str) -> None:
    recorded = runtime.load("gallery/night_setback").set("run.engine", engine).run()

    def rates(t: float, x: Any, on: bool) -> list[float]:
        heat = 1.5 * (20.0 - x[0]) + x[1] if on else 0.0
        return [heat - 0.2 * (x[0] - 5.0), 0.6 * (20.0 - x[0]) if on else 0.0]

    state, times, rows = np.array([12.0, 0.0]), recorded.time("temperature"), []
    for first, last, on in ((0, 6, False), (6, 20, True), (20, 30, False), (30, 40, True)):
        inside = times[(times > first - 1e-9) & (times < last - 1e-9)]
        solved = solve_ivp(
            rates, (first, last), state, args=(on,), rtol=1e-10, atol=1e-12, t_eval=[*inside, last]
        )
        rows.append(solved.y[0, :-1])
        state = np.array([solved.y[0, -1], 0.0])
    np.testing.assert_allclose(recorded["temperature"], np.concatenate(rows), atol=1e-6)
    assert np.ptp(recorded["temperature"]) > 10.0
    assert not recorded["heat"][2000:3000].any()


def test_no_spike_is_recorded_while_a_population_is_off() -> None:
    population = {
        "inputs": {"x": "Scalar", "enable": "Scalar"},
        "outputs": {"spikes": "neurons.spikes"},
        "blocks": {"enable": {"type": "Enable"}, "neurons": {"type": "Ensemble", "neurons": 20}},
        "wires": {"enable": {"input": "inputs.enable"}, "neurons": {"input": "inputs.x"}},
    }
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 0.2},
            "blocks": {
                "x": {"type": "Constant", "value": 0.8},
                "on": {"type": "Pulse", "period": 0.2, "width": 0.1},
                "population": population,
            },
            "wires": {"population": {"x": "x.value", "enable": "on.out"}},
            "probes": {"spikes": "population.spikes"},
        }
    )
    spikes = graph.run()["spikes"]
    assert spikes[:100].any()
    assert not spikes[101:].any()


def test_a_linearization_at_a_time_when_a_part_is_off() -> None:
    graph = runtime.load("gallery/night_setback")
    by_night = graph.linearize(["target.value"], ["room.out"], at=1.0)
    by_day = graph.linearize(["target.value"], ["room.out"], at=8.0)
    assert sorted(by_night.poles.real) == pytest.approx([-0.2, 0.0], abs=1e-6)
    # s^2 + (0.2 + 1.5) s + 0.6
    root = math.sqrt(1.7**2 - 4 * 0.6)
    expected = [(-1.7 - root) / 2, (-1.7 + root) / 2]
    assert sorted(by_day.poles.real) == pytest.approx(expected, abs=1e-6)


def test_explain_says_what_switches_a_block(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["explain", "gallery/night_setback"]) == 0
    assert "from input, while control.enable.on" in capsys.readouterr().out
    assert run(["explain", "gallery/night_setback", "--code"]) == 0
    text = capsys.readouterr().out
    assert "if control_enable_on:" in text


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("part.wires.enable.input", "delay.out", "is in the part that 'part.enable' switches"),
        ("part.blocks.enable.while_off", "rest", "expected one of hold, reset"),
        ("part.blocks.enable.off", "reset", "unknown parameter"),
        ("part.blocks.total", {"type": "Integrator"}, "its states are continuous"),
        ("part.inputs.enable", "Pose", "Pose"),
        ("blocks.extra", {"type": "Enable"}, "not in one"),
    ],
)
def test_mistakes_are_reported(path: str, value: Any, message: str) -> None:
    graph = switched()
    if "continuous" in message:
        graph = graph.set("part.blocks.enable", {"type": "Trigger"})
    with pytest.raises(GraphError, match=message):
        graph.set(path, value).check()


def test_a_loop_through_what_switches_a_part_is_reported(tmp_path: Path) -> None:
    graph = switched().set("blocks.back", {"type": "Compare", "value": 1.0})
    graph = graph.wire("back.input", "part.out").wire("part.enable", "back.out")
    with pytest.raises(GraphError, match=r"algebraic loop.*part\.enable\.on ▸ part\.twice"):
        graph.program()


def test_such_a_loop_is_reported_at_its_first_wire(tmp_path: Path) -> None:
    """Between what switches and what is switched there is no wire, and so no place."""
    (tmp_path / "g.yaml").write_text(
        "blocks:\n"
        "  a:\n"
        "    inputs: {switch: Scalar}\n"
        "    outputs: {out: twice.out}\n"
        "    blocks: {enable: {type: Enable}, twice: {type: Gain, gain: 2.0}, t: {type: Clock}}\n"
        "    wires: {enable: {input: inputs.switch}, twice: {input: t.time}}\n"
        "  z: {type: Compare, value: 1.0}\n"
        "wires:\n"
        "  a: {switch: z.out}\n"
        "  z: {input: a.out}\n"
    )
    graph = runtime.load(tmp_path / "g.yaml")
    with pytest.raises(
        GraphError, match=r"g\.yaml:10:14: algebraic loop: a\.enable\.on ▸ a\.twice"
    ):
        graph.program()
