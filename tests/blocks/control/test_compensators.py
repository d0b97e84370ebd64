"""LQI, the disturbance observer and L1 adaptive control: closed forms, scipy, and linear theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

import blocks
from blocks import LQI, LQR, Block, DisturbanceObserver, L1Adaptive
from blocks.control.lqr import linearised
from tests.blocks.control.test_trackers import STEP, ask, command, drive, linear
from tests.blocks.direct import state_of

COMPENSATORS = (DisturbanceObserver, L1Adaptive)
TRACKERS = (LQI, *COMPENSATORS)
weights = st.floats(0.01, 100.0)


def push(block: Block, disturbance: float, ticks: int, learn: float = 1.0) -> np.ndarray:
    """The block's estimates while e_theta' = u + disturbance, from 0."""
    state, heading, found = state_of(block, dt=STEP), 0.0, []
    for _ in range(ticks):
        arguments = (state, 0.0, (0.0, 0.0, heading), (0.0, 0.0, 0.0))
        found.append(float(state.estimated[0]))
        _, u = block.output(*arguments)  # type: ignore[attr-defined]
        block.update(*arguments, learn)  # type: ignore[attr-defined]
        heading += STEP * (u + disturbance)
    return np.array(found)


@pytest.mark.parametrize("tracker", TRACKERS)
class TestAll:
    def test_it_has_the_ports_of_the_lqr(self, tracker: type[Block]) -> None:
        """And one that may stay open."""
        inputs = {n: p.type for n, p in tracker.spec.inputs.items() if n != "learn"}
        assert inputs == {n: p.type for n, p in LQR.spec.inputs.items()}
        assert tracker.spec.inputs["learn"].default == 1.0

    @given(at=st.floats(-3.0, 3.0), v_r=st.floats(0.1, 3.0))
    def test_on_the_path_there_is_nothing_to_correct(
        self, tracker: type[Block], at: float, v_r: float
    ) -> None:
        assert command(tracker(v_r=v_r), 0.0, 0.0, 0.0, at) == (0.0, 0.0)

    @given(lateral=st.floats(-5, 5), heading=st.floats(-1.2, 1.2), at=st.floats(-7.0, 7.0))
    def test_the_laws_have_no_direction_of_their_own(
        self, tracker: type[Block], lateral: float, heading: float, at: float
    ) -> None:
        v, omega = command(tracker(), 0.1, lateral, heading)
        assert command(tracker(), 0.1, lateral, heading, at) == pytest.approx((v, omega), abs=1e-9)
        mirrored = command(tracker(), 0.1, -lateral, -heading)
        assert mirrored == pytest.approx((v, -omega), abs=1e-9)

    @pytest.mark.parametrize(("v_r", "beside"), [(1.0, 0.2), (0.2, 0.18)])
    def test_from_any_heading_it_comes_to_the_path(
        self, tracker: type[Block], v_r: float, beside: float
    ) -> None:
        for heading in (-3.0, 0.0, 1.6, 3.1):
            x, y, theta = drive(tracker(v_r=v_r), beside, heading, 40.0, STEP)["plant.pose"][-1]
            assert abs(y) < 0.02
            assert abs(math.remainder(theta, math.tau)) < 0.02
            assert x > 10.0 * v_r

    def test_it_needs_a_speed(self, tracker: type[Block]) -> None:
        with pytest.raises(blocks.ParameterError, match="v_r: at 0 turning does not move"):
            tracker(v_r=0.0)


class TestLQI:
    @given(st.tuples(weights, weights, weights), weights, st.sampled_from([0.01, 0.05]))
    def test_the_gain_is_scipys(
        self, q: tuple[float, float, float], integral: float, dt: float
    ) -> None:
        gain = LQI(q=q, q_integral=integral, v_r=0.5, model="exact").gain_at(dt)
        a, b = np.eye(4), np.zeros((4, 2))
        a[:3, :3], b[:3] = linearised(0.5, 0.0, dt, "exact")
        a[3, 1] = dt
        p = solve_discrete_are(a, b, np.diag([*q, integral]), np.eye(2))
        expected = np.linalg.solve(np.eye(2) + b.T @ p @ b, b.T @ p @ a)
        np.testing.assert_allclose(gain, expected, rtol=1e-6, atol=1e-8)

    def test_near_the_path_it_is_the_linear_loop(self) -> None:
        """[z, y, theta] with the gains of a fast sampling."""
        lqi = LQI(model="exact")
        pose = drive(lqi, 0.01, 0.004, 6.0)["plant.pose"][::500]
        k = lqi.gain_at(1e-3)[1]
        a = np.array([[0, 1, 0], [0, 0, 1], [-k[3], -k[1], -k[2]]])
        expected = linear(a, np.array([0.0, 0.01, 0.004]), 0.5 * np.arange(len(pose)))
        np.testing.assert_allclose(pose[:, 1:], expected[:, 1:], rtol=0.0, atol=2e-5)

    def test_it_cancels_a_constant_push(self) -> None:
        """At rest theta' = 0 = omega + d, so -K z = -d with all errors 0."""
        lqi = LQI()
        state, y, theta = state_of(lqi, dt=STEP), 0.0, 0.0
        for _ in range(6000):
            _, omega = ask(lqi, state, 0.0, y, theta)
            y, theta = y + STEP * math.sin(theta), theta + STEP * (omega + 0.15)
        assert (y, theta) == pytest.approx((0.0, 0.0), abs=1e-4)
        assert state.integral[0] * lqi.gain_at(STEP)[1, 3] == pytest.approx(0.15, rel=1e-3)

    def test_at_the_limit_the_sum_waits(self) -> None:
        lqi = LQI(limit=0.1)
        state = state_of(lqi, dt=STEP)
        for _ in range(100):
            assert ask(lqi, state, 0.0, 3.0, 0.0)[1] == -0.1
        assert state.integral[0] == 0.0
        paused = LQI()
        state = state_of(paused, dt=STEP)
        paused.update(state, 0.0, (0.0, 0.3, 0.0), (0.0, 0.0, 0.0), 0.0)
        assert state.integral[0] == 0.0


class TestDisturbanceObserver:
    @given(st.floats(-0.5, 0.5), st.floats(0.1, 2.0))
    def test_a_constant_is_found_like_a_lowpass(self, disturbance: float, tau: float) -> None:
        got = push(DisturbanceObserver(tau=tau), disturbance, 200)
        # The first change is known on the second tick.
        t = STEP * np.maximum(np.arange(200) - 1, 0)
        expected = -disturbance * np.expm1(-t / tau)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-9)


class TestL1Adaptive:
    @given(st.floats(-0.5, 0.5), st.floats(0.5, 5.0), st.floats(0.5, 5.0))
    def test_a_constant_is_found_in_a_tick_and_filtered(
        self, disturbance: float, predictor: float, bandwidth: float
    ) -> None:
        """The piecewise constant law finds exp(-a dt) d, one tick late."""
        block = L1Adaptive(predictor=predictor, filter=bandwidth)
        got = push(block, disturbance, 200)
        t = STEP * np.maximum(np.arange(200) - 1, 0)
        found = math.exp(-predictor * STEP) * disturbance
        np.testing.assert_allclose(got, -found * np.expm1(-bandwidth * t), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("compensator", COMPENSATORS)
class TestCompensators:
    def test_near_the_path_both_poles_are_at_the_rate(self, compensator: type[Block]) -> None:
        """(s + w)^2 from (y, 0): y (1 + w t) exp(-w t)."""
        pose = drive(compensator(v_r=0.5, rate=1.5), 0.004, 0.0, 5.0)["plant.pose"]
        t = 1e-3 * np.arange(5000)
        expected = 0.004 * (1.0 + 1.5 * t) * np.exp(-1.5 * t)
        np.testing.assert_allclose(pose[:, 1], expected, rtol=0.0, atol=2e-5)

    def test_learning_may_pause(self, compensator: type[Block]) -> None:
        assert not push(compensator(), 0.3, 50, learn=0.0).any()

    def test_the_estimate_is_limited(self, compensator: type[Block]) -> None:
        assert np.abs(push(compensator(limit=0.2), 0.5, 2000)).max() <= 0.2
