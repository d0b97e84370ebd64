"""The trackers against their textbook laws: closed forms, geometry, and linear theory."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import blocks
import runtime
from blocks import LQR, Block, BlockState, FloatArray, PathPID, PurePursuit, Stanley
from blocks.core import Evaluation, TwistValue
from blocks.vehicle import INTEGRATORS
from tests.blocks.direct import state_of

TRACKERS = (PathPID, PurePursuit, Stanley)
STEP = 0.01

# Where all laws are smooth: the point ahead is ahead, and the robot does not look away from it.
alongs, laterals, headings = st.floats(-0.5, 0.5), st.floats(-5.0, 5.0), st.floats(-1.2, 1.2)
speeds, gains = st.floats(0.1, 3.0), st.floats(0.2, 5.0)


def ask(
    block: Block, state: BlockState, along: float, lateral: float, heading: float, at: float = 0.0
) -> TwistValue:
    """The command about a reference that looks along ``at``; then one update."""
    c, s = math.cos(at), math.sin(at)
    error = (c * along - s * lateral, s * along + c * lateral, heading)
    values: dict[str, Any] = {"error": error, "reference": (3.0, -1.0, at)}
    values |= {"learn": 1.0, "turn": 0.0}
    (evaluation,), update = block.spec.evaluations, block.spec.update
    command: TwistValue = _called(block, evaluation, state, values)
    if update is not None:
        _called(block, update, state, {**values, "command": command})
    return command


def _called(block: Block, call: Evaluation, state: BlockState, values: dict[str, Any]) -> Any:
    """One of the block's methods, with the ports that it needs."""
    return getattr(block, call.method)(state, 0.0, *(values[port] for port in call.needs))


def command(block: Block, *error: float) -> TwistValue:
    return ask(block, state_of(block, dt=STEP), *error)


def drive(
    block: Block, lateral: float, heading: float, seconds: float, dt: float = 1e-3
) -> runtime.Result:
    """A robot beside a straight path, steered by the block and a feedforward of v_r."""
    graph = runtime.Graph(dt=dt, until=seconds)
    v_r = block.value("v_r")
    graph = graph.add("track", blocks.LinePath(x_end=2.0 * abs(v_r) * seconds + 1.0, samples=20001))
    graph = graph.add("match", blocks.MatchingPoint(v_r=v_r)).add("error", blocks.TrackingError())
    graph = graph.add("tracker", block).add("total", blocks.Sum())
    graph = graph.add(
        "plant", blocks.DifferentialDrive(x0=[0.1, lateral, heading], integrator="exact")
    )
    for wire in ("plant.pose match.pose", "track.path match.path", "plant.pose error.pose"):
        graph = graph.connect(*wire.split())
    graph = graph.connect("match.reference", "error.reference")
    graph = graph.connect("error.state", "tracker.error").connect(
        "match.reference", "tracker.reference"
    )
    graph = graph.connect("tracker.command", "total.terms").connect(
        "match.feedforward", "total.terms"
    )
    return graph.connect("total.out", "plant.command").probe("plant.pose").run()


def linear(a: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """States of x' = A x, row by row."""
    return np.array([expm(a * t) @ start for t in times])


@pytest.mark.parametrize("tracker", TRACKERS)
class TestAll:
    def test_it_has_the_ports_of_the_lqr(self, tracker: type[Block]) -> None:
        for mine, theirs in (
            (tracker.spec.inputs, LQR.spec.inputs),
            (tracker.spec.outputs, LQR.spec.outputs),
        ):
            assert {n: p.type for n, p in mine.items()} == {n: p.type for n, p in theirs.items()}

    @given(at=headings, v_r=speeds)
    def test_on_the_path_there_is_nothing_to_correct(
        self, tracker: type[Block], at: float, v_r: float
    ) -> None:
        assert command(tracker(v_r=v_r), 0.0, 0.0, 0.0, at) == (0.0, 0.0)

    @given(along=alongs, lateral=laterals, heading=headings, at=st.floats(-7.0, 7.0))
    def test_north_is_no_direction_of_its_own(
        self, tracker: type[Block], along: float, lateral: float, heading: float, at: float
    ) -> None:
        expected = command(tracker(), along, lateral, heading)
        turned = command(tracker(), along, lateral, heading, at)
        assert turned == pytest.approx(expected, abs=1e-9)

    @given(along=alongs, lateral=laterals, heading=headings)
    def test_left_is_right_mirrored(
        self, tracker: type[Block], along: float, lateral: float, heading: float
    ) -> None:
        v, omega = command(tracker(), along, lateral, heading)
        mirrored = command(tracker(), along, -lateral, -heading)
        assert mirrored == pytest.approx((v, -omega), abs=1e-12)

    @pytest.mark.parametrize(("v_r", "beside"), [(1.0, 0.2), (0.2, 0.18)])
    @pytest.mark.slow
    def test_from_any_heading_it_comes_to_the_path(
        self, tracker: type[Block], v_r: float, beside: float
    ) -> None:
        for heading in (-3.0, -1.5, 0.0, 1.6, 3.1):
            x, y, theta = drive(tracker(v_r=v_r), beside, heading, 30.0, STEP)["plant.pose"][-1]
            assert abs(y) < 0.02
            assert abs(math.remainder(theta, math.tau)) < 0.02
            assert x > 10.0 * v_r


class TestPID:
    @given(lateral=laterals, at=headings, v_r=speeds, ahead=gains)
    def test_looking_at_the_point_ahead_is_right(
        self, lateral: float, at: float, v_r: float, ahead: float
    ) -> None:
        looks = math.atan2(-lateral, v_r * ahead)
        pid = PathPID(v_r=v_r, lookahead_time=ahead, limit=1e3)
        assert command(pid, 0.4, lateral, looks, at)[1] == pytest.approx(0.0, abs=1e-12)
        assert command(pid, 0.4, lateral, looks + 0.1, at)[1] == pytest.approx(-2.0 * 0.1)

    def test_step(self) -> None:
        """u = -(kp E + ki E t + kd E (a / dt) exp(-t / tau)): the rate's impulse keeps its area."""
        pid = PathPID(kp=1.5, ki=0.7, kd=0.3, tau=0.08, limit=1e3)
        state = state_of(pid, dt=STEP)
        assert ask(pid, state, 0.0, 0.0, 0.0) == (0.0, 0.0)
        got = np.array([ask(pid, state, 0.0, 0.0, 0.25)[1] for _ in range(200)])
        t = STEP * np.arange(200)
        peak = -math.expm1(-STEP / 0.08) / STEP
        expected = -0.25 * (1.5 + 0.7 * t + 0.3 * peak * np.exp(-t / 0.08))
        np.testing.assert_allclose(got, expected, rtol=1e-12)

    def test_ramp(self) -> None:
        """u = -(kp c t + ki c t (t - dt) / 2 + kd c (1 - exp(-t / tau)))."""
        pid = PathPID(kp=1.5, ki=0.7, kd=0.3, tau=0.08, limit=1e3)
        state = state_of(pid, dt=STEP)
        t = STEP * np.arange(200)
        got = np.array([ask(pid, state, 0.0, 0.0, 0.4 * now)[1] for now in t])
        expected = -0.4 * (1.5 * t + 0.35 * t * (t - STEP) - 0.3 * np.expm1(-t / 0.08))
        np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-14)

    def test_the_rate_is_wrapped(self) -> None:
        pid = PathPID(kp=0.0, ki=0.0, kd=1.0)
        state = state_of(pid, dt=STEP)
        ask(pid, state, 0.0, 0.0, 3.14)
        peak = -math.expm1(-STEP / 0.1) / STEP
        turned = ask(pid, state, 0.0, 0.0, 0.01 - 3.14)[1]
        assert turned == pytest.approx(-peak * (math.tau - 6.28 + 0.01), rel=1e-9)

    def test_at_the_limit_the_sum_waits(self) -> None:
        pid = PathPID(kp=2.0, ki=1.0, kd=0.0, limit=1.0)
        state = state_of(pid, dt=STEP)
        assert [ask(pid, state, 0.0, 0.0, 0.6)[1] for _ in range(500)] == [-1.0] * 500
        assert state.integral[0] == 0.0
        # Back in range at once, as if the limit had never been reached.
        assert ask(pid, state, 0.0, 0.0, -0.1) == pytest.approx((0.0, 0.2))

    def test_at_the_limit_the_sum_may_lead_away(self) -> None:
        pid = PathPID(kp=0.0, ki=1.0, kd=0.0, limit=1.0)
        state = state_of(pid, dt=STEP)
        for _ in range(500):
            ask(pid, state, 0.0, 0.0, 0.5)
        assert 1.0 < state.integral[0] <= 1.0 + 0.5 * STEP + 1e-12
        wound = float(state.integral[0])
        assert ask(pid, state, 0.0, 0.0, -0.2)[1] == -1.0
        assert state.integral[0] == pytest.approx(wound - 0.2 * STEP)

    @pytest.mark.parametrize(("v_r", "ki"), [(1.0, 0.0), (0.3, 0.4)])
    def test_near_the_path_it_is_the_linear_loop(self, v_r: float, ki: float) -> None:
        pid = PathPID(v_r=v_r, kp=2.0, ki=ki, kd=0.0, lookahead_time=1.2)
        pose = drive(pid, 0.01 * v_r, 0.004, 6.0)["plant.pose"][::500]
        ahead = v_r * 1.2
        a = np.array([[0.0, v_r, 0.0], [-2.0 / ahead, -2.0, -ki], [1.0 / ahead, 1.0, 0.0]])
        expected = linear(a, np.array([0.01 * v_r, 0.004, 0.0]), 0.5 * np.arange(len(pose)))
        np.testing.assert_allclose(pose[:, 1:], expected[:, :2], rtol=0.0, atol=2e-5)

    def test_backwards_it_looks_the_other_way(self) -> None:
        forwards, backwards = (command(PathPID(v_r=v), 0.0, 0.3, 0.0)[1] for v in (0.5, -0.5))
        assert backwards == -forwards > 0.0

    def test_it_needs_a_speed(self) -> None:
        with pytest.raises(blocks.ParameterError, match="v_r: at 0 turning does not move"):
            PathPID(v_r=0.0)


class TestPurePursuit:
    @given(along=alongs, lateral=laterals, heading=headings, v_r=speeds, ahead=gains)
    def test_the_arc_leads_to_the_point_ahead(
        self, along: float, lateral: float, heading: float, v_r: float, ahead: float
    ) -> None:
        """Driven along the arc, a robot arrives there."""
        along *= v_r * ahead
        goal = np.array([v_r * ahead, 0.0])
        bearing = math.atan2(-lateral, v_r * ahead - along) - heading
        if abs(bearing) >= 0.5 * math.pi:
            return
        _, omega = command(PurePursuit(v_r=v_r, lookahead_time=ahead), along, lateral, heading)
        # An arc that leaves at an angle to its chord turns by twice that angle.
        straight = float(np.hypot(*(goal - [along, lateral]))) / v_r
        time = 2.0 * bearing / omega if abs(omega) > 1e-6 else straight
        end = INTEGRATORS["exact"]((along, lateral, heading), v_r, omega, time)
        np.testing.assert_allclose(end[:2], goal, rtol=0.0, atol=1e-5 * (1.0 + straight * v_r))

    @given(bearing=st.floats(1.58, 3.14))
    def test_a_point_behind_is_as_one_abeam(self, bearing: float) -> None:
        for side in (1.0, -1.0):
            _, omega = command(PurePursuit(lookahead_time=0.7), 0.0, 0.0, -side * bearing)
            assert omega == pytest.approx(side * 2.0 / 0.7)

    def test_at_the_point_there_is_nowhere_to_go(self) -> None:
        assert command(PurePursuit(), 1.0, 0.0, 0.3) == (0.0, 0.0)

    @pytest.mark.parametrize("v_r", [1.0, 0.3])
    def test_near_the_path_it_is_the_linear_loop(self, v_r: float) -> None:
        """s^2 + (2 / T) s + 2 / T^2, damped with 1 / sqrt(2), at every speed."""
        pose = drive(PurePursuit(v_r=v_r, lookahead_time=1.5), 0.01 * v_r, 0.0, 6.0)
        w, damping = math.sqrt(2.0) / 1.5, 1.0 / math.sqrt(2.0)
        t = 1e-3 * np.arange(6000)
        real = w * damping
        decay = np.exp(-real * t) * (np.cos(real * t) + np.sin(real * t))
        np.testing.assert_allclose(pose["plant.pose"][:, 1], 0.01 * v_r * decay, atol=2e-5)


class TestStanley:
    @given(lateral=laterals, heading=headings, at=headings, v_r=speeds, k=gains, base=gains)
    def test_the_front_wheel_rolls_as_the_law_says(
        self, lateral: float, heading: float, at: float, v_r: float, k: float, base: float
    ) -> None:
        """At v_r, against the path at atan(k e_f / v_r), where the steering angle allows."""
        front = lateral + base * math.sin(heading)
        towards = -math.atan(k * front / v_r)
        steering = max(-1.2, min(1.2, towards - heading))
        stanley = Stanley(v_r=v_r, k=k, wheel_base=base, delta_max=1.2)
        dv, omega = command(stanley, 0.0, lateral, heading, at)
        # The front wheel moves along the body with the robot, and across it by its turning.
        assert v_r + dv == pytest.approx(v_r * math.cos(steering), abs=1e-9)
        assert base * omega == pytest.approx(v_r * math.sin(steering), abs=1e-9)

    @pytest.mark.parametrize(("v_r", "k"), [(1.0, 1.0), (0.3, 2.0)])
    def test_the_cross_track_error_decays_as_in_the_paper(self, v_r: float, k: float) -> None:
        """e' = -k e / sqrt(1 + (k e / v)^2), from far away."""
        length = 0.4
        stanley = Stanley(v_r=v_r, k=k, wheel_base=length, delta_max=1.5)
        pose = drive(stanley, 2.0, -0.3, 8.0)["plant.pose"][::100]
        front = pose[:, 1] + length * np.sin(pose[:, 2])

        def law(t: float, e: FloatArray) -> FloatArray:
            return np.asarray(-k * e / np.sqrt(1.0 + (k * e / v_r) ** 2))

        times = 0.1 * np.arange(len(pose))
        expected = solve_ivp(law, (0.0, 8.0), [front[0]], t_eval=times, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(front, expected.y[0], rtol=0.0, atol=2e-3)

    def test_near_the_path_the_rates_are_k_and_twice_that(self) -> None:
        """From (e0, 0), s^2 + 3 k s + 2 k^2 gives 2 exp(-k t) - exp(-2 k t)."""
        pose = drive(Stanley(v_r=0.5, k=1.5), 0.004, 0.0, 5.0)["plant.pose"]
        t = 1e-3 * np.arange(len(pose))
        expected = 0.004 * (2.0 * np.exp(-1.5 * t) - np.exp(-3.0 * t))
        np.testing.assert_allclose(pose[:, 1], expected, rtol=0.0, atol=1e-5)

    @given(lateral=laterals, heading=st.floats(-3.1, 3.1))
    def test_it_keeps_moving(self, lateral: float, heading: float) -> None:
        dv, _ = command(Stanley(), 0.0, lateral, heading)
        assert 1.0 + dv >= math.cos(1.0) - 1e-12
