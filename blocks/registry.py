"""The registry: which block types exist, and where users' own come from."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import sys
import threading
from collections.abc import Mapping
from functools import cache
from pathlib import Path as FilePath
from types import ModuleType

from blocks.actuators import ActuatorFault, Saturator
from blocks.arithmetic import Constant, Gain, Mux, Sum
from blocks.bias import AdaptiveBias
from blocks.block import Block
from blocks.drivetrain import ActuatorDelay, ActuatorLag, WheelSlip
from blocks.explorer import Explorer
from blocks.lidar import Lidar
from blocks.lqr import LQR
from blocks.matching import MatchingPoint
from blocks.memory import Lowpass, UnitDelay
from blocks.mujoco_vacuum import MujocoVacuum
from blocks.neurons import AdaptiveEnsemble, RateEnsemble
from blocks.paths import CirclePath, LinePath, SinePath, WaypointPath
from blocks.plants import DifferentialDrive
from blocks.sensors import PoseNoise
from blocks.signals import SignalType
from blocks.switch import Switch
from blocks.trackers import PID, PurePursuit, Stanley
from blocks.tracking import TrackingError
from blocks.wall_fitter import WallFitter

ENTRY_POINTS = "spikeblocks.blocks"
# A module is registered before its text has run: another thread must not look into it till then.
_LOADING = threading.RLock()

BUILTIN: Mapping[str, type[Block]] = {
    block.__name__: block
    for block in (
        *(LinePath, SinePath, CirclePath, WaypointPath),
        *(MatchingPoint, TrackingError, LQR, PID, PurePursuit, Stanley),
        *(AdaptiveEnsemble, RateEnsemble, AdaptiveBias),
        *(Lidar, WallFitter, Explorer),
        *(Constant, Sum, Mux, Gain, Switch, UnitDelay, Lowpass),
        *(Saturator, ActuatorFault, ActuatorLag, ActuatorDelay, WheelSlip),
        *(PoseNoise, DifferentialDrive, MujocoVacuum),
    )
}


@cache
def installed() -> dict[str, type[Block]]:
    """Block types that installed packages offer under the entry point ``spikeblocks.blocks``."""
    points = importlib.metadata.entry_points(group=ENTRY_POINTS)
    return {point.name: point.load() for point in points}


def blocks_of_module(file: FilePath) -> dict[str, type[Block]]:
    """Block types that a Python file defines; the file is run once per process and version.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    module = _module(file)
    return {
        key: value
        for key, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, Block)
        and value.__module__ == module.__name__
    }


def types_of_module(file: FilePath) -> list[SignalType]:
    """Signal types among the names of a Python file, the library's that it imports included.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    return [value for value in vars(_module(file)).values() if isinstance(value, SignalType)]


def _module(file: FilePath) -> ModuleType:
    with _LOADING:
        return _loaded(file)


def _loaded(file: FilePath) -> ModuleType:
    stamp = file.stat()
    name = f"_blocks_of_{file.stem}_{abs(hash((str(file.resolve()), stamp.st_mtime_ns)))}"
    module = sys.modules.get(name)
    if module is None:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise ImportError(f"{file} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return module
