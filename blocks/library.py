"""All names of ``blocks``: what a block is, and every block of the library.

Each room's blocks are what its ``__all__`` holds; :data:`blocks.registry.BUILTIN` is made of them.
"""

from blocks import (
    control,
    dynamics,
    generic,
    mujoco,
    neural,
    nonlinear,
    plants,
    sources,
    vehicle,
    wall_fitting,
    world,
)
from blocks.control import *
from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    DeclarationError,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Path,
    PointCloud,
    Pose,
    Same,
    Scalar,
    Scan,
    SignalType,
    Spikes,
    State,
    TrackingState,
    Twist,
    Vector,
    WheelSpeeds,
    kernel_of,
    param,
)
from blocks.dynamics import *
from blocks.generic import *
from blocks.mujoco import *
from blocks.neural import *
from blocks.nonlinear import *
from blocks.plants import *
from blocks.sources import *
from blocks.vehicle import *
from blocks.wall_fitting import *
from blocks.world import *

__all__ = ["Block", "BlockContext", "BlockState", "DeclarationError", "FloatArray"]
__all__ += ["Input", "Output", "ParameterError", "Path", "PointCloud", "Pose", "Same", "Scalar"]
__all__ += ["Scan", "SignalType", "Spikes", "State", "TrackingState", "Twist", "Vector"]
__all__ += ["WheelSpeeds", "kernel_of", "param"]
__all__ += control.__all__
__all__ += dynamics.__all__
__all__ += generic.__all__
__all__ += mujoco.__all__
__all__ += nonlinear.__all__
__all__ += plants.__all__
__all__ += sources.__all__
__all__ += neural.__all__
__all__ += vehicle.__all__
__all__ += wall_fitting.__all__
__all__ += world.__all__
