"""Units of signals: whether two texts such as ``m/s`` and ``rad/s`` mean the same dimension."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache

# Derived units; an angle in radians has no dimension, as in SI.
_DERIVED = {"rad": "", "Hz": "1/s", "N": "kg m/s^2", "J": "kg m^2/s^2", "W": "kg m^2/s^3"}
_FACTOR = re.compile(r"([A-Za-z%]+)(?:\^(-?\d+))?|1")


@cache
def dimension(unit: str) -> frozenset[tuple[str, int]] | None:
    """The powers of the base units in a unit; None for a text that is not a product of powers.

    ``kg m/s^2`` is read from left to right: each factor after a ``/`` divides. Units of other
    scales (deg, km) count as base units of their own.
    """
    powers: Counter[str] = Counter()
    for place, group in enumerate(unit.split("/")):
        for text in group.replace("*", " ").split():
            match = _FACTOR.fullmatch(text)
            if match is None:
                return None
            if match[1] is None:
                continue
            power = int(match[2] or 1) * (-1 if place else 1)
            inner = dimension(_DERIVED[match[1]]) if match[1] in _DERIVED else {(match[1], 1)}
            for name, inner_power in inner or ():
                powers[name] += power * inner_power
    return frozenset((name, power) for name, power in powers.items() if power)


def differ(one: str, other: str) -> bool:
    """Whether two units certainly measure different things; an unknown unit ('') differs from none.

    rad/s and 1/s do not differ, since radians have no dimension; m and rad do.
    """
    if not one or not other or one == other:
        return False
    first, second = dimension(one), dimension(other)
    return first is not None and second is not None and first != second
