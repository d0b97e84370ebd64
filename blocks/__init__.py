"""Typed blocks: what a block is, and every block of the library."""

from blocks.actuators import ActuatorFault, Saturator
from blocks.arithmetic import Constant, Gain, Mux, Sum
from blocks.bias import AdaptiveBias
from blocks.block import (
    Block,
    BlockState,
    DeclarationError,
    Input,
    Output,
    Setting,
    State,
)
from blocks.checking import CheckError, check_block
from blocks.drivetrain import ActuatorDelay, ActuatorLag, WheelSlip
from blocks.explorer import Explorer
from blocks.kernels import kernel_of
from blocks.lidar import Lidar
from blocks.lqr import LQR
from blocks.matching import MatchingPoint
from blocks.memory import Lowpass, UnitDelay
from blocks.mujoco_vacuum import MujocoVacuum
from blocks.neurons import AdaptiveEnsemble, RateEnsemble
from blocks.params import ParameterError, param
from blocks.paths import CirclePath, LinePath, SinePath, WaypointPath
from blocks.plants import DifferentialDrive
from blocks.sensors import PoseNoise
from blocks.signals import (
    FloatArray,
    Path,
    PointCloud,
    Pose,
    Same,
    Scalar,
    Scan,
    SignalType,
    Spikes,
    TrackingState,
    Twist,
    Vector,
    WheelSpeeds,
)
from blocks.switch import Switch
from blocks.trackers import PID, PurePursuit, Stanley
from blocks.tracking import TrackingError
from blocks.wall_fitter import WallFitter
from blocks.world import World

__all__ = [
    "LQR",
    "PID",
    "ActuatorDelay",
    "ActuatorFault",
    "ActuatorLag",
    "AdaptiveBias",
    "AdaptiveEnsemble",
    "Block",
    "BlockState",
    "CheckError",
    "CirclePath",
    "Constant",
    "DeclarationError",
    "DifferentialDrive",
    "Explorer",
    "FloatArray",
    "Gain",
    "Input",
    "Lidar",
    "LinePath",
    "Lowpass",
    "MatchingPoint",
    "MujocoVacuum",
    "Mux",
    "Output",
    "ParameterError",
    "Path",
    "PointCloud",
    "Pose",
    "PoseNoise",
    "PurePursuit",
    "RateEnsemble",
    "Same",
    "Saturator",
    "Scalar",
    "Scan",
    "Setting",
    "SignalType",
    "SinePath",
    "Spikes",
    "Stanley",
    "State",
    "Sum",
    "Switch",
    "TrackingError",
    "TrackingState",
    "Twist",
    "UnitDelay",
    "Vector",
    "WallFitter",
    "WaypointPath",
    "WheelSlip",
    "WheelSpeeds",
    "World",
    "check_block",
    "kernel_of",
    "param",
]
