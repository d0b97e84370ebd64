"""Pendulums."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import Block, BlockState, FloatArray, Input, Output, Scalar, State, param


class Pendulum(Block):
    """A point mass on a massless rod that turns about a fixed joint.

        torque ─▶ [ Pendulum ] ─▶ angle, rate

    m l^2 theta'' = torque - b theta' - m g l sin(theta): theta = 0 hangs down (Tedrake,
    Underactuated Robotics, eq. 2.3).
    """

    torque = Input(Scalar, unit="N m", default=0.0, doc="at the joint")
    angle = Output(Scalar, unit="rad", doc="theta, 0 hanging down; not wrapped")
    rate = Output(Scalar, unit="rad/s", doc="theta'")

    mass: float = param(1.0, unit="kg", above=0.0, tunable=True, doc="m")
    length: float = param(
        1.0, unit="m", above=0.0, tunable=True, doc="l, from the joint to the mass"
    )
    damping: float = param(
        0.0, unit="N m s", at_least=0.0, tunable=True, doc="b, friction of the joint"
    )
    gravity: float = param(9.81, unit="m/s^2", tunable=True, doc="g")
    angle0: float = param(0.0, unit="rad", doc="theta at the start")
    rate0: float = param(0.0, unit="rad/s", doc="theta' at the start")

    x = State(2, name="x", continuous=True, doc="theta, theta'")

    def start(self, state: BlockState) -> None:
        state.x[0], state.x[1] = self.angle0, self.rate0

    def output(self, state: BlockState, t: float) -> tuple[float, float]:
        return float(state.x[0]), float(state.x[1])

    def derivative(self, state: BlockState, t: float, torque: float) -> FloatArray:
        rates = np.empty(2)
        inertia = self.mass * self.length * self.length
        weight = self.mass * self.gravity * self.length * math.sin(state.x[0])
        rates[0] = state.x[1]
        rates[1] = (torque - self.damping * state.x[1] - weight) / inertia
        return rates


class CartPole(Block):
    """A cart on a rail with a pole that swings freely about a joint on it.

        force ─▶ [ CartPole ] ─▶ position, velocity, angle, rate

    With theta = 0 upright and positive towards +x: (M + m) x'' + m l theta'' cos(theta) =
    force - b x' + m l theta'^2 sin(theta), l theta'' + x'' cos(theta) = g sin(theta), where the
    pole's mass m is at its end (Tedrake, Underactuated Robotics, section 3.2, with theta counted
    from the top).
    """

    force = Input(Scalar, unit="N", default=0.0, doc="on the cart, along the rail")
    position = Output(Scalar, unit="m", doc="x of the cart")
    velocity = Output(Scalar, unit="m/s", doc="x'")
    angle = Output(Scalar, unit="rad", doc="theta, 0 upright; not wrapped")
    rate = Output(Scalar, unit="rad/s", doc="theta'")

    cart_mass: float = param(1.0, unit="kg", above=0.0, tunable=True, doc="M")
    pole_mass: float = param(
        0.1, unit="kg", above=0.0, tunable=True, doc="m, at the end of the pole"
    )
    length: float = param(
        0.5, unit="m", above=0.0, tunable=True, doc="l, from the joint to the mass"
    )
    friction: float = param(
        0.0, unit="N s/m", at_least=0.0, tunable=True, doc="b, of the cart on the rail"
    )
    gravity: float = param(9.81, unit="m/s^2", tunable=True, doc="g")
    x0: FloatArray = param(
        [0.0, 0.0, 0.0, 0.0],
        unit="m, m/s, rad, rad/s",
        shape=(4,),
        doc="position, velocity, angle and rate at the start",
    )

    x = State(4, name="x", continuous=True, doc="x, x', theta, theta'")

    def start(self, state: BlockState) -> None:
        state.x[:] = self.x0

    def output(self, state: BlockState, t: float) -> tuple[float, float, float, float]:
        return float(state.x[0]), float(state.x[1]), float(state.x[2]), float(state.x[3])

    def derivative(self, state: BlockState, t: float, force: float) -> FloatArray:
        velocity, angle, rate = state.x[1], state.x[2], state.x[3]
        sine, cosine = math.sin(angle), math.cos(angle)
        m, length = self.pole_mass, self.length
        push = force - self.friction * velocity + m * length * rate * rate * sine
        mass = self.cart_mass + m * sine * sine
        acceleration = (push - m * self.gravity * sine * cosine) / mass
        rates = np.empty(4)
        rates[0] = velocity
        rates[1] = acceleration
        rates[2] = rate
        rates[3] = (self.gravity * sine - acceleration * cosine) / length
        return rates
