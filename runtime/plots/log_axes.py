"""Labels of logarithmic axes: at least two of them, at the values that were swept if they are few.

In: an axis, and maybe its values. Out: ticks with numbers as a paper prints them::

    label_log(axes.xaxis, at=[2.5e-6, 5e-6])  ->  2.5 × 10⁻⁶   5 × 10⁻⁶
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    NullFormatter,
)

FEW = 8  # up to this many values of an axis are its ticks
SMALLEST, LARGEST = 1e-3, 1e4  # outside, a number is written as a power of ten
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power_text(value: float, digits: int = 4) -> str:
    """A number with so many digits: ``0.02``, ``5 × 10⁻⁶``, ``10⁴``."""
    if value == 0.0 or SMALLEST <= abs(value) < LARGEST or not np.isfinite(value):
        return f"{value:.{digits}g}"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    power = f"10{str(int(exponent)).translate(_RAISED)}"
    return power if mantissa == "1" else f"{mantissa} × {power}"


def label_log(*axes: Axis, at: Iterable[float] = ()) -> None:
    """Label logarithmic axes at least twice.

    Parameters
    ----------
    at : the values on them; ticks are there if these are few.

    Matplotlib labels decades alone, of which less than a decade has one or none, or all minor
    ticks, in powers of ten that overlap.
    """
    values = sorted({value for value in at if value > 0.0})
    for axis in axes:
        if axis.get_scale() != "log":
            continue
        axis.set_major_locator(FixedLocator(values) if 0 < len(values) <= FEW else _Decades())
        axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value, 3)))
        axis.set_minor_formatter(NullFormatter())


class _Decades(LogLocator):
    """Decades; in less than two of them 1, 2 and 5 of each, then round numbers."""

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        low, high = sorted((vmin, vmax))
        ticks = list(super().tick_values(vmin, vmax))
        if low <= 0.0 or _inside(ticks, low, high) >= 2:
            return ticks
        powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
        few = [float(tick) for tick in np.outer(powers, (1.0, 2.0, 5.0)).ravel()]
        if _inside(few, low, high) >= 2:
            return few
        return [float(tick) for tick in MaxNLocator(4).tick_values(low, high)]


def _inside(ticks: Sequence[float], low: float, high: float) -> int:
    return int(((np.asarray(ticks) >= low) & (np.asarray(ticks) <= high)).sum())
