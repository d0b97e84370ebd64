"""Sensors with their usual errors, and what happens to measurements on their way.

Each gives a ``stamp`` beside its values, the time at which they were measured: a filter uses a
value when its stamp is new, and where it belongs if it comes late.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.sensors.inertial import IMU
    from blocks.sensors.odometry import WheelOdometry
    from blocks.sensors.positioning import GPS, Compass
    from blocks.sensors.transport import Dropout, Latency
else:
    __getattr__ = door(__name__)

__all__ = ["GPS", "IMU", "Compass", "Dropout", "Latency", "WheelOdometry"]
