"""Timing on a shared machine: contestants take turns within one process, medians are quoted."""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Timing:
    """Seconds of each round, and what one round is divided by."""

    seconds: list[float]
    units: int = 1

    @property
    def median(self) -> float:
        return statistics.median(self.seconds) / self.units

    @property
    def spread(self) -> tuple[float, float]:
        return min(self.seconds) / self.units, max(self.seconds) / self.units


def take_turns(
    contestants: Mapping[str, Callable[[], float]], rounds: int, units: int = 1
) -> dict[str, Timing]:
    """Let every contestant run once per round, after one round that does not count.

    A contestant returns the seconds that its own measured part took.
    """
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for number in range(rounds + 1):
        for name, run in contestants.items():
            took = run()
            if number:
                seconds[name].append(took)
    return {name: Timing(values, units) for name, values in seconds.items()}


def process_seconds(*arguments: str) -> float:
    """Wall seconds of one Python process, which may keep its bytecode as it does for users."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    began = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=kept)
    return time.perf_counter() - began


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> str:
    """The machine in one line: processor, cores, Python."""
    model = platform.processor() or platform.machine()
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            model = next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        pass
    return f"{model}, {cores()} cores, Python {platform.python_version()}"
