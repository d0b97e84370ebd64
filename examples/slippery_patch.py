"""A block of your own, in about 25 lines; examples/slippery_patch.yaml uses it."""

from __future__ import annotations

import math

from blocks import Block, BlockState, Input, Output, Twist, param


class SlipperyPatch(Block):
    """Lose part of the turn rate again and again, as on patches of wet floor.

        command ─▶ [ SlipperyPatch ] ─▶ actual

    actual = [v, (1 - loss) omega] while sin(2 pi t / period) > 0, and command elsewhere.
    """

    command = Input(Twist, doc="what the motors do")
    actual = Output(Twist, through="command", doc="how the robot moves")

    loss: float = param(0.5, at_least=0.0, at_most=1.0, doc="part of the turn rate that is lost")
    period: float = param(4.0, unit="s", above=0.0, doc="time from patch to patch")

    def output(
        self, state: BlockState, t: float, command: tuple[float, float]
    ) -> tuple[float, float]:
        v, omega = command
        if math.sin(2.0 * math.pi * t / self.period) > 0.0:
            omega *= 1.0 - self.loss
        return v, omega
