"""Two blocks: one computes its output from the time alone, the other has a memory."""

import math

from blocks import Block, Input, Output, Scalar, State, param


class Wave(Block):
    """A sine wave.

        [ Wave ] ─▶ out

    out = sin(2 pi t / period).
    """

    out = Output(Scalar)

    period: float = param(unit="s", above=0.0, doc="duration of one wave")

    def output(self, state, t):
        return math.sin(2.0 * math.pi * t / self.period)


class Backlash(Block):
    """The play of a gear: the output moves only when the input pushes it.

        input ─▶ [ Backlash ] ─▶ out

    out follows the input at a distance of at most width / 2; in between it stays where it is.
    """

    input = Input(Scalar)
    out = Output(Scalar, through="input")  # what --bypass wires straight

    width: float = param(0.1, at_least=0.0, doc="free play, in units of the input")

    held = State()  # one number, which starts at 0; State("n") is an array of length n

    def output(self, state, t):  # does not name 'input': the output is one tick late
        return float(state.held)

    def update(self, state, t, input):  # once per tick, after all outputs
        half = 0.5 * self.width
        state.held = min(max(float(state.held), input - half), input + half)
