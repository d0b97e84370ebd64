"""Blocks that switch the part that they are in: enabled and triggered subsystems."""

from __future__ import annotations

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    PartEnable,
    Scalar,
    State,
    param,
)

EDGES = ("rising", "falling", "either")


class Enable(PartEnable):
    """Run the part that this block is in while a signal is positive.

        input ─▶ [ Enable ] ─▶ on

    on = 1 if input > 0, otherwise 0. It is decided at ticks, and where the input is continuous, at
    the times between them at which it changes its sign. While it is 0, nothing in the part is
    computed: outputs hold their last values, zero before the part first ran, and states hold, the
    derivatives of continuous ones being zero. With ``while_off: reset``, outputs are zero and
    states have their initial values, which an output that depends on states alone shows from the
    next tick on. Outputs that are constant are not switched. (An enabled subsystem of Simulink.)
    """

    signal = Input(Scalar, name="input", doc="what decides, from outside of the part")
    on = Output(Scalar, doc="1 on ticks on which the part runs, otherwise 0")

    while_off: str = param(
        "hold", choices=("hold", "reset"), doc="what outputs and states do while the part is off"
    )

    @property
    def resets(self) -> bool:
        return self.while_off == "reset"

    def output(self, state: BlockState, t: float, input: float) -> float:
        return 1.0 if input > 0.0 else 0.0

    def crossings(self, context: BlockContext) -> tuple[str, ...]:
        return ("either",)

    def guards(self, state: BlockState, t: float, input: float) -> FloatArray:
        return np.array([input])


class Trigger(PartEnable):
    """Run the part that this block is in once, on each tick on which a signal changes its sign.

        input ─▶ [ Trigger ] ─▶ on

    on = 1 if input is positive and was not on the last tick (rising), the other way round
    (falling), or both; otherwise 0. The input before the first tick counts as zero. Outputs and
    states hold in between. Where the input is continuous, the part runs at the time between ticks
    at which the sign changes. (A triggered subsystem of Simulink.)
    """

    momentary = True

    signal = Input(Scalar, name="input", doc="what decides, from outside of the part")
    on = Output(Scalar, doc="1 on ticks on which the part runs, otherwise 0")

    edge: str = param("rising", choices=EDGES, doc="which changes of the sign trigger")

    before = State(doc="1 if the input was positive on the last tick, otherwise 0")

    def output(self, state: BlockState, t: float, input: float) -> float:
        after, before = input > 0.0, float(state.before) > 0.0
        if self.edge != "falling" and after and not before:
            return 1.0
        if self.edge != "rising" and before and not after:
            return 1.0
        return 0.0

    def update(self, state: BlockState, t: float, input: float) -> None:
        state.before[...] = 1.0 if input > 0.0 else 0.0

    def crossings(self, context: BlockContext) -> tuple[str, ...]:
        return ("either",)

    def guards(self, state: BlockState, t: float, input: float) -> FloatArray:
        return np.array([input])
