"""Trackers that remove a constant disturbance: by integral action, an observer, or adaptation."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import final

import numpy as np

from blocks.control.lqr import feedback_gain, linearised, riccati
from blocks.control.tracking import Tracker, offsets
from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    ParameterError,
    PoseValue,
    Scalar,
    State,
    TwistValue,
    param,
    wrap,
)
from blocks.core.portable import flush, flush_due, share_of


@final
class LQI(Tracker):
    """Linear quadratic regulation with integral action on the lateral error.

        error, reference, learn ─▶ [ LQI ] ─▶ command

    command = -K [along, lateral, heading, z], the turn rate within +-limit, with z' = lateral: the
    linear quadratic regulator of the model in the path's frame, extended by the integral z
    (Anderson and Moore, Optimal Control: Linear Quadratic Methods, 1990, section on integral
    feedback). At rest the lateral error is 0 under any constant disturbance.

    ``q`` weighs the errors along the path, across it and in heading. At the limit, only errors that
    lead away from it are integrated.
    """

    learn = Input(Scalar, default=1.0, doc="factor on what is integrated: 0 pauses")

    q: FloatArray = param(
        (1.0, 1.0, 1.0), at_least=0.0, shape=(3,), tunable=True, doc="weights of the errors"
    )
    q_integral: float = param(
        0.1, above=0.0, tunable=True, doc="weight of the integral z of the lateral error"
    )
    r: FloatArray = param(
        (1.0, 1.0), above=0.0, shape=(2,), tunable=True, doc="weights of v and omega"
    )
    v_r: float = param(
        1.0, unit="m/s", tunable=True, doc="reference speed; not 0, where no turn moves it across"
    )
    model: str = param("paper", choices=("paper", "exact"), doc="second-order term of B, as in LQR")
    limit: float = param(3.0, unit="rad/s", above=0.0, tunable=True, doc="largest turn rate")

    integral = State(1, unit="m s", doc="integral z of the lateral error")

    def validate(self) -> None:
        _check_speed(self.v_r)

    def validate_in(self, context: BlockContext) -> None:
        try:
            self.gain_at(context.dt)
        except ValueError as error:
            raise ParameterError([("q", f"{error}; expected weights above 0")]) from None

    def gain_at(self, dt: float) -> FloatArray:
        """K, (2, 4), for a sampling period (s)."""
        a, b = np.eye(4), np.zeros((4, 2))
        a[:3, :3], b[:3] = linearised(self.v_r, 0.0, dt, self.model)
        a[3, 1] = dt
        q, r = np.diag([*self.q.tolist(), self.q_integral]), np.diag(self.r)
        return feedback_gain(a, b, r, riccati(a, b, q, r))

    def start(self, state: BlockState) -> None:
        state.gain_v, state.gain_omega = map(tuple, self.gain_at(state.dt).tolist())

    def _wanted(self, state: BlockState, along: float, lateral: float, heading: float) -> float:
        """The turn rate before it is limited."""
        k = state.gain_omega
        z = float(state.integral[0])
        return -float(k[0] * along + k[1] * lateral + k[2] * heading + k[3] * z)

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        along, lateral = offsets(error, reference[2])
        k = state.gain_v
        z = float(state.integral[0])
        v = -(k[0] * along + k[1] * lateral + k[2] * error[2] + k[3] * z)
        omega = self._wanted(state, along, lateral, error[2])
        return v, max(-self.limit, min(self.limit, omega))

    def update(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue, learn: float
    ) -> None:
        along, lateral = offsets(error, reference[2])
        wanted = self._wanted(state, along, lateral, error[2])
        if abs(wanted) <= self.limit or wanted * state.gain_omega[3] * lateral > 0.0:
            state.integral[0] += learn * lateral * state.dt


class Compensator(Tracker):
    """A tracker that subtracts an estimate of the disturbance of the turn rate.

        error, reference, learn ─▶ [ Compensator ] ─▶ command

    e_theta' = u + d, where u is the block's own turn rate and the disturbance d all else: a bias, a
    share of the command that is lost, curvature that is not fed forward. command = [0, u] with
    u = u_b - d_hat, within +-limit, and u_b = -2 rate wrap(e_theta + atan(rate e / (2 v_r))), which
    near a straight path gives (s + rate)^2 and turns the robot towards it from anywhere.
    """

    learn = Input(Scalar, default=1.0, doc="factor on what is learnt in a tick: 0 pauses")

    rate: float = param(
        1.0, unit="1/s", above=0.0, tunable=True, doc="both poles of the tracking error"
    )
    v_r: float = param(
        1.0, unit="m/s", tunable=True, doc="reference speed; not 0, where no turn moves it across"
    )
    limit: float = param(
        3.0, unit="rad/s", above=0.0, tunable=True, doc="largest turn rate, and largest d_hat"
    )

    def validate(self) -> None:
        _check_speed(self.v_r)

    @abstractmethod
    def _estimate(self, state: BlockState) -> float:
        """d_hat from the updates before this tick (rad/s)."""

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        return 0.0, self._turn(state, error, reference)

    def _turn(self, state: BlockState, error: PoseValue, reference: PoseValue) -> float:
        _, lateral = offsets(error, reference[2])
        course = wrap(error[2] + math.atan(0.5 * self.rate * lateral / self.v_r))
        wanted = -2.0 * self.rate * course - self._estimate(state)
        return max(-self.limit, min(self.limit, wanted))


@final
class DisturbanceObserver(Compensator):
    """Path following: estimate the disturbance of the turn rate from what the heading did.

        error, reference, learn ─▶ [ DisturbanceObserver ] ─▶ command

    For other plants there is LinearDisturbanceObserver. Here,
    d_hat is (change of e_theta) / dt - u of the last tick behind a lowpass of time constant
    ``tau``: the observer of Ohnishi with a first-order filter (Chen, Yang, Guo and Li,
    Disturbance-Observer-Based Control and Related Methods: An Overview, 2016). A constant d is
    estimated as d (1 - exp(-t / tau)). The control law is that of :class:`Compensator`:
    command = [0, u_b - d_hat], both poles at -rate.
    """

    tau: float = param(0.5, unit="s", above=0.0, tunable=True, doc="time constant of the filter")

    estimated = State(1, unit="rad/s", doc="the estimate d_hat")
    heading = State(1, unit="rad", doc="heading error of the last tick; NaN before the first")
    applied = State(1, unit="rad/s", doc="the block's turn rate of the last tick")

    def start(self, state: BlockState) -> None:
        state.heading[0] = math.nan
        state.share = share_of(self.tau, state.dt)

    def _estimate(self, state: BlockState) -> float:
        return float(state.estimated[0])

    def update(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue, learn: float
    ) -> None:
        turn, before = self._turn(state, error, reference), float(state.heading[0])
        if not math.isnan(before):
            disturbance = wrap(error[2] - before) / state.dt - float(state.applied[0])
            d = float(state.estimated[0])
            d += learn * state.share * (disturbance - d)
            state.estimated[0] = max(-self.limit, min(self.limit, d))
        state.applied[0] = turn
        if flush_due(t, state.dt):
            flush(state.estimated)
        state.heading[0] = error[2]


@final
class L1Adaptive(Compensator):
    """Path following: L1 adaptive control of the turn rate, by a predictor and a filter.

        error, reference, learn ─▶ [ L1Adaptive ] ─▶ command

    For other plants there is LinearL1.

    Predictor   x(t_k+1) = e_theta + dt (u + sigma) + fade (x - e_theta)
    Adaptation  sigma = -fade (x - e_theta) / dt, fade = exp(-predictor dt)
    Filter      d_hat' = filter (sigma - d_hat)

    The piecewise constant law of Hovakimyan and Cao (L1 Adaptive Control Theory, 2010, section
    3.3), for the one state that the disturbance enters, sampled every dt: a constant d is estimated
    in one tick as exp(-predictor dt) d, and the filter decides which part is compensated. The rest
    of the law is :class:`Compensator`'s: command = [0, u_b - d_hat], both poles at -rate.
    """

    predictor: float = param(
        2.0, unit="1/s", above=0.0, tunable=True, doc="pole of the prediction error"
    )
    bandwidth: float = param(
        2.0, unit="1/s", above=0.0, name="filter", tunable=True, doc="bandwidth of the filter"
    )

    estimated = State(1, unit="rad/s", doc="the estimate behind the filter, d_hat")
    predicted = State(1, unit="rad", doc="predicted heading error; NaN before the first tick")

    def start(self, state: BlockState) -> None:
        state.predicted[0] = math.nan
        state.fade = math.exp(-self.predictor * state.dt)
        state.share = -math.expm1(-self.bandwidth * state.dt)

    def _estimate(self, state: BlockState) -> float:
        return float(state.estimated[0])

    def update(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue, learn: float
    ) -> None:
        turn = self._turn(state, error, reference)
        ahead = 0.0
        if not math.isnan(state.predicted[0]):
            ahead = wrap(float(state.predicted[0]) - error[2])
        sigma = -state.fade * ahead / state.dt
        d = float(state.estimated[0])
        d += learn * state.share * (sigma - d)
        state.estimated[0] = max(-self.limit, min(self.limit, d))
        # The adaptation cancels what is left of the error, so that the disturbance alone shows at
        # the next tick.
        state.predicted[0] = error[2] + state.dt * (turn + sigma) + state.fade * ahead
        if flush_due(t, state.dt):
            flush(state.estimated)


def _check_speed(v_r: float) -> None:
    if v_r == 0.0:
        message = "at 0 turning does not move the robot across; expected another"
        raise ParameterError([("v_r", message)])
