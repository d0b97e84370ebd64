"""Real time: a run whose ticks wait for the clock, and how late they were.

In: an engine and a clock. Out: the same recordings, and figures of lateness::

    pacing = Pacing(speed=2.0)
    engine.run(progress, partial(pacing.advance, engine))
    pacing.figures()     # {"period_s": 0.001, "late_s": {"p50": 6e-05, ...}, "overruns": 3, ...}

Tick k is due k * dt / speed after the first one, which compiles and is not paced. Ticks of less
than 1 ms are run together in periods of about 1 ms. No number of a run depends on the clock.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from runtime.engine import Engine, stoppable
from runtime.errors import UsageError
from runtime.observation import RunData

OVERRUNS = ("catch-up", "skip")
UNITS = {"s": 1.0, "ns": 1e-9, "us": 1e-6, "ms": 1e-3, "min": 60.0, "h": 3600.0, "d": 86400.0}
# A process of normal priority wakes up about 0.1 ms late: the last part of a wait is a loop.
PERIOD_NS, SPIN_NS, PROGRESS_NS = 1e6, 200_000, 1e8
PRIORITY = 50  # of 1 to 99: above other programs, below the kernel's own threads for interrupts
SHARES = {"p50": 0.5, "p99": 0.99, "p99_9": 0.999, "worst": 1.0}


@dataclass
class Pacing:
    """Runs ticks when they are due by the clock, and measures how late they were; for one run.

    Parameters
    ----------
    speed : seconds of the graph in one second of the clock.
    overrun : what follows where the ticks of a period end after the next period is due: "catch-up"
        runs those at once, without waiting, until the clock is reached; "skip" leaves out the due
        times that have passed, so that the graph's time stays behind. No tick is left out.
    priority : run under the scheduler's policy SCHED_FIFO, if the system has and allows it.
    now, sleep : the clock (ns), and what waits (s).

    Raises
    ------
    UsageError : the speed is not above 0, or ``overrun`` is not one of :data:`OVERRUNS`.
    """

    speed: float = 1.0
    overrun: str = "catch-up"
    priority: bool = False
    now: Callable[[], int] = time.monotonic_ns
    sleep: Callable[[float], None] = time.sleep
    notes: list[str] = field(init=False, default_factory=list)
    policy: str = field(init=False, default="normal")
    period: float = field(init=False, default=0.0)
    ticks: int = field(init=False, default=1)
    late: npt.NDArray[np.int64] = field(init=False)
    periods_done: int = field(init=False, default=0)
    overruns: int = field(init=False, default=0)
    skipped: int = field(init=False, default=0)
    behind: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.speed) and self.speed > 0.0):
            raise UsageError(f"expected a speed above 0, got {self.speed}")
        if self.overrun not in OVERRUNS:
            known = " or ".join(OVERRUNS)
            raise UsageError(f"expected {known} for an overrun, got '{self.overrun}'")
        self.late = np.zeros(0, dtype=np.int64)

    def advance(
        self, engine: Engine, last: int, progress: Callable[[int, int], None] | None = None
    ) -> None:
        """Run the ticks up to one, as ``Engine.advance`` does, each when it is due."""
        engine.advance(min(engine.state.tick + 1, last), progress)
        first, network = engine.state.tick, engine.network
        tick = 1e9 * network.dt * UNITS[network.time_unit] / self.speed
        self.ticks = max(1, round(PERIOD_NS / tick))
        count = -(-(last - first) // self.ticks)
        each = max(1, round(PROGRESS_NS / (self.ticks * tick)))
        begin = self.now() + tick
        for number in self.periods(self.ticks * tick, count, begin, lambda: engine.is_stopped):
            shown = progress if number % each == 0 else None
            engine.advance(min(first + (number + 1) * self.ticks, last), shown)

    def periods(
        self,
        period: float,
        count: int,
        begin: float | None = None,
        is_over: Callable[[], bool] = lambda: False,
    ) -> Iterator[int]:
        """Numbers from 0 on, each when its period is due: number * period (ns) after ``begin``.

        The caller's work between two of them is that of a period. ``begin`` is now by default;
        ``is_over`` ends the loop before the next period.
        """
        self.period = period
        # Allocated before the loop: growing it would make ticks late.
        self.late = np.zeros(count, dtype=np.int64)
        with _schedule(self.priority, self.notes) as self.policy:
            begin = self.now() if begin is None else begin
            for number in range(count):
                if is_over():
                    break
                # From one beginning, since a sum of periods would drift.
                due = round(begin + (number + self.skipped) * self.period)
                self.late[number] = self._wait(due) - due
                self.periods_done = number + 1
                yield number
                self._check(due + self.period)

    def _wait(self, due: int) -> int:
        """Wait until a time (ns), and return the one that it is then."""
        left = due - self.now() - SPIN_NS
        if left > 0.0:
            with stoppable():
                self.sleep(1e-9 * left)
        while (now := self.now()) < due:
            pass
        return now

    def _check(self, due: float) -> None:
        """Notice an overrun: the ticks of a period have ended, and the next is due at a time."""
        over = max(0.0, self.now() - due)
        self.behind = over + self.skipped * self.period
        if over > 0.0:
            self.overruns += 1
            if self.overrun == "skip":
                self.skipped += math.ceil(over / self.period)

    def figures(self) -> dict[str, Any]:
        """What was measured, for the manifest; times in s of the clock.

        ``late_s`` are quantiles of the time between when a period was due and when its first tick
        began (inverse of the empirical distribution function); None if there was no period.
        ``behind_s`` is how far the end of the run was behind the clock.
        """
        late = self.late[: self.periods_done] * 1e-9
        shares = list(SHARES.values())
        found = np.quantile(late, shares, method="inverted_cdf") if self.periods_done else shares
        values = [float(value) if self.periods_done else None for value in found]
        return {
            "speed": self.speed,
            "priority": self.policy,
            "period_s": 1e-9 * self.period,
            "ticks_per_period": self.ticks,
            "periods": self.periods_done,
            "late_s": dict(zip(SHARES, values, strict=True)),
            "overrun": self.overrun,
            "overruns": self.overruns,
            "skipped": self.skipped,
            "behind_s": 1e-9 * self.behind,
        }

    def end(self, result: RunData) -> None:
        """Give the figures to the result of the run."""
        result.manifest["real_time"] = self.figures()
        result.notes += self.notes


@contextmanager
def _schedule(wanted: bool, notes: list[str]) -> Iterator[str]:
    """A context under SCHED_FIFO, if that is wanted and possible; the policy's name."""
    if not wanted:
        yield "normal"
        return
    if sys.platform != "linux":
        notes.append("ran with normal priority: this system has no SCHED_FIFO, which Linux has")
        yield "normal"
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError as error:
        notes.append(
            f"ran with normal priority: SCHED_FIFO was refused ({error.strerror}); allow it by "
            f"'rtprio {PRIORITY}' for your user in /etc/security/limits.conf, or CAP_SYS_NICE"
        )
        yield "normal"
        return
    try:
        yield f"SCHED_FIFO {PRIORITY}"
    finally:
        os.sched_setscheduler(0, *before)


def pacing_text(figures: Mapping[str, Any]) -> str:
    """The figures of a run in real time as one line."""
    if not figures["periods"]:
        return "real time: the run ended before its second tick, so nothing was late"
    late = figures["late_s"]
    names = {"p50": "50 %", "p99": "99 %", "p99_9": "99.9 %", "worst": "worst"}
    measured = ", ".join(f"{_time(late[key])} ({name})" for key, name in names.items())
    text = f"real time, speed {figures['speed']:g}, {figures['priority']} priority: "
    text += f"{figures['periods']} periods of {_time(figures['period_s'])} began late by {measured}"
    text += f"; {figures['overruns']} overruns ({figures['overrun']})"
    behind = figures["behind_s"]
    return text + (f", {_time(behind)} behind at the end" if behind > 0.0 else "")


def _time(seconds: float) -> str:
    """A short time with its unit."""
    factor, unit = next(
        ((f, u) for f, u in ((1.0, "s"), (1e3, "ms")) if seconds * f >= 1.0), (1e6, "µs")
    )
    return f"{seconds * factor:.3g} {unit}"
