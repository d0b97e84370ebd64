"""What lies between a command and the motion, or between a pose and its estimate."""

from __future__ import annotations

import math
from collections.abc import Iterable

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Pose,
    PoseValue,
    Scalar,
    State,
    Twist,
    TwistValue,
    kernel_of,
    param,
)
from blocks.core.portable import flush, flush_due, share_of

NEARLY_ALWAYS = 0.95


class Saturator(Block):
    """Limit the turn rate and slow down in proportion (paper, case A).

        command ─▶ [ Saturator ] ─▶ limited, saturated

    limited = s * command with s = min(1, omega_max / |omega|); saturated is 1 where s < 1. A run
    in which that is so on at least 95 % of the ticks reports it in a note.
    """

    command = Input(Twist, doc="what the controller wants")
    limited = Output(Twist, through="command", doc="the motors' command")
    saturated = Output(Scalar, doc="1 while the turn rate is limited, else 0")

    omega_max: float = param(unit="rad/s", above=0.0, tunable=True, doc="largest turn rate")

    limited_ticks = State(1, doc="ticks so far on which the turn rate was limited")

    def update(self, state: BlockState, t: float, saturated: float) -> None:
        if saturated:
            state.limited_ticks[0] += saturated

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        share = float(state.limited_ticks[0]) / max(1, ticks)
        if share >= NEARLY_ALWAYS:
            yield (
                f"the turn rate was limited to omega_max = {self.omega_max:g} rad/s on "
                f"{100.0 * share:.3g} % of the ticks, so that the controller had little "
                "influence"
            )

    def output(self, state: BlockState, t: float, command: TwistValue) -> tuple[TwistValue, float]:
        v, omega = command
        if abs(omega) <= self.omega_max:
            return command, 0.0
        return (v * (self.omega_max / abs(omega)), math.copysign(self.omega_max, omega)), 1.0


class ActuatorFault(Block):
    """Scale and shift the command between two times (paper, case A: half the turn rate).

        command ─▶ [ ActuatorFault ] ─▶ actual

    actual = gain * command + bias for start <= t < stop, and command elsewhere.
    """

    command = Input(Twist, doc="the motors' command")
    actual = Output(Twist, through="command", doc="the actual motion")

    gain: FloatArray = param((1.0, 1.0), shape=(2,), tunable=True, doc="factors on v and omega")
    bias: FloatArray = param(
        (0.0, 0.0), shape=(2,), tunable=True, doc="shifts of v (m/s) and omega (rad/s)"
    )
    begin: float = param(0.0, name="start", unit="s", tunable=True, doc="when the fault sets in")
    end: float = param(
        math.inf, name="stop", unit="s", finite=False, tunable=True, doc="when it ends"
    )

    def validate(self) -> None:
        if self.end <= self.begin:
            raise ParameterError(
                [("stop", f"must lie after start = {self.begin:g} s, got {self.end:g}")]
            )

    def start(self, state: BlockState) -> None:
        state.gain = tuple(self.gain.tolist())
        state.bias = tuple(self.bias.tolist())
        # Tick times are k * dt with rounding: 3 * 0.009 lies below 0.027.
        slack = 1e-6 * state.dt
        state.begin, state.end = self.begin - slack, self.end - slack

    def output(self, state: BlockState, t: float, command: TwistValue) -> TwistValue:
        if not state.begin <= t < state.end:
            return command
        (gain_v, gain_omega), (bias_v, bias_omega) = state.gain, state.bias
        return gain_v * command[0] + bias_v, gain_omega * command[1] + bias_omega


class ActuatorLag(Block):
    """Motors that follow the command with a first-order lag.

        command ─▶ [ ActuatorLag ] ─▶ actual

    tau actual' = command - actual, from rest; exact for a command that holds between ticks.
    ``actual`` depends on the state alone: it breaks loops.
    """

    command = Input(Twist, doc="the motors' command")
    actual = Output(Twist, through="command", doc="the actual motion")

    tau: float = param(unit="s", above=0.0, tunable=True, doc="time constant")

    reached = State(like="actual", doc="speed and turn rate at the coming tick: m/s, rad/s")

    def start(self, state: BlockState) -> None:
        state.share = share_of(self.tau, state.dt)

    def output(self, state: BlockState, t: float) -> TwistValue:
        v, omega = state.reached.tolist()
        return v, omega

    def update(self, state: BlockState, t: float, command: TwistValue) -> None:
        state.reached[...] = state.reached - state.share * (state.reached - command)
        if flush_due(t, state.dt):
            flush(state.reached)


class ActuatorDelay(Block):
    """Motors that execute each command after a delay.

        command ─▶ [ ActuatorDelay ] ─▶ actual

    actual(t) = command(t - delay), at rest before the first command arrives. ``delay`` is a whole
    number of the block's steps, at least one; for none, bypass the block. ``actual`` depends on
    the state alone: it breaks loops.
    """

    command = Input(Twist, doc="the motors' command")
    actual = Output(Twist, through="command", doc="the actual motion")

    delay: float = param(unit="s", above=0.0, doc="time from a command to its execution")
    capacity: int = param(1000, at_least=1, doc="how many steps the delay may be, at most")

    ring = State("capacity", 2, doc="delayed commands: m/s, rad/s")
    head = State(1, doc="the row of the next output")

    def validate_in(self, context: BlockContext) -> None:
        steps = self.delay / context.dt
        if steps < 1.0 - 1e-6 or abs(steps - round(steps)) > 1e-6:
            nearest = max(1, round(steps)) * context.dt
            message = (
                f"must be a multiple of the block's step, {context.dt:g} s: such as {nearest:g}"
            )
            raise ParameterError([("delay", f"{message}, got {self.delay:g}")])
        if round(steps) > self.capacity:
            message = f"a delay of {self.delay:g} s is {steps:.0f} steps of {context.dt:g} s"
            raise ParameterError([("capacity", f"{message}, got {self.capacity}")])

    def start(self, state: BlockState) -> None:
        state.steps = round(self.delay / state.dt)

    def output(self, state: BlockState, t: float) -> TwistValue:
        v, omega = state.ring[int(state.head[0])].tolist()
        return v, omega

    def update(self, state: BlockState, t: float, command: TwistValue) -> None:
        row = int(state.head[0])
        state.ring[row] = command
        state.head[0] = (row + 1) % state.steps


class WheelSlip(Block):
    """Two wheels that each lose a random share of their speed.

        command ─▶ [ WheelSlip ] ─▶ actual

    v_L,R = v -+ omega wheel_base / 2 become (1 - s_L,R) v_L,R. Each share s is drawn from
    U(0, slip) and drawn again with probability 1 - exp(-dt / correlation_time) per step, so that
    its autocorrelation is exp(-|t| / correlation_time) at any step.
    """

    command = Input(Twist, doc="the motors' command")
    actual = Output(Twist, through="command", doc="how the robot moves")

    slip: float = param(
        0.1, at_least=0.0, at_most=1.0, tunable=True, doc="largest share of speed that is lost"
    )
    correlation_time: float = param(
        0.5, unit="s", above=0.0, tunable=True, doc="how long a share lasts"
    )
    wheel_base: float = param(
        0.3, unit="m", above=0.0, tunable=True, doc="distance between the wheels"
    )

    share = State(2, doc="shares that the left and the right wheel lose in the coming step")

    def start(self, state: BlockState) -> None:
        state.chance = share_of(self.correlation_time, state.dt)
        state.share[:] = state.rng.uniform(0.0, self.slip, 2)

    def output(self, state: BlockState, t: float, command: TwistValue) -> TwistValue:
        v, omega = command
        lost_left, lost_right = state.share.tolist()
        half = 0.5 * self.wheel_base * omega
        left, right = (v - half) * (1.0 - lost_left), (v + half) * (1.0 - lost_right)
        return 0.5 * (left + right), (right - left) / self.wheel_base

    def update(self, state: BlockState, t: float) -> None:
        # The same count of numbers on every tick, so that the wheels' random sequences are
        # independent.
        chance_left, chance_right, left, right = state.rng.random(4).tolist()
        if chance_left < state.chance:
            state.share[0] = self.slip * left
        if chance_right < state.chance:
            state.share[1] = self.slip * right


class PoseNoise(Block):
    """Add white Gaussian noise to a pose, independent on each tick (paper, case B).

        pose ─▶ [ PoseNoise ] ─▶ measured

    measured = pose + N(0, diag(sigma_position^2, sigma_position^2, sigma_heading^2)).
    """

    pose = Input(Pose, doc="the true pose")
    measured = Output(Pose, through="pose", doc="the estimate that controllers see")

    sigma_position: float = param(
        0.05, unit="m", at_least=0.0, tunable=True, doc="deviation of x and of y"
    )
    sigma_heading: float = param(
        0.1, unit="rad", at_least=0.0, tunable=True, doc="deviation of theta"
    )

    noise = State(3, doc="the noise of the coming tick: m, m, rad")

    def start(self, state: BlockState) -> None:
        self._draw(state)

    def _draw(self, state: BlockState) -> None:
        state.rng.standard_normal(out=state.noise)
        state.noise[:2] *= self.sigma_position
        state.noise[2] *= self.sigma_heading

    @kernel_of(_draw)
    def _draw_kernel(self, state: BlockState) -> None:
        for i in range(3):
            state.noise[i] = state.rng.standard_normal()
        state.noise[0] *= self.sigma_position
        state.noise[1] *= self.sigma_position
        state.noise[2] *= self.sigma_heading

    def output(self, state: BlockState, t: float, pose: PoseValue) -> PoseValue:
        nx, ny, ntheta = state.noise.tolist()
        return pose[0] + nx, pose[1] + ny, pose[2] + ntheta

    def update(self, state: BlockState, t: float) -> None:
        self._draw(state)
