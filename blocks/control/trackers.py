"""Textbook path trackers, each with the ports of the LQR, which it can replace."""

from __future__ import annotations

import math
from typing import final

from blocks.control.tracking import Tracker, offsets
from blocks.core import BlockState, ParameterError, PoseValue, State, TwistValue, param, wrap
from blocks.core.portable import share_of

QUARTER = 0.5 * math.pi


@final
class PathPID(Tracker):
    """Hold the course to a point ahead on the path's tangent with a PID controller.

        error, reference ─▶ [ PathPID ] ─▶ command

    The point lies v_r * lookahead_time along the tangent from where the robot is beside it, and
    epsilon = wrap(e_theta + atan(e / (v_r lookahead_time))) is the deviation of the
    heading from its direction (line-of-sight guidance; Fossen, Breivik and Skjetne, 2003).
    command = [0, omega] with omega = -(kp epsilon + ki (sum of epsilon dt) + kd d), within +-limit.

    d is the rate of epsilon behind a lowpass of time constant ``tau``, and 0 on the first tick:
    d = (a / dt) wrap(epsilon - s), s += a wrap(epsilon - s), a = 1 - exp(-dt / tau), which is
    exact on steps and ramps. At the limit, only errors that lead away from it are integrated
    (conditional integration; Åström and Hägglund, PID Controllers, 1995). Near a straight path
    kp alone gives s^2 + kp s + kp / lookahead_time, whatever the speed.
    """

    kp: float = param(2.0, unit="1/s", at_least=0.0, tunable=True, doc="turn rate per course error")
    ki: float = param(
        0.2, unit="1/s^2", at_least=0.0, tunable=True, doc="turn rate per sum of course errors"
    )
    kd: float = param(0.2, at_least=0.0, tunable=True, doc="turn rate per rate of the course error")
    tau: float = param(
        0.1, unit="s", above=0.0, tunable=True, doc="time constant of the rate's lowpass"
    )
    limit: float = param(3.0, unit="rad/s", above=0.0, tunable=True, doc="largest turn rate")
    v_r: float = param(
        1.0, unit="m/s", tunable=True, doc="reference speed; not 0, where no turn moves it across"
    )
    lookahead_time: float = param(
        1.0, unit="s", above=0.0, tunable=True, doc="how far ahead the point lies"
    )

    integral = State(1, unit="rad s", doc="sum of the course error times dt")
    smooth = State(1, unit="rad", doc="course error behind the lowpass; NaN before the first tick")

    def validate(self) -> None:
        if self.v_r == 0.0:
            message = "at 0 turning does not move the robot across; expected another"
            raise ParameterError([("v_r", message)])

    def start(self, state: BlockState) -> None:
        state.smooth[0] = math.nan
        state.share = share_of(self.tau, state.dt)

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        epsilon, past = self._course(state, error, reference)
        return 0.0, max(-self.limit, min(self.limit, self._wanted(state, epsilon, past)))

    def _course(
        self, state: BlockState, error: PoseValue, reference: PoseValue
    ) -> tuple[float, float]:
        """The course error, and what it is past the smoothed one (rad)."""
        _, lateral = offsets(error, reference[2])
        epsilon = wrap(error[2] + math.atan(lateral / (self.v_r * self.lookahead_time)))
        smooth = float(state.smooth[0])
        return epsilon, 0.0 if math.isnan(smooth) else wrap(epsilon - smooth)

    def _wanted(self, state: BlockState, epsilon: float, past: float) -> float:
        """The turn rate before it is limited."""
        rate: float = state.share / state.dt * past
        return -(self.kp * epsilon + self.ki * float(state.integral[0]) + self.kd * rate)

    def update(self, state: BlockState, t: float, error: PoseValue, reference: PoseValue) -> None:
        epsilon, past = self._course(state, error, reference)
        wanted = self._wanted(state, epsilon, past)
        # At the limit, only what leads away from it is integrated (conditional integration): the
        # turn rate is minus the sum, so that an error of the same sign reduces it.
        if abs(wanted) <= self.limit or wanted * epsilon > 0.0:
            state.integral[0] += epsilon * state.dt
        state.smooth[0] = epsilon - (1.0 - state.share) * past


@final
class PurePursuit(Tracker):
    """Steer along the arc that leads to a point ahead on the path (Coulter, 1992).

        error, reference ─▶ [ PurePursuit ] ─▶ command

    The arc from the robot, tangent to its heading, through a point at distance L and bearing
    alpha has the curvature kappa = 2 sin(alpha) / L; command = [0, v_r kappa]. The point lies
    v_r * lookahead_time ahead of the reference on its tangent: the path's
    curvature is left to the feedforward, which adds v_r times it. The robot turns towards a point
    behind it as fast as towards one abeam.

    Near a straight path the error decays with damping 1 / sqrt(2) and natural frequency sqrt(2) /
    lookahead_time. (CMU-RI-TR-92-01 takes the point of the path at a given L; this one exists
    at any distance from the path.)
    """

    v_r: float = param(1.0, unit="m/s", above=0.0, tunable=True, doc="reference speed")
    lookahead_time: float = param(
        1.0, unit="s", above=0.0, tunable=True, doc="how far ahead the point lies"
    )

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        along, lateral = offsets(error, reference[2])
        ahead = self.v_r * self.lookahead_time - along
        distance = math.hypot(ahead, lateral)
        if distance == 0.0:
            return 0.0, 0.0
        alpha = wrap(math.atan2(-lateral, ahead) - error[2])
        # Beyond a right angle the sine falls again, and a robot that faces away would turn slowly.
        sine = math.sin(alpha) if abs(alpha) < QUARTER else math.copysign(1.0, alpha)
        return 0.0, self.v_r * 2.0 * sine / distance


@final
class Stanley(Tracker):
    """Steer a virtual front wheel onto the path (Hoffmann, Tomlin, Montemerlo and Thrun, 2007).

        error, reference ─▶ [ Stanley ] ─▶ command

    delta = -(e_theta + atan(k e_f / v_r)), within +-delta_max, is the steering angle of a wheel
    that rolls at v_r, l ahead of the robot's own two; e_f = e + l sin(e_theta) is how far it is
    from the path's tangent. Two driven wheels can move so that this point does what that wheel
    would: v = v_r cos(delta), omega = v_r sin(delta) / l, and command = [v - v_r, omega].

    Hence the law of the paper on a straight path, e_f' = -k e_f / sqrt(1 + (k e_f / v_r)^2): it
    converges from anywhere, and in the end like exp(-k t). The heading follows at the rate
    v_r / l. The robot never stops, since delta_max is less than a right angle. (Autonomous
    Automobile Trajectory Tracking for Off-Road Driving, ACC 2007; without its terms for tires,
    steering servo and low speeds.)
    """

    v_r: float = param(
        1.0, unit="m/s", above=0.0, tunable=True, doc="reference speed, that of the front wheel"
    )
    k: float = param(
        1.0, unit="1/s", above=0.0, tunable=True, doc="rate at which the cross-track error decays"
    )
    wheel_base: float | None = param(
        None, unit="m", above=0.0, doc="l; default v_r / (2 k): the heading is twice as fast"
    )
    delta_max: float = param(
        1.0, unit="rad", above=0.0, below=QUARTER, tunable=True, doc="largest steering angle"
    )

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        length = 0.5 * self.v_r / self.k if self.wheel_base is None else self.wheel_base
        _, lateral = offsets(error, reference[2])
        front = lateral + length * math.sin(error[2])
        # Limited after wrapping: a robot that faces back turns as fast as it may, one way.
        delta = wrap(-error[2] - math.atan2(self.k * front, self.v_r))
        delta = max(-self.delta_max, min(self.delta_max, delta))
        return self.v_r * (math.cos(delta) - 1.0), self.v_r * math.sin(delta) / length
