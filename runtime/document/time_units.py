"""Units of time: a graph whose times are in ns or in hours says so, as ``run: {time_unit: ns}``.

Blocks declare their units in seconds. ``in_time`` turns them into those of the graph: with ns,
``m/s`` is m/ns and ``Hz`` is GHz. No number is converted: those of a graph are in its own units.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

SECOND = "s"
# A unit of time and the unit of frequency that is one over it.
TIME_UNITS: Mapping[str, str] = {
    SECOND: "Hz",
    "ns": "GHz",
    "us": "MHz",
    "ms": "kHz",
    "min": "1/min",
    "h": "1/h",
    "d": "1/d",
}
# An s that stands for a unit by itself: in m/s and 1/s^2, not in spikes or rad_s.
_SECONDS = re.compile(r"(?<![^\W\d])s(?![^\W])")
_HERTZ = re.compile(r"(?<!\w)Hz(?!\w)")


def in_time(unit: str, time_unit: str) -> str:
    """A unit that is declared in seconds or Hz, in another unit of time.

    Parameters
    ----------
    unit : as in ``m/s``, ``1/s^2`` or ``Hz``; others, such as ``m``, stay as they are.
    time_unit : one of :data:`TIME_UNITS`.
    """
    if time_unit == SECOND:
        return unit
    return _HERTZ.sub(TIME_UNITS[time_unit], _SECONDS.sub(time_unit, unit))


def rate_text(period: float, time_unit: str) -> str:
    """How often something happens: ``100 Hz``, ``2.5 GHz``; ``every 0.5 h`` where that is clearer.

    Parameters
    ----------
    period : in the unit of time, above 0.
    """
    if time_unit in ("min", "h"):
        return f"every {period:.4g} {time_unit}"
    rate, unit = 1.0 / period, TIME_UNITS[time_unit]
    # With four digits, 999.95 and more print as 1000: the next unit.
    larger = dict(zip(("Hz", "kHz", "MHz", "GHz"), ("kHz", "MHz", "GHz", "THz"), strict=True))
    return f"{rate / 1000.0:.4g} {larger[unit]}" if rate >= 999.95 else f"{rate:.4g} {unit}"
