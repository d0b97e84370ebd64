"""A wall fitter with its state, fed scan by scan without an engine."""

from __future__ import annotations

import numpy as np

from blocks import BlockContext, BlockState, Scan
from blocks.wall_fitting.fitter import WallFitter

Pose = tuple[float, float, float]
Fit = tuple[np.ndarray, np.ndarray, float]


class Fitter:
    """Keeps what the block's update writes."""

    def __init__(self, beams: int = 360, **parameters: object) -> None:
        self.block = WallFitter(**parameters)
        context = BlockContext(0.1, {"scan": Scan(beams)})
        shapes = {"last_path": (self.block.samples, 4), "last_wall": (self.block.wall_points, 2)}
        arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
        arrays["fitted"] = np.zeros(1)
        self.state = BlockState(context, np.random.SeedSequence(0), arrays)
        self.block.start(self.state)

    def __call__(self, scan: np.ndarray, pose: Pose = (0.0, 0.0, 0.0)) -> Fit:
        path, wall, valid = self.block.output(self.state, 0.0, scan, pose)
        self.block.update(self.state, 0.0, path, wall, valid)
        return path, wall, valid
