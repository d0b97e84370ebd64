"""Wall fitting: from a LiDAR scan to a reference path beside the wall (paper, section III-A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.wall_fitting.fitter import WallFitter
else:
    __getattr__ = door(__name__)

__all__ = ["WallFitter"]
