"""Loops that are cut, and their margins, against closed forms and python-control."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import blocks
import runtime
from runtime.errors import MissingExtraError, UsageError
from runtime.plots.linear import step_end
from runtime.runs import margins, step_info
from tests.conftest import Run
from tests.runtime.runs.test_sampled_linearization import A, B, loop

ct = pytest.importorskip("control")


def test_a_cut_pid_loop_is_its_transfer_function() -> None:
    found = runtime.load("gallery/pid_loop").linearize(opened="pid.out")
    s = ct.tf("s")
    expected = (3.0 + 2.0 / s + 0.1 * s / (1.0 + s / 10.0)) * 0.3 / s
    system = found.to_control()
    assert system.input_labels == ["pid_out"]
    assert system.state_labels == ["pid_integral", "pid_filtered", "plant_integral"]
    for w in (0.1, 1.0, 10.0):
        assert complex(system(1j * w)) == pytest.approx(complex(expected(1j * w)), rel=1e-9)
    gm, pm, _, wpc = ct.margin(expected)
    got = margins(found)
    assert (got.gain, got.phase) == pytest.approx((gm, pm), rel=1e-6)
    assert got.delay == pytest.approx(math.radians(pm) / got.phase_at, rel=1e-9)
    assert math.isnan(wpc) or wpc > 0.0
    assert got.is_stable


@pytest.mark.slow
def test_a_sampled_loop_that_is_cut() -> None:
    """L(z) of a gain at 10 ms before the unstable plant, by scipy's zero-order hold."""
    graph = loop({"type": "Gain", "gain": 60.0, "dt": 0.01})
    found = graph.linearize(opened="control.out")
    plant = ct.c2d(ct.ss(A, B, [[1.0, 0.2]], 0.0), 0.01)
    system = found.to_control()
    assert system.dt == 0.01
    for w in (1.0, 30.0, 200.0):
        z = np.exp(0.01j * w)
        assert complex(system(z)) == pytest.approx(60.0 * complex(plant(z)), rel=1e-8)
    got = margins(found)
    assert got.is_stable
    # 1 / S at its smallest: the distance from -1.
    w = np.geomspace(0.1, math.pi / 0.01, 200_000)
    closest = np.abs(1.0 + 60.0 * plant(np.exp(0.01j * w))).min()
    assert got.modulus == pytest.approx(closest, rel=1e-4)
    assert got.sensitivity == pytest.approx(1.0 / closest, rel=1e-4)


def test_integrators_that_are_sampled_fast_have_no_margins_by_rounding() -> None:
    graph = runtime.load("gallery/balanced_pole").without("noise")
    got = margins(graph.linearize(states={"cart.x": 0.0}, opened="lqr.command"))
    assert got.is_stable
    assert 0.1 < got.gain_at < 160.0
    # With the gain of its margin, the loop is at the boundary.
    for factor, stable in ((got.gain * 0.99, False), (got.gain * 1.01, True)):
        scaled = graph.add("by", blocks.Gain(gain=factor)).connect("lqr.command", "by.input")
        scaled = scaled.wire("cart.force", "by.out").wire("observer.control", "by.out")
        assert scaled.linearize(states={"cart.x": 0.0}).is_stable == stable


@pytest.mark.parametrize("dt", [None, 0.01])
def test_an_unstable_plant_has_a_smallest_gain(dt: float | None) -> None:
    gain = {"type": "Gain", "gain": 90.0, **({} if dt is None else {"dt": dt})}
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 1.0},
            "blocks": {
                "ref": {"type": "Constant", "value": 0.0},
                "error": {"type": "Sum", "signs": [1, -1]},
                "k": gain,
                "p": {"type": "TransferFunction", "numerator": [1], "denominator": [1, 8, -62.1]},
            },
            "wires": {
                "error": {"terms": ["ref.value", "p.out"]},
                "k": {"input": "error.out"},
                "p": {"input": "k.out"},
            },
        }
    )
    got = margins(graph.linearize(opened="k.out"))
    # 1 + g / (s^2 + 8 s - 62.1) is stable for every g above 62.1.
    assert got.is_stable
    assert got.gain == pytest.approx(62.1 / 90.0, rel=1e-9)
    assert got.gain_at == 0.0


def delayed(plant: dict[str, object], delay: float) -> runtime.Graph:
    """A loop around a plant and a delay, with a step of 1 ms."""
    return runtime.load(
        {
            "run": {"dt": 0.001, "until": 1.0},
            "blocks": {
                "r": {"type": "Constant", "value": 0.0},
                "e": {"type": "Sum", "signs": [1, -1]},
                "p": plant,
                "d": {"type": "Delay", "delay": delay},
            },
            "wires": {
                "e": {"terms": ["r.value", "d.out"]},
                "p": {"input": "e.out"},
                "d": {"input": "p.out"},
            },
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["d.out", "e.out"])
def test_a_loop_with_a_delay_of_hundreds_of_ticks(cut: str) -> None:
    """2 exp(-0.3 s) / (s + 1), with the plant held for a tick."""
    plant = {"type": "TransferFunction", "numerator": [2], "denominator": [1, 1]}
    found = delayed(plant, 0.3).linearize(opened=cut)
    got = margins(found)
    assert got.is_stable
    assert got.phase_at == pytest.approx(math.sqrt(3.0), rel=1e-6)
    # The tick for which the plant is held is a delay of half a tick.
    assert got.phase == pytest.approx(120.0 - math.degrees(0.3005 * math.sqrt(3.0)), abs=1e-4)
    assert got.delay == pytest.approx(math.radians(got.phase) / got.phase_at, rel=1e-12)
    # atan(w) + 0.3005 w = pi, and the gain there.
    w = got.gain_at
    assert math.atan(w) + 0.3005 * w == pytest.approx(math.pi, rel=1e-6)
    assert got.gain == pytest.approx(math.hypot(1.0, w) / 2.0, rel=1e-5)
    # A pole at z = 0 is s = -inf, without an imaginary part.
    assert np.isneginf(found.equivalent[1:].real).all()
    assert (found.equivalent[1:].imag == 0.0).all()


@pytest.mark.slow
def test_an_integrator_with_a_delay() -> None:
    """k exp(-s d) / s: the gain margin is pi / (2 k d), the phase margin pi / 2 - k d."""
    plant = {"type": "TransferFunction", "numerator": [4], "denominator": [1, 0]}
    got = margins(delayed(plant, 0.2).linearize(opened="d.out"))
    assert got.gain == pytest.approx(math.pi / (2.0 * 4.0 * 0.2005), rel=1e-5)
    assert got.gain_at == pytest.approx(math.pi / (2.0 * 0.2005), rel=1e-6)
    assert got.phase == pytest.approx(math.degrees(math.pi / 2.0 - 4.0 * 0.2005), abs=1e-3)
    assert got.is_stable


def test_a_short_delay_is_what_python_control_makes_of_it() -> None:
    plant = {"type": "TransferFunction", "numerator": [200], "denominator": [1, 20, 0]}
    found = delayed(plant, 0.006).linearize(opened="d.out")
    late = ct.tf([1], [1, *([0] * 6)], 0.001)
    expected = ct.c2d(ct.tf([200], [1, 20, 0]), 0.001) * late
    got = margins(found)

    def at(w: float) -> complex:
        return complex(expected(np.exp(0.001j * w)))

    assert at(got.gain_at) == pytest.approx(-1.0 / got.gain, rel=1e-8)
    assert at(got.phase_at) == pytest.approx(-np.exp(1j * math.radians(got.phase)), rel=1e-8)
    closest = min(abs(1.0 + at(w)) for w in np.geomspace(1.0, 100.0, 5_000))
    assert got.modulus == pytest.approx(closest, rel=1e-5)


def test_a_component_of_a_command_is_cut_alone() -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.0},
            "blocks": {
                "k": {"type": "Gain", "gain": [-2.0, -3.0], "signal": "Vector(2)"},
                "x": {"type": "Integrator", "initial": [1.0, 1.0]},
            },
            "wires": {"k": {"input": "x.out"}, "x": {"input": "k.out"}},
        }
    )
    found = graph.linearize(opened="k.out.1")
    assert found.inputs == ("k.out.1",)
    np.testing.assert_allclose(found.a, [[-2.0, 0.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(found.b, [[0.0], [1.0]], atol=1e-12)
    np.testing.assert_allclose(found.c, [[0.0, 3.0]], atol=1e-12)
    # L = 3 / s: 90 degrees at 3 rad/s.
    assert margins(found).phase == pytest.approx(90.0)
    assert margins(found).phase_at == pytest.approx(3.0, rel=1e-6)
    with pytest.raises(UsageError, match="expected one input and one output, got 2 and 2"):
        margins(graph.linearize(opened="k.out"))


def test_the_numbers_of_a_step_response() -> None:
    graph = runtime.load("gallery/pid_loop")
    found = graph.linearize(["setpoint.out"], ["gain.out"])
    expected = ct.step_info(ct.ss(found.a, found.b, found.c, found.d))
    assert step_info(found) == pytest.approx(expected)
    with pytest.raises(UsageError, match="not stable, so its step response has no final value"):
        step_info(graph.linearize(opened="pid.out"))


def test_step_responses_of_unstable_systems_end_early() -> None:
    # Growth by 30, not 2e175.
    assert step_end(np.array([4.84 + 0j, -0.083])) == pytest.approx(math.log(30.0) / 4.84)
    assert step_end(np.array([-0.5 + 0j, -10.0])) == pytest.approx(14.0)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(
        MissingExtraError, match=r"needs an optional extra: pip install .*\[control\]"
    ):
        runtime.load("gallery/pid_loop").linearize(opened="pid.out").to_control()


@pytest.mark.slow
def test_the_command_draws_each_figure(cli: Run, tmp_path: Path) -> None:
    for name, more in (
        ("margins", ["--open", "pid.out", "--margins"]),
        ("nyquist", ["--open", "pid.out", "--nyquist"]),
        ("locus", ["--rlocus", "blocks.pid.ki=0.1..10"]),
        ("step", ["--inputs", "setpoint.out", "--outputs", "gain.out", "--step"]),
    ):
        done = cli("linearize", "gallery/pid_loop", *more, "-o", f"{name}.png")
        assert done.returncode == 0, done.stderr
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    found = json.loads(
        cli("linearize", "gallery/pid_loop", "--open", "pid.out", "--margins", "--json").stdout
    )
    assert found["margins"]["phase"] == pytest.approx(59.17, abs=0.01)
    assert found["opened"] == "pid.out"
    wrong = cli("linearize", "gallery/pid_loop", "--nyquist")
    assert wrong.returncode == 2
    assert "name the file of the figure: -o FILE" in wrong.stderr
