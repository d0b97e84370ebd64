"""Blocks for any signal: constants, sums, gains, switches, delays and filters."""

from blocks.generic.arithmetic import Constant, Gain, Mux, Pair, Sum, Switch, added, scaled
from blocks.generic.memory import Lowpass, UnitDelay

__all__ = [
    "Constant",
    "Gain",
    "Lowpass",
    "Mux",
    "Pair",
    "Sum",
    "Switch",
    "UnitDelay",
    "added",
    "scaled",
]
