"""Kill workers of a real sweep at random moments: ``python -m tests.fuzz.kill_workers [TRIES]``.

Every try runs ``runtime sweep`` in a process of its own, with a recording of some megabytes for
each point, and kills a random one of its processes (a worker, or the nursery that forks them)
every few milliseconds; every third try ends with Ctrl-C at a random moment and goes on with
``--resume``. Prints one line: how many tries, kills, hangs and tracebacks there were, how many
indexes equal that of a sweep that nobody disturbed, and how many points were given up because
three of their workers were killed. Exit code 1 if a sweep hung, ended with a traceback, or left
an index that differs in anything but such points.
"""

from __future__ import annotations

import argparse
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
PATIENCE = 120.0  # s; a sweep that takes longer hangs
Row = tuple[str, ...]


def main() -> int:
    """Run the tries; print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tries", type=int, nargs="?", default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    parser.add_argument("--seconds", type=float, default=3600.0, help="begin no try after these")
    options = parser.parse_args()
    found: Counter[str] = Counter()
    end = time.monotonic() + options.seconds
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "own.py").write_text(MODULE)
        (folder / "noise.yaml").write_text(GRAPH)
        run(folder, "whole", None, found)
        expected = index(folder / "sweeps" / "whole")
        for number in range(options.tries):
            if time.monotonic() > end:
                break
            found["tries"] += 1
            moments = random.Random(f"{options.seed}.{number}")
            name = f"try{number}"
            while run(folder, name, moments, found, interrupts=number % 3 == 2) == "interrupted":
                found["interrupts"] += 1
            rows = index(folder / "sweeps" / name)
            lost = [point for point, row in rows.items() if row[0] == "lost"]
            found["lost"] += len(lost)
            rows |= {point: expected[point] for point in lost}
            found["equal"] += rows == expected
            for point in expected:
                if rows.get(point) != expected[point]:
                    print(f"{name}: point {point}: {rows.get(point)}", file=sys.stderr)
    print(
        f"tries {found['tries']}, kills {found['kills']}, interrupts {found['interrupts']}, "
        f"hangs {found['hangs']}, tracebacks {found['tracebacks']}, "
        f"indexes equal {found['equal']} of {found['tries']}, points given up {found['lost']}"
    )
    is_sound = not found["hangs"] and not found["tracebacks"]
    return 0 if is_sound and found["equal"] == found["tries"] else 1


def run(
    folder: Path,
    name: str,
    moments: random.Random | None,
    found: Counter[str],
    interrupts: bool = False,
) -> str:
    """Run a sweep, or go on with it; returns ``interrupted`` if Ctrl-C ended it."""
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
            found["hangs"] += 1
            sweep.kill()
        message.seek(0)
        text = message.read().decode()
        if "Traceback" in text:
            found["tracebacks"] += 1
            print(text, file=sys.stderr)
        return "interrupted" if sweep.returncode == 130 else "ended"


def kill_one(sweep: int, moments: random.Random) -> bool:
    """Kill one of a sweep's workers; now and then the nursery."""
    nurseries = children(sweep)
    workers = [pid for fork_server in nurseries for pid in children(fork_server)]
    # Killed whenever there are no workers yet, the nursery would never come to fork any.
    chosen = nurseries if moments.random() < 0.1 else workers
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
    """The rows of an index by point: status, reason, knob and metric."""
    with (folder / "index.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return {
        row["point"]: (row["status"], row["reason"], row["noise.level"], row["first"])
        for row in rows
    }


if __name__ == "__main__":
    sys.exit(main())
