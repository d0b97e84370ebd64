"""What a sweep adds to its runs: 200 seeds of case A, start-up included, against one run alone.

And what a trial costs beside its ticks, where only a number and the seed differ from the last one.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time

from benchmarks.start_up import CLI
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, cores, take_turns

GRAPH = "line_actuator_failure"
SEEDS = 200
MOST = 1.1
ENGINES = ("python", "compiled")
ALONE = """
import statistics, sys, time
import runtime

engine, until = sys.argv[1], float(sys.argv[2])
graph = runtime.load({graph!r}).set("run.engine", engine).set("run.until", until).check()
graph.run(seed=100)
taken = []
for seed in range(int(sys.argv[3])):
    began = time.perf_counter()
    graph.run(seed=seed)
    taken.append(time.perf_counter() - began)
print(statistics.median(taken))
"""
TRIALS = 101
MOST_BESIDE = 1.0  # ms
# Trials as a worker runs them; two lengths tell the ticks from what is beside them.
BESIDE = """
import statistics, sys, time
import runtime
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import Task, run_task

graph = runtime.load({graph!r}).set("run.engine", sys.argv[1]).set("run.until", float(sys.argv[2]))
bundle = GraphBundle.of(graph.check())
taken = []
for i in range(int(sys.argv[3])):
    loss = "[1.0, " + str(0.5 + i / 1000) + "]"
    trial = Trial(i, Configuration(i, (loss,), bundle, (("fault.gain", loss),)), i)
    began = time.process_time()
    done = run_task(Task(trial))
    taken.append(time.process_time() - began)
    if done.status != "ok":
        raise RuntimeError(done.reason)
print(statistics.median(taken[1:]))
"""
RUNS = {"python": 1, "compiled": 9}  # of which one run alone is the median
ROUNDS = {"python": 1, "compiled": 3}  # for each one that is asked for


def alone_seconds(engine: str, until: float, processes: int = 1) -> float:
    """Wall seconds of one run in a process that has run one before.

    Of several processes at once, the mean: they share memory and caches, and maybe more.
    """
    code, count = ALONE.format(graph=GRAPH), str(RUNS[engine])
    command = [sys.executable, "-c", code, engine, str(until), count]
    started = [
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(processes)
    ]
    return statistics.mean(float(process.communicate()[0]) for process in started)


def arguments(engine: str, seeds: int, until: float, folder: str) -> tuple[str, ...]:
    """The command line of the sweep, without figures."""
    return (
        *("sweep", GRAPH, "--seeds", f"0..{seeds - 1}", "--engine", engine, "--until", str(until)),
        *("--jobs", str(cores()), "--json", "--no-plots", "--out", folder),
    )


def sweep_seconds(engine: str, seeds: int, until: float) -> float:
    """Wall seconds of the whole command, from its start to its end."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", CLI, *arguments(engine, seeds, until, folder)]
        began = time.perf_counter()
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        took = time.perf_counter() - began
    counts = json.loads(done.stdout)["counts"]
    if counts != {"ok": seeds}:
        raise RuntimeError(f"of {seeds} seeds ended {counts}; the measurement is void")
    return took


def beside_seconds(engine: str, length: float) -> float:
    """CPU seconds of a trial beside its ticks: twice that of a length, less that of its double."""
    code = BESIDE.format(graph=GRAPH)
    short, double = (
        float(subprocess.check_output([sys.executable, "-c", code, engine, str(t), str(TRIALS)]))
        for t in (length, 2.0 * length)
    )
    return 2.0 * short - double


def section(seeds: int, until: float, rounds: int) -> str:
    """The time of a sweep as a multiple of what its runs would take side by side."""
    timings: dict[str, Timing] = {}
    for engine in ENGINES:
        timings |= take_turns(
            {
                f"one run, {engine} engine": lambda e=engine: alone_seconds(e, until),
                f"one on each, {engine} engine": lambda e=engine: alone_seconds(e, until, cores()),
                f"{seeds} seeds, {engine} engine": lambda e=engine: sweep_seconds(e, seeds, until),
            },
            rounds * ROUNDS[engine],
        )
    beside = take_turns({"a trial": lambda: beside_seconds("compiled", 0.2)}, 3 * rounds)["a trial"]
    rows, wanted = [], []
    for engine in ENGINES:
        alone = timings[f"one run, {engine} engine"]
        each = timings[f"one on each, {engine} engine"]
        whole = timings[f"{seeds} seeds, {engine} engine"]
        ratio = whole.median / (alone.median * seeds / cores())
        figures = [figure(alone, 1.0, "s", 3), figure(each, 1.0, "s", 3)]
        rows.append([engine, *figures, figure(whole, 1.0, "s", 2), f"{ratio:.3f}"])
        message = f"{seeds} seeds, {engine} engine, against one run x {seeds} / {cores()} at most"
        wanted.append(Goal(f"{message} {MOST:g}", ratio, most=MOST))
    wanted.append(
        Goal(
            "CPU time of a trial beside its ticks",
            1e3 * beside.median,
            most=MOST_BESIDE,
            unit=" ms",
        )
    )
    each = f"one on each of {cores()} processors"
    head = ["engine", "one run", each, f"sweep of {seeds} seeds", "sweep / ideal"]
    return (
        f"\n## What a sweep adds\n\nCase A over {until:g} s. 'One run' is warm and alone in its "
        f"process; the sweep is the whole command on {cores()} workers, from its start to its last "
        f"row, without figures. Ideal: the runs side by side, each as long as one alone.\n\n"
        f"{table(head, rows)}\nA trial of the compiled engine in which a number and the seed are "
        f"other ones than in the last takes {figure(beside, 1e3, 'ms', 2)} beside its ticks.\n"
        f"{goals(wanted)}"
    )


if __name__ == "__main__":
    print(section(SEEDS, 20.0, rounds=1))
