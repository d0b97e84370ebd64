"""Case C, the whole loop: how many seconds of it a second of computing takes care of."""

from __future__ import annotations

import math
from collections.abc import Callable

import runtime
from benchmarks.agreement import Run, largest_difference
from benchmarks.case_a import DT
from benchmarks.contests import ENGINES
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import take_turns

GRAPHS = ("wall_following", "wall_following_robust")
LEAST = 150.0
EVERY = 100
# Up to here (s) the engines must agree. Past it the robot steers by curves fitted to its scans,
# which make a rounding error a hundred times larger each second: either engine has its own path.
HELD = 7.5


def graph(name: str, until: float, engine: str) -> runtime.Graph:
    """A shipped graph without pictures and metrics."""
    loaded = runtime.load(name).set("run.until", until).set("run.engine", engine)
    for section in ("plots", "metrics", "probes"):
        loaded = loaded.set(section, {})
    loaded = loaded.set("probes.engaged", {"of": "explore.engaged", "every": EVERY})
    return loaded.set("probes.pose", {"of": "plant.pose", "every": EVERY}).check()


def run(checked: runtime.Graph) -> Run:
    """A run; RuntimeError if the robot has found no wall to follow."""
    result = checked.run()
    if not result["engaged"][-1]:
        raise RuntimeError("the robot never found a wall; the measurement is void")
    took = result.manifest["wall_s"] - result.manifest["ready_s"]
    return Run(took, result["pose"])


class WholeLoop:
    """Both graphs under both engines, held against each other where that makes sense.

    Raises
    ------
    DisagreementError : the engines went different ways.
    """

    def __init__(self, until: float) -> None:
        self.until = until
        self.graphs = {
            (name, label): graph(name, until, engine)
            for name in GRAPHS
            for label, engine in ENGINES.items()
        }
        self.apart, self.apart_at_end = 0.0, 0.0
        for name in GRAPHS:
            runs = {label: run(self.graphs[name, label]) for label in ENGINES}
            rows = round(HELD / (EVERY * DT))
            early = {label: Run(ran.seconds, ran.poses[:rows]) for label, ran in runs.items()}
            self.apart = max(self.apart, largest_difference(name, early))
            first, second = (ran.poses[-1, :2] for ran in runs.values())
            self.apart_at_end = max(self.apart_at_end, math.dist(first, second))

    def section(self, rounds: int) -> str:
        def seconds(checked: runtime.Graph) -> Callable[[], float]:
            return lambda: run(checked).seconds

        taken = take_turns(
            {" ".join(key): seconds(checked) for key, checked in self.graphs.items()}, rounds
        )
        times = {key: taken[" ".join(key)] for key in self.graphs}
        rows = [
            [
                f"`{name}`",
                label,
                figure(time, 1e3 / self.until, "ms"),
                f"{self.until / time.median:.1f}",
            ]
            for (name, label), time in times.items()
        ]
        reached = [
            Goal(
                f"`{name}` compiled at least {LEAST:g} times real time",
                self.until / times[name, label].median,
                least=LEAST,
                unit=" times",
            )
            for name, label in times
            if ENGINES[label] == "compiled"
        ]
        return (
            "\n## Case C, the whole loop\n\nExploring, then following the walls, ensembles at "
            f"1 kHz, {self.until:g} s on one core. The engines were held against each other for "
            f"the first {HELD:g} s; at the end they are {1e3 * self.apart_at_end:.1g} mm apart, "
            "since following fitted curves makes rounding errors grow.\n\n"
            + table(["graph", "", "per simulated second", "times real time"], rows)
            + goals(reached)
        )
