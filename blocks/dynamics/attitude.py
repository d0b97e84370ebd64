"""The attitude of a body that turns, as a quaternion in continuous time.

Rates of turn (3,) go in, the quaternion (4,) comes out::

    gyro (rad/s) ─▶ QuaternionIntegrator ─▶ attitude (w, x, y, z)
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    State,
    Vector,
    param,
)


class QuaternionIntegrator(Block):
    """Integrate a rate of turn to an attitude.

        rate ─▶ [ QuaternionIntegrator ] ─▶ attitude

    q' = q (0, omega) / 2 with omega in the body, or (0, omega) q / 2 with omega in the world, as
    ``frame`` says; q is a unit quaternion (w, x, y, z), brought back to length one after each step
    of the solver (Stevens, Lewis and Johnson, Aircraft Control and Simulation, 2016, section 1.8).
    """

    rate = Input(Vector(3), unit="rad/s", doc="the rate of turn omega")
    attitude = Output(Vector(4), doc="the quaternion q")

    initial: FloatArray = param([1.0, 0.0, 0.0, 0.0], shape=(4,), doc="q at the start, normalised")
    frame: str = param("body", choices=("body", "world"), doc="in which omega is given")

    q = State(4, continuous=True, doc="the quaternion")

    def validate(self) -> None:
        if not self.initial.any():
            raise ParameterError([("initial", "expected a quaternion of length 1, got 0")])

    def start(self, state: BlockState) -> None:
        state.q[:] = self.initial / math.sqrt(float(self.initial @ self.initial))
        state.sign = 1.0 if self.frame == "body" else -1.0

    def output(self, state: BlockState, t: float) -> FloatArray:
        attitude: FloatArray = state.q.copy()
        return attitude

    def derivative(self, state: BlockState, t: float, rate: FloatArray) -> FloatArray:
        q, s = state.q, state.sign
        out = np.empty(4)
        out[0] = -0.5 * (q[1] * rate[0] + q[2] * rate[1] + q[3] * rate[2])
        # q (0, omega) has w omega + r x omega, (0, omega) q has w omega - r x omega.
        out[1] = 0.5 * (q[0] * rate[0] + s * (q[2] * rate[2] - q[3] * rate[1]))
        out[2] = 0.5 * (q[0] * rate[1] + s * (q[3] * rate[0] - q[1] * rate[2]))
        out[3] = 0.5 * (q[0] * rate[2] + s * (q[1] * rate[1] - q[2] * rate[0]))
        return out

    def project(self, state: BlockState) -> None:
        total = 0.0
        for i in range(4):
            total += state.q[i] * state.q[i]
        length = math.sqrt(total)
        for i in range(4):
            state.q[i] /= length
