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
    """Graphs under both engines, held against each other where that makes sense.

    Parameters
    ----------
    until : seconds to run.
    title, what : of the section, and what it measures.
    names : of shipped graphs.
    least : times real time that the compiled engine should reach.

    Raises
    ------
    DisagreementError : the engines went different ways.
    """

    def __init__(
        self, until: float, title: str, what: str, names: tuple[str, ...], least: float
    ) -> None:
        self.until, self.title, self.what, self.least = until, title, what, least
        self.graphs = {
            (name, label): graph(name, until, engine)
            for name in names
            for label, engine in ENGINES.items()
        }
        self.apart, self.apart_at_end = 0.0, 0.0
        for name in names:
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
                f"`{name}` compiled at least {self.least:g} times real time",
                self.until / times[name, label].median,
                least=self.least,
                unit=" times",
            )
            for name, label in times
            if ENGINES[label] == "compiled"
        ]
        return (
            f"\n## {self.title}\n\n{self.what}, ensembles at 1 kHz, {self.until:g} s on one core. "
            f"The engines were held against each other for the first {HELD:g} s; at the end they "
            f"are {1e3 * self.apart_at_end:.1g} mm apart, "
            "since following fitted curves makes rounding errors grow.\n\n"
            + table(["graph", "", "per simulated second", "times real time"], rows)
            + goals(reached)
        )


def planar(until: float) -> WholeLoop:
    """Case C in the plane."""
    what = "Exploring, then following the walls"
    names = ("wall_following", "wall_following_robust")
    return WholeLoop(until, "Case C, the whole loop", what, names, 150.0)


def physics(until: float) -> WholeLoop:
    """Case C in MuJoCo."""
    what = "The same with rigid-body physics, five steps of 2 ms a tick of the plant"
    names = ("wall_following_mujoco", "wall_following_mujoco_robust")
    return WholeLoop(until, "Case C with physics, the whole loop", what, names, 50.0)
