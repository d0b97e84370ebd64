"""Regulators and observers against closed forms, python-control, and each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import signal

import blocks
import runtime
from blocks import Scalar, Vector
from blocks.core import BlockContext
from tests.blocks.responses import respond

ct = pytest.importorskip("control")

A, B, C = [[0.0, 1.0], [-2.0, -0.3]], [[0.0], [1.5]], [[1.0, 0.0]]
Q, R = [[4.0, 0.1], [0.1, 2.0]], [[0.5]]


def context(n: int, dt: float = 0.02, sampled: bool = False) -> BlockContext:
    types = {"states": Scalar, "reference": Vector(n), "command": Scalar}
    return BlockContext(dt, types, terms={"states": (True,) * n}, sampled=sampled)


def regulator(**parameters: Any) -> Any:
    return blocks.LinearQuadraticRegulator(**parameters)


def test_the_double_integrator_has_a_closed_form() -> None:
    """Q = I, R = 1: K = [1, sqrt(3)]; Q = [q, 0]: [sqrt(q), sqrt(2) q^(1/4)]."""
    double = {"A": [[0.0, 1.0], [0.0, 0.0]], "B": [0.0, 1.0], "R": 1.0}
    gain, _ = regulator(Q=[1.0, 1.0], **double).design(context(2))
    np.testing.assert_allclose(gain, [[1.0, math.sqrt(3.0)]], rtol=1e-10)
    gain, _ = regulator(Q=[7.0, 0.0], **double).design(context(2))
    np.testing.assert_allclose(gain, [[7.0**0.5, math.sqrt(2.0) * 7.0**0.25]], rtol=1e-10)


def test_gains_are_those_of_python_control() -> None:
    block = regulator(Q=Q, R=R, A=A, B=B)
    np.testing.assert_allclose(block.design(context(2))[0], ct.lqr(A, B, Q, R)[0], rtol=1e-9)
    ad, bd, *_ = signal.cont2discrete(tuple(map(np.array, (A, B, C, [[0.0]]))), 0.02)
    found, model = block.design(context(2, sampled=True))
    np.testing.assert_allclose(model.a, ad, rtol=1e-12)
    np.testing.assert_allclose(found, ct.dlqr(ad, bd, Q, R)[0], rtol=1e-9)
    stepped = regulator(Q=Q, R=R, A=ad.tolist(), B=bd.tolist(), discrete=True)
    np.testing.assert_allclose(stepped.design(context(2))[0], found, rtol=1e-9)


def test_a_command_about_an_operating_point() -> None:
    entry = {"type": "LinearQuadraticRegulator", "A": A, "B": B, "Q": Q, "R": R}
    entry |= {"x0": [1.0, -1.0], "u0": [3.0], "discrete": False}
    x = np.random.default_rng(1).standard_normal((20, 2))
    found = respond(entry, {"states": [x], "reference": np.full((20, 2), 0.5)}, of="command")
    gain = np.asarray(ct.lqr(A, B, Q, R)[0])
    expected = 3.0 - (x - [1.0, -1.0] - 0.5) @ gain.T
    np.testing.assert_allclose(found.ravel(), expected.ravel(), rtol=1e-9)


def cart(regulator: dict[str, Any], **more: Any) -> runtime.Graph:
    return runtime.load(
        {
            "run": {"dt": 0.002, "until": 6.0, "seed": 1},
            "blocks": {
                "cart": {"type": "CartPole", "x0": [0.5, 0.0, 0.1, 0.0]},
                "lqr": {"type": "LinearQuadraticRegulator", "plant": "cart", **regulator},
                **more.get("blocks", {}),
            },
            "wires": {
                "lqr": {"states": [f"cart.{p}" for p in ("position", "velocity", "angle", "rate")]},
                "cart": {"force": "lqr.command"},
                **more.get("wires", {}),
            },
            "probes": {"x": "cart.x", "gain": "lqr.gain"},
        }
    )


@pytest.mark.parametrize("dt", [None, 0.02])
def test_the_model_of_a_plant_is_its_linearization(dt: float | None) -> None:
    graph = cart({"Q": [1.0, 1.0, 10.0, 1.0], "R": 0.1, **({} if dt is None else {"dt": dt})})
    alone = runtime.load({"run": {"dt": 0.002}, "blocks": {"cart": {"type": "CartPole"}}})
    plant = alone.linearize(["cart.force"])
    q, r = np.diag([1.0, 1.0, 10.0, 1.0]), [[0.1]]
    if dt is None:
        expected = np.asarray(ct.lqr(plant.a, plant.b, q, r)[0])
    else:
        ad, bd, *_ = signal.cont2discrete((plant.a, plant.b, np.eye(4), np.zeros((4, 1))), dt)
        expected = np.asarray(ct.dlqr(ad, bd, q, r)[0])
    ran = graph.run()
    np.testing.assert_allclose(ran["gain"][-1], expected, rtol=1e-6)
    assert np.abs(ran["x"][-1]).max() < 0.02
    # The loop that it closes has the poles that the design says.
    loop = graph.linearize(states={"cart.x": [0.0] * 4})
    closed = plant.a - plant.b @ expected if dt is None else ad - bd @ expected
    np.testing.assert_allclose(
        np.sort_complex(loop.poles), np.sort_complex(np.linalg.eigvals(closed)), atol=1e-5
    )


def test_an_arm_about_a_posture_that_needs_torque() -> None:
    alone = runtime.load({"run": {"dt": 0.002}, "blocks": {"arm": {"type": "TwoLinkArm"}}})
    rest = alone.trim(["arm.torque"], fixed={"arm.x.0": 0.5, "arm.x.1": -0.4})
    assert rest.is_equilibrium
    x0, u0 = list(rest.states.values()), list(rest.inputs.values())
    graph = runtime.load(
        {
            "run": {"dt": 0.002, "until": 4.0},
            "blocks": {
                "arm": {"type": "TwoLinkArm", "q0": [0.7, -0.5]},
                "lqr": {
                    "type": "LinearQuadraticRegulator",
                    "plant": "arm",
                    "x0": x0,
                    "u0": u0,
                    "Q": [100.0, 100.0, 1.0, 1.0],
                    "R": [0.1, 0.1],
                },
            },
            "wires": {
                "lqr": {"states": ["arm.angles", "arm.rates"]},
                "arm": {"torque": "lqr.command"},
            },
            "probes": {"q": "arm.angles"},
        }
    )
    np.testing.assert_allclose(graph.run()["q"][-1], [0.5, -0.4], atol=1e-3)
    with pytest.raises(runtime.GraphError, match="'arm' does not rest there.*--trim finds"):
        graph.set("blocks.lqr.u0", [0.0, 0.0]).check()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"Q": [1, 1], "R": 1, "A": [[1, 0], [0, -1]], "B": [0, 1]}, "no input moves .* pole 1,"),
        ({"Q": [0, 1], "R": 1, "A": [[0, 0], [0, -1]], "B": [1, 1]}, "no weight of Q sees .* 0,"),
        (
            {"Q": [1, 1], "R": 0, "A": A, "B": B},
            "a matrix of weights has only positive",
        ),
        ({"Q": [1, 1], "R": 1, "A": A, "B": B, "plant": "p"}, "given with plant"),
        ({"Q": [1, 1], "R": 1}, "missing; give A and B, or a plant"),
        ({"Q": [1, 1, 1], "R": 1, "A": A, "B": B}, "expected 3 x 3 numbers, as of Q and R, got"),
        ({"Q": [1, 1], "R": 1, "plant": "p"}, "there is no block 'p'"),
    ],
)
def test_what_is_wrong_is_said(entry: dict[str, Any], message: str) -> None:
    graph = {
        "run": {"dt": 0.01, "until": 1.0},
        "blocks": {
            "x": {"type": "Constant", "value": [0.0, 0.0]},
            "lqr": {"type": "LinearQuadraticRegulator", **entry},
        },
        "wires": {"lqr": {"states": "x.value"}},
    }
    with pytest.raises(runtime.GraphError, match=message):
        runtime.load(graph).check()


W, V = np.diag([0.01, 0.2]), [[0.05]]


def test_the_gains_of_observers_are_those_of_python_control() -> None:
    types = {"measurement": Scalar, "control": Scalar, "estimate": Vector(2)}
    around = BlockContext(0.02, types, terms={"measurement": (True,), "control": (True,)})
    given = {"A": A, "B": B, "C": C, "Q": W.tolist(), "R": V}
    gain, _ = blocks.SteadyStateKalman(**given).design(around)
    np.testing.assert_allclose(gain, ct.lqe(A, np.eye(2), C, W, V)[0], rtol=1e-9)
    ad = signal.cont2discrete(tuple(map(np.array, (A, B, C, [[0.0]]))), 0.02)[0]
    found, _ = blocks.DiscreteSteadyStateKalman(**{**given, "A": ad.tolist()}).design(around)
    # python-control's gain is that of the prediction for the next tick.
    np.testing.assert_allclose(ad @ found, ct.dlqe(ad, np.eye(2), C, W, V)[0], rtol=1e-9)


def test_the_discrete_one_is_a_kalman_filter_that_has_settled() -> None:
    from scipy.linalg import solve_discrete_are

    ad, bd, *_ = (
        np.asarray(m)
        for m in signal.cont2discrete(tuple(map(np.array, (A, B, C, [[0.0]]))), 0.02)[:2]
    )
    given = {"A": ad.tolist(), "B": bd.tolist(), "C": C, "Q": W.tolist(), "R": V}
    settled = solve_discrete_are(ad.T, np.transpose(C), W, V)
    y, u = np.random.default_rng(4).standard_normal((2, 200))
    filtered = respond(
        {"type": "KalmanFilter", **given, "P0": settled.tolist()},
        {"measurement": y, "control": u},
        of="estimate",
    )
    steady = respond(
        {"type": "DiscreteSteadyStateKalman", **given},
        {"measurement": [y], "control": [u]},
        of="estimate",
    )
    np.testing.assert_allclose(steady, filtered, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("kind", ["SteadyStateKalman", "DiscreteSteadyStateKalman"])
def test_a_regulator_balances_a_pole_by_what_an_observer_estimates(kind: str) -> None:
    entry = {
        "type": kind,
        "plant": "cart",
        "measured": ["position", "angle"],
        "Q": [1e-5, 1e-2, 1e-5, 1e-2],
        "R": [1e-5, 1e-5],
    }
    step = {"dt": 0.01} if kind.startswith("Discrete") else {}
    graph = cart(
        {"Q": [1.0, 1.0, 10.0, 1.0], "R": 0.1, **step},
        blocks={"observer": {**entry, **step}},
        wires={
            "observer": {
                "measurement": ["cart.position", "cart.angle"],
                "control": "lqr.command",
            },
            "lqr": {"states": "observer.estimate"},
        },
    )
    ran = graph.run()
    assert np.abs(ran["x"][-1]).max() < 0.05
    # Separation: the poles of the loop are those of the regulator and those of the observer.
    assert graph.linearize(states={"cart.x": [0.0] * 4}).is_stable


def test_both_engines_agree() -> None:
    graph = cart({"Q": [1.0, 1.0, 10.0, 1.0], "R": 0.1, "dt": 0.01}).set("run.until", 0.5)
    by_python, compiled = (graph.set("run.engine", e).run()["x"] for e in ("python", "compiled"))
    np.testing.assert_allclose(by_python, compiled, rtol=1e-12, atol=1e-14)
