"""Wall fitting: from a LiDAR scan to a reference path beside the wall (paper, section III-A)."""

from blocks.wall_fitting.fitter import WallFitter

__all__ = ["WallFitter"]
