"""Linearization against closed forms and scipy."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import blocks
import runtime
from runtime.errors import UsageError
from runtime.graph import Graph
from tests.conftest import Run
from tests.runtime.engine.test_continuous import OSCILLATOR, Pendulum, graph_of


def pendulum(theta0: float = 0.0) -> Graph:
    return runtime.Graph(dt=0.01, until=5.0).add("p", Pendulum(theta0=theta0))


def test_a_pendulum_at_rest_and_upright() -> None:
    for theta, sign in ((0.0, -1.0), (math.pi, 1.0)):
        found = pendulum().linearize(["p.torque"], ["p.angle"], states={"p.theta": theta})
        assert found.states == ("p.theta", "p.omega")
        np.testing.assert_allclose(found.a, [[0.0, 1.0], [sign * 9.81, 0.0]], atol=1e-8)
        np.testing.assert_allclose(found.b, [[0.0], [1.0]], atol=1e-9)
        np.testing.assert_allclose(found.c, [[1.0, 0.0]], atol=1e-9)
        np.testing.assert_allclose(found.d, [[0.0]], atol=1e-9)
        expected = sorted(np.roots([1.0, 0.0, -sign * 9.81]), key=lambda p: (-p.real, p.imag))
        np.testing.assert_allclose(found.poles, expected, atol=1e-6)


def test_the_operating_point_is_found_by_running() -> None:
    found = pendulum(1.0).linearize(["p.torque"], ["p.theta"], at=0.5)
    run = pendulum(1.0).probe("p.theta").run()
    theta = float(np.ravel(run["p.theta"])[50])
    assert found.t == 0.5
    assert found.point[0] == pytest.approx(theta, abs=1e-12)
    assert found.a[1, 0] == pytest.approx(-9.81 * math.cos(theta), abs=1e-7)


def test_blocks_between_states_are_part_of_it() -> None:
    """x'' = -x over three blocks, driven at the gain's input and read behind it."""
    found = graph_of(OSCILLATOR).linearize(["spring.input"], ["spring.out", "speed.integral"])
    assert found.states == ("position.integral", "speed.integral")
    np.testing.assert_allclose(found.a, [[0.0, 1.0], [-1.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(found.b, [[0.0], [-1.0]], atol=1e-9)
    np.testing.assert_allclose(found.c, [[-1.0, 0.0], [0.0, 1.0]], atol=1e-9)
    np.testing.assert_allclose(found.d, [[-1.0], [0.0]], atol=1e-9)


def test_a_linear_system_is_found_again_through_its_source() -> None:
    a, b = [[0.0, 1.0], [-2.0, -3.0]], [[1.0, 0.0], [0.5, 2.0]]
    c, d = [[1.0, 2.0], [0.0, 1.0]], [[0.1, 0.2], [0.3, 0.4]]
    graph = runtime.Graph(dt=0.01, until=1.0).add("s", blocks.StateSpace(A=a, B=b, C=c, D=d))
    graph = graph.add("u", blocks.Constant(value=[1.0, -1.0], signal="Vector"))
    graph = graph.connect("u.value", "s.input")
    found = graph.linearize(["u.value"], ["s.out"], at=0.3)
    for name, expected in (("a", a), ("b", b), ("c", c), ("d", d)):
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-8)
    assert found.inputs == ("u.value.0", "u.value.1")
    assert found.outputs == ("s.out.0", "s.out.1")
    from scipy import signal

    numerators, denominator = signal.ss2tf(np.array(a), np.array(b), np.array(c), np.array(d))
    system = found.system()
    np.testing.assert_allclose(
        signal.ss2tf(system.A, system.B, system.C, system.D)[0], numerators, atol=1e-7
    )
    assert denominator[0] == 1.0


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"),
    [
        (["spring.inpt"], [], "'spring' has no output or state 'inpt'"),
        ([], ["positon.out"], "did you mean 'position'"),
        (["position.integral"], [], "expected an input or output of a block"),
    ],
)
def test_wrong_addresses(inputs: list[str], outputs: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        graph_of(OSCILLATOR).linearize(inputs, outputs)


def test_states_that_do_not_exist_and_graphs_without_any() -> None:
    with pytest.raises(UsageError, match="no state 'p.thet', did you mean 'p.theta'"):
        pendulum().linearize([], [], states={"p.thet": 0.0})
    with pytest.raises(UsageError, match="the graph has no states"):
        runtime.Graph().add("c", blocks.Constant(value=1.0)).linearize()


TANK = {
    "run": {"dt": 0.01, "until": 2.0},
    "blocks": {
        "f": {"type": "Constant", "value": [1.0, 2.0], "signal": "Vector(2)"},
        "p": {
            "type": "DynamicSystem",
            "states": ["V", "W"],
            "names": ["F", "G"],
            "let": {"Q": "V**2"},
            "derivative": ["F - Q", "G - V*W"],
            "initial": [1, 2],
        },
        "hold": {"type": "UnitDelay", "dt": 0.05},
        "cart": {"type": "Unicycle"},
        "k": {"type": "Constant", "value": [1.0, 0.0], "signal": "Twist"},
    },
    "wires": {
        "p": {"u": ["f.value[0]", "f.value[1]"]},
        "hold": {"input": "p.out"},
        "cart": {"command": "k.value"},
    },
}


def test_every_name_that_is_printed_is_accepted() -> None:
    """As an output, an input, a state's value, a cut; each is what it is among all others."""
    graph = runtime.load(TANK)
    whole = graph.linearize(["f.value", "k.value"], ["p.x", "p.out", "cart.pose"])
    for number, name in enumerate(whole.inputs):
        for other, output in enumerate(whole.outputs):
            one = graph.linearize([name], [output])
            assert (one.inputs, one.outputs) == ((name,), (output,))
            np.testing.assert_allclose(one.b[:, 0], whole.b[:, number], atol=1e-9)
            np.testing.assert_allclose(one.c[0], whole.c[other], atol=1e-9)
    sampled = graph.linearize(["f.value"], ["hold.out"])
    for states in (whole.states, sampled.states):
        assert graph.linearize([], list(states)).outputs == states
    np.testing.assert_allclose(
        graph.linearize([], list(whole.states)).c, np.eye(len(whole.states)), atol=1e-9
    )
    for name, at in zip(whole.states, whole.point, strict=True):
        moved = graph.linearize([], states={name: at + 0.25})
        assert moved.point[moved.states.index(name)] == at + 0.25
    assert whole.outputs[:2] == ("p.x.V", "p.x.W")
    a = graph.linearize(["f.value.0"], ["p.x.V"])
    assert a.a[a.states.index("p.x.V"), a.states.index("p.x.V")] == pytest.approx(-2.0, abs=1e-6)
    np.testing.assert_array_equal(
        graph.linearize([], ["p.x.0"]).c, graph.linearize([], ["p.x.V"]).c
    )
    assert graph.linearize([], ["p.x[0:2]"]).outputs == ("p.x.V", "p.x.W")
    assert graph.linearize([], ["p.out[1:2]"]).outputs == (whole.outputs[3],)


def test_a_component_at_which_a_loop_is_cut_is_the_same_by_any_name() -> None:
    system = blocks.DynamicSystem(derivative=["-x[0] + u[0]", "-2*x[1] + u[1]"], initial=[0, 0])
    graph = runtime.Graph(dt=0.01, until=1.0).add("p", system)
    graph = graph.connect("p.out[0]", "p.u").connect("p.out[1]", "p.u")
    one, other = graph.linearize(opened="p.out.1"), graph.linearize(opened="p.out[1]")
    np.testing.assert_allclose(one.a, other.a)
    np.testing.assert_allclose(one.a, [[0.0, 0.0], [0.0, -2.0]], atol=1e-8)
    np.testing.assert_allclose(one.c, other.c)


@pytest.mark.slow
def test_the_command(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(graph_of(OSCILLATOR).to_yaml(), encoding="utf-8")
    line = ["linearize", "g.yaml", "--inputs", "spring.input", "--outputs", "position.out"]
    done = cli(*line, "--state", "position.integral=2", "-o", "bode.png")
    assert done.returncode == 0, done.stderr
    assert "position.integral = 2" in done.stdout
    assert "Poles (1/s)" in done.stdout
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    found = json.loads(cli(*line, "--json").stdout)
    np.testing.assert_allclose(found["A"], [[0, 1], [-1, 0]], atol=1e-9)
    wrong = cli(*line, "-o", "bode.xyz")
    assert wrong.returncode == 2
    assert "expected a file that ends in" in wrong.stderr


def test_a_point_without_a_value_is_an_error() -> None:
    system = blocks.DynamicSystem(derivative="-sqrt(x[0])", initial=1.0)
    graph = runtime.Graph(dt=0.01, until=1.0).add("tank", system)
    assert graph.linearize().poles.real.tolist() == pytest.approx([-0.5], rel=1e-6)
    with pytest.raises(UsageError, match="no value at the operating point.*--at or --state"):
        graph.linearize(states={"tank.x": -1.0})
