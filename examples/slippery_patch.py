"""Your own block, in about 25 lines; examples/slippery_patch.yaml uses it."""

from __future__ import annotations

import math

from blocks import Block, BlockState, Input, Output, Twist, param


class SlipperyPatch(Block):
    """Lose part of the turn rate periodically, as on patches of wet floor.

        command ─▶ [ SlipperyPatch ] ─▶ actual

    actual = [v, (1 - loss) omega] while sin(2 pi t / period) > 0, and command elsewhere.
    """

    command = Input(Twist, doc="the motors' command")
    actual = Output(Twist, through="command", doc="the robot's motion")

    loss: float = param(0.5, at_least=0.0, at_most=1.0, doc="part of the turn rate that is lost")
    period: float = param(4.0, unit="s", above=0.0, doc="time between patches")

    def output(
        self, state: BlockState, t: float, command: tuple[float, float]
    ) -> tuple[float, float]:
        v, omega = command
        if math.sin(2.0 * math.pi * t / self.period) > 0.0:
            omega *= 1.0 - self.loss
        return v, omega
