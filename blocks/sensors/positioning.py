"""Sensors of a position and of a heading: a satellite receiver, and a compass.

The motion of a body goes in, what it measures comes out, at each tick of the block::

    gps: {type: GPS, dt: 0.2, noise: [0.1, 0.1, 0.2]}
    compass: {type: Compass, dt: 0.02, noise: 1deg}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    State,
    Vector,
    param,
    wrap,
)


class GPS(Block):
    """A receiver of satellite signals: position and velocity with noise and a slow drift.

        position, velocity ─▶ [ GPS ] ─▶ fix, course, stamp

    fix = position + d + n, course = velocity + n_v, with white noises n of given deviations per
    sample, and a drift d, a Gauss-Markov process: d(t + dt) = e^(-dt / tau) d + noise, with the
    deviation ``drift`` in its stationary state, in which it begins (Beard and McLain, Small
    Unmanned Aircraft, 2012, section 7.5). The defaults are of a receiver with corrections; without,
    a drift of [4.7, 4.7, 9.2] m is usual. The block's own ``dt`` is the time between fixes.
    """

    position = Input(Vector(3), unit="m", doc="the true position")
    velocity = Input(Vector(3), unit="m/s", default=0.0, doc="the true velocity")
    fix = Output(Vector(3), unit="m", doc="the measured position")
    course = Output(Vector(3), unit="m/s", doc="the measured velocity")
    stamp = Output(Scalar, unit="s", doc="when it was measured")

    noise: FloatArray = param(
        [0.1, 0.1, 0.2], unit="m", shape=(3,), at_least=0.0, doc="deviation of a fix, per axis"
    )
    drift: FloatArray = param(
        [0.0, 0.0, 0.0], unit="m", shape=(3,), at_least=0.0, doc="deviation of the slow error"
    )
    tau: float = param(1100.0, unit="s", above=0.0, doc="time constant of the slow error")
    velocity_noise: FloatArray = param(
        [0.05, 0.05, 0.1], unit="m/s", shape=(3,), at_least=0.0, doc="deviation of the velocity"
    )

    slow = State(3, unit="m", doc="the slow error d")
    fresh = State(6, doc="noise of this tick: of the position (m), of the velocity (m/s)")

    def start(self, state: BlockState) -> None:
        state.drift, state.keep = self.drift.copy(), math.exp(-state.dt / self.tau)
        # What keeps the variance of the stationary state.
        state.renew = math.sqrt(max(1.0 - state.keep * state.keep, 0.0))
        state.sigma = np.concatenate((self.noise, self.velocity_noise))
        for i in range(3):
            state.slow[i] = state.drift[i] * state.rng.standard_normal()
        self.draw(state)

    def draw(self, state: BlockState) -> None:
        for i in range(6):
            state.fresh[i] = state.sigma[i] * state.rng.standard_normal()

    def output(
        self, state: BlockState, t: float, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        fix, course = position.copy(), velocity.copy()
        for i in range(3):
            fix[i] += state.slow[i] + state.fresh[i]
            course[i] += state.fresh[3 + i]
        return fix, course, t

    def update(self, state: BlockState, t: float) -> None:
        for i in range(3):
            fresh = state.renew * state.drift[i] * state.rng.standard_normal()
            state.slow[i] = state.keep * state.slow[i] + fresh
        self.draw(state)


class Compass(Block):
    """A magnetic compass: a heading with noise, declination and deviation.

        attitude ─▶ [ Compass ] ─▶ heading, stamp

    heading = psi + declination + B sin(psi) + C cos(psi) + n, wrapped to (-pi, pi], with white
    noise n. B and C are the coefficients of the deviation by iron that is fixed to the vehicle
    (hard iron; Bowditch, The American Practical Navigator, 2019, chapter 8). ``attitude`` is a
    heading (one number), a pose (three), or a quaternion (four), of which psi is the heading of the
    body's x axis.
    """

    attitude = Input(
        Scalar,
        variadic=True,
        spread="numbers",
        doc="a heading (rad), a pose, or the quaternion from the body to the world",
    )
    heading = Output(Scalar, unit="rad", doc="the measured heading")
    stamp = Output(Scalar, unit="s", doc="when it was measured")

    noise: float = param(0.02, unit="rad", at_least=0.0, doc="deviation of a measurement")
    declination: float = param(0.0, unit="rad", doc="of magnetic from true north, if not corrected")
    deviation: FloatArray = param([0.0, 0.0], unit="rad", shape=(2,), doc="B and C")

    fresh = State(unit="rad", doc="noise of this tick")

    def validate_in(self, context: BlockContext) -> None:
        count = context.count("attitude")
        if count not in (1, 3, 4):
            text = f"a heading has 1 number, a pose 3 and a quaternion 4, got {count} in attitude"
            raise ParameterError([("attitude", text)])

    def start(self, state: BlockState) -> None:
        count, state.deviation = len(state.context.terms["attitude"]), self.deviation.copy()
        state.is_quaternion, state.is_pose = count == 4, count == 3
        state.fresh[...] = self.noise * state.rng.standard_normal()

    def output(
        self, state: BlockState, t: float, attitude: tuple[float, ...]
    ) -> tuple[float, float]:
        if state.is_quaternion:
            w, x, y, z = attitude
            psi = math.atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)
        elif state.is_pose:
            psi = attitude[2]
        else:
            psi = attitude[0]
        error = self.declination + float(state.fresh)
        error += state.deviation[0] * math.sin(psi) + state.deviation[1] * math.cos(psi)
        return wrap(psi + error), t

    def update(self, state: BlockState, t: float) -> None:
        state.fresh[...] = self.noise * state.rng.standard_normal()
