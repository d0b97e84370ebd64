"""Case C with rigid-body physics: the whole graph against real time, and where its time goes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import runtime
from benchmarks.agreement import Run, largest_difference
from benchmarks.case_c import started
from benchmarks.contests import ENGINES
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, take_turns
from benchmarks.whole_loop import graph, run
from blocks import MujocoVacuum, Scan, Setting

GRAPHS = ("wall_following_mujoco", "wall_following_mujoco_robust")
LEAST = 50.0
# The loop through LiDAR and wall fitter makes ten of a last bit in less than a second: engines
# that round differently go the same way for so long (s), to so much (m), then each its own.
TOGETHER = 8.0
TOLERANCE = 1e-6
DT = 0.01
TICKS = 1000
COMMAND = (0.2, 0.1)


class Parts:
    """The block alone, in the paper's room: its steps, its copies of MuJoCo's state, its scans."""

    def __init__(self) -> None:
        self.robot = MujocoVacuum(scan_period=TICKS * DT)
        types = {"scan": Scan(self.robot.beams)}
        world = runtime.load("wall_following").network.world
        self.state = started(self.robot, Setting(DT, types, world=world))

    def step_seconds(self) -> float:
        """Seconds of ticks without a scan, driving in a circle."""
        began = time.perf_counter()
        for k in range(TICKS - 1):
            self.robot.update(self.state, k * DT, COMMAND)
        return time.perf_counter() - began

    def copy_seconds(self) -> float:
        """Seconds of taking the state into MuJoCo and back, as often."""
        state = self.state
        mujoco, scratch = state.mujoco, (state.model, state.data, state.physics, state.parts)
        began = time.perf_counter()
        for _ in range(TICKS - 1):
            mujoco.mj_setState(*scratch)
            mujoco.mj_getState(*scratch)
        return time.perf_counter() - began

    def scan_seconds(self) -> float:
        """Seconds of as many scans."""
        began = time.perf_counter()
        for _ in range(TICKS - 1):
            self.state.lidar.cast()
        return time.perf_counter() - began


class Physics:
    """Both graphs under both engines.

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
        self.apart = max(self._apart(name) for name in GRAPHS)

    def _apart(self, name: str) -> float:
        """How far the engines part while they go together (m)."""
        runs = {label: run(self.graphs[name, label]) for label in ENGINES}
        rows = round(TOGETHER * len(next(iter(runs.values())).poses) / self.until)
        begins = {label: Run(made.seconds, made.poses[:rows]) for label, made in runs.items()}
        return largest_difference(name, begins, TOLERANCE)

    def section(self, rounds: int) -> str:
        """The section of docs/performance.md, measured now."""

        def seconds(checked: runtime.Graph) -> Callable[[], float]:
            return lambda: run(checked).seconds

        taken = take_turns({" ".join(k): seconds(g) for k, g in self.graphs.items()}, rounds)
        times = {key: taken[" ".join(key)] for key in self.graphs}
        whole = table(
            ["graph", "", "per simulated second", "times real time"],
            [
                [
                    f"`{name}`",
                    label,
                    figure(timing, 1e3 / self.until, "ms"),
                    f"{self.until / timing.median:.1f}",
                ]
                for (name, label), timing in times.items()
            ],
        )
        best = {
            name: max(self.until / times[name, label].median for label in ENGINES)
            for name in GRAPHS
        }
        reached = [
            Goal(f"`{n}`: at least {LEAST:g} times real time", best[n], least=LEAST, unit=" times")
            for n in GRAPHS
        ]
        return (
            "\n## Case C with rigid-body physics\n\nThe whole graph in MuJoCo, neurons at 1 kHz, "
            f"five physics steps a tick of the plant, {self.until:g} s on one core. The engines "
            f"part by {self.apart:.1g} m within {TOGETHER:g} s; later, rounding takes each its own "
            "way.\n\n" + whole + goals(reached) + "\nThe block alone:\n\n" + self._parts(rounds)
        )

    def _parts(self, rounds: int) -> str:
        parts = Parts()
        timings = take_turns(
            {
                "a tick: state in, five steps, state out, odometry": parts.step_seconds,
                "of which copying the state in and out": parts.copy_seconds,
                "a scan of 360 beams": parts.scan_seconds,
            },
            rounds,
        )
        if not np.isfinite(parts.state.physics).all():
            raise RuntimeError("the simulation broke down; the measurement is void")
        rows = [
            [name, figure(Timing(timing.seconds, TICKS - 1), 1e6, "us")]
            for name, timing in timings.items()
        ]
        return table(["", "time"], rows)
