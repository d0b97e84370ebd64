"""Paths, the tracking error about them, and controllers; regulators and observers by design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.control.compensators import LQI, DisturbanceObserver, L1Adaptive
    from blocks.control.geometric import GeometricControl
    from blocks.control.linear_control import LinearDisturbanceObserver, LinearL1, LinearMPC
    from blocks.control.lqr import LQR
    from blocks.control.mpc import MPC
    from blocks.control.observer import DiscreteSteadyStateKalman, SteadyStateKalman
    from blocks.control.paths import CirclePath, LinePath, SinePath, WaypointPath, curvature
    from blocks.control.regulator import LinearQuadraticRegulator
    from blocks.control.trackers import PathPID, PurePursuit, Stanley
    from blocks.control.tracking import CourseError, MatchingPoint, TrackingError
else:
    __getattr__ = door(__name__)

__all__ = [
    "LQI",
    "LQR",
    "MPC",
    "CirclePath",
    "CourseError",
    "DiscreteSteadyStateKalman",
    "DisturbanceObserver",
    "GeometricControl",
    "L1Adaptive",
    "LinePath",
    "LinearDisturbanceObserver",
    "LinearL1",
    "LinearMPC",
    "LinearQuadraticRegulator",
    "MatchingPoint",
    "PathPID",
    "PurePursuit",
    "SinePath",
    "Stanley",
    "SteadyStateKalman",
    "TrackingError",
    "WaypointPath",
    "curvature",
]
