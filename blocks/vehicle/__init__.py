"""blocks.vehicle."""

from blocks.vehicle.actuators import ActuatorFault, Saturator
from blocks.vehicle.drivetrain import ActuatorDelay, ActuatorLag, WheelSlip
from blocks.vehicle.explorer import Explorer
from blocks.vehicle.plants import INTEGRATORS, DifferentialDrive
from blocks.vehicle.sensors import PoseNoise

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
