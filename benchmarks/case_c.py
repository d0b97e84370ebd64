"""Case C by parts: a scan, a fitted path, and the whole graph with its neurons at 1 kHz."""

from __future__ import annotations

import time

import numpy as np

import runtime
from blocks import Block, BlockContext, BlockState, Lidar, Pose, Scan, WallFitter, World
from blocks.core import FloatArray, PoseValue

DT = 0.001
DISTANCE = 0.18
PLACES = 100


def room() -> tuple[World, list[PoseValue]]:
    """The paper's room, and poses on its contour as while following it."""
    graph = runtime.load("wall_following")
    world = graph.network.world
    if world is None:
        raise RuntimeError("wall_following has no world to measure in")
    contour = world.offset_contour(DISTANCE)[0][:-1]
    x, y = contour.T
    heading = np.arctan2(np.roll(y, -1) - y, np.roll(x, -1) - x)
    chosen = np.linspace(0, len(contour), PLACES, endpoint=False).astype(int)
    rows = np.column_stack((contour, heading))[chosen].tolist()
    return world, [(row[0], row[1], row[2]) for row in rows]


def started(block: Block, context: BlockContext) -> BlockState:
    """The state of a block outside of any graph."""
    sizes = dict(block.sizes())
    shapes = {
        name: [n if isinstance(n, int) else sizes[n] for n in state.shape]
        for name, state in block.spec.states.items()
    }
    arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
    state = BlockState(context, np.random.SeedSequence(0), arrays)
    block.start(state)
    return state


class Parts:
    """LiDAR and wall fitter with their states, at poses around the room."""

    def __init__(self) -> None:
        world, self.poses = room()
        self.lidar, self.fitter = Lidar(), WallFitter()
        types = {"pose": Pose, "scan": Scan(self.lidar.beams)}
        context = BlockContext(0.1, types, world=world)
        self.lidar_state = started(self.lidar, context)
        self.fitter_state = started(self.fitter, context)
        self.scans = [self._scan(pose) for pose in self.poses]

    def _scan(self, pose: PoseValue) -> FloatArray:
        scan = self.lidar.output(self.lidar_state, 0.0, pose)
        self.lidar.update(self.lidar_state, 0.0)
        return scan

    def scan_seconds(self) -> float:
        """Seconds of one scan at each pose, with the noise of the next."""
        began = time.perf_counter()
        for pose in self.poses:
            self._scan(pose)
        return time.perf_counter() - began

    def fit_seconds(self) -> float:
        """Seconds of chains, splines, offset, trim, fillet and the path's spline, per pose."""
        began = time.perf_counter()
        fits = [
            self.fitter.output(self.fitter_state, 0.0, scan, pose)
            for scan, pose in zip(self.scans, self.poses, strict=True)
        ]
        took = time.perf_counter() - began
        if not all(valid for _, _, valid in fits):
            raise RuntimeError("a scan of the paper's room gave no path; the measurement is void")
        return took


def run_seconds(until: float) -> float:
    """Seconds of a run of the shipped graph without pictures, building left out."""
    graph = runtime.load("wall_following").set("run.until", until)
    for section in ("plots", "metrics", "probes"):
        graph = graph.set(section, {})
    graph = graph.set("probes.engaged", {"of": "explore.engaged", "every": 100})
    graph.check()
    result = graph.run()
    if not result["engaged"][-1]:
        raise RuntimeError("the robot never found a wall; the measurement is void")
    return float(result.manifest["wall_s"])
