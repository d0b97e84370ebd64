"""The robot with physics by parts: its steps, its copies of MuJoCo's state, its scans."""

from __future__ import annotations

import time

import numpy as np

import runtime
from benchmarks.case_c import started
from benchmarks.tables import figure, table
from benchmarks.timing import Timing, take_turns
from blocks import BlockContext, Scan
from spikeblocks.mujoco import MujocoVacuum

DT = 0.01
TICKS = 1000
COMMAND = (0.1, 0.5)


class Parts:
    """The block alone, in the paper's room."""

    def __init__(self) -> None:
        self.robot = MujocoVacuum(scan_period=TICKS * DT)
        types = {"scan": Scan(self.robot.beams)}
        world = runtime.load("wall_following").network.world
        self.state = started(self.robot, BlockContext(DT, types, world=world))

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


def section(rounds: int) -> str:
    """The section of docs/performance.md, measured now."""
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
        [name, figure(Timing(timing.seconds, TICKS - 1), 1e6, "µs")]
        for name, timing in timings.items()
    ]
    return "\n## The robot with physics by parts\n\n" + table(["", "time"], rows)
