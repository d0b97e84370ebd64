"""Robots and what disturbs them: plants, contact, actuators with limits and faults, noise."""

from blocks.vehicle.disturbances import (
    ActuatorDelay,
    ActuatorFault,
    ActuatorLag,
    PoseNoise,
    Saturator,
    WheelSlip,
)
from blocks.vehicle.explorer import Explorer
from blocks.vehicle.plants import INTEGRATORS, DifferentialDrive

__all__ = [
    "INTEGRATORS",
    "ActuatorDelay",
    "ActuatorFault",
    "ActuatorLag",
    "DifferentialDrive",
    "Explorer",
    "PoseNoise",
    "Saturator",
    "WheelSlip",
]
