"""Predictive and adaptive control of linear systems, against scipy, closed forms and each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import linalg, optimize, signal

import blocks
import runtime
from blocks import Scalar, Vector
from blocks.core import BlockContext, ParameterError
from runtime.errors import GraphError
from tests.blocks.responses import respond

A, B = [[0.0, 1.0], [-2.0, 0.3]], [[0.0], [1.5]]
Q, R, DT = [3.0, 1.0], [0.2], 0.05


def sampled() -> tuple[np.ndarray, np.ndarray]:
    ad, bd, *_ = signal.cont2discrete((np.array(A), np.array(B), np.eye(2), np.zeros((2, 1))), DT)
    return ad, bd


def mpc(x: np.ndarray, reference: float = 0.0, **params: Any) -> np.ndarray:
    """The commands for states (k, 2), each the first of a run of its own."""
    entry = {"type": "LinearMPC", "A": A, "B": B, "Q": Q, "R": R, "dt": DT, **params}
    x = np.vstack((x, x[-1:]))  # a table has two rows at least
    given = {"states": [x], "reference": np.tile([reference, 0.0], (len(x), 1))}
    return np.asarray(respond(entry, given, of="command", dt=DT)).ravel()[:-1]


def test_without_limits_it_is_the_regulator_for_any_horizon() -> None:
    x = np.random.default_rng(3).standard_normal((8, 2))
    ad, bd = sampled()
    p = linalg.solve_discrete_are(ad, bd, np.diag(Q), np.diag(R))
    gain = np.linalg.solve(np.diag(R) + bd.T @ p @ bd, bd.T @ p @ ad)
    for steps in (1, 7, 30):
        np.testing.assert_allclose(mpc(x, steps=steps), (-x @ gain.T).ravel(), rtol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_at_limits_it_solves_the_program_that_scipy_solves(seed: int) -> None:
    """The cost of a command sequence, summed along the states, minimised without any condensing."""
    ad, bd = sampled()
    weights, r, steps, bound, rate = np.diag(Q), np.diag(R), 6, 0.8, 6.0
    p = linalg.solve_discrete_are(ad, bd, weights, r)
    x0 = np.random.default_rng(seed).standard_normal(2) * 2.0

    def cost(u: np.ndarray) -> float:
        x, total = x0, 0.0
        for k in range(steps):
            total += float(x @ weights @ x + u[k] * r[0, 0] * u[k])
            x = ad @ x + bd[:, 0] * u[k]
        return total + float(x @ p @ x)

    # The first command has no predecessor: only the changes that follow are limited.
    changes = optimize.LinearConstraint(np.diff(np.eye(steps), axis=0), -rate * DT, rate * DT)
    best = optimize.minimize(
        cost,
        np.zeros(steps),
        method="SLSQP",
        bounds=[(-bound, bound)] * steps,
        constraints=[changes],
        options={"ftol": 1e-14, "maxiter": 500},
    )
    found = mpc(x0[None], steps=steps, low=-bound, high=bound, rate=rate)
    assert found[0] == pytest.approx(best.x[0], abs=1e-5)


def test_a_command_changes_no_faster_than_its_rate() -> None:
    x = np.array([[2.0, 0.0], [-2.0, 0.0], [-2.0, 0.0], [2.0, 1.0]])
    found = mpc(x, steps=5, low=-1.0, high=1.0, rate=4.0)
    assert np.abs(np.diff(found)).max() == pytest.approx(4.0 * DT)
    assert np.abs(found).max() <= 1.0 + 1e-9


def test_a_cart_pole_is_balanced_within_its_limit_in_both_engines() -> None:
    """The regulator exceeds the limit; the predictive controller does not, and still arrives."""
    plain = {
        "run": {"dt": 0.005, "until": 6.0},
        "blocks": {
            "cart": {"type": "CartPole", "x0": [0.6, 0.0, 0.15, 0.0]},
            "mpc": {"type": "LinearMPC", "plant": "cart", "Q": [5, 1, 10, 1], "R": 0.1, "dt": 0.04},
        },
        "wires": {"cart": {"force": "mpc.command"}, "mpc": {}},
        "probes": {"u": "mpc.command", "x": "cart.x"},
    }
    plain["wires"]["mpc"] = {
        "states": ["cart.position", "cart.velocity", "cart.angle", "cart.rate"]
    }
    limited: Any = {**plain, "blocks": {**plain["blocks"]}}
    limits = {"low": -6.0, "high": 6.0, "steps": 25}
    limited["blocks"]["mpc"] = {**plain["blocks"]["mpc"], **limits}
    free = runtime.load(plain).run(engine="python")
    python, compiled = (runtime.load(limited).run(engine=each) for each in ("python", "compiled"))
    assert np.abs(free["u"]).max() > 6.5
    assert np.abs(python["u"]).max() == pytest.approx(6.0)
    assert np.abs(python["x"][-1]).max() < 0.05
    np.testing.assert_allclose(python["x"], compiled["x"], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("reference", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_states_are_limited_softly_as_scipy_limits_them(seed: int, reference: float) -> None:
    ad, bd = sampled()
    weights, r, steps, penalty, high = np.diag(Q), np.diag(R), 6, 50.0, 0.3
    p = linalg.solve_discrete_are(ad, bd, weights, r)
    x0 = np.array([np.random.default_rng(seed).standard_normal(), 1.5])
    states = [x0 - reference * np.array([1.0, 0.0])]

    def simulated(u: np.ndarray) -> np.ndarray:
        for k in range(steps):
            states[k + 1 :] = [ad @ states[k] + bd[:, 0] * u[k]]
        return np.array(states)

    def cost(u: np.ndarray) -> float:
        x, e = simulated(u[:-1]), u[-1]
        total = sum(float(x[k] @ weights @ x[k] + u[k] * r[0, 0] * u[k]) for k in range(steps))
        return total + float(x[-1] @ p @ x[-1]) + penalty * e * e

    def room(u: np.ndarray) -> np.ndarray:
        second = simulated(u[:-1])[1:, 1]
        return np.concatenate((high + u[-1] - second, second + 0.2 + u[-1]))

    best = optimize.minimize(
        cost,
        np.zeros(steps + 1),
        method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    limits = {"states_low": [-math.inf, -0.2], "states_high": [math.inf, high]}
    found = mpc(x0[None], reference, steps=steps, penalty=penalty, **limits)
    assert best.x[-1] > 1e-3  # a limit is passed
    assert found[0] == pytest.approx(best.x[0], abs=1e-4)


PLANT = {"type": "StateSpace", "A": A, "B": B, "C": [[1, 0], [0, 1]]}


def disturbed(block: dict[str, Any], wires: dict[str, Any], d: float = 0.7) -> runtime.Graph:
    """A plant under state feedback, to the command of which a constant is added."""
    return runtime.load(
        {
            "run": {"dt": DT, "until": 16.0},
            "blocks": {
                "plant": {**PLANT, "x0": [0.5, 0.0]},
                "base": {"type": "Function", "expression": "-3*u[0] - 2*u[1]", "dt": DT},
                "given": {"type": "Function", "expression": "u[0] - u[1]"},
                "d": {"type": "Constant", "value": d},
                "applied": {"type": "Function", "expression": "u[0] + u[1]"},
                "adaptive": {"dt": DT, **block},
            },
            "wires": {
                "base": {"u": "plant.out"},
                "applied": {"u": ["given.out", "d.value"]},
                "plant": {"input": "applied.out"},
                **wires,
            },
            "probes": {"x": "plant.out", "estimate": "adaptive.estimated"},
        }
    )


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_l1_estimates_a_constant_disturbance_as_its_equations_say(engine: str) -> None:
    block = {"type": "LinearL1", "A": A, "B": B, "predictor": 2.0, "filter": 3.0}
    wires = {
        "adaptive": {"states": "plant.out", "baseline": "base.out"},
        "applied": {"u": ["adaptive.command", "d.value"]},
    }
    graph = disturbed(block, wires).without("given")
    run = graph.run(engine=engine)
    fade, share = math.exp(-2.0 * DT), -math.expm1(-3.0 * DT)
    k = np.arange(len(run["estimate"]))
    # Exact from the second tick on: the first has no prediction to compare with.
    expected = 0.7 * fade * (1.0 - (1.0 - share) ** np.maximum(k - 1, 0))
    np.testing.assert_allclose(run["estimate"].ravel(), expected, rtol=1e-6, atol=1e-9)
    # What is left of the disturbance is what fades, and so is the error at rest.
    rest = np.linalg.solve(np.array(A) - np.array(B) @ [[3.0, 2.0]], [0.0, -1.5])
    np.testing.assert_allclose(run["x"][-1], rest * 0.7 * (1.0 - fade), atol=1e-5)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_an_observer_finds_the_disturbance_from_the_position_alone(engine: str) -> None:
    ad, bd = sampled()
    block = {"type": "LinearDisturbanceObserver", "A": ad.tolist(), "B": bd.tolist(), "C": [1, 0]}
    block |= {"Q": [1e-6, 1e-6], "R": 1e-4, "D": [1e-3]}
    wires = {
        "adaptive": {"measurement": "plant.out.0", "control": "given.out"},
        "given": {"u": ["base.out", "adaptive.disturbance"]},
    }
    graph = disturbed(block, wires)
    graph = graph.set("probes.estimate", "adaptive.disturbance")
    run = graph.run(engine=engine)
    assert run["estimate"].ravel()[-1] == pytest.approx(0.7, abs=1e-6)
    assert np.abs(run["x"][-1]).max() < 1e-6


def test_the_observers_gain_is_scipys_for_the_extended_system() -> None:
    ad, bd = sampled()
    c = np.array([[1.0, 0.0]])
    block = blocks.LinearDisturbanceObserver(
        A=ad.tolist(), B=bd.tolist(), C=c.tolist(), Q=[0.1, 0.2], R=[0.3], D=[0.05]
    )
    types = {"measurement": Scalar, "control": Scalar, "disturbance": Scalar, "estimate": Vector(2)}
    gain, _ = block.design(BlockContext(DT, types, terms={"measurement": (True,)}, sampled=True))
    a, ce = np.eye(3), np.array([[1.0, 0.0, 0.0]])
    a[:2, :2], a[:2, 2:] = ad, bd
    p = linalg.solve_discrete_are(a.T, ce.T, np.diag([0.1, 0.2, 0.05]), np.array([[0.3]]))
    expected = p @ ce.T / (ce @ p @ ce.T + 0.3)
    np.testing.assert_allclose(gain, expected, rtol=1e-8)


def test_two_commands_that_act_alike_are_refused() -> None:
    alike = {"type": "LinearL1", "A": A, "B": [[0.0, 0.0], [1.5, 1.5]]}
    wires = {
        "both": {"u": "plant.out"},
        "adaptive": {"states": "plant.out", "baseline": "both.out"},
        "given": {"u": ["base.out", "d.value"]},
    }
    graph = disturbed(alike, wires).add("both", blocks.Function(expression=["u[0]", "u[1]"]))
    with pytest.raises(GraphError, match="adaptive.B: two commands act alike"):
        graph.check()


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"low": 1.0, "high": 0.0}, "above low"),
        ({"low": [1.0, 2.0]}, "one number, or 1, one per command"),
        ({"steps": 0}, "at least 1"),
    ],
)
def test_wrong_limits_are_refused(params: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        blocks.LinearMPC(A=A, B=B, Q=Q, R=R, **params)
