"""Continuous states: which order the solvers reach, what is held, how failures are reported."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blocks
import runtime
from blocks import Block, Input, Output, Scalar, State, param
from blocks.core import DeclarationError
from runtime import check_block
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


class Pulse(Block):
    """One for a hundredth of a second at t = 0.5.

    [ Pulse ] ─▶ y
    """

    y = Output(Scalar, doc="the integral")
    x = State(continuous=True)

    def output(self, state: Any, t: float) -> float:
        return float(state.x)

    def derivative(self, state: Any, t: float) -> float:
        return 1.0 if 0.5 <= t < 0.51 else 0.0


class Escape(Block):
    """x' = 1 + x^2: x = tan(t), which is infinite at pi / 2.

    [ Escape ] ─▶ y
    """

    y = Output(Scalar, doc="x")
    x = State(continuous=True)

    def output(self, state: Any, t: float) -> float:
        return 0.0

    def derivative(self, state: Any, t: float) -> float:
        return 1.0 + float(state.x) ** 2


class Opaque(Block):
    """A gain that does not compile.

    x ─▶ [ Opaque ] ─▶ y
    """

    x = Input(Scalar, doc="any number")
    y = Output(Scalar, doc="-x")

    def start(self, state: Any) -> None:
        state.table = {"factor": -1.0}

    def output(self, state: Any, t: float, x: float) -> float:
        return float(state.table["factor"] * x)


def swinging(**run: Any) -> Graph:
    """A pendulum driven by a sampled gain, a linear system, and an integrator of a vector."""
    graph = runtime.Graph(dt=0.02, until=2.0).add("p", Pendulum())
    graph = graph.add("gain", blocks.Gain(gain=-0.3), dt=0.1).connect("p.angle", "gain.input")
    graph = graph.connect("gain.out", "p.torque")
    matrices = {"A": [[0, 1], [-4, -1]], "B": [0, 1], "C": [[1, 0], [0, 1]], "D": [[0], [1]]}
    graph = graph.add("filter", blocks.StateSpace(**matrices)).connect("p.angle", "filter.input")
    graph = graph.add("sum", blocks.Integrator(upper=0.1)).connect("filter.out", "sum.input")
    graph = graph.add("opposite", blocks.Gain(gain=2.0)).connect("sum.out", "opposite.input")
    graph = graph.add("twice", blocks.Integrator()).connect("opposite.out", "twice.input")
    for key, value in run.items():
        graph = graph.set(f"run.{key}", value)
    return graph.probe("p.theta").probe("twice.out")


@pytest.mark.parametrize("solver", ["heun", "rk4"])
def test_engines_agree_to_the_bit(solver: str) -> None:
    python, compiled = (swinging(engine=e, solver=solver).run() for e in ("python", "compiled"))
    for probe in ("p.theta", "twice.out"):
        np.testing.assert_allclose(compiled[probe], python[probe], rtol=0.0, atol=1e-13)


def test_a_block_of_the_stages_that_does_not_compile_is_called_from_python() -> None:
    made = {}
    for engine in ("python", "compiled"):
        graph = graph_of(OSCILLATOR, engine=engine).without("spring").add("o", Opaque())
        graph = graph.connect("position.out", "o.x").wire("speed.input", "o.y")
        made[engine] = np.asarray(graph.run()["x"])
    np.testing.assert_array_equal(made["compiled"], made["python"])
    assert abs(made["python"] - np.cos(0.1 * np.arange(100))).max() < 1e-4


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_dopri5_meets_its_tolerance_against_scipy(engine: str) -> None:
    """A pendulum over a tick of half a second, with what scipy's own solver makes of it."""
    graph = alone(Pendulum(theta0=2.0), "b.theta", dt=0.5, until=10.0)
    graph = graph.set("run.solver", "dopri5").set("run.rtol", 1e-8).set("run.atol", 1e-10)
    theta = np.asarray(graph.set("run.engine", engine).run()["b.theta"]).ravel()

    def rates(t: float, x: Any) -> list[float]:
        return [x[1], -9.81 * math.sin(x[0])]

    t = 0.5 * np.arange(20)
    exact = solve_ivp(rates, (0, 10), [2.0, 0.0], "DOP853", t, rtol=1e-12, atol=1e-13).y[0]
    peer = solve_ivp(rates, (0, 10), [2.0, 0.0], "RK45", t, rtol=1e-8, atol=1e-10).y[0]
    assert abs(theta - exact).max() < max(2e-6, 2.0 * abs(peer - exact).max())


def test_dopri5_keeps_to_the_largest_step() -> None:
    """A pulse that is shorter than a tick is not stepped over."""
    graph = alone(Pulse(), "b.x", dt=1.0, until=3.0).set("run.solver", "dopri5")
    x = np.asarray(graph.set("run.max_step", 0.01).run()["b.x"]).ravel()
    np.testing.assert_allclose(x, [0.0, 0.01, 0.01], atol=1e-5)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_tolerance_that_cannot_be_met(engine: str) -> None:
    graph = alone(Escape(), "b.x", dt=0.5, until=3.0).set("run.solver", "dopri5")
    message = r"block 'b' at tick 3 \(t = 1.5 s\): dopri5 cannot integrate state 'x' with rtol"
    with pytest.raises(SimulationError, match=message):
        graph.set("run.engine", engine).run()


@pytest.mark.parametrize(
    ("key", "value", "solver", "message"),
    [
        ("rtol", 1e-6, "rk4", "run.rtol: solver: rk4 takes one step per tick"),
        ("rtol", -1, "dopri5", "run.rtol: expected a number above 0, got -1"),
        ("max_step", "x", "dopri5", "run.max_step: expected a number above 0"),
    ],
)
def test_options_of_solvers(key: str, value: Any, solver: str, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        graph_of(OSCILLATOR, **{"solver": solver, key: value}).check()


def test_a_run_folder_holds_the_solver(tmp_path: Path) -> None:
    graph = graph_of(OSCILLATOR, solver="dopri5", rtol=1e-7)
    folder = graph.run().save(tmp_path / "run")
    text = (folder / "graph.resolved.yaml").read_text(encoding="utf-8")
    assert "solver: dopri5" in text
    assert "rtol: 1e-07" in text or "rtol: 1.0e-07" in text


def test_the_text_of_a_graph_without_continuous_states_has_no_stages() -> None:
    text = runtime.load("line_actuator_failure").program().source()
    assert "stage" not in text
    assert "states" not in text


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_state_that_is_no_number_names_block_state_tick_and_time(engine: str) -> None:
    with pytest.raises(SimulationError) as caught:
        alone(Blowup()).set("run.engine", engine).run()
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
    with pytest.raises(
        GraphError, match="run.solver: there is no solver 'rk5', did you mean 'rk4'"
    ):
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


def test_a_solver_without_continuous_states_is_noted() -> None:
    graph: dict[str, Any] = {"run": {"solver": "heun"}, "blocks": {"clock": {"type": "Clock"}}}
    (note,) = runtime.load(graph).network.notes
    assert note == "run.solver: not used, since no block has continuous states to integrate"
    assert not graph_of(OSCILLATOR, solver="heun").network.notes
