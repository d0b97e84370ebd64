"""Many seeds of case A: ``runtime sweep`` against a pool of processes that run nengo."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

from benchmarks.case_a import DT, nengo_model
from benchmarks.contests import COMPILED
from benchmarks.start_up import CLI
from benchmarks.tables import Goal, goals, table
from benchmarks.timing import Timing, cores, take_turns

NENGO_POOL = "nengo in a process pool"
TIMES = 20.0


def sweep_seconds(seeds: int, until: float) -> float:
    """Wall seconds of the whole command, from its start to its end."""
    with tempfile.TemporaryDirectory() as folder:
        # A sweep needs a factor: here one with a single value, the graph's own.
        command = [
            *(sys.executable, "-c", CLI, "sweep", "line_actuator_failure"),
            *("--seeds", f"0..{seeds - 1}", "--vary", "limit.omega_max=[1.0]"),
            *("--engine", "compiled", "--until", str(until), "--jobs", str(cores())),
            *("--no-plots", "--json", "--out", folder, "--name", "seeds"),
        ]
        began = time.perf_counter()
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        took = time.perf_counter() - began
    counts = json.loads(done.stdout)["counts"]
    if counts != {"ok": seeds}:
        raise RuntimeError(f"of {seeds} seeds ended {counts}; the measurement is void")
    return took


def nengo_seed(job: tuple[int, float]) -> float:
    """Build and run one seed in nengo; the distance travelled along the line (m)."""
    import nengo

    seed, until = job
    model, probe = nengo_model(100, seed)
    with nengo.Simulator(model, dt=DT, progress_bar=False) as simulator:
        simulator.run(until)
        way = simulator.data[probe]
    return float(way[-1, 0] - way[0, 0])


@contextlib.contextmanager
def nengo_pool() -> Iterator[Any]:
    """A pool that has imported all it needs; its start is nobody's measured time."""
    # Not forked: this process has threads by now.
    with multiprocessing.get_context("spawn").Pool(cores()) as pool:
        pool.map(nengo_seed, [(seed, 0.01) for seed in range(2 * cores())])
        yield pool


def pool_seconds(pool: Any, seeds: int, until: float) -> float:
    began = time.perf_counter()
    pool.map(nengo_seed, [(seed, until) for seed in range(seeds)], chunksize=1)
    return time.perf_counter() - began


def section(seeds: int, nengo_seeds: int, until: float, rounds: int) -> str:
    """Throughputs; both sides run as many seeds as fill some seconds."""
    contestants = {COMPILED: lambda: sweep_seconds(seeds, until)}
    number = {COMPILED: seeds, NENGO_POOL: nengo_seeds}
    with contextlib.ExitStack() as stack:
        if find_spec("nengo"):
            pool = stack.enter_context(nengo_pool())
            contestants[NENGO_POOL] = lambda: pool_seconds(pool, nengo_seeds, until)
        timings = take_turns(contestants, rounds)
    rows = [
        [name, str(number[name]), rate(timing, number[name])] for name, timing in timings.items()
    ]
    reached = None
    if NENGO_POOL in timings:
        each = {name: timing.median / number[name] for name, timing in timings.items()}
        reached = each[NENGO_POOL] / each[COMPILED]
    wanted = Goal(f"at least {TIMES:g}x the throughput of nengo", reached, least=TIMES)
    return (
        f"\n## A Monte Carlo of case A\n\nRuns of {until:g} s with other neurons each, "
        f"{cores()} worker processes on either side. Not 1,000 seeds but as many as fill some "
        "seconds: what counts is runs per minute. Ours is the whole command `runtime sweep`, from "
        "its start to its table on disk; nengo's pool is warm, and builds a model for each seed."
        "\n\n" + table(["", "seeds", "runs per minute"], rows) + goals([wanted])
    )


def rate(timing: Timing, runs: int) -> str:
    """``4100 (3900 to 4200)`` runs per minute."""
    low, high = timing.spread
    values = [f"{60.0 * runs / seconds:,.0f}" for seconds in (timing.median, high, low)]
    return f"{values[0]} ({values[1]} to {values[2]})"
