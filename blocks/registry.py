"""The registry: which block types exist, and where users' own come from."""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import linecache
import sys
import threading
from collections.abc import Mapping
from functools import cache
from pathlib import Path as FilePath
from types import ModuleType

from blocks.control import (
    LQR,
    PID,
    CirclePath,
    LinePath,
    MatchingPoint,
    PurePursuit,
    SinePath,
    Stanley,
    TrackingError,
    WaypointPath,
)
from blocks.core import Block, SignalType
from blocks.generic import Constant, Gain, Lowpass, Mux, Sum, Switch, UnitDelay
from blocks.learning import AdaptiveBias, AdaptiveEnsemble, RateEnsemble
from blocks.mujoco import MujocoVacuum
from blocks.vehicle import (
    ActuatorDelay,
    ActuatorFault,
    ActuatorLag,
    DifferentialDrive,
    Explorer,
    PoseNoise,
    Saturator,
    WheelSlip,
)
from blocks.wall_fitting import WallFitter
from blocks.world import Lidar

ENTRY_POINTS = "spikeblocks.blocks"
# A module is registered before its text has run: another thread must not look into it till then.
_LOADING = threading.RLock()
_CONTENT = "__spikeblocks_content__"

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

    What runs is what the file held when it was read here, also where its text is looked at later
    (by the compiled engine, by a traceback, by a run's folder).

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
    data, where = file.read_bytes(), str(file.resolve())
    digest = hashlib.sha256(where.encode("utf-8", "backslashreplace") + b"\0" + data)
    name = f"_blocks_of_{file.stem}_{digest.hexdigest()[:16]}"
    module = sys.modules.get(name)
    if module is None:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise ImportError(f"{file} is no Python file")
        module = importlib.util.module_from_spec(spec)
        setattr(module, _CONTENT, {where: data})
        sys.modules[name] = module
        try:
            code = compile(data, str(file), "exec", dont_inherit=True)
            lines = importlib.util.decode_source(data).splitlines(keepends=True)
            # Without a time of change, which lets linecache keep it whatever the file becomes.
            linecache.cache[str(file)] = (len(data), None, lines, str(file))
            exec(code, vars(module))
        except BaseException:
            del sys.modules[name]
            raise
    return module


def module_text(cls: type[Block]) -> dict[str, bytes]:
    """The content of the file that :func:`blocks_of_module` ran for a type, by resolved path."""
    found: dict[str, bytes] = getattr(sys.modules.get(cls.__module__), _CONTENT, {})
    return found
