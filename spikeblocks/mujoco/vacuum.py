"""A robot vacuum in a rigid-body simulation: a plant and its LiDAR in one block."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Pose,
    PoseValue,
    Scalar,
    Scan,
    State,
    Twist,
    TwistValue,
    WheelSpeeds,
    param,
)
from blocks.vehicle import INTEGRATORS
from blocks.world import bearings, misplaced, required_world
from spikeblocks.mujoco.robot_model import SEEN_GROUP, BeamCaster, VacuumBody, engine, model_of
from spikeblocks.mujoco.solid_walls import wall_pieces

# Where MuJoCo's numbers are in the state: time, then position and quaternion of the body and the
# wheels' angles (9), their velocities (8), and the accelerations that its solver starts from (8).
POSITION = slice(1, 4)
QUATERNION = slice(4, 8)
WHEEL_ANGLES = slice(8, 10)
WHEEL_RATES = slice(16, 18)
SIZE = 26


def state_parts(mujoco: Any) -> int:
    """Which of MuJoCo's numbers the state holds: all that its next step depends on."""
    return int(mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART)


class MujocoVacuum(VacuumBody):
    """A robot vacuum with mass, slipping wheels and a LiDAR, in MuJoCo.

        command ─▶ [ MujocoVacuum ] ─▶ pose, odometry, scan, wheels, contact, tilt
                          ▲
                        world

    The command is followed within the ramps ``acceleration`` and ``turn_acceleration``, to v and
    omega; the motors are commanded v -+ omega track / 2 at the wheels' rims, left and right, and
    turn them with torque = motor_gain (commanded - actual), limited. The rest is rigid-body
    dynamics with friction, in steps of ``physics_step``. All outputs depend on the state alone:
    they break loops.

    ``odometry`` starts at ``x0`` and adds the arcs of the wheels' rotation, as if they rolled.
    The LiDAR casts its beams from the body as it is tilted, every ``scan_period``, and its scan
    holds in between; misses are inf.

    For ``start`` <= t < ``stop`` there are faults: the commanded speeds of the two wheels are
    multiplied by ``wheel_gain``, after their difference was multiplied by ``turn_gain`` and the
    turn rate ``yaw_bias`` was added; a wheel on the disc ``patch`` has
    ``patch_friction``.

    Needs the extra ``physics``.
    """

    command = Input(Twist, doc="speed and turn rate")

    pose = Output(Pose, doc="true pose of the point between the wheels; theta is not wrapped")
    odometry = Output(Pose, doc="the pose computed from the rotation of the wheels")
    scan = Output(Scan("beams"), doc="ranges; inf for a miss")
    wheels = Output(WheelSpeeds, doc="speeds of the wheels' rims")
    contact = Output(Scalar, unit="N", doc="normal force on the hull, mean over the last step")
    tilt = Output(Scalar, unit="rad", doc="angle between the body's axis and the vertical")

    acceleration: float = param(1.0, unit="m/s^2", above=0.0, doc="ramp of the speed")
    turn_acceleration: float = param(8.0, unit="rad/s^2", above=0.0, doc="ramp of the turn rate")
    beams: int = param(360, at_least=1, doc="number of beams, over the full turn from -pi")
    sigma: float = param(0.01, unit="m", at_least=0.0, doc="standard deviation of a range")
    range_min: float = param(0.05, unit="m", at_least=0.0, doc="nearer returns are misses")
    range_max: float = param(12.0, unit="m", above=0.0, doc="farther returns are misses")
    scan_period: float = param(0.1, unit="s", above=0.0, doc="time between scans")
    wheel_gain: FloatArray = param((1.0, 1.0), shape=(2,), doc="fault: left, right wheel's factor")
    turn_gain: float = param(1.0, doc="fault: factor on the difference of the wheels' speeds")
    yaw_bias: float = param(0.0, unit="rad/s", doc="fault: turn rate that is added")
    patch: FloatArray | None = param(None, shape=(3,), doc="fault: disc on the floor, x, y, r in m")
    patch_friction: float = param(0.1, above=0.0, doc="fault: friction of wheels on the disc")
    begin: float = param(0.0, name="start", unit="s", doc="when the faults set in")
    end: float = param(math.inf, name="stop", unit="s", finite=False, doc="when they are over")

    physics = State(SIZE, doc="MuJoCo's time, positions, velocities and warm start")
    asked = State(2, doc="speed and turn rate that the ramps have reached: m/s, rad/s")
    heading = State(1, unit="rad", doc="the true heading, not wrapped")
    reckoned = State(3, doc="the odometry's pose: m, m, rad")
    force = State(1, unit="N", doc="mean normal force on the hull over the last step")
    ranges = State("beams", unit="m", doc="the last scan")

    def validate(self) -> None:
        problems = []
        if self.end <= self.begin:
            problems.append(("stop", f"must lie after start = {self.begin:g} s, got {self.end:g}"))
        if self.range_max <= self.range_min:
            message = f"must lie above range_min = {self.range_min:g} m, got {self.range_max:g}"
            problems.append(("range_max", message))
        if self.mass <= 2.0 * self.wheel_mass:
            message = f"two wheels of {self.wheel_mass:g} kg are part of it; got {self.mass:g} kg"
            problems.append(("mass", message))
        for name, reach in (
            ("track", 0.5 * (self.track + self.wheel_width)),
            ("caster", self.caster),
        ):
            if reach >= self.body_radius:
                message = f"reaches {reach:g} m from the middle, out of hull_radius"
                problems.append((name, f"{message} = {self.body_radius:g} m"))
        if not 0.0 < self.centre_of_mass < self.caster:
            message = f"must lie between the axle (0 m) and the caster ({self.caster:g} m)"
            problems.append(("centre_of_mass", f"{message}, got {self.centre_of_mass:g}"))
        if self.patch is not None and self.patch[2] <= 0.0:
            problems.append(("patch", f"its radius must be above 0 m, got {self.patch[2]:g}"))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        world = required_world(context)
        wall_pieces(world)
        problems = []
        for name, longer, shorter in (
            ("physics_step", context.dt, self.physics_step),
            ("scan_period", self.scan_period, context.dt),
        ):
            ratio = longer / shorter
            if ratio < 1.0 - 1e-6 or abs(ratio - round(ratio)) > 1e-6:
                what = "a whole part" if name == "physics_step" else "a multiple"
                message = f"must be {what} of the block's step, dt: {context.dt:g}"
                problems.append((name, f"{message}; got {self.value(name):g} s"))
        x, y, _ = self.x0.tolist()
        message = misplaced(world, "hull", x, y, self.body_radius)
        problems += [("x0", message)] if message else []
        if problems:
            raise ParameterError(problems)
        engine()

    def start(self, state: BlockState) -> None:
        mujoco = state.mujoco = engine()
        model = state.model = model_of(self, required_world(state.context))
        data = state.data = mujoco.MjData(model)
        state.parts = state_parts(mujoco)
        size = mujoco.mj_stateSize(model, state.parts)
        if size != SIZE:
            raise RuntimeError(f"expected {SIZE} numbers of physics, this mujoco has {size}")
        state.steps = round(state.dt / self.physics_step)
        state.scan_ticks = round(self.scan_period / state.dt)
        state.tyres = [model.geom(name).id for name in ("left", "right")]
        around = bearings(self.beams, -math.pi, math.pi)
        state.lidar = BeamCaster(mujoco, model, data, around, SEEN_GROUP, self.range_max)
        mujoco.mj_getState(model, data, state.physics, state.parts)
        state.heading[0] = self.x0[2]
        state.reckoned[:] = self.x0
        self._scan(state)

    def output(
        self, state: BlockState, t: float
    ) -> tuple[PoseValue, PoseValue, FloatArray, tuple[float, float], float, float]:
        x, y, _ = state.physics[POSITION].tolist()
        left, right = state.physics[WHEEL_RATES].tolist()
        _, qx, qy, _ = state.physics[QUATERNION].tolist()
        upright = 1.0 - 2.0 * (qx * qx + qy * qy)
        return (
            (x, y, float(state.heading[0])),
            tuple(state.reckoned.tolist()),
            state.ranges.copy(),
            (self.wheel_radius * left, self.wheel_radius * right),
            float(state.force[0]),
            math.acos(min(1.0, upright)),
        )

    def update(self, state: BlockState, t: float, command: TwistValue) -> None:
        mujoco, model, data = state.mujoco, state.model, state.data
        mujoco.mj_setState(model, data, state.physics, state.parts)
        faulty = self._is_faulty(state, t)
        data.ctrl[:] = self._wheel_rates(state, command, faulty)
        if self.patch is not None:
            self._set_friction(state, self.patch, faulty)
        before = data.qpos[-2:].tolist()
        force = 0.0
        for _ in range(state.steps):
            mujoco.mj_step(model, data)
            force += data.sensordata[0]
        if not data.time > state.physics[0]:
            # MuJoCo resets the simulation where it finds NaN or numbers that are too large.
            message = (
                "the simulation became unstable; a smaller physics_step or motor_gain may help"
            )
            raise ArithmeticError(message)
        mujoco.mj_getState(model, data, state.physics, state.parts)
        state.force[0] = force / state.steps
        self._reckon(state, before)
        if (round(t / state.dt) + 1) % state.scan_ticks == 0:
            self._scan(state)

    def _is_faulty(self, state: BlockState, t: float) -> bool:
        # Tick times are k * dt with rounding: 3 * 0.009 lies below 0.027.
        slack = 1e-6 * state.dt
        return self.begin - slack <= t < self.end - slack

    def _wheel_rates(
        self, state: BlockState, command: TwistValue, faulty: bool
    ) -> tuple[float, float]:
        """The commanded wheel rates (rad/s), left and right."""
        rises = (self.acceleration * state.dt, self.turn_acceleration * state.dt)
        for i, (wanted, rise) in enumerate(zip(command, rises, strict=True)):
            state.asked[i] += max(-rise, min(rise, wanted - state.asked[i]))
        v, omega = state.asked.tolist()
        gain_left = gain_right = 1.0
        if faulty:
            omega = self.turn_gain * omega + self.yaw_bias
            gain_left, gain_right = self.wheel_gain.tolist()
        half = 0.5 * self.track * omega
        return (
            gain_left * (v - half) / self.wheel_radius,
            gain_right * (v + half) / self.wheel_radius,
        )

    def _set_friction(self, state: BlockState, patch: FloatArray, faulty: bool) -> None:
        """Give each wheel the friction of the floor that it is on."""
        x, y, r = patch.tolist()
        at_x, at_y, _ = state.physics[POSITION].tolist()
        theta = float(state.heading[0])
        for tyre, side in zip(state.tyres, (0.5 * self.track, -0.5 * self.track), strict=True):
            apart = math.hypot(at_x - side * math.sin(theta) - x, at_y + side * math.cos(theta) - y)
            slippery = faulty and apart < r
            state.model.geom_friction[tyre, 0] = self.patch_friction if slippery else self.friction

    def _reckon(self, state: BlockState, before: list[float]) -> None:
        """Bring the unwrapped heading and the odometry up to date."""
        w, qx, qy, qz = state.physics[QUATERNION].tolist()
        yaw = math.atan2(2.0 * (w * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        state.heading[0] += math.remainder(yaw - state.heading[0], math.tau)
        left, right = (
            self.wheel_radius * (now - then)
            for now, then in zip(state.physics[WHEEL_ANGLES].tolist(), before, strict=True)
        )
        pose = tuple(state.reckoned.tolist())
        turn = (right - left) / self.track
        state.reckoned[:] = INTEGRATORS["exact"](pose, 0.5 * (left + right), turn, 1.0)

    def _scan(self, state: BlockState) -> None:
        ranges = state.lidar.cast()
        ranges += self.sigma * state.rng.standard_normal(self.beams)
        ranges[(ranges < self.range_min) | (ranges > self.range_max)] = np.inf
        state.ranges[:] = ranges
