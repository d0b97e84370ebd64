"""The robot against closed-form arcs, scipy's integrator and the orders of the methods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import blocks
import runtime
from blocks.core.signals import FloatArray
from tests.blocks.direct import state_of
from tests.examples import examples

INTEGRATORS = ["euler", "rk4", "exact"]
commands = st.tuples(st.floats(-3, 3), st.floats(-5, 5))
starts = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-10, 10))


def drive(
    twists: list[tuple[float, float]],
    dt: float,
    integrator: str = "exact",
    x0: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FloatArray:
    """The poses before each command and after the last."""
    plant = blocks.DifferentialDrive(x0=list(x0), integrator=integrator)
    state = state_of(plant, dt=dt)
    poses = [plant.output_pose(state, 0.0)]
    for twist in twists:
        plant.update(state, 0.0, twist)
        poses.append(plant.output_pose(state, 0.0))
    return np.array(poses)


@given(commands, starts, st.floats(1e-4, 2.0))
def test_exact_is_the_arc(
    twist: tuple[float, float], x0: tuple[float, float, float], dt: float
) -> None:
    """The circle about (x - r sin(theta), y + r cos(theta)) with r = v / omega."""
    (v, omega), (x, y, theta) = twist, x0
    end = drive([twist], dt, x0=x0)[-1]
    assert end[2] == pytest.approx(theta + omega * dt, abs=1e-12)
    if abs(omega) < 1e-3:
        return
    r = v / omega
    expected = (
        x + r * (math.sin(theta + omega * dt) - math.sin(theta)),
        y - r * (math.cos(theta + omega * dt) - math.cos(theta)),
    )
    # The closed form itself cancels where the arc is long and flat.
    assert end[:2] == pytest.approx(expected, abs=1e-13 + 4e-16 * abs(r) * 10)


@pytest.mark.parametrize("omega", [0.0, 5e-324, 1e-300, -1e-12, 1e-8])
def test_exact_is_a_straight_line_without_turning(omega: float) -> None:
    end = drive([(0.8, omega)], 0.5, x0=(1.0, 2.0, 0.3))[-1]
    expected = (1.0 + 0.4 * math.cos(0.3), 2.0 + 0.4 * math.sin(0.3), 0.3)
    assert end == pytest.approx(expected, abs=1e-8)
    if abs(omega) < 1e-100:
        assert end == pytest.approx(expected, abs=1e-15)


@examples(15)
@given(st.lists(commands, min_size=1, max_size=8), starts, st.floats(0.01, 0.5))
def test_exact_is_solve_ivp(
    twists: list[tuple[float, float]], x0: tuple[float, float, float], dt: float
) -> None:
    poses, q = drive(twists, dt, x0=x0), np.array(x0)
    for (v, omega), pose in zip(twists, poses[1:], strict=True):

        def rates(t: float, q: FloatArray, v: float = v, omega: float = omega) -> list[float]:
            return [v * math.cos(q[2]), v * math.sin(q[2]), omega]

        q = solve_ivp(rates, (0.0, dt), q, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(pose, q, atol=1e-10)


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("rk4", 4)])
def test_order_of_convergence(integrator: str, order: int) -> None:
    """Half the step, 2^-order of the error, on commands that hold over the coarsest step."""
    coarse = [(1.0 + 0.5 * math.sin(k), 2.0 * math.cos(0.7 * k)) for k in range(10)]
    errors = []
    for halvings in range(4):
        n = 2**halvings
        twists = [twist for twist in coarse for _ in range(n)]
        got = drive(twists, 0.4 / n, integrator)[-1]
        errors.append(np.hypot(*(got - drive(coarse, 0.4)[-1])[:2]))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, order, atol=0.15)


@given(st.lists(commands, min_size=1, max_size=20), st.floats(0.001, 0.5))
def test_every_integrator_turns_exactly(twists: list[tuple[float, float]], dt: float) -> None:
    """theta' = omega, counterclockwise positive, and never wrapped."""
    expected = dt * np.concatenate(([0.0], np.cumsum([omega for _, omega in twists])))
    for integrator in INTEGRATORS:
        np.testing.assert_allclose(drive(twists, dt, integrator)[:, 2], expected, atol=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_positive_turn_rate_turns_left(integrator: str) -> None:
    poses = drive([(1.0, 0.5)] * 100, 0.01, integrator)
    assert poses[-1, 2] == pytest.approx(0.5)
    assert (np.diff(poses[2:, 1]) > 0.0).all()


@pytest.mark.parametrize("integrator", INTEGRATORS)
@given(commands, st.floats(-10, 10), st.floats(0.001, 0.3))
def test_turning_the_start_turns_the_way(
    integrator: str, twist: tuple[float, float], turn: float, dt: float
) -> None:
    plain = drive([twist] * 3, dt, integrator)[-1]
    turned = drive([twist] * 3, dt, integrator, (0.0, 0.0, turn))[-1]
    c, s = math.cos(turn), math.sin(turn)
    expected = (c * plain[0] - s * plain[1], s * plain[0] + c * plain[1])
    assert turned[:2] == pytest.approx(expected, abs=1e-12)


@given(commands, st.floats(0.01, 2.0))
def test_wheels_are_consistent_with_the_twist(twist: tuple[float, float], base: float) -> None:
    plant = blocks.DifferentialDrive(wheel_base=base)
    left, right = plant.output_wheels(state_of(plant), 0.0, twist)
    assert 0.5 * (left + right) == pytest.approx(twist[0], abs=1e-12)
    assert (right - left) / base == pytest.approx(twist[1], abs=1e-12 / base)


@given(commands, st.floats(0.05, 1.0))
def test_wheels_roll_the_way_of_their_hubs(twist: tuple[float, float], base: float) -> None:
    """Each rim's speed is the speed of the point half a base beside the robot's centre."""
    plant = blocks.DifferentialDrive(wheel_base=base)
    left, right = plant.output_wheels(state_of(plant), 0.0, twist)
    h = 1e-6
    before, after = drive([twist], h)
    for speed, side in ((left, 0.5 * base), (right, -0.5 * base)):
        hubs = [p[:2] + side * np.array([-math.sin(p[2]), math.cos(p[2])]) for p in (before, after)]
        assert (hubs[1] - hubs[0])[0] / h == pytest.approx(speed, abs=1e-4)


@pytest.mark.parametrize("v", [0.7, -0.4])
def test_distance_to_the_centre_of_turning_is_conserved(v: float) -> None:
    poses = drive([(v, 0.9)] * 500, 0.1, x0=(1.0, 2.0, 0.4))
    r = v / 0.9
    center = np.array([1.0 - r * math.sin(0.4), 2.0 + r * math.cos(0.4)])
    np.testing.assert_allclose(np.hypot(*(poses[:, :2] - center).T), abs(r), rtol=1e-12)


def test_pose_is_that_of_the_tick_and_breaks_loops() -> None:
    """The first row is x0, and the robot's own pose may be fed back without a delay."""
    graph = runtime.Graph(dt=0.1, until=1.0)
    graph = graph.add("plant", blocks.DifferentialDrive(x0=[1.0, 2.0, 0.5])).add(
        "turn", blocks.Mux()
    )
    graph = graph.connect("plant.pose.theta", "turn.v").connect("turn.out", "plant.command")
    poses = graph.probe("plant.pose").run()["plant.pose"]
    assert poses[0].tolist() == [1.0, 2.0, 0.5]
    # v = theta = 0.5 for good, so a straight line.
    np.testing.assert_allclose(poses[:, 0], 1.0 + 0.05 * math.cos(0.5) * np.arange(10))


def test_by_default_it_starts_at_the_origin_and_looks_along_x() -> None:
    plant = blocks.DifferentialDrive()
    assert plant.output_pose(state_of(plant), 0.0) == (0.0, 0.0, 0.0)


def test_bad_parameters() -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.DifferentialDrive(x0=[0, 0], wheel_base=0)
    assert str(caught.value) == ("DifferentialDrive.wheel_base: expected a number above 0 m, got 0")
    with pytest.raises(blocks.ParameterError, match="x0: expected an array of 3 numbers in m, m"):
        blocks.DifferentialDrive(x0=[0, 0])
    with pytest.raises(blocks.ParameterError, match="integrator: expected one of euler, rk4, exac"):
        blocks.DifferentialDrive(integrator="rk45")
