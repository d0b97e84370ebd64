"""Nonlinear elements: limits, dead zones, relays, quantizers, rate limits, backlash, tables."""

from blocks.nonlinear.hits import HitCrossing
from blocks.nonlinear.lookup import LookupTable, LookupTable2D
from blocks.nonlinear.static import Clip, DeadZone, Quantizer
from blocks.nonlinear.with_memory import Backlash, RateLimiter, Relay

__all__ = [
    "Backlash",
    "Clip",
    "DeadZone",
    "HitCrossing",
    "LookupTable",
    "LookupTable2D",
    "Quantizer",
]
__all__ += ["RateLimiter", "Relay"]
