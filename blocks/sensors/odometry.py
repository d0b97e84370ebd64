"""Odometry: a pose from the turns of two wheels.

The true motion goes in, the pose that the encoders suggest comes out::

    odometry: {type: WheelOdometry, wheel_base: 0.3, scale: [1.01, 0.99], dt: 0.02}
"""

from __future__ import annotations

import math

from blocks.core import (
    Block,
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


class WheelOdometry(Block):
    """The pose that a robot's two wheel encoders suggest.

        motion ─▶ [ WheelOdometry ] ─▶ pose, stamp

    Each wheel rolls d = (v -+ omega b / 2) dt, and its encoder counts scale d plus noise with the
    variance noise^2 |d|, as slip adds up along the way (Chong and Kleeman, Accurate odometry and
    error modelling for a mobile robot, 1997), in whole steps of ``resolution``, the rest counting
    later. ``scale`` of both wheels and ``base_scale`` of their distance are the systematic errors
    E_d and E_b of Borenstein and Feng (Measurement and correction of systematic odometry errors in
    mobile robots, 1996). The pose adds up the counts, along arcs.
    """

    motion = Input(Twist, doc="the true speed and rate of turn")
    pose = Output(Pose, doc="the pose by the encoders")
    stamp = Output(Scalar, unit="s", doc="when it was measured")

    wheel_base: float = param(0.3, unit="m", above=0.0, doc="b, the true distance of the wheels")
    base_scale: float = param(1.0, above=0.0, doc="assumed distance of the wheels, over b")
    scale: FloatArray = param(
        [1.0, 1.0],
        shape=(2,),
        above=0.0,
        doc="assumed radius of left and right wheel, over the true",
    )
    noise: float = param(
        0.01, unit="m/sqrt(m)", at_least=0.0, doc="deviation after one metre of a wheel"
    )
    resolution: float = param(
        0.0, unit="m", at_least=0.0, doc="way of a wheel per count of its encoder; 0: none"
    )
    x0: FloatArray = param((0.0, 0.0, 0.0), unit="m, m, rad", shape=(3,), doc="first pose")

    reached = State(like="pose", doc="the pose by the encoders")
    rest = State(2, unit="m", doc="way of each wheel that is not yet counted")

    def start(self, state: BlockState) -> None:
        state.scale = self.scale.copy()
        state.reached[:] = self.x0

    def output(self, state: BlockState, t: float) -> tuple[PoseValue, float]:
        x, y, theta = state.reached.tolist()
        return (x, y, theta), t

    def counted(self, state: BlockState, wheel: int, way: float) -> float:
        """What the encoder of a wheel counts on a way (m)."""
        way = state.scale[wheel] * way
        way += self.noise * math.sqrt(abs(way)) * state.rng.standard_normal()
        if self.resolution == 0.0:
            return way
        way += state.rest[wheel]
        count = self.resolution * math.floor(way / self.resolution)
        state.rest[wheel] = way - count
        return count

    def update(self, state: BlockState, t: float, motion: TwistValue) -> None:
        half = 0.5 * self.wheel_base * motion[1]
        left = self.counted(state, 0, (motion[0] - half) * state.dt)
        right = self.counted(state, 1, (motion[0] + half) * state.dt)
        turn = (right - left) / (self.base_scale * self.wheel_base)
        way, theta = 0.5 * (left + right), state.reached[2]
        # An arc's chord: way sin(turn / 2) / (turn / 2), in the direction of its middle.
        chord = way if abs(turn) < 1e-9 else way * math.sin(0.5 * turn) / (0.5 * turn)
        state.reached[0] += chord * math.cos(theta + 0.5 * turn)
        state.reached[1] += chord * math.sin(theta + 0.5 * turn)
        state.reached[2] = theta + turn
