"""How time grows: with blocks, neurons, simulated time and trials, each with its exponent.

The exponent is that of a power of the size, from the smallest size to the largest: 1 is as much
again for each further one. Per tick, more simulated time should cost nothing: 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from benchmarks import case_a, chains
from benchmarks.monte_carlo import sweep_seconds
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, take_turns

GPU = """
### On a graphics processor

An estimate on paper, without code. A step of a LIF neuron that learns reads and writes about 80
bytes and takes about 25 operations: 0.3 per byte, so that the bandwidth of the memory decides. At
the 4 TB/s of a large device, a tick of a trial of case A with two populations of 100 neurons takes
about 4 ns if thousands of them run at once, against 270 ns of a core on which the numbers stay in
the cache. Since each tick also starts kernels one after the other, a few microseconds, it pays from
about 1,000 trials at once, or from about 2,000 neurons per population.
"""


@dataclass(frozen=True)
class Growth:
    """What is measured at several sizes.

    units : by which seconds are divided at a size. most : the exponent that it should not exceed.
    """

    title: str
    what: str
    sizes: tuple[int, ...]
    seconds: Callable[[int], float]
    units: Callable[[int], int]
    most: float

    def row(self, rounds: int) -> tuple[list[str], Goal]:
        """Figures at each size, and the exponent."""
        turns = {str(n): partial(self.seconds, n) for n in self.sizes}
        taken = take_turns(turns, rounds)
        timings = [Timing(taken[str(n)].seconds, self.units(n)) for n in self.sizes]
        ratio = timings[-1].median / timings[0].median
        power = math.log(ratio) / math.log(self.sizes[-1] / self.sizes[0])
        sizes = ", ".join(f"{n:,}" for n in self.sizes)
        # Of one unit, so that a row can be read at a glance.
        scale, unit = (1e6, "µs") if timings[0].median < 0.01 else (1.0, "s")
        cells = [figure(t, scale, unit, 2).partition(" (")[0] for t in timings]
        goal = Goal(f"{self.title}: exponent", power, most=self.most, unit="")
        return [self.title, self.what, sizes, ", ".join(cells), f"{power:.2f}"], goal


def case_a_seconds(neurons: int, ticks: int) -> float:
    """Seconds of the ticks of case A under the compiled engine."""
    return case_a.Ours(neurons, ticks, "compiled")().seconds


def chain_seconds(engine: str, length: int) -> float:
    """Seconds of the ticks of a chain of Gains."""
    result = chains.chain(length).set("run.engine", engine).run()
    return float(result.manifest["us_per_tick"]) * 1e-6 * chains.TICKS


def measured(quick: bool) -> list[Growth]:
    """What is measured."""
    lengths = (10, 100) if quick else (10, 100, 1000)
    neurons = (100, 1000) if quick else (100, 1000, 10_000)
    times = (1, 2) if quick else (5, 20, 100)
    trials = (4, 8) if quick else (50, 100, 200, 400)
    ticks = 200 if quick else 2000
    until = 0.5 if quick else 20.0
    per_tick = lambda n: chains.TICKS  # noqa: E731
    return [
        Growth(
            *("blocks, Python engine", "a chain of Gains, per tick", lengths),
            *(partial(chain_seconds, "python"), per_tick, 1.1),
        ),
        Growth(
            *("blocks, compiled engine", "a chain of Gains, per tick", lengths),
            *(partial(chain_seconds, "compiled"), per_tick, 1.1),
        ),
        Growth(
            *("neurons", "case A, compiled, per tick, neurons in each of two populations"),
            *(neurons, lambda n: case_a_seconds(n, ticks), lambda n: ticks, 1.1),
        ),
        Growth(
            *("simulated time", "case A, compiled, per tick, over so many seconds"),
            *(times, lambda n: case_a_seconds(100, 1000 * n), lambda n: 1000 * n, 0.05),
        ),
        Growth(
            *("trials", f"a sweep of case A over {until:g} s, the whole command", trials),
            *(lambda n: sweep_seconds(n, until), lambda n: 1, 1.05),
        ),
    ]


def section(rounds: int, quick: bool = False) -> str:
    """The sections of docs/performance.md about growth, and about graphics processors."""
    rows, wanted = zip(*(each.row(rounds) for each in measured(quick)), strict=True)
    head = ["what grows", "measured", "sizes", "time", "exponent"]
    return f"\n## Growth\n\nTime as a power of the size.\n\n{table(head, rows)}{goals(wanted)}{GPU}"
