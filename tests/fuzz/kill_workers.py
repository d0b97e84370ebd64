"""Kill workers of a real sweep at random moments.

Every example runs ``runtime sweep`` in a process of its own, with a recording of some megabytes for
each trial, and kills a random one of its processes (a worker, or the process that forks them)
every few hundred milliseconds; every third example ends with Ctrl-C at a random moment and goes on
with ``--resume``.
"""

from __future__ import annotations

import contextlib
import csv
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.campaign import Record, cpu_seconds

MODULE = '''
import blocks
from blocks.core.signals import Vector


class Noise(blocks.Block):
    """Many numbers: out = level + N(0, 1)."""

    out = blocks.Output(Vector(500))
    first = blocks.Output(blocks.Scalar)
    held = blocks.State(500)

    level: float = blocks.param(0.0, doc="what the numbers are added to")

    def start(self, state):
        self.update(state, 0.0)

    def update(self, state, t):
        state.held[...] = self.level + state.rng.normal(size=500)

    def output(self, state, t):
        return state.held.copy(), float(state.held[0])
'''
GRAPH = """
graph: noise
run: {dt: 0.01, until: 5.0}
blocks:
  noise: {type: Noise, module: own.py}
probes:
  out: noise.out
metrics:
  first: {kind: final, of: noise.first}
"""
POINTS = 24
TITLE = "Kill workers"
WHAT = (
    "Workers of a real sweep, and now and then the process that forks them, are killed at random "
    "moments; every third sweep is also interrupted by Ctrl-C and resumed."
)
HOLDS = (
    "No sweep hangs or ends with a traceback, and its rows equal those of a sweep that nobody "
    "disturbed, but for trials that lost three workers and say so."
)
PATIENCE = 120.0  # s; a sweep that takes longer hangs
Row = tuple[str, ...]


def run(examples: int, seed: int) -> Record:
    """Run sweeps whose workers are killed, and compare their rows with an undisturbed sweep's."""
    started = cpu_seconds()
    found: Counter[str] = Counter()
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "own.py").write_text(MODULE)
        (folder / "noise.yaml").write_text(GRAPH)
        failures += sweep_until(folder, "whole", None, found)[1]
        expected = index(folder / "sweeps" / "whole")
        for number in range(examples):
            moments = random.Random(f"{seed}.{number}")
            name, ended = f"try{number}", "interrupted"
            while ended == "interrupted":
                ended, faults = sweep_until(folder, name, moments, found, number % 3 == 2)
                failures += faults
                found["Ctrl-C"] += ended == "interrupted"
            rows = index(folder / "sweeps" / name)
            # Three killed workers are what a trial may cost; such a row says so.
            lost = [point for point, row in rows.items() if row[0] == "lost"]
            found["trials given up"] += len(lost)
            rows |= {point: expected[point] for point in lost}
            found["equal indexes"] += rows == expected
            failures += [
                f"{name}: point {point}: {rows.get(point)}"
                for point in expected
                if rows.get(point) != expected[point]
            ]
    seconds = cpu_seconds() - started
    return Record("kill_workers", examples, seed, dict(found), tuple(failures), seconds)


def sweep_until(
    folder: Path,
    name: str,
    moments: random.Random | None,
    found: Counter[str],
    interrupts: bool = False,
) -> tuple[str, list[str]]:
    """Run a sweep, or go on with it; returns ``interrupted`` or ``ended``, and what went wrong."""
    faults: list[str] = []
    script = Path(sys.executable).parent / "runtime"
    command = [str(script), "sweep", "noise.yaml", "--vary", f"noise.level=0..1:{POINTS}"]
    command += ["-j", "2", "--keep", "all", "--no-plots", "-q", "--resume", "--name", name]
    with (
        tempfile.TemporaryFile() as message,
        subprocess.Popen(
            command, cwd=folder, stdout=message, stderr=message, start_new_session=True
        ) as sweep,
    ):
        # Ctrl-C is for a sweep that has begun; one that still starts has nothing to lose.
        while moments and sweep.poll() is None and not (folder / "sweeps" / name).exists():
            time.sleep(0.01)
        end = time.monotonic() + PATIENCE
        until = time.monotonic() + moments.uniform(0.0, 4.0) if moments and interrupts else end
        while sweep.poll() is None and time.monotonic() < min(end, until):
            with contextlib.suppress(subprocess.TimeoutExpired):
                sweep.wait(PATIENCE if moments is None else moments.uniform(0.0, 0.4))
            found["kills"] += moments is not None and kill_one(sweep.pid, moments)
        if sweep.poll() is None and time.monotonic() < end:
            os.kill(sweep.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                sweep.wait(PATIENCE)
        if sweep.poll() is None:
            faults.append(f"{name}: the sweep hangs")
            sweep.kill()
        message.seek(0)
        text = message.read().decode()
        if "Traceback" in text:
            faults.append(f"{name}: {text}")
        return ("interrupted" if sweep.returncode == 130 else "ended"), faults


def kill_one(sweep: int, moments: random.Random) -> bool:
    """Kill one of a sweep's workers; now and then the process that forks them."""
    fork_servers = children(sweep)
    workers = [pid for fork_server in fork_servers for pid in children(fork_server)]
    # Killed whenever there are no workers yet, the fork server would never come to fork any.
    chosen = fork_servers if moments.random() < 0.1 else workers
    if not chosen:
        return False
    with contextlib.suppress(ProcessLookupError):
        os.kill(moments.choice(chosen), signal.SIGKILL)
        return True
    return False


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    found: list[int] = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += map(int, (task / "children").read_text().split())
    return found


def index(folder: Path) -> dict[str, Row]:
    """The rows of an index by point: status, reason, factor and metric."""
    with (folder / "index.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return {
        row["point"]: (row["status"], row["reason"], row["noise.level"], row["first"])
        for row in rows
    }
