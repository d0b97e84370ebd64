"""What compiling costs and gains, each figure in processes of its own.

An earlier tree of this project can take part, such as the last whose compiled engine was numba's:

    git archive 3e2cb92 | tar -x -C OLD_TREE
    python -m benchmarks --only against --against OLD_TREE
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from benchmarks import sweeps
from benchmarks.contests import NUMBA, case_a_contest
from benchmarks.start_up import CLI
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, cores, machine

HERE = Path(__file__).parent.parent
NOW, BEFORE = "now", "before"
SHIPPED, BARE = "case A as shipped", "case A, one probe"
SEEDS = 200
# A shipped graph, and one block out of it.
CASES: dict[str, tuple[str, str]] = {
    "A": ("line_actuator_failure", "adaptive"),
    "C": ("wall_following", "adaptive"),
    "C with MuJoCo": ("wall_following_mujoco", "adaptive"),
}
# Seconds beyond the Python engine's: goals of an empty cache, of one block out, of a full cache.
LIMITS: dict[str, tuple[float, float, float]] = {
    "A": (2.0, 0.3, 0.15),
    "C": (4.0, 0.5, 0.15),
    "C with MuJoCo": (4.0, 0.5, 0.15),
}
STATES = ("empty cache", "one block out", "cached")

FIRST = """
import sys
import runtime

name, engine, removed = sys.argv[1:]
graph = runtime.load(name)
graph = graph.without(removed) if removed else graph
for section in ("plots", "metrics"):
    graph = graph.set(section, {})
graph.run(until=0.002, engine=engine)
"""
# µs per tick of the second run, of a graph as shipped or with one probe, and the most memory (MB).
TICKS = """
import json, resource, sys
import runtime

what, size = sys.argv[1], float(sys.argv[2])
if what == "chain":
    from benchmarks.chains import chain
    graph = chain(int(size))
elif what == "neurons":
    from benchmarks.case_a import graph as case_a
    graph = case_a(int(size), 2000, "compiled")
else:
    graph = runtime.load("wall_following" if what == "C" else "line_actuator_failure")
    graph = graph.set("run.until", size)
    if what != "A as shipped":
        for section in ("plots", "metrics", "probes"):
            graph = graph.set(section, {})
        graph = graph.set("probes.pose", {"of": "plant.pose", "every": 10})
graph = graph.set("run.engine", "compiled").check()
found = []
for _ in range(4):
    manifest = graph.run().manifest
    found.append(manifest["us_per_tick"])
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
most /= 1024 if sys.platform == "linux" else 2**20
print(json.dumps({"us": found[1:], "mb": most}))
"""


@dataclass
class Tree:
    """A tree of the project, and a cache folder for its compiled engine."""

    path: Path
    cache: Path
    start: Timing = field(default_factory=lambda: Timing([0.0]))

    def run(self, code: str, *arguments: str, cache: Path | None = None) -> tuple[float, str]:
        """Wall seconds of a process that runs a text in this tree, and what it printed."""
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        environment |= {"PYTHONPATH": str(self.path), "SPIKEBLOCKS_CACHE": str(cache or self.cache)}
        command = [sys.executable, "-c", code, *arguments]
        began = time.perf_counter()
        done = subprocess.run(
            command, check=True, capture_output=True, text=True, cwd=self.path, env=environment
        )
        return time.perf_counter() - began, done.stdout

    def measured(self, what: str, size: float) -> dict[str, list[float] | float]:
        """Time per tick (µs) and memory (MB) of a graph, compiled before."""
        _, answer = self.run(TICKS, what, str(size))
        found: dict[str, list[float] | float] = json.loads(answer)
        return found

    def sweep(self, seeds: int, until: float) -> tuple[float, float]:
        """Wall seconds of a whole sweep of case A without figures, and of one run of it alone."""
        with tempfile.TemporaryDirectory() as folder:
            took, answer = self.run(CLI, *sweeps.arguments("compiled", seeds, until, folder))
        counts = json.loads(answer)["counts"]
        if counts != {"ok": seeds}:
            raise RuntimeError(f"of {seeds} seeds ended {counts}; the measurement is void")
        runs = str(sweeps.RUNS["compiled"])
        _, alone = self.run(sweeps.ALONE.format(graph=sweeps.GRAPH), "compiled", str(until), runs)
        return took, float(alone)


@contextmanager
def trees(against: Path | None) -> Iterator[dict[str, Tree]]:
    """This tree and the earlier one, with empty caches."""
    with tempfile.TemporaryDirectory() as folder:
        paths = {NOW: HERE, **({BEFORE: against} if against is not None else {})}
        yield {name: Tree(path, Path(folder) / name) for name, path in paths.items()}


def tell(text: str) -> None:
    """What is measured now, on stderr."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def first_ticks(found: Mapping[str, Tree], case: str, rounds: int) -> dict[str, dict[str, Timing]]:
    """Seconds of a compiled first tick beyond the Python engine's, by tree and state of the cache.

    Raises
    ------
    subprocess.CalledProcessError : a run failed.
    """
    graph, removed = CASES[case]
    seconds: dict[str, dict[str, list[float]]] = {
        name: {state: [] for state in STATES} for name in found
    }
    tell(f"first ticks of case {case}")
    for _ in range(rounds):
        for name, tree in found.items():
            with tempfile.TemporaryDirectory() as cache:
                run = partial(tree.run, FIRST, graph, cache=Path(cache))
                usual, without = run("python", "")[0], run("python", removed)[0]
                taken = [run("compiled", "")[0] - usual, run("compiled", removed)[0] - without]
                taken.append(run("compiled", "")[0] - usual)
            for state, value in zip(STATES, taken, strict=True):
                seconds[name][state].append(value)
    return {
        name: {state: Timing(values) for state, values in by_state.items()}
        for name, by_state in seconds.items()
    }


def start_rows(
    found: Mapping[str, Tree], cases: Mapping[str, object], rounds: int
) -> tuple[list[list[str]], list[Goal]]:
    """Rows and goals of :func:`first_ticks`."""
    rows, wanted = [], []
    for case in cases:
        times = first_ticks(found, case, rounds)
        for state, limit in zip(STATES, LIMITS[case], strict=True):
            row = [figure(times[name][state], 1.0, "s", 2) for name in found]
            rows.append([f"case {case}, {state}", *row])
            reached = times[NOW][state].median
            wanted.append(Goal(f"case {case}, {state}, {limit:g} s", reached, None, limit, " s"))
    return rows, wanted


def tick_rows(
    found: Mapping[str, Tree], sizes: Mapping[str, tuple[str, float]], rounds: int
) -> tuple[list[list[str]], list[Goal]]:
    """Times per tick and memory, each the median over processes that take turns."""
    taken: dict[str, dict[str, list[dict[str, list[float] | float]]]] = {}
    for _ in range(rounds):
        for title, (what, size) in sizes.items():
            tell(f"ticks of {title}")
            for name, tree in found.items():
                by_tree = taken.setdefault(title, {}).setdefault(name, [])
                by_tree.append(tree.measured(what, size))
    rows, wanted, medians = [], [], {}
    for title, trees_of in taken.items():
        timings = {
            name: Timing([statistics.median(entry["us"]) for entry in entries])  # type: ignore[arg-type]
            for name, entries in trees_of.items()
        }
        medians[title] = timings[NOW].median
        rows.append([f"{title}, per tick", *(figure(timings[n], 1.0, "µs", 2) for n in found)])
        if BEFORE in timings:
            ratio = timings[NOW].median / timings[BEFORE].median
            wanted.append(Goal(f"{title}, per tick against before", ratio, most=1.0))
        if title == "case C":
            memory = {n: Timing([e["mb"] for e in entries]) for n, entries in trees_of.items()}  # type: ignore[misc]
            rows.append(["case C, memory", *(figure(memory[n], 1.0, "MB", 0) for n in found)])
            message = "memory of a process with case C"
            wanted.append(Goal(message, memory[NOW].median, most=150.0, unit=" MB"))
    if SHIPPED in medians:
        ratio = medians[SHIPPED] / medians[BARE]
        wanted.append(Goal(f"{SHIPPED} against one probe", ratio, most=1.2))
    return rows, wanted


def by_hand_rows(ticks: int, rounds: int) -> tuple[list[list[str]], list[Goal]]:
    """Case A against the loop by hand, in turns in this process."""
    contest, _ = case_a_contest(100, ticks)
    ours = next(name for name in contest.contestants if "compiled" in name)
    pair = {name: contest.contestants[name] for name in (ours, NUMBA)}
    times = type(contest)(contest.subject, pair).times(rounds)
    rows = [[f"case A, {name}", figure(times[name], 1e6, "µs", 2)] for name in pair]
    ratio = times[ours].median / times[NUMBA].median
    return rows, [Goal("case A against a numba loop by hand", ratio, most=1.15)]


def sweep_rows(
    found: Mapping[str, Tree], seeds: int, until: float, rounds: int
) -> tuple[list[list[str]], list[Goal]]:
    """A sweep of case A as a multiple of its runs side by side."""
    rows, wanted, row = [], [], []
    for name, tree in found.items():
        tell(f"sweep of the tree {name}")
        taken = [tree.sweep(seeds, until) for _ in range(rounds)]
        sweep, alone = (Timing(list(column)) for column in zip(*taken, strict=True))
        ideal = alone.median * seeds / cores()
        row.append(f"{figure(sweep, 1.0, 's', 2)}, ideal {ideal:.2f} s")
        if name == NOW:
            message = f"sweep of {seeds} seeds against its runs side by side"
            wanted.append(Goal(message, sweep.median / ideal, most=sweeps.MOST))
    rows.append([f"sweep of {seeds} seeds of case A", *row])
    return rows, wanted


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md."""
    cases = {"A": CASES["A"]} if quick else CASES
    sizes: dict[str, tuple[str, float]] = {
        BARE: ("A", 1.0 if quick else 20.0),
        SHIPPED: ("A as shipped", 1.0 if quick else 20.0),
        "10,000 neurons in each ensemble": ("neurons", 10_000),
        "a chain of 100 Gains": ("chain", 20 if quick else 100),
        **({} if quick else {"a chain of 1,000 Gains": ("chain", 1000), "case C": ("C", 20.0)}),
    }
    with trees(None) as found:
        starts, start_goals = start_rows(found, cases, rounds)
        ticks, tick_goals = tick_rows(found, sizes, rounds)
        seeds, until = (4, 0.5) if quick else (SEEDS, 20.0)
        swept, sweep_goals = sweep_rows(found, seeds, until, rounds)
    hand, hand_goals = by_hand_rows(300 if quick else 10_000, rounds)
    head = ["", *found]
    return (
        "\n## What compiling costs and gains\n\nEach figure comes from processes of its own. The "
        "first rows are the wall time of a process that runs two ticks under the compiled engine, "
        "less that of one under the Python engine, without plots and metrics; 'one block out' is "
        f"the graph without its adaptive part, after the whole graph has run.\n\n"
        f"{table(head, [*starts, *ticks, *swept])}\n{table(['', 'per tick'], hand)}"
        f"{goals([*start_goals, *tick_goals, *sweep_goals, *hand_goals])}"
    )


def section_against(rounds: int, against: Path) -> str:
    """Times per tick beside those of an earlier tree.

    Raises
    ------
    subprocess.CalledProcessError : a run failed.
    """
    sizes = {
        BARE: ("A", 20.0),
        "10,000 neurons in each ensemble": ("neurons", 10_000.0),
        "a chain of 10 Gains": ("chain", 10.0),
        "a chain of 100 Gains": ("chain", 100.0),
        "case C": ("C", 20.0),
    }
    with trees(against) as found:
        rows, wanted = tick_rows(found, sizes, rounds)
    return (
        "\n## The compiled engine against its predecessor\n\nThe last tree whose compiled engine "
        "was numba's, in turns with this one, each in processes of its own. Chains are as long as "
        "numba compiles them in minutes.\n\n"
        f"{table(['', *found], rows)}{goals(wanted)}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compiling")
    parser.add_argument("rounds", nargs="?", type=int, default=3)
    parser.add_argument(
        "--against", type=Path, help="only times per tick, beside an earlier tree's"
    )
    parser.add_argument("--quick", action="store_true", help="little of everything")
    options = parser.parse_args()
    print(machine())
    if options.against is not None:
        print(section_against(options.rounds, options.against))
    else:
        print(section(options.rounds, options.quick))
    return 0


if __name__ == "__main__":
    sys.exit(main())
