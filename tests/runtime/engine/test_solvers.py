"""Each solver has the order that it declares, and the control of steps meets its tolerances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from blocks import Block, Output, Scalar, State
from blocks.core import FloatArray
from runtime import solvers
from runtime.document import RunSection
from runtime.engine.steps import LONGEST, SHORTEST, growth
from runtime.graph import Graph
from runtime.solvers import ADAPTIVE, DEFAULT, SOLVERS, Method

ENGINES = ("python", "compiled")
UNTIL = 4.0
# Bogacki and Shampine, A 3(2) pair of Runge-Kutta formulas (1989), as the recipe adds a solver.
BS3 = Method(
    "bs3",
    "Bogacki and Shampine's pair",
    order=3,
    nodes=(0.0, 0.5, 0.75, 1.0),
    rows=((0.5,), (0.0, 0.75), (2 / 9, 1 / 3, 4 / 9), (2 / 9, 1 / 3, 4 / 9)),
    errors=(-5 / 72, 1 / 12, 1 / 9, -1 / 8),
    error_order=3,
)
calls = 0


class Decay(Block):
    """x' = -2 t x^2: x = 1 / (1 + t^2).

    [ Decay ] ─▶ x
    """

    x = Output(Scalar, doc="the state")
    q = State(1, continuous=True)

    def start(self, state: Any) -> None:
        state.q[:] = 1.0

    def output(self, state: Any, t: float) -> float:
        return float(state.q[0])

    def derivative(self, state: Any, t: float) -> FloatArray:
        return -2.0 * t * state.q**2


class Swing(Block):
    """x'' = -x, which counts how often it is asked for its rates: each step has the same error.

    [ Swing ] ─▶ x
    """

    x = Output(Scalar, doc="the position")
    q = State(2, continuous=True)

    def start(self, state: Any) -> None:
        state.q[0] = 1.0

    def output(self, state: Any, t: float) -> float:
        return float(state.q[0])

    def derivative(self, state: Any, t: float) -> FloatArray:
        global calls
        calls += 1
        return np.array([state.q[1], -state.q[0]])


def errors_of(block: Block, exact: Any, engine: str = "python", **run: Any) -> float:
    """The largest error on the ticks of a run."""
    graph = Graph().add("b", block).probe("b.x")
    for key, value in {"until": UNTIL, **run}.items():
        graph = graph.set(f"run.{key}", value)
    result = graph.run(engine=engine)
    assert result.manifest["engine"] == engine
    found = np.ravel(result["b.x"])
    return float(np.abs(found - exact(run["dt"] * np.arange(len(found)))).max())


def bell(t: Any) -> Any:
    return 1.0 / (1.0 + t**2)


@pytest.fixture
def scratch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver of another order, beside ours."""
    monkeypatch.setitem(SOLVERS, BS3.name, BS3)


@pytest.mark.usefixtures("scratch")
@pytest.mark.parametrize("name", [*SOLVERS, BS3.name])
def test_a_run_has_the_order_that_its_solver_declares(name: str) -> None:
    method = SOLVERS[name]
    found = []
    for dt in (0.05, 0.025):
        loose = {"rtol": 1e9, "atol": 1e9} if method.is_adaptive else {}
        found.append(errors_of(Decay(), bell, dt=dt, solver=name, **loose))
    assert math.log2(found[0] / found[1]) == pytest.approx(method.order, abs=0.3), found


@pytest.mark.usefixtures("scratch")
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", [*ADAPTIVE, BS3.name])
def test_the_error_follows_the_tolerance(name: str, engine: str) -> None:
    for rtol in (1e-4, 1e-6, 1e-8):
        tight = {"rtol": rtol, "atol": rtol, "dt": 1.0, "solver": name}
        assert errors_of(Decay(), bell, engine, **tight) < 10.0 * rtol, rtol


@pytest.mark.usefixtures("scratch")
@pytest.mark.parametrize("name", ["dopri5", BS3.name])
def test_one_step_reaches_the_error_that_the_control_aims_at(name: str) -> None:
    """An error e is h^q times a constant: the next step has 0.9^q tolerances, whatever e was."""
    method = SOLVERS[name]
    for error in (0.02, 0.3, 1.0, 5.0):
        following = error * growth(error, method.exponent) ** method.error_order
        assert following == pytest.approx(0.9**method.error_order)
    assert growth(0.0, method.exponent) == LONGEST
    assert growth(1e300, method.exponent) == SHORTEST


@pytest.mark.usefixtures("scratch")
@pytest.mark.parametrize("name", ["dopri5", BS3.name])
def test_the_steps_are_as_few_as_the_tolerance_allows(name: str) -> None:
    """The estimate of a step is that of x' = i x, and less where both components share it."""
    global calls
    method, tolerance, until = SOLVERS[name], 1e-7, 20.0

    def estimate(h: float) -> float:
        slopes: list[complex] = []
        for row in ((), *method.rows)[: method.stages]:
            slopes.append(1j * (1.0 + h * sum(a * k for a, k in zip(row, slopes, strict=False))))
        return abs(h * sum(w * k for w, k in zip(method.errors, slopes, strict=True)))

    power = math.log2(estimate(0.02) / estimate(0.01))
    assert method.error_order == pytest.approx(power, abs=0.01)
    longest = brentq(lambda h: estimate(h) - 0.9**power * tolerance, 1e-6, 1.0)
    calls = 0
    run = {"until": 2 * until, "dt": until, "rtol": 1e-30, "atol": tolerance}
    errors_of(Swing(), np.cos, solver=name, **run)
    # The two ticks have one call each; what is left of a tick is divided into equal steps.
    assert calls / method.stages <= 1.02 * 2 * until / longest + 10


def test_what_is_said_of_solvers_is_derived() -> None:
    assert RunSection().solver == DEFAULT
    text = solvers.solver_docs()
    assert all(f"`{name}`" in text and method.doc in text for name, method in SOLVERS.items())
    with pytest.raises(ValueError, match="solver 'x': the weights .* and its order go together"):
        Method("x", "", order=1, nodes=(0.0,), rows=((1.0,),), errors=(1.0,))
