"""A switch between two signals of one type."""

from __future__ import annotations

from typing import Any

from blocks.core import Block, BlockState, Input, Output, Same, Scalar


class Switch(Block):
    """Pass on one of two signals.

        select, off, on ─▶ [ Switch ] ─▶ out

    out = on where select > 0.5, off elsewhere. Both signals are computed all the time. Under
    ``bypass``, ``on`` takes its place.
    """

    select = Input(Scalar, doc="which one")
    off = Input(Same("T"), doc="passed on while select is 0.5 or less")
    on = Input(Same("T"), doc="passed on while select is above 0.5")
    out = Output(Same("T"), through="on", doc="the selected signal")

    def output(self, state: BlockState, t: float, select: float, off: Any, on: Any) -> Any:
        return on if select > 0.5 else off
