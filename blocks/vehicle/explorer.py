"""Exploration: drive around without touching anything until a wall is near; find a lost one."""

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
    Pose,
    PoseValue,
    Scalar,
    Scan,
    State,
    Twist,
    TwistValue,
    cos,
    kernel_of,
    param,
    sin,
)
from blocks.world import bearings, window_problems

# Turn rate per heading error while driving straight (1/s), and how far to the side (rad) things
# still count as something to steer away from.
COURSE_GAIN = 2.0
ASIDE = 0.6 * math.pi


class Explorer(Block):
    """Wander, drive straight until a wall is near, and signal that; lead back to a lost one.

        scan, pose ─▶ [ Explorer ] ─▶ command, engaged

    Until ``explore_time`` it wanders: turn rates drawn from U(-wander_rate, wander_rate), each
    held for ``wander_hold``, and away from whatever is nearer than ``avoid_distance``. Then it
    holds its heading, omega = 2 (course - theta), until a return is nearer than
    ``engage_distance``; ``engaged`` is 1 from that tick on. Whenever something lies in the
    rectangle of ``stop_distance`` by twice ``half_width`` ahead, it turns in place, always in
    the same direction until the rectangle is free. Misses (inf, NaN) count as free.

    Once engaged, its command is for a robot that has lost its wall: omega = 2 phi, with phi the
    bearing of the nearest return, until that is nearer than ``engage_distance``; then straight on.
    """

    scan = Input(Scan("beams"), doc="ranges; inf where a beam hits nothing")
    pose = Input(Pose, doc="where the robot believes it is")

    command = Output(Twist, doc="speed and turn rate")
    engaged = Output(Scalar, doc="0 while exploring, 1 once a wall was near")

    explore_time: float = param(6.0, unit="s", at_least=0.0, tunable=True, doc="how long to wander")
    engage_distance: float = param(
        0.45, unit="m", above=0.0, tunable=True, doc="a wall nearer than this is near"
    )
    v_r: float = param(0.2, unit="m/s", above=0.0, tunable=True, doc="speed")
    omega_max: float = param(1.5, unit="rad/s", above=0.0, tunable=True, doc="largest turn rate")
    wander_rate: float = param(0.6, unit="rad/s", at_least=0.0, doc="largest random turn rate")
    wander_hold: float = param(1.5, unit="s", above=0.0, doc="how long one of them holds")
    avoid_distance: float = param(
        0.7, unit="m", above=0.0, tunable=True, doc="nearer things are steered away from"
    )
    stop_distance: float = param(
        0.3, unit="m", above=0.0, tunable=True, doc="nearer things ahead stop the robot"
    )
    half_width: float = param(
        0.2, unit="m", above=0.0, tunable=True, doc="half the width to have free ahead"
    )
    angle_min: float = param(-math.pi, unit="rad", doc="bearing of the first beam, as the Lidar's")
    angle_max: float = param(math.pi, unit="rad", doc="bearing past the last beam, as the Lidar's")

    latch = State(1, doc="1 once a wall was near")
    wander = State(2, doc="the random turn rate (rad/s), and when it ends (s)")
    course = State(1, unit="rad", doc="the heading to hold")
    side = State(1, doc="direction of turning in place: 1 left, -1 right, 0 while the path is free")

    def validate(self) -> None:
        problems = window_problems(self.angle_min, self.angle_max)
        for name in ("engage_distance", "avoid_distance"):
            if self.value(name) <= self.stop_distance:
                message = (
                    f"must lie above stop_distance = {self.stop_distance:g} m, or it turns away"
                )
                problems.append((name, f"{message} first; got {self.value(name):g}"))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        scan = state.context.types["scan"]
        state.bearings = bearings(scan.shape[0], self.angle_min, self.angle_max)
        # From -pi to pi, whatever the window: signs tell left from right.
        state.bearings = np.remainder(state.bearings + math.pi, 2.0 * math.pi) - math.pi
        state.cos, state.sin = cos(state.bearings), sin(state.bearings)
        self._draw(state, 0.0)

    def _draw(self, state: BlockState, t: float) -> None:
        state.wander[0] = state.rng.uniform(-self.wander_rate, self.wander_rate)
        state.wander[1] = t + self.wander_hold

    def output(
        self, state: BlockState, t: float, scan: FloatArray, pose: PoseValue
    ) -> tuple[TwistValue, float]:
        ranges = _without_nan(scan)
        exploring = t < self.explore_time - 0.5 * state.dt
        near = float(ranges.min()) < self.engage_distance
        engaged = 1.0 if state.latch[0] > 0.0 or (near and not exploring) else 0.0
        side = self._blocked(state, ranges)
        if side:
            return (0.0, side * self.omega_max), engaged
        if exploring:
            return (self.v_r, self._wandering(state, ranges)), engaged
        if engaged:
            bearing = self._nearest(state, ranges)
            return (self.v_r, self._limited(COURSE_GAIN * bearing)), engaged
        error = math.remainder(float(state.course[0]) - pose[2], 2.0 * math.pi)
        return (self.v_r, self._limited(COURSE_GAIN * error)), engaged

    def _blocked(self, state: BlockState, ranges: FloatArray) -> float:
        """Direction in which to turn in place: 1 left, -1 right; 0 if the path ahead is free."""
        # A miss straight ahead is inf times 0 to the side: it is far ahead, and that decides.
        with np.errstate(invalid="ignore"):
            ahead, aside = ranges * state.cos, ranges * state.sin
            inside = (ahead > 0.0) & (ahead < self.stop_distance)
            inside &= np.abs(aside) < self.half_width
        if not inside.any():
            return 0.0
        if state.side[0]:
            return float(state.side[0])
        nearest = int(np.where(inside, ranges, np.inf).argmin())
        return -1.0 if state.bearings[nearest] > 0.0 else 1.0

    @kernel_of(_blocked)
    def _blocked_kernel(self, state: BlockState, ranges: FloatArray) -> float:
        nearest, least = -1, math.inf
        for i in range(len(ranges)):
            ahead, aside = ranges[i] * state.cos[i], ranges[i] * state.sin[i]
            inside = 0.0 < ahead < self.stop_distance and abs(aside) < self.half_width
            if inside and (nearest < 0 or ranges[i] < least):
                nearest, least = i, ranges[i]
        if nearest < 0:
            return 0.0
        if state.side[0] != 0.0:
            return float(state.side[0])
        return -1.0 if state.bearings[nearest] > 0.0 else 1.0

    def _wandering(self, state: BlockState, ranges: FloatArray) -> float:
        """The random turn rate, or away from what is near, the faster the nearer it is."""
        in_view = np.where(np.abs(state.bearings) < ASIDE, ranges, np.inf)
        nearest = int(in_view.argmin())
        return self._turned(state, float(in_view[nearest]), float(state.bearings[nearest]))

    def _nearest(self, state: BlockState, ranges: FloatArray) -> float:
        """The bearing (rad) of the nearest return; 0 where it is near, or where there is none."""
        nearest = int(ranges.argmin())
        if not self.engage_distance <= ranges[nearest] < math.inf:
            return 0.0
        return float(state.bearings[nearest])

    def _turned(self, state: BlockState, distance: float, bearing: float) -> float:
        if distance >= self.avoid_distance:
            return self._limited(float(state.wander[0]))
        urgency = (self.avoid_distance - distance) / (self.avoid_distance - self.stop_distance)
        away = -1.0 if bearing > 0.0 else 1.0
        return self._limited(away * urgency * self.omega_max)

    def _limited(self, omega: float) -> float:
        return max(-self.omega_max, min(self.omega_max, omega))

    def update(
        self, state: BlockState, t: float, pose: PoseValue, command: TwistValue, engaged: float
    ) -> None:
        turning = command[0] == 0.0
        state.latch[0] = engaged
        state.side[0] = math.copysign(1.0, command[1]) if turning else 0.0
        # The course is where it looks when it begins to drive straight.
        if turning or t < self.explore_time - 0.5 * state.dt:
            state.course[0] = pose[2]
        if t >= state.wander[1] - 0.5 * state.dt:
            self._draw(state, t)


def _without_nan(scan: FloatArray) -> FloatArray:
    """The scan with inf in place of NaN."""
    ranges: FloatArray = np.fmin(scan, np.inf)
    return ranges


@kernel_of(_without_nan)
def _without_nan_kernel(scan: FloatArray) -> FloatArray:
    ranges = np.empty(len(scan))
    for i in range(len(scan)):
        ranges[i] = math.inf if math.isnan(scan[i]) else scan[i]
    return ranges
