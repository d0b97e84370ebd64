"""Blocks for any signal: constants, sums, gains, switches, delays, filters; switches of parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.generic.arithmetic import Constant, Gain, Mux, Sum, Switch, added, scaled
    from blocks.generic.constraint import AlgebraicConstraint
    from blocks.generic.enabling import Enable, Trigger
    from blocks.generic.fourier import FourierTransform, InverseFourierTransform
    from blocks.generic.functions import Function
    from blocks.generic.mathematics import Compare, Logic, Norm, Product, Wrap
    from blocks.generic.memory import Lowpass, UnitDelay
    from blocks.generic.rotations import (
        Cross,
        MatrixMultiply,
        Normalize,
        QuaternionMultiply,
        Rotate,
    )
    from blocks.generic.routing import Broadcast, Concatenate, MultiportSwitch, Select
else:
    __getattr__ = door(__name__)

__all__ = [
    "AlgebraicConstraint",
    "Compare",
    "Concatenate",
    "Constant",
    "Enable",
    "FourierTransform",
    "Function",
    "Gain",
    "InverseFourierTransform",
    "Logic",
    "Lowpass",
]
__all__ += ["MultiportSwitch", "Mux", "Norm", "Product", "Select", "Sum", "Switch"]
__all__ += ["Trigger", "UnitDelay", "Wrap", "added", "scaled"]
__all__ += ["Broadcast", "Cross", "MatrixMultiply", "Normalize", "QuaternionMultiply", "Rotate"]
