"""Who runs against whom: checked to agree, then timed in turns."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec

import numpy as np

from benchmarks import by_hand, case_a, in_c, peers, tracking
from benchmarks.agreement import Run, largest_difference, run_all
from benchmarks.timing import Timing, take_turns

PYTHON, COMPILED = "spikeblocks, Python engine", "spikeblocks, compiled engine"
NUMPY, NUMBA, NENGO = "numpy loop by hand", "numba loop by hand", "nengo"
C, VECTOR = "C by hand, the C library's functions", "C by hand, in vector instructions"
ENGINES = {PYTHON: "python", COMPILED: "compiled"}

LEAST = 0.2  # s of runs in a round

Contestant = Callable[[], Run]


@dataclass(frozen=True)
class Contest:
    """Contestants over a number of ticks each."""

    subject: str
    contestants: dict[str, tuple[Contestant, int]]

    def times(self, rounds: int) -> dict[str, Timing]:
        """Seconds per tick of each, taken in turns."""
        taken = take_turns({n: partial(_seconds, run) for n, (run, _) in self.items()}, rounds)
        return {name: Timing(taken[name].seconds, ticks) for name, (_, ticks) in self.items()}

    def items(self):  # type: ignore[no-untyped-def]
        return self.contestants.items()


def _seconds(run: Contestant) -> float:
    """Seconds of a run; of a short one, on which a clock or another process weighs more, the
    median of several."""
    found = [run().seconds]
    while sum(found) < LEAST:
        found.append(run().seconds)
    return statistics.median(found)


def case_a_contest(neurons: int, ticks: int) -> tuple[Contest, float]:
    """Case A, and the largest difference between any two (m, rad).

    Nengo filters what the decoders give, we the spikes (paper, section III-D): with weights that
    move, that is not quite the same. So nengo is held against the numpy loop in nengo's order, on
    the same neurons, and the numpy loop in the paper's order against the others.

    Raises
    ------
    DisagreementError : the poses differ.
    """
    numbers = case_a.numbers(neurons)
    ours: dict[str, Contestant] = {
        name: case_a.Ours(neurons, ticks, engine) for name, engine in ENGINES.items()
    }
    hands = {
        NUMPY: partial(by_hand.numpy_case_a, numbers, ticks),
        NUMBA: partial(by_hand.numba_case_a, numbers, ticks),
        C: partial(in_c.case_a, numbers, ticks),
        VECTOR: partial(in_c.case_a, numbers, ticks, vector=True),
    }
    subject = f"case A, {neurons} neurons"
    ran = run_all(ours)
    ran |= {name: _rows(run, 0) for name, run in run_all(hands).items()}
    apart = largest_difference(subject, ran)
    contestants = {name: (run, ticks) for name, run in {**ours, **hands}.items()}
    if find_spec("nengo"):
        theirs = partial(case_a.nengo_run, numbers, ticks)
        filtered = by_hand.numpy_case_a(numbers, ticks, filtered="decoded")
        pair = {f"{NUMPY}, in nengo's order": _rows(filtered, case_a.EVERY - 1), NENGO: theirs()}
        apart = max(apart, largest_difference(subject, pair))
        contestants[NENGO] = (theirs, ticks)
    return Contest(subject, contestants), apart


def _rows(run: Run, first: int) -> Run:
    return Run(run.seconds, np.ascontiguousarray(run.poses[first :: case_a.EVERY]))


def tracking_contest(dt: float, ticks: int) -> tuple[Contest, float]:
    """The diagram without neurons, and the largest difference between any two.

    What is compiled runs fifty times as many ticks, lest the clock be what is measured.

    Raises
    ------
    DisagreementError : the poses differ.
    """
    found, _ = peers.installed(peers.PEERS)
    short: dict[str, Contestant] = {
        name: tracking.Ours(ticks, dt, engine) for name, engine in ENGINES.items()
    }
    short[NUMBA] = partial(by_hand.numba_tracking, ticks, dt)
    short[C] = partial(in_c.tracking, ticks, dt)
    short |= {title: partial(peer.poses, ticks, dt) for title, peer in found.items()}
    subject = f"tracking at {1e3 * dt:g} ms"
    apart = largest_difference(subject, run_all(short))
    contestants = {name: (run, ticks) for name, run in short.items()}
    long = 50 * ticks
    contestants[COMPILED] = (tracking.Ours(long, dt, "compiled"), long)
    contestants[NUMBA] = (partial(by_hand.numba_tracking, long, dt), long)
    contestants[C] = (partial(in_c.tracking, long, dt), long)
    return Contest(subject, contestants), apart
