"""Vehicles on a plane as differential equations, without slip.

Speeds and steering go in, the pose comes out; the run's solver integrates between ticks::

    car: {type: Bicycle, wheel_base: 2.7, x0: [0, 0, 0], body_radius: 1.2}
"""

from __future__ import annotations

import math
from abc import ABC

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    Pose,
    PoseValue,
    Scalar,
    State,
    Twist,
    TwistValue,
    param,
)
from blocks.vehicle.contact import check_body, free_place
from blocks.world import world_of


class _ContinuousVehicle(Block, ABC):
    pose = Output(Pose, doc="position and heading; the heading is not wrapped")

    x0: FloatArray = param([0.0, 0.0, 0.0], unit="m, m, rad", shape=(3,), doc="pose at the start")
    body_radius: float = param(
        0.0,
        unit="m",
        at_least=0.0,
        doc="radius of a body about the pose that the world stops; 0: no body",
    )

    def validate_in(self, context: BlockContext) -> None:
        if self.body_radius:
            x, y, _ = self.x0.tolist()
            check_body(context, (x, y), self.body_radius)

    def start(self, state: BlockState) -> None:
        state.x[:] = self.x0
        world = world_of(state.context)
        state.surfaces = None if world is None else world.arrays

    def hold_back(self, state: BlockState) -> None:
        """Move a body out of the surfaces that the last step of the solver ended in."""
        # A step of the solver ends at most its own length inside a surface. Pushing the body out
        # along the normal leaves the tangential part of the motion, as a wall without friction.
        if self.body_radius > 0.0 and state.surfaces is not None:
            x, y = float(state.x[0]), float(state.x[1])
            x, y = free_place(state.surfaces, x, y, self.body_radius)
            state.x[0], state.x[1] = x, y

    def output(self, state: BlockState, t: float) -> PoseValue:
        return float(state.x[0]), float(state.x[1]), float(state.x[2])

    def pose_rates(self, state: BlockState, v: float, omega: float) -> FloatArray:
        """The rate of change of the pose at a speed and a turn rate."""
        rates = np.empty(3)
        rates[0] = v * math.cos(state.x[2])
        rates[1] = v * math.sin(state.x[2])
        rates[2] = omega
        return rates


class Unicycle(_ContinuousVehicle):
    """A vehicle that turns on the spot, such as one with two driven wheels.

        command ─▶ [ Unicycle ] ─▶ pose

    x' = v cos(theta), y' = v sin(theta), theta' = omega (Lynch and Park, Modern Robotics, 2017,
    eq. 13.12). The continuous twin of DifferentialDrive: the solver of the run integrates it.
    """

    command = Input(Twist, doc="speed and turn rate")

    x = State(3, name="x", continuous=True, signal=Pose, doc="the pose")

    def derivative(self, state: BlockState, t: float, command: TwistValue) -> FloatArray:
        return self.pose_rates(state, command[0], command[1])

    def project(self, state: BlockState) -> None:
        self.hold_back(state)


class Bicycle(_ContinuousVehicle):
    """A vehicle with a steered front wheel, such as a car.

        v, steering ─▶ [ Bicycle ] ─▶ pose

    x' = v cos(theta), y' = v sin(theta), theta' = v tan(delta) / wheel_base, where delta is
    ``steering``, limited to steering_max, and the pose that of the rear axle (Corke, Robotics,
    Vision and Control, 2nd ed., eq. 4.2).
    """

    v = Input(Scalar, unit="m/s", doc="speed of the rear axle")
    steering = Input(Scalar, unit="rad", doc="angle of the front wheel, left positive")

    wheel_base: float = param(
        1.0, unit="m", above=0.0, tunable=True, doc="distance between the axles"
    )
    steering_max: float = param(
        0.5,
        unit="rad",
        above=0.0,
        below=0.5 * math.pi,
        tunable=True,
        doc="largest angle of the front wheel",
    )
    v_max: float = param(
        math.inf, unit="m/s", above=0.0, finite=False, tunable=True, doc="largest speed, either way"
    )

    x = State(3, name="x", continuous=True, signal=Pose, doc="the pose")

    def derivative(self, state: BlockState, t: float, v: float, steering: float) -> FloatArray:
        # Limited here and not by a block ahead: whatever commands it, a car steers no farther.
        speed = max(-self.v_max, min(self.v_max, v))
        delta = max(-self.steering_max, min(self.steering_max, steering))
        return self.pose_rates(state, speed, speed * math.tan(delta) / self.wheel_base)

    def project(self, state: BlockState) -> None:
        self.hold_back(state)
