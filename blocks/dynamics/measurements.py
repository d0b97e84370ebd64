"""Several measurements of one filter, each with its own model, covariance, rate and delay.

In goes a mapping of a graph; out come the measurements in order, all numbers checked::

    {gps: {observation: p, R: "diag(0.04, 0.04)", dt: 0.2}, height: {observation: "p[2]", R: 1}}
    ->  (Measurement("gps", r (2, 2), ("p",), dt=0.2), Measurement("height", r (1, 1), ("p[2]",)))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from blocks.core import (
    FloatArray,
    Setting,
    SettingError,
    covariance_fault,
    misspelt,
    param,
    size_of,
)
from blocks.messages import Message

_FIELDS = {
    "observation": param(None, doc="h, as expressions").bound("observation", "texts"),
    "C": param(None, shape=[(None, None), (None,)], doc="rows of n numbers").bound("C", "array"),
    "R": param(shape=[(None, None), ()], doc="covariance of the noise").bound("R", "array"),
    "dt": param(None, unit="s", above=0.0, doc="time between two").bound("dt", "float"),
    "offset": param(0.0, unit="s", at_least=0.0, doc="when the first arrives").bound(
        "offset", "float"
    ),
    "delay": param(0.0, unit="s", at_least=0.0, doc="age at arrival").bound("delay", "float"),
    "angles": param(None, shape=(None,), doc="those that are angles").bound("angles", "array"),
}


@dataclass(frozen=True, eq=False)
class Measurement:
    """One measurement of p numbers.

    observation : the expressions of h, or c : its rows in y = C x, (p, n).
    r : covariance of its noise, (p, p).
    dt : time between two (s); None: each tick of the filter, or as its stamp says.
    offset : when the first one arrives (s). delay : how long ago it was measured then (s).
    angles : which of its numbers are angles.
    """

    name: str
    r: FloatArray
    observation: tuple[str, ...] | None = None
    c: FloatArray | None = None
    dt: float | None = None
    offset: float = 0.0
    delay: float = 0.0
    angles: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        return len(self.r)

    @property
    def problems(self) -> list[tuple[str, str]]:
        """What is wrong with its own numbers."""
        p, found = self.size, []
        if self.r.shape != (p, p):
            found.append(("R", f"expected {p} x {p} numbers, got {size_of(self.r)}"))
        elif fault := covariance_fault(self.r, definite=True):
            found.append(("R", fault))
        found += [
            ("angles", f"expected numbers from 0 to {p - 1}, got {index:g}")
            for index in self.angles
            if index not in range(p)
        ]
        if self.dt is not None and self.offset >= self.dt:
            found.append(("offset", f"expected less than dt = {self.dt:g}, got {self.offset:g}"))
        if self.dt is None and self.offset:
            found.append(("offset", "without dt; give both, or neither"))
        return found


class Measurements(Setting):
    """Measurements by name, in the order in which they are wired."""

    expected = "measurements by name, as in {gps: {observation: [x, y], R: 'diag(1, 1)', dt: 0.2}}"

    def __init__(self, items: Sequence[Measurement], written: Mapping[str, Any]) -> None:
        self.items, self._written = tuple(items), dict(written)

    @classmethod
    def read(cls, written: Any) -> Self:
        if not isinstance(written, Mapping) or not written:
            raise ValueError(f"expected {cls.expected}, got {written!r}")
        problems: list[tuple[str, str]] = []
        items = [_read(str(name), given, problems) for name, given in written.items()]
        if problems:
            raise SettingError(problems)
        return cls([each for each in items if each is not None], written)

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {
            "{gps: {observation: [x, y], R: 'diag(1, 1)', dt: 0.2, delay: 0.1}}": (
                "of an ExtendedKalmanFilter: new every 0.2 s, each measured 0.1 s before; also "
                "'offset', when the first arrives, and 'angles'"
            ),
            "{wheel: {C: [[0, 1]], R: 0.01}}": "of a KalmanFilter; new at each of its ticks",
        }

    def written(self) -> Any:
        return self._written


def _read(name: str, given: Any, problems: list[tuple[str, str]]) -> Measurement | None:
    if not isinstance(given, Mapping):
        problems.append((name, f"expected a mapping with a model and R, got {given!r}"))
        return None
    found: dict[str, Any] = {}
    before = len(problems)
    for key, value in given.items():
        if key not in _FIELDS:
            other = f"; expected {', '.join(_FIELDS)}"
            message = misspelt("unknown-key", "unknown", key, _FIELDS, other)
            problems.append((f"{name}.{key}", message))
            continue
        try:
            found[key] = _FIELDS[key].convert(value)
        except ValueError as error:
            problems.append((f"{name}.{key}", str(error)))
    if "R" not in given:
        problems.append(
            (f"{name}.R", Message("missing; expected the covariance of its noise", "missing-value"))
        )
    if len(problems) > before:
        return None
    r, c = found.pop("R"), found.pop("C", None)
    wrapped = found.pop("angles", None)
    angles = () if wrapped is None else tuple(wrapped.tolist())
    r = r.reshape(1, 1) if r.ndim == 0 else r
    c = None if c is None else np.atleast_2d(c)
    item = Measurement(name, r, c=c, angles=angles, **found)
    problems += [(f"{name}.{key}", text) for key, text in item.problems]
    return item
