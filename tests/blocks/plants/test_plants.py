"""Plants against conservation laws, closed forms and equations of motion derived otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Vector
from blocks.core import BlockContext, ParameterError, started
from tests.blocks.direct import state_of

T = 0.01 * np.arange(500)


def run(entry: dict[str, Any], inputs: dict[str, Any], *of: str, dt: float = 0.01) -> list[Any]:
    made = {"it": entry, **inputs}
    graph = {
        "run": {"dt": dt, "until": 5.0, "engine": "python"},
        "blocks": made,
        "wires": {"it": {name: f"{name}.value" for name in inputs}},
        "probes": {name: f"it.{name}" for name in of},
    }
    result = runtime.load(graph).run()
    return [np.asarray(result[name]) for name in of]


def constant(value: Any, kind: str = "Scalar") -> dict[str, Any]:
    return {"type": "Constant", "value": value, "signal": kind}


def test_a_unicycle_drives_a_circle() -> None:
    (pose,) = run({"type": "Unicycle"}, {"command": constant([1.0, 0.5], "Twist")}, "pose")
    expected = np.column_stack((2 * np.sin(0.5 * T), 2 - 2 * np.cos(0.5 * T), 0.5 * T))
    np.testing.assert_allclose(pose, expected, atol=1e-9)


def test_a_bicycle_turns_about_its_centre_and_not_beyond_its_limit() -> None:
    inputs = {"v": constant(1.0), "steering": constant(2.0)}
    (pose,) = run({"type": "Bicycle", "wheel_base": 2.0, "steering_max": 0.3}, inputs, "pose")
    radius = 2.0 / np.tan(0.3)
    away = np.hypot(pose[:, 0], pose[:, 1] - radius)
    np.testing.assert_allclose(away, radius, atol=1e-9)
    np.testing.assert_allclose(pose[:, 2], T / radius, atol=1e-9)


def test_a_pendulum_keeps_its_energy_and_its_small_period() -> None:
    entry = {"type": "Pendulum", "mass": 2.0, "length": 0.5, "angle0": 2.0}
    angle, rate = run(entry, {}, "angle", "rate")
    energy = 0.5 * 2.0 * 0.25 * rate**2 - 2.0 * 9.81 * 0.5 * np.cos(angle)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-5)
    (angle,) = run({**entry, "angle0": 1e-4}, {}, "angle")
    np.testing.assert_allclose(angle, 1e-4 * np.cos(np.sqrt(9.81 / 0.5) * T), atol=1e-9)


def test_a_cart_with_a_pole_keeps_energy_and_momentum() -> None:
    entry = {"type": "CartPole", "cart_mass": 2.0, "pole_mass": 0.7, "x0": [0, 0.3, 2.5, -1.0]}
    x, v, theta, rate = run(entry, {}, "position", "velocity", "angle", "rate")
    pole = v + 0.5 * rate * np.cos(theta), -0.5 * rate * np.sin(theta)
    kinetic = 0.5 * 2.0 * v**2 + 0.5 * 0.7 * (pole[0] ** 2 + pole[1] ** 2)
    energy = kinetic + 0.7 * 9.81 * 0.5 * np.cos(theta)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)
    np.testing.assert_allclose(2.0 * v + 0.7 * pole[0], (2.0 * v + 0.7 * pole[0])[0], atol=1e-5)
    assert np.abs(x).max() > 0.1


def test_masses_follow_their_closed_forms() -> None:
    entry = {"type": "MassSpringDamper", "mass": 2.0, "stiffness": 8.0, "position0": 1.0}
    position, velocity = run(entry, {}, "position", "velocity")
    np.testing.assert_allclose(position, np.cos(2.0 * T), atol=1e-7)
    np.testing.assert_allclose(velocity, -2.0 * np.sin(2.0 * T), atol=1e-7)
    entry = {"type": "DoubleIntegrator", "velocity0": [1, 0]}
    push = {"acceleration": constant([0.0, 2.0], "Vector(2)")}
    position, velocity = run(entry, push, "position", "velocity")
    np.testing.assert_allclose(position, np.column_stack((T, T**2)), atol=1e-9)
    np.testing.assert_allclose(velocity, np.column_stack((1 + 0 * T, 2 * T)), atol=1e-9)


def test_an_arm_keeps_its_energy() -> None:
    entry = {"type": "TwoLinkArm", "masses": [1.0, 2.0], "lengths": [0.6, 0.4], "q0": [1.0, 0.5]}
    angles, rates = run(entry, {}, "angles", "rates", dt=0.001)
    energy = np.array([arm_energy(q, r) for q, r in zip(angles, rates, strict=True)])
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)


def arm_energy(q: Any, rate: Any) -> float:
    """Of two uniform rods, from the velocities of their centers."""
    total = 0.0
    joint, speed, angle, turn = np.zeros(2), np.zeros(2), 0.0, 0.0
    for i, (mass, length) in enumerate(((1.0, 0.6), (2.0, 0.4))):
        angle, turn = angle + q[i], turn + rate[i]
        along = np.array([np.cos(angle), np.sin(angle)])
        across = turn * np.array([-along[1], along[0]])
        center, velocity = joint + 0.5 * length * along, speed + 0.5 * length * across
        inertia = mass * length**2 / 12.0
        total += 0.5 * mass * velocity @ velocity + 0.5 * inertia * turn**2
        total += mass * 9.81 * center[1]
        joint, speed = joint + length * along, speed + length * across
    return float(total)


@pytest.mark.parametrize("at", [[0.0, 0.0], [1.0, -2.0], [3.0, 0.4]])
def test_torques_that_hold_an_arm_are_those_of_gravity(at: list[float]) -> None:
    arm = blocks.TwoLinkArm(q0=at)
    state = state_of(arm)
    q1, q2 = at
    far = 9.81 * 0.5 * np.cos(q1 + q2)
    torque = np.array([9.81 * 1.5 * np.cos(q1) + far, far])
    np.testing.assert_allclose(arm.derivative(state, 0.0, torque), np.zeros(4), atol=1e-12)
    tip = arm.output_tip(state, 0.0)
    expected = [np.cos(q1) + np.cos(q1 + q2), np.sin(q1) + np.sin(q1 + q2)]
    np.testing.assert_allclose(tip, expected)


THREE = {"lengths": [0.6, 0.4, 0.3], "masses": [1.0, 2.0, 0.5]}


def planar(**params: Any) -> tuple[Any, Any]:
    """A PlanarArm and its state as after ``start``."""
    arm = blocks.PlanarArm(**params)
    n = len(params["lengths"])
    kinds = {"torque": Vector(n), "angles": Vector(n), "rates": Vector(n), "force": Vector(2)}
    return arm, started(arm, BlockContext(0.01, kinds))


def test_two_links_are_the_two_link_arm() -> None:
    """Whose equations are the textbook's, written out."""
    params = {"lengths": [0.6, 0.4], "masses": [1.0, 2.0], "centers": [0.2, 0.3]}
    params |= {"inertias": [0.05, 0.02], "friction": [0.3, 0.1]}
    at = {"q0": [0.7, -1.1], "rates0": [2.0, -3.0]}
    arm, state = planar(**params, **at)
    other = blocks.TwoLinkArm(**params, **at)
    theirs, torque = state_of(other), np.array([1.5, -0.4])
    found = arm.derivative(state, 0.0, torque, np.zeros(2))
    np.testing.assert_allclose(found, other.derivative(theirs, 0.0, torque), rtol=1e-12)
    np.testing.assert_allclose(arm.output_tip(state, 0.0), other.output_tip(theirs, 0.0))


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_three_links_keep_their_energy(engine: str) -> None:
    """Kinetic energy by the mass matrix, potential energy by the heights of the centers."""
    graph = {
        "run": {
            **{"dt": 0.01, "until": 1.0, "engine": engine},
            **{"solver": "dopri5", "rtol": 1e-11, "atol": 1e-11},
        },
        "blocks": {"arm": {"type": "PlanarArm", **THREE, "q0": [1.0, 0.5, -2.0]}},
        "probes": {name: f"arm.{name}" for name in ("angles", "rates", "inertia")},
    }
    result = runtime.load(graph).run()
    q, rates, inertia = (np.asarray(result[name]) for name in ("angles", "rates", "inertia"))
    p, lengths, masses = np.cumsum(q, axis=1), np.array([0.6, 0.4, 0.3]), np.array([1.0, 2.0, 0.5])
    ends = np.cumsum(lengths * np.sin(p), axis=1)
    heights = ends - 0.5 * lengths * np.sin(p)
    kinetic = 0.5 * np.einsum("ti,tij,tj->t", rates, inertia.reshape(-1, 3, 3), rates)
    energy = kinetic + 9.81 * heights @ masses
    assert np.ptp(kinetic) > 5.0
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)


def test_the_jacobian_is_the_slope_of_the_tip() -> None:
    q, rates = np.array([0.4, 1.2, -0.7]), np.array([1.0, -2.0, 0.5])
    arm, state = planar(**THREE, q0=q.tolist(), rates0=rates.tolist())
    jacobian = arm.output_jacobian(state, 0.0).reshape(2, 3)
    for joint in range(3):
        sides = []
        for step in (1e-6, -1e-6):
            moved = q + step * np.eye(3)[joint]
            sides.append(np.array(arm.output_tip(planar(**THREE, q0=moved.tolist())[1], 0.0)))
        np.testing.assert_allclose(jacobian[:, joint], (sides[0] - sides[1]) / 2e-6, atol=1e-9)
    np.testing.assert_allclose(arm.output_velocity(state, 0.0), jacobian @ rates, rtol=1e-12)


def test_torques_balance_a_force_at_the_tip_by_the_jacobian() -> None:
    arm, state = planar(**THREE, q0=[0.4, 1.2, -0.7], gravity=0.0)
    force = np.array([3.0, -5.0])
    torque = -arm.output_jacobian(state, 0.0).reshape(2, 3).T @ force
    np.testing.assert_allclose(arm.derivative(state, 0.0, torque, force), 0.0, atol=1e-12)


def test_one_link_is_a_physical_pendulum() -> None:
    arm, state = planar(lengths=[0.8], masses=[2.0], q0=[0.3])
    found = arm.derivative(state, 0.0, np.zeros(1), np.zeros(2))
    np.testing.assert_allclose(found, [0.0, -1.5 * 9.81 / 0.8 * np.cos(0.3)], rtol=1e-12)


def test_each_list_of_an_arm_has_a_number_per_link() -> None:
    with pytest.raises(ParameterError, match="masses: expected 3 numbers, one per li"):
        blocks.PlanarArm(lengths=[1, 1, 1], masses=[1, 1])
