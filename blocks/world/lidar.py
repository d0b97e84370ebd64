"""A LiDAR: ranges to the walls around the robot, with noise and drop-outs."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Pose,
    PoseValue,
    Scan,
    State,
    kernel_of,
    param,
)
from blocks.world.surfaces import cast_kernel
from blocks.world.world import required_world

FULL_TURN = 2.0 * math.pi


def bearings(beams: int, angle_min: float, angle_max: float) -> FloatArray:
    """Directions of a scan's beams (rad, 0 is ahead, left is positive), (beams,).

    Beam i points to ``angle_min + i (angle_max - angle_min) / beams``: evenly spaced, and
    ``angle_max`` itself is excluded, so that a full turn has no duplicate beam.
    """
    return np.linspace(angle_min, angle_max, beams, endpoint=False)


def window_problems(angle_min: float, angle_max: float) -> list[tuple[str, str]]:
    """What is wrong with an angular window, as problems of a :class:`ParameterError`."""
    if angle_max <= angle_min:
        return [("angle_max", f"must lie above angle_min = {angle_min:g} rad, got {angle_max:g}")]
    if angle_max - angle_min > FULL_TURN + 1e-9:
        message = f"from angle_min = {angle_min:g} to {angle_max:g} rad is more than a full turn"
        return [("angle_max", message)]
    return []


class Lidar(Block):
    """Cast beams from the robot's centre into the world, all at the tick's time.

        pose ─▶ [ Lidar ] ─▶ scan
                   ▲
                 world

    scan_i = range along theta + b_i, plus N(0, sigma^2), with the bearings b_i of
    :func:`bearings`. It is inf for a miss: nothing there, nearer than ``range_min`` or farther
    than ``range_max`` as measured, or dropped out (each beam of each scan by itself). The block's
    own dt is the time between scans.
    """

    pose = Input(Pose, doc="the true pose")
    scan = Output(Scan("beams"), doc="ranges; inf for a miss")

    beams: int = param(360, at_least=1, doc="number of beams")
    sigma: float = param(
        0.01, unit="m", at_least=0.0, tunable=True, doc="standard deviation of a range"
    )
    range_min: float = param(0.05, unit="m", at_least=0.0, doc="nearer returns are misses")
    range_max: float = param(
        12.0, unit="m", above=0.0, finite=False, doc="farther returns are misses"
    )
    dropout: float = param(
        0.0, at_least=0.0, at_most=1.0, tunable=True, doc="probability that a beam is lost"
    )
    angle_min: float = param(-math.pi, unit="rad", doc="bearing of the first beam")
    angle_max: float = param(math.pi, unit="rad", doc="bearing past the last beam")

    noise = State("beams", unit="m", doc="what the coming scan adds to the ranges")
    lost = State("beams", doc="1 where the coming scan loses the beam")

    def validate(self) -> None:
        problems = window_problems(self.angle_min, self.angle_max)
        if self.range_max <= self.range_min:
            message = f"must lie above range_min = {self.range_min:g} m, got {self.range_max:g}"
            problems.append(("range_max", message))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        required_world(context)

    def start(self, state: BlockState) -> None:
        state.world = required_world(state.context)
        state.surfaces = state.world.arrays
        state.bearings = bearings(self.beams, self.angle_min, self.angle_max)
        self._draw(state)

    def _draw(self, state: BlockState) -> None:
        # Both are always drawn, so that changing one parameter leaves the other numbers unchanged.
        state.rng.standard_normal(out=state.noise)
        state.noise *= self.sigma
        state.lost[:] = state.rng.random(self.beams) < self.dropout

    @kernel_of(_draw)
    def _draw_kernel(self, state: BlockState) -> None:
        for i in range(len(state.noise)):
            state.noise[i] = self.sigma * state.rng.standard_normal()
        for i in range(len(state.lost)):
            state.lost[i] = 1.0 if state.rng.random() < self.dropout else 0.0

    def output(self, state: BlockState, t: float, pose: PoseValue) -> FloatArray:
        x, y, theta = pose
        ranges: FloatArray = state.world.cast(x, y, state.bearings + theta)
        ranges += state.noise
        miss = (ranges < self.range_min) | (ranges > self.range_max) | (state.lost > 0.0)
        ranges[miss] = np.inf
        return ranges

    @kernel_of(output)
    def _output_kernel(self, state: BlockState, t: float, pose: PoseValue) -> FloatArray:
        ranges = cast_kernel(state.surfaces, pose[0], pose[1], pose[2], state.bearings)
        for i in range(len(ranges)):
            distance = ranges[i] + state.noise[i]
            miss = distance < self.range_min or distance > self.range_max or state.lost[i] > 0.0
            ranges[i] = math.inf if miss else distance
        return ranges

    def update(self, state: BlockState, t: float) -> None:
        self._draw(state)
