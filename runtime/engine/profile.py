"""Profiling: the plan's function with a clock around every call of a block.

In: the seconds of each call. Out: a row for each block, the slowest first, with its share of the
run; ``profile_text`` makes of them the table that ``runtime run --profile`` shows.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from runtime.terminal import table

# Further names in the plan's function, see python_text. The cost of the clock itself is included.
CLOCK, SPENT = "clock", "spent"


@dataclass
class Profile:
    """Seconds and calls of each block, by name, from the second tick on.

    The first tick imports and builds what blocks need, as a run's time per tick does not count it.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    def __call__(self, called: str | tuple[str, ...], began: float) -> None:
        """Add a call of a block, or one of several blocks, of which each took an equal part."""
        took = time.perf_counter() - began
        names = (called,) if isinstance(called, str) else called
        for block in names:
            self.seconds[block] = self.seconds.get(block, 0.0) + took / len(names)
            self.calls[block] = self.calls.get(block, 0) + 1

    def restart(self) -> None:
        """Forget what was measured."""
        self.seconds.clear()
        self.calls.clear()

    def names(self) -> dict[str, Any]:
        """The names that the function's text refers to."""
        return {CLOCK: time.perf_counter, SPENT: self}

    def rows(self, ticks: int, wall_s: float) -> list[dict[str, Any]]:
        """One row per block, the slowest first, and one for everything else: checks of values,
        recording, the loop itself and the clock.

        Parameters
        ----------
        ticks : after the first one. wall_s : their time (s).
        """
        rest = max(0.0, wall_s - sum(self.seconds.values()))
        spent = sorted(self.seconds.items(), key=lambda item: -item[1])
        return [
            {
                "block": name,
                "calls": self.calls.get(name, 0),
                "total_s": seconds,
                "us_per_tick": 1e6 * seconds / max(1, ticks),
                "us_per_call": 1e6 * seconds / self.calls[name] if name in self.calls else None,
                "share": seconds / wall_s if wall_s else 0.0,
            }
            for name, seconds in [*spent, ("", rest)]
        ]


def profile_text(rows: list[dict[str, Any]]) -> str:
    """The rows as a table for a terminal."""
    cells = [("block", "us/tick", "us/call", "total s", "share")]
    for row in rows:
        call = "" if row["us_per_call"] is None else f"{row['us_per_call']:.2f}"
        tick, share = f"{row['us_per_tick']:.2f}", f"{100.0 * row['share']:.1f} %"
        name = row["block"] or "everything else"
        cells.append((name, tick, call, f"{row['total_s']:.3f}", share))
    return table(cells, right=range(1, 5))
