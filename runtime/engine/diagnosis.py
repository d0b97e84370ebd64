"""Diagnosis after a run: blocks judge their own states, at no cost during the run.

In: the states at eight even moments of a run. Out: notes. A learner whose weights had the norms 1,
2, 5, 16, ... at them says::

    block 'snn': what it learnt grew 40-fold over the last half of the run, and ever faster: ...
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from blocks.core import Block, BlockState
from runtime.errors import raised_text
from runtime.network import Network

MOMENTS = 8


@dataclass
class Diagnosis:
    """Calls :meth:`Block.watch` of the blocks that define it, at eight even moments of a run."""

    network: Network
    states: Mapping[str, BlockState]
    seen: dict[str, list[float]] = field(init=False)
    moments: list[int] = field(init=False)
    total: int = field(init=False)
    # Of a trial nobody reads the notes, and eight moments cut its ticks into as many calls.
    is_wanted: bool = field(init=False, default=True)

    def __post_init__(self) -> None:
        blocks = {name: type(entry.block) for name, entry in self.network.entries.items()}
        self.seen = {name: [] for name, cls in blocks.items() if cls.watch is not Block.watch}
        total = self.total = self.network.ticks
        self.moments = [total * i // MOMENTS for i in range(1, MOMENTS + 1)] if self.seen else []

    def begin_again(self) -> None:
        """Forget what was seen."""
        self.seen = {name: [] for name in self.seen}

    def boundary(self, tick: int) -> int:
        """The next tick before which blocks are watched; the end of the run if there is none."""
        if not (self.moments and self.is_wanted):
            return self.total
        return next((moment for moment in self.moments if moment > tick), self.total)

    def look(self, tick: int) -> None:
        """Store what the blocks return before this tick."""
        if self.is_wanted and tick in self.moments:
            for name, values in self.seen.items():
                values.append(float(self.network.entries[name].block.watch(self.states[name])))

    def notes(self, ticks: int) -> list[str]:
        """The blocks' diagnoses of a run of so many base ticks."""
        found = []
        for name, entry in self.network.entries.items():
            taken = -((entry.offset - ticks) // entry.every)
            watched = tuple(self.seen.get(name, ()))
            try:
                message = list(entry.block.diagnose(self.states[name], taken, watched))
            except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything
                message = [f"its diagnose() failed: {raised_text(error, with_place=False)}"]
            found += [f"block '{name}': {text}" for text in message]
        return found
