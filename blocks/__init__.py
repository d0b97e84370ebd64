"""Typed blocks: what a block is, and every block of the library.

    from blocks import Block, Gain, Input, Output, Scalar, param

A name is imported when it is first used, from the module that ``index.py`` gives, so that a graph
of nine types of blocks does not wait for a hundred.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from blocks.index import OTHERS, TYPES
from blocks.lazy import door

if TYPE_CHECKING:
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
    from blocks.fmu import *
    from blocks.generic import *
    from blocks.mujoco import *
    from blocks.neural import *
    from blocks.nonlinear import *
    from blocks.plants import *
    from blocks.sensors import *
    from blocks.sources import *
    from blocks.vehicle import *
    from blocks.wall_fitting import *
    from blocks.world import *

__all__ = [*OTHERS, *TYPES]
_ROOMS = {module.partition(".")[0] for module in {**OTHERS, **TYPES}.values()}
_name = door(__name__)

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        return importlib.import_module(f"blocks.{name}") if name in _ROOMS else _name(name)


def __dir__() -> list[str]:
    return sorted(__all__)
