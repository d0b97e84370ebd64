"""Typed blocks: what a block is, and every block of the library.

    from blocks import Block, Gain, Input, Output, Scalar, param

A name is imported when it is first used, from the module that ``index.py`` gives, so that a graph
of nine types of blocks does not wait for a hundred.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from blocks.library.index import OTHERS, TYPES
from blocks.library.lazy import door

if TYPE_CHECKING:
    # "as" exports a name to those who check their types strictly.
    from blocks.control import *
    from blocks.core import Block as Block
    from blocks.core import BlockContext as BlockContext
    from blocks.core import BlockState as BlockState
    from blocks.core import DeclarationError as DeclarationError
    from blocks.core import FloatArray as FloatArray
    from blocks.core import Input as Input
    from blocks.core import Output as Output
    from blocks.core import ParameterError as ParameterError
    from blocks.core import Path as Path
    from blocks.core import PointCloud as PointCloud
    from blocks.core import Pose as Pose
    from blocks.core import Same as Same
    from blocks.core import Scalar as Scalar
    from blocks.core import Scan as Scan
    from blocks.core import SignalType as SignalType
    from blocks.core import Spikes as Spikes
    from blocks.core import State as State
    from blocks.core import TrackingState as TrackingState
    from blocks.core import Twist as Twist
    from blocks.core import Vector as Vector
    from blocks.core import WheelSpeeds as WheelSpeeds
    from blocks.core import kernel_of as kernel_of
    from blocks.core import param as param
    from blocks.dynamics import *
    from blocks.generic import *
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
        if name in _ROOMS:
            return importlib.import_module(f"blocks.{name}")
        if name not in __all__ and not name.startswith("_"):
            from blocks.library.registry import BUILTIN

            if name in BUILTIN:  # of a bridge
                return BUILTIN[name]
        return _name(name)


def __dir__() -> list[str]:
    return sorted(__all__)
