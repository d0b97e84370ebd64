"""Paths, the tracking error about them, and the controllers that reduce it."""

from blocks.control.lqr import LQR
from blocks.control.paths import CirclePath, LinePath, SinePath, WaypointPath, curvature
from blocks.control.trackers import PID, PurePursuit, Stanley
from blocks.control.tracking import MatchingPoint, TrackingError

__all__ = [
    "LQR",
    "PID",
    "CirclePath",
    "LinePath",
    "MatchingPoint",
    "PurePursuit",
    "SinePath",
    "Stanley",
    "TrackingError",
    "WaypointPath",
    "curvature",
]
