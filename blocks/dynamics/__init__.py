"""Dynamic systems: continuous, integrated by the run's solver, and in discrete time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.dynamics.attitude import QuaternionIntegrator
    from blocks.dynamics.delays import Delay, FirstOrderHold, Hold, MovingAverage
    from blocks.dynamics.discrete import DiscreteIntegrator, DiscreteTransferFunction
    from blocks.dynamics.extended_kalman import ExtendedKalmanFilter
    from blocks.dynamics.integrator import Integrator
    from blocks.dynamics.kalman import KalmanFilter
    from blocks.dynamics.linear import DiscreteStateSpace, StateSpace
    from blocks.dynamics.pid import PID, DiscretePID
    from blocks.dynamics.system import DiscreteSystem, DynamicSystem
    from blocks.dynamics.transfer import (
        Butterworth,
        Derivative,
        SecondOrder,
        TransferFunction,
        ZeroPoleGain,
    )
else:
    __getattr__ = door(__name__)

__all__ = ["PID", "Butterworth", "DiscreteSystem"]
__all__ += ["Delay", "Derivative", "DiscreteIntegrator", "DiscretePID", "DiscreteStateSpace"]
__all__ += ["DiscreteTransferFunction", "DynamicSystem", "ExtendedKalmanFilter", "Hold"]
__all__ += ["FirstOrderHold"]
__all__ += [
    "Integrator",
    "KalmanFilter",
    "MovingAverage",
    "QuaternionIntegrator",
    "SecondOrder",
    "StateSpace",
]
__all__ += ["TransferFunction", "ZeroPoleGain"]
