"""Vehicles and what disturbs them: motion, contact, actuators with limits and faults, noise.

``differential_drive.py`` moves a robot tick by tick through the world, which can stop it;
``kinematics.py`` has the same kinematics, and a car's, as equations for the run's solver.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.vehicle.body import Contact
    from blocks.vehicle.differential_drive import INTEGRATORS, DifferentialDrive
    from blocks.vehicle.disturbances import (
        ActuatorDelay,
        ActuatorFault,
        ActuatorLag,
        PoseNoise,
        Saturator,
        WheelSlip,
    )
    from blocks.vehicle.explorer import Explorer
    from blocks.vehicle.kinematics import Bicycle, Unicycle
else:
    __getattr__ = door(__name__)

__all__ = [
    "INTEGRATORS",
    "ActuatorDelay",
    "ActuatorFault",
    "ActuatorLag",
    "Bicycle",
    "Contact",
    "DifferentialDrive",
    "Explorer",
    "PoseNoise",
    "Saturator",
    "Unicycle",
    "WheelSlip",
]
