"""Blocks for any signal: constants, sums, gains, switches, delays and filters."""

from blocks.generic.arithmetic import Constant, Gain, Mux, Sum, Switch, added, scaled
from blocks.generic.functions import Function
from blocks.generic.memory import Lowpass, UnitDelay
from blocks.generic.routing import Concatenate

__all__ = ["Concatenate", "Constant", "Function", "Gain", "Lowpass", "Mux", "Sum", "Switch"]
__all__ += ["UnitDelay", "added", "scaled"]
