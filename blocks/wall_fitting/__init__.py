"""blocks.wall_fitting."""

from blocks.wall_fitting.contour import IntArray
from blocks.wall_fitting.fitter import WallFitter

__all__ = ["IntArray", "WallFitter"]
