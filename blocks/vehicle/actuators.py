"""What lies between a command and the motion: limits and faults."""

from __future__ import annotations

import math
from collections.abc import Iterable

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    State,
    Twist,
    TwistValue,
    param,
)

NEARLY_ALWAYS = 0.95


class Saturator(Block):
    """Limit the turn rate and slow down in proportion (paper, case A).

        command ─▶ [ Saturator ] ─▶ limited, saturated

    limited = s * command with s = min(1, omega_max / |omega|); saturated is 1 where s < 1. A run
    in which it was that on at least 95 % of the ticks says so in a note.
    """

    command = Input(Twist, doc="what the controller wants")
    limited = Output(Twist, through="command", doc="what the motors are asked for")
    saturated = Output(Scalar, doc="1 while the turn rate is limited, else 0")

    omega_max: float = param(unit="rad/s", above=0.0, doc="largest turn rate")

    limited_ticks = State(1, doc="ticks so far on which the turn rate was limited")

    def update(self, state: BlockState, t: float, saturated: float) -> None:
        state.limited_ticks[0] += saturated

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        share = float(state.limited_ticks[0]) / max(1, ticks)
        if share >= NEARLY_ALWAYS:
            yield (
                f"the turn rate was limited to omega_max = {self.omega_max:g} rad/s on "
                f"{100.0 * share:.3g} % of the ticks, so that what the controller asked for "
                "hardly mattered"
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

    command = Input(Twist, doc="what the motors are asked for")
    actual = Output(Twist, through="command", doc="what they do")

    gain: FloatArray = param((1.0, 1.0), shape=(2,), doc="factors on v and omega")
    bias: FloatArray = param((0.0, 0.0), shape=(2,), doc="shifts of v (m/s) and omega (rad/s)")
    begin: float = param(0.0, name="start", unit="s", doc="when the fault sets in")
    end: float = param(math.inf, name="stop", unit="s", finite=False, doc="when it is over")

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
