"""Nonlinear elements: limits, dead zones, relays, quantizers, rate limits, backlash, tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.nonlinear.hits import HitCrossing
    from blocks.nonlinear.lookup import LookupTable, LookupTable2D
    from blocks.nonlinear.static import Clip, DeadZone, Quantizer
    from blocks.nonlinear.with_memory import Backlash, RateLimiter, Relay
else:
    __getattr__ = door(__name__)

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
