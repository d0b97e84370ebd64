"""What a sweep adds to its runs: 200 seeds of case A, start-up included, against one run alone."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time

from benchmarks.start_up import CLI
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, cores, take_turns

GRAPH = "line_actuator_failure"
SEEDS = 200
MOST = 1.15
ENGINES = ("python", "compiled")
ALONE = """
import sys, time
import runtime

engine, until = sys.argv[1], float(sys.argv[2])
graph = runtime.load({graph!r}).set("run.engine", engine).set("run.until", until).check()
graph.run(seed=1)
began = time.perf_counter()
graph.run(seed=0)
print(time.perf_counter() - began)
"""


def alone_seconds(engine: str, until: float) -> float:
    """Wall seconds of one run in a process that does nothing else and has run one before."""
    command = [sys.executable, "-c", ALONE.format(graph=GRAPH), engine, str(until)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return float(done.stdout)


def sweep_seconds(engine: str, seeds: int, until: float) -> float:
    """Wall seconds of the whole command, from its start to its end."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *(sys.executable, "-c", CLI, "sweep", GRAPH, "--seeds", f"0..{seeds - 1}"),
            *("--engine", engine, "--until", str(until), "--jobs", str(cores())),
            *("--json", "--no-plots", "--out", folder),
        ]
        began = time.perf_counter()
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        took = time.perf_counter() - began
    counts = json.loads(done.stdout)["counts"]
    if counts != {"ok": seeds}:
        raise RuntimeError(f"of {seeds} seeds ended {counts}; the measurement is void")
    return took


def section(seeds: int, until: float, rounds: int) -> str:
    """The time of a sweep as a multiple of what its runs would take side by side."""
    timings: dict[str, Timing] = {}
    for engine in ENGINES:
        timings |= take_turns(
            {
                f"one run, {engine} engine": lambda e=engine: alone_seconds(e, until),
                f"{seeds} seeds, {engine} engine": lambda e=engine: sweep_seconds(e, seeds, until),
            },
            rounds,
        )
    rows, wanted = [], []
    for engine in ENGINES:
        alone = timings[f"one run, {engine} engine"]
        whole = timings[f"{seeds} seeds, {engine} engine"]
        ratio = whole.median / (alone.median * seeds / cores())
        rows.append(
            [engine, figure(alone, 1.0, "s", 3), figure(whole, 1.0, "s", 2), f"{ratio:.3f}"]
        )
        message = f"{seeds} seeds, {engine} engine, against one run x {seeds} / {cores()} at most"
        wanted.append(Goal(f"{message} {MOST:g}", ratio, most=MOST))
    head = ["engine", "one run", f"sweep of {seeds} seeds", "sweep / ideal"]
    return (
        f"\n## What a sweep adds\n\nCase A over {until:g} s. 'One run' is warm and alone in its "
        f"process; the sweep is the whole command on {cores()} workers, from its start to its last "
        f"row, without figures. Ideal: the runs side by side and nothing else.\n\n"
        f"{table(head, rows)}{goals(wanted)}"
    )


if __name__ == "__main__":
    print(section(SEEDS, 20.0, rounds=1))
