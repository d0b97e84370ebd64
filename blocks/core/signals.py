"""Signal types: what a wire carries, with the names and units of its components.

A signal's Python value depends on its form alone, and every block may rely on it:

=========  ==================================  =======================================
form       types                               value
=========  ==================================  =======================================
scalar     Scalar                              a ``float``
record     Pose, Twist, TrackingState, ...     a ``tuple`` of floats, one per component
array      Vector, Scan, Spikes (n,);          a float64 ``ndarray``
           Path (n, 4), PointCloud (n, 2)
=========  ==================================  =======================================

Scalars and records are plain Python numbers because a numpy array of three costs five times as
much as three floats.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]
TwistValue = tuple[float, float]
PoseValue = tuple[float, float, float]
SignalValue = float | tuple[float, ...] | FloatArray
Length = int | str | None
SignalForm = Literal["scalar", "record", "array"]


@dataclass(frozen=True)
class SignalType:
    """A signal type; two types are the same when name and length agree.

    Parameters
    ----------
    name : the type's name in graphs and messages.
    form : the Python form of a value, see the module.
    components : names of a record's fields or of a table's columns.
    units : one unit per component.
    length : number of rows of an array; a string is a symbol that a block's parameter or a
        wire resolves; None for scalars and records.
    finite : False where ``inf`` is a legitimate value (a LiDAR ray that hits nothing).
    rows : name and unit of each component of a vector, or of a scalar; types that differ in them
        or in ``finite`` alone are the same.
    """

    name: str
    form: SignalForm
    components: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    length: Length = None
    finite: bool = field(default=True, compare=False)
    rows: tuple[tuple[str, str], ...] = field(default=(), compare=False)

    @property
    def symbol(self) -> str | None:
        """The unresolved length, if there is one."""
        return self.length if isinstance(self.length, str) else None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the value as an array: () for a scalar, (k,) for a record."""
        if self.form == "scalar":
            return ()
        if self.form == "record":
            return (len(self.components),)
        if not isinstance(self.length, int):
            raise TypeError(f"{self} has no shape before its length is known")
        return (self.length, len(self.components)) if self.components else (self.length,)

    def sized(self, length: Length) -> SignalType:
        """The same type with another length."""
        return replace(self, length=length, rows=self.rows if length == self.length else ())

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the components of a record, a table or a vector; numbers without any."""
        own = self.components or tuple(name for name, _ in self.rows)
        return own or tuple(map(str, range(self.shape[0] if self.shape else 0)))

    def wrong(self, array: FloatArray) -> str:
        """What is wrong with numbers that a value of this type shall have; '' if nothing is."""
        bad = np.argwhere(np.isnan(array) | (np.isinf(array) & self.finite))
        if not len(bad):
            return ""
        at = tuple(map(int, bad[0]))
        place = f" at {list(at)}" if at else ""
        return f"expected finite numbers for a {self}, got {array[at]:g}{place}"

    def pack(self, array: FloatArray) -> SignalValue:
        """Turn an array of this type's shape into a signal value (arrays are copied)."""
        if self.form == "scalar":
            return float(array)
        if self.form == "record":
            return tuple(array.tolist())
        return array.copy()

    def filled(self, number: float) -> SignalValue:
        """The value whose components are all one number."""
        return self.pack(np.full(self.shape, number))

    def zero(self) -> SignalValue:
        """The value whose components are all zero."""
        return self.filled(0.0)

    def column(self, component: str) -> int | None:
        """Index of a component by name (records) or number (arrays of one dimension)."""
        if self.form == "record":
            return self.components.index(component) if component in self.components else None
        if self.form == "array" and self.rows and component in self.names:
            return self.names.index(component)
        if self.form == "array" and not self.components and re.fullmatch("[0-9]+", component):
            index = int(component)
            return index if not isinstance(self.length, int) or index < self.length else None
        return None

    @property
    def numbers(self) -> str:
        """How a value is written: ``a number``, ``3 numbers``, ``4x2 numbers``."""
        if self.symbol:
            return "a table of numbers" if self.components else "a list of numbers"
        return "x".join(map(str, self.shape)) + " numbers" if self.shape else "a number"

    @property
    def held_as(self) -> str:
        """A description of the value's Python form."""
        if self.form == "scalar":
            return "a float"
        if self.form == "record":
            return f"a tuple of {len(self.components)} floats ({', '.join(self.components)})"
        return f"a float64 array of shape {self.shape}"

    def holds(self, value: object, exact: bool = True) -> bool:
        """Whether a value has this type's Python form.

        ``exact`` is the contract for blocks; otherwise an ``int`` counts as a float, too.
        """

        # isinstance and not a conversion: np.float64 is a float, np.float32 and arrays without axes
        # are not, and would change the arithmetic of whatever reads them.
        kinds = (float,) if exact else (float, int)
        if self.form == "scalar":
            return isinstance(value, kinds) and not isinstance(value, bool)
        if self.form == "record":
            if not isinstance(value, tuple) or len(value) != len(self.components):
                return False
            return all(isinstance(x, kinds) and not isinstance(x, bool) for x in value)
        if not isinstance(value, np.ndarray):
            return False
        return bool(value.dtype == np.float64) and value.shape == self.shape

    def __str__(self) -> str:
        return self.name if self.length is None else f"{self.name}({self.length})"


@dataclass(frozen=True)
class Same:
    """A type variable: all ports of a block with ``Same("T")`` have one common type.

    They share one unit as well, except those with ``own_unit``, such as a Gain's output.
    """

    variable: str = "T"
    own_unit: bool = field(default=False, compare=False)

    def __str__(self) -> str:
        return f"any type {self.variable}"


PortType = SignalType | Same

Scalar = SignalType("Scalar", "scalar")
Pose = SignalType("Pose", "record", ("x", "y", "theta"), ("m", "m", "rad"))
Twist = SignalType("Twist", "record", ("v", "omega"), ("m/s", "rad/s"))
WheelSpeeds = SignalType("WheelSpeeds", "record", ("left", "right"), ("m/s", "m/s"))
TrackingState = SignalType("TrackingState", "record", ("x", "y", "theta"), ("m", "m", "rad"))

_VECTOR = SignalType("Vector", "array")
_SPIKES = SignalType("Spikes", "array", units=("1/s",))
_SCAN = SignalType("Scan", "array", units=("m",), finite=False)
_CLOUD = SignalType("PointCloud", "array", ("x", "y"), ("m", "m"))
_PATH = SignalType("Path", "array", ("x", "y", "theta", "kappa"), ("m", "m", "rad", "1/m"))


def _family(template: SignalType) -> Callable[[int | str], SignalType]:
    def sized(length: int | str) -> SignalType:
        return template.sized(length)

    sized.__doc__ = f"The signal type {template.name}(length)."
    return sized


Vector = _family(_VECTOR)
Spikes = _family(_SPIKES)
Scan = _family(_SCAN)
PointCloud = _family(_CLOUD)
Path = _family(_PATH)

TYPES: Mapping[str, SignalType] = {
    t.name: t
    for t in (
        *(Scalar, Pose, Twist, WheelSpeeds, TrackingState),
        *(_VECTOR, _SPIKES, _SCAN, _CLOUD, _PATH),
    )
}

_WRITTEN = re.compile(r"(?P<name>\w+)\s*(\(\s*(?P<length>[1-9]\d*)\s*\))?", re.ASCII)


def signal_type(
    text: str, symbol: str = "n", own: Mapping[str, SignalType] | None = None
) -> SignalType:
    """Read a type as people write it: ``Pose``, ``Vector(3)``; ``Vector`` leaves the length open.

    ``own`` are additional types, by name.

    Raises
    ------
    ValueError : if no such type exists, or a length is given to a type that has none.
    """
    match = _WRITTEN.fullmatch(text.strip())
    known = {**(own or {}), **TYPES}
    base = known.get(match["name"]) if match else None
    if match is None or base is None:
        raise ValueError(f"no signal type '{text}'; the types are {', '.join(known)}")
    if base.form != "array":
        if match["length"]:
            raise ValueError(f"{base.name} has no length; write '{base.name}'")
        return base
    return base.sized(int(match["length"]) if match["length"] else symbol)


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
