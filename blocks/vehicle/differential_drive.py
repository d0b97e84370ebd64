"""A robot with two driven wheels that moves by ticks, and stops at the walls of the world.

A command (v, omega) goes in; pose, wheel speeds, clearance and contact come out, all from the state
of the tick before::

    plant: {type: DifferentialDrive, body_radius: 0.18}
"""

from __future__ import annotations

import math
from collections.abc import Callable

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
    WheelSpeeds,
    kernel_of,
    param,
)
from blocks.vehicle.contact import check_body, slide
from blocks.world import TOUCH, Surfaces, World, nearest, world_of

# The distance (m) reported where there is nothing: signals are finite.
NOTHING_NEAR = 1000.0


def _euler(pose: PoseValue, v: float, omega: float, dt: float) -> PoseValue:
    x, y, theta = pose
    return x + dt * v * math.cos(theta), y + dt * v * math.sin(theta), theta + dt * omega


def _rk4(pose: PoseValue, v: float, omega: float, dt: float) -> PoseValue:
    # The heading is linear in time, so RK4's four slopes are Simpson's rule on three headings.
    x, y, theta = pose
    middle, end = theta + 0.5 * dt * omega, theta + dt * omega
    c = math.cos(theta) + 4.0 * math.cos(middle) + math.cos(end)
    s = math.sin(theta) + 4.0 * math.sin(middle) + math.sin(end)
    return x + dt * v * c / 6.0, y + dt * v * s / 6.0, end


def _exact(pose: PoseValue, v: float, omega: float, dt: float) -> PoseValue:
    x, y, theta = pose
    half = 0.5 * dt * omega
    chord = dt * v * (math.sin(half) / half if half else 1.0)
    return (
        x + chord * math.cos(theta + half),
        y + chord * math.sin(theta + half),
        theta + 2.0 * half,
    )


INTEGRATORS: dict[str, Callable[[PoseValue, float, float, float], PoseValue]] = {
    "euler": _euler,
    "rk4": _rk4,
    "exact": _exact,
}


class DifferentialDrive(Block):
    """A robot with two driven wheels (paper, section III-B).

        command ─▶ [ DifferentialDrive ] ─▶ pose, wheels, clearance, contact
                            ▲
                          world (if the graph has one)

    x' = v cos(theta), y' = v sin(theta), theta' = omega; the command holds over the step.
    v = (v_R + v_L) / 2 and omega = (v_R - v_L) / wheel_base (the paper prints the opposite sign,
    against its own theta' = omega). ``pose`` depends on the state alone: it breaks loops.

    With a ``body_radius`` the robot is a disc that slides without friction along the surfaces of
    the graph's world and never passes through them: of a motion into a surface only the
    tangential part remains, the heading turns freely, and ``wheels`` are the motors' speeds.
    Without one it is a point that passes through everything.
    """

    command = Input(Twist, doc="speed and turn rate")

    pose = Output(Pose, doc="true pose; theta is not wrapped")
    wheels = Output(WheelSpeeds, doc="speeds of the wheels' rims")
    clearance = Output(
        Scalar, unit="m", doc="from body to nearest surface; 1000 where there is no world"
    )
    contact = Output(Scalar, doc="1 while the body touches a surface (within 1e-6 m), else 0")

    x0: FloatArray = param((0.0, 0.0, 0.0), shape=(3,), unit="m, m, rad", doc="initial pose")
    wheel_base: float = param(
        0.3, unit="m", above=0.0, tunable=True, doc="distance between the wheels"
    )
    integrator: str = param("exact", choices=tuple(INTEGRATORS), doc="how a step is integrated")
    body_radius: float = param(
        0.0, unit="m", at_least=0.0, doc="radius of a body that the world stops; 0: no body"
    )

    q = State(3, name="pose_state", doc="the pose at the next tick: m, m, rad")
    gap = State(1, unit="m", doc="the clearance at the next tick")

    def validate_in(self, context: BlockContext) -> None:
        if self.body_radius:
            x, y, _ = self.x0.tolist()
            check_body(context, (x, y), self.body_radius)

    def start(self, state: BlockState) -> None:
        state.pose_state[:] = self.x0
        state.step = INTEGRATORS[self.integrator]
        state.world = world = world_of(state.context)
        state.surfaces = None if world is None else world.arrays
        x, y, _ = self.x0.tolist()
        near = NOTHING_NEAR if world is None else world.nearest(x, y)[0] - self.body_radius
        state.gap[0] = near

    def output_pose(self, state: BlockState, t: float) -> PoseValue:
        x, y, theta = state.pose_state.tolist()
        return x, y, theta

    def output_wheels(
        self, state: BlockState, t: float, command: TwistValue
    ) -> tuple[float, float]:
        v, omega = command
        half = 0.5 * self.wheel_base * omega
        return v - half, v + half

    def output(self, state: BlockState, t: float) -> tuple[float, float]:
        if state.surfaces is None:
            return NOTHING_NEAR, 0.0
        gap = float(state.gap[0])
        if self.body_radius == 0.0:
            return gap, 0.0
        # A body that touches a surface is 0 m from it, rounding errors apart.
        return max(gap, 0.0), 1.0 if gap <= TOUCH else 0.0

    def update(self, state: BlockState, t: float, command: TwistValue) -> None:
        pose = tuple(state.pose_state.tolist())
        wanted = state.step(pose, command[0], command[1], state.dt)
        if state.surfaces is not None:
            wanted = self._reached(state, pose, wanted)
        for i in range(3):
            state.pose_state[i] = wanted[i]

    def _reached(self, state: BlockState, pose: PoseValue, wanted: PoseValue) -> PoseValue:
        """The pose that the body reaches on its way to another, stopped by the world."""
        x, y, theta = wanted
        if self.body_radius:
            dx, dy, gap = x - pose[0], y - pose[1], float(state.gap[0])
            x, y, gap = slide(self._walls(state), pose[0], pose[1], gap, dx, dy, self.body_radius)
        else:
            gap = nearest(self._walls(state), x, y)[0]
        state.gap[0] = gap
        return x, y, theta

    def _walls(self, state: BlockState) -> World:
        world: World = state.world
        return world

    @kernel_of(_walls)
    def _walls_kernel(self, state: BlockState) -> Surfaces:
        surfaces: Surfaces = state.surfaces
        return surfaces
