"""blocks.wall_fitting."""

from blocks.wall_fitting.fitter import WallFitter

__all__ = ["WallFitter"]
