"""What a block is that says when the part around it runs."""

from __future__ import annotations

from abc import ABC
from typing import ClassVar

from blocks.core.block import Block


class PartEnable(Block, ABC):
    """Base of blocks that switch the part that they are in.

    A subclass declares an output ``on = Output(Scalar)``: the part runs on ticks where it is not 0.
    The engine computes it before the outputs of the part. ``momentary`` tells whether the part runs
    on single ticks; it may then have no continuous states.
    """

    momentary: ClassVar[bool] = False

    @property
    def resets(self) -> bool:
        """Whether the part begins anew after it was off."""
        return False

    @property
    def stepwise(self) -> bool:
        return True
