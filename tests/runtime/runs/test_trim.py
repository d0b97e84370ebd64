"""Equilibria against closed forms, and the overlays that begin a run there."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from runtime.errors import UsageError
from runtime.graph import Graph
from tests.conftest import Run


def pendulum(**more: Any) -> Graph:
    graph = runtime.Graph("swing", dt=0.01, until=2.0).add("p", blocks.Pendulum(**more))
    graph = graph.add("torque", blocks.Constant(value=0.0))
    return graph.connect("torque.value", "p.torque")


def test_the_torque_that_holds_a_pendulum() -> None:
    found = pendulum().trim(["torque.value"], ["p.rate"], fixed={"p.angle": 0.5})
    assert found.is_equilibrium
    assert found.inputs["torque.value"] == pytest.approx(9.81 * math.sin(0.5), rel=1e-9)
    assert found.states["p.x.0"] == pytest.approx(0.5, abs=1e-9)
    assert found.outputs == pytest.approx({"p.rate": 0.0, "p.angle": 0.5}, abs=1e-9)


def test_a_run_from_the_overlay_stays_there(tmp_path: Path, cli: Run) -> None:
    (tmp_path / "g.yaml").write_text(pendulum().probe("p.angle").to_yaml(), encoding="utf-8")
    line = ["linearize", "g.yaml", "--inputs", "torque.value", "--fix", "p.angle=0.5"]
    done = cli(*line, "--trim", "rest.yaml")
    assert done.returncode == 0, done.stderr
    assert "no equilibrium" not in done.stdout
    # theta'' = -g cos(theta) theta there.
    assert f"-{9.81 * math.cos(0.5):.4g}" in done.stdout
    ran = runtime.load(tmp_path / "g.yaml").overlay(tmp_path / "rest.yaml").run()
    np.testing.assert_allclose(ran["p_angle"], 0.5, atol=1e-7)
    # Without the input there is none at this angle, and it says what moves.
    failed = cli("linearize", "g.yaml", "--trim", "no.yaml", "--fix", "p.x.0=0.5")
    assert failed.returncode == 1
    assert "no equilibrium found; the nearest point has p.x.1'" in failed.stderr
    assert not (tmp_path / "no.yaml").exists()


def test_bounds_choose_among_equilibria() -> None:
    upright = pendulum().trim(bounds={"p.x.0": (2.0, 4.0)})
    assert upright.states["p.x.0"] == pytest.approx(math.pi, abs=1e-7)


def test_an_open_input_gets_a_constant() -> None:
    graph = runtime.Graph(dt=0.01, until=1.0).add("p", blocks.Pendulum())
    found = graph.trim(["p.torque"], fixed={"p.x.0": 0.2})
    assert found.inputs["p.torque"] == pytest.approx(9.81 * math.sin(0.2), rel=1e-9)
    rest = graph.overlay(dict(found.overlay)).probe("p.angle").run()
    np.testing.assert_allclose(rest["p_angle"], 0.2, atol=1e-8)


def test_a_sampled_integral_is_part_of_it() -> None:
    """A DiscretePID holds a pendulum at 0.3: its integral is the torque at rest."""
    graph = runtime.load(
        {
            "run": {"dt": 0.002, "until": 1.0},
            "blocks": {
                "r": {"type": "Constant", "value": 0.3},
                "e": {"type": "Sum", "signs": [1, -1]},
                "pid": {"type": "DiscretePID", "kp": 30.0, "ki": 20.0, "kd": 5.0, "dt": 0.01},
                "p": {"type": "Pendulum"},
            },
            "wires": {
                "e": {"terms": ["r.value", "p.angle"]},
                "pid": {"error": "e.out"},
                "p": {"torque": "pid.out"},
            },
        }
    )
    moving = graph.linearize().moving
    assert {name for name, _ in moving} >= {"p.x.1", "pid.integral"}
    found = graph.trim()
    assert found.is_equilibrium
    assert found.states["pid.integral"] == pytest.approx(9.81 * math.sin(0.3), rel=1e-6)
    at_rest = graph.overlay(dict(found.overlay)).linearize(["r.value"], ["p.angle"])
    assert at_rest.moving == ()
    assert at_rest.is_stable


def test_what_an_overlay_cannot_hold_is_an_error() -> None:
    graph = pendulum()
    with pytest.raises(UsageError, match="'p.torque' is wired; name a Constant"):
        graph.trim(["p.torque"])
    sine = graph.add("s", blocks.Sine()).wire("p.torque", "s.out")
    with pytest.raises(UsageError, match="'s.out' is the output of a Sine"):
        sine.trim(["s.out"])
    with pytest.raises(UsageError, match="'p' has no output or state 'angel'"):
        graph.trim(fixed={"p.angel": 1.0})


def test_initial_states_as_numbers() -> None:
    graph = pendulum().overlay({"initial": {"p.x": [0.1, 0.2]}})
    assert graph.probe("p.x").run()["p_x"][0].tolist() == [0.1, 0.2]
    with pytest.raises(runtime.GraphError, match=r"shape \(2,\), what is given \(3,\)"):
        pendulum().overlay({"initial": {"p.x": [0.1, 0.2, 0.3]}}).check()
    with pytest.raises(runtime.GraphError, match="expected numbers"):
        pendulum().overlay({"initial": {"p.x": [0.1, "a"]}}).check()
