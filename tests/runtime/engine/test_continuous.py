"""Continuous states: which order the solvers reach, what is held, how failures are reported."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Block, Input, Output, Scalar, State, check_block, param
from blocks.core import DeclarationError
from runtime.errors import GraphError, SimulationError
from runtime.graph import Graph

OSCILLATOR: dict[str, Any] = {
    "run": {"dt": 0.1, "until": 10.0, "engine": "python"},
    "blocks": {
        "position": {"type": "Integrator", "initial": 1.0, "signal": "Scalar"},
        "speed": {"type": "Integrator"},
        "spring": {"type": "Gain", "gain": -1.0},
    },
    "wires": {
        "position": {"input": "speed.out"},
        "speed": {"input": "spring.out"},
        "spring": {"input": "position.out"},
    },
    "probes": {"x": "position.out"},
}


class Pendulum(Block):
    """A pendulum in two states.

    torque ─▶ [ Pendulum ] ─▶ angle
    """

    torque = Input(Scalar, default=0.0, doc="torque per inertia")
    angle = Output(Scalar, unit="rad", doc="angle")

    stiffness: float = param(9.81, doc="g / length")
    theta0: float = param(0.5, unit="rad", doc="initial angle")

    theta = State(unit="rad", continuous=True)
    omega = State(unit="rad/s", continuous=True)

    def start(self, state: Any) -> None:
        state.theta[...] = self.theta0

    def output(self, state: Any, t: float) -> float:
        return float(state.theta)

    def derivative(self, state: Any, t: float, torque: float) -> tuple[float, float]:
        return float(state.omega), torque - self.stiffness * math.sin(float(state.theta))


class Clock(Block):
    """The time.

    [ Clock ] ─▶ t
    """

    now = Output(Scalar, doc="the time")

    def output(self, state: Any, t: float) -> float:
        return t


class Blowup(Block):
    """A state whose rate is not a number after half a second.

    x ─▶ [ Blowup ] ─▶ y
    """

    y = Output(Scalar, doc="x")
    x = State(2, continuous=True)

    def output(self, state: Any, t: float) -> float:
        return float(state.x[0])

    def derivative(self, state: Any, t: float) -> tuple[float, float]:
        return 1.0, math.nan if t > 0.5 else 0.0


def graph_of(document: dict[str, Any], **run: Any) -> Graph:
    graph = runtime.load(document)
    for key, value in run.items():
        graph = graph.set(f"run.{key}", value)
    return graph


def alone(block: Block, *probes: str, dt: float = 0.1, until: float = 3.0) -> Graph:
    """A graph of one block under the Python engine."""
    graph = runtime.Graph(dt=dt, until=until).add("b", block).set("run.engine", "python")
    for probe in probes or ("b.y",):
        graph = graph.probe(probe)
    return graph


def order(errors: list[float]) -> float:
    return math.log2(errors[0] / errors[1])


@pytest.mark.parametrize(("solver", "expected"), [("euler", 1), ("heun", 2), ("rk4", 4)])
def test_a_loop_over_separate_blocks_converges_at_the_order_of_the_solver(
    solver: str, expected: int
) -> None:
    errors = []
    for dt in (0.01, 0.005):
        x = np.asarray(graph_of(OSCILLATOR, solver=solver, dt=dt, until=2.0).run()["x"])
        errors.append(abs(x - np.cos(dt * np.arange(len(x)))).max())
    assert abs(order(errors) - expected) < 0.2


def test_several_states_in_one_block_conserve_energy() -> None:
    result = alone(Pendulum(), "b.theta", "b.omega", dt=0.01, until=10.0).run()
    theta, omega = np.asarray(result["b.theta"]).ravel(), np.asarray(result["b.omega"]).ravel()
    energy = 0.5 * omega**2 - 9.81 * np.cos(theta)
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)


def test_blocks_that_read_the_time_are_evaluated_at_each_stage() -> None:
    """The integral of t^3 is exact with rk4 (Simpson's rule), whatever the step."""
    graph = runtime.Graph(dt=0.5, until=5.0).set("run.engine", "python").add("t", Clock())
    graph = graph.add("gain", blocks.Gain(gain=6.0)).connect("t.now", "gain.input")
    source = "gain.out"
    for name in "abc":
        graph = graph.add(name, blocks.Integrator(signal="Scalar")).connect(source, f"{name}.input")
        source = f"{name}.out"
    y = np.asarray(graph.probe("c.out").run()["c.out"])
    np.testing.assert_allclose(y, (0.5 * np.arange(10)) ** 4 / 4.0, atol=1e-12)


def test_sampled_outputs_hold() -> None:
    """A gain with a dt is a sample and hold: x' = -x(t_k) is Euler's method, to the bit."""
    document = {
        "run": {"dt": 0.1, "until": 3.0, "engine": "python"},
        "blocks": {
            "x": {"type": "Integrator", "initial": 1.0, "signal": "Scalar"},
            "back": {"type": "Gain", "gain": -1.0, "dt": 0.1},
        },
        "wires": {"x": {"input": "back.out"}, "back": {"input": "x.out"}},
        "probes": {"x": "x.out"},
    }
    x = np.asarray(graph_of(document).run()["x"])
    np.testing.assert_allclose(x, 0.9 ** np.arange(30), rtol=1e-12)
    text = graph_of(document).program().source()
    assert text.count("back.output(") == 1


def test_the_text_of_a_graph_without_continuous_states_has_no_stages() -> None:
    text = runtime.load("line_actuator_failure").program().source()
    assert "stage" not in text
    assert "states" not in text


def test_a_state_that_is_no_number_names_block_state_tick_and_time() -> None:
    with pytest.raises(SimulationError) as caught:
        alone(Blowup()).run()
    assert str(caught.value) == (
        "block 'b' at tick 5 (t = 0.5 s): the derivative of state 'x[1]' is not finite: nan "
        "(stage 2 of the solver, t = 0.55 s)"
    )


def test_an_exception_in_a_stage_names_its_block() -> None:
    class Breaks(Blowup):
        """Fails."""

        def derivative(self, state: Any, t: float) -> tuple[float, float]:
            return 1.0 / (0.0 if t > 0.5 else 1.0), 0.0

    with pytest.raises(SimulationError, match="block 'b' at tick 5 .*ZeroDivisionError"):
        alone(Breaks()).run()


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (1.0, r"must be numbers of shape \(2,\), got 1.0"),
        ((1.0, 2.0, 3.0), r"must be numbers of shape \(2,\)"),
        ("ab", r"must be numbers of shape \(2,\), got 'ab'"),
    ],
)
def test_a_derivative_of_the_wrong_form(returned: Any, message: str) -> None:
    class Wrong(Blowup):
        """Returns something else."""

        def derivative(self, state: Any, t: float) -> Any:
            return returned

    with pytest.raises(SimulationError, match=f"block 'b' at tick 0 .*{message}"):
        alone(Wrong()).run()


def test_a_continuous_block_has_no_step_of_its_own() -> None:
    document = {**OSCILLATOR, "blocks": {**OSCILLATOR["blocks"]}}
    document["blocks"]["speed"] = {"type": "Integrator", "dt": 0.2}
    with pytest.raises(GraphError, match=r"blocks.speed.dt: its states are continuous"):
        graph_of(document).check()


def test_an_unknown_solver() -> None:
    with pytest.raises(GraphError, match="run.solver: no solver .*'rk5', did you mean 'rk4'"):
        graph_of(OSCILLATOR, solver="rk5").check()


def test_declarations_that_do_not_fit() -> None:
    with pytest.raises(DeclarationError, match="'x' but has no method derivative"):

        class NoDerivative(Block):
            x = State(3, continuous=True)

    with pytest.raises(DeclarationError, match="the class has no continuous state"):

        class NoState(Block):
            def derivative(self, state: Any, t: float) -> float:
                return 0.0

    with pytest.raises(DeclarationError, match="cannot be cached"):

        class Both(Block):
            x = State(3, continuous=True, cached=True)

            def derivative(self, state: Any, t: float) -> float:
                return 0.0

    with pytest.raises(DeclarationError, match=r"project must take \(self, state\)"):

        class Wrong(Block):
            x = State(3, continuous=True)

            def derivative(self, state: Any, t: float) -> float:
                return 0.0

            def project(self, state: Any, t: float) -> None: ...


def test_check_block_checks_derivatives() -> None:
    check_block(Pendulum())

    class Impure(Pendulum):
        """Writes into its state."""

        def derivative(self, state: Any, t: float, torque: float) -> tuple[float, float]:
            state.omega[...] += 1.0
            return 0.0, 0.0

    class Short(Pendulum):
        """One value too few."""

        def derivative(self, state: Any, t: float, torque: float) -> Any:
            return 0.0

    class Infinite(Pendulum):
        """Not finite."""

        def derivative(self, state: Any, t: float, torque: float) -> tuple[float, float]:
            return math.inf, 0.0

    for cls, message in (
        (Impure, "derivative: changes 'omega' of the state"),
        (Short, r"one value per continuous state \(theta, omega\), got 0.0"),
        (Infinite, "state 'theta': its rate of change is not finite: inf"),
    ):
        with pytest.raises(Exception, match=message):
            check_block(cls())
