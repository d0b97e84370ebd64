"""blocks.generic."""

from blocks.generic.arithmetic import Constant, Gain, Mux, Sum, added, scaled
from blocks.generic.memory import Lowpass, UnitDelay
from blocks.generic.switch import Switch

__all__ = ["Constant", "Gain", "Lowpass", "Mux", "Sum", "Switch", "UnitDelay", "added", "scaled"]
