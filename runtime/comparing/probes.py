"""Differences of two recordings of one probe: column by column, and where the bits part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from blocks.signals import FloatArray
from runtime.result import Recorded

RESOLUTION = 1e-3  # ticks: times nearer than that are the same
BLOCK = 2**22  # numbers that are compared at a time
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.signedinteger[Any]]


@dataclass(frozen=True)
class Place:
    """One recorded number in two runs: tick and time (s) in the first, its column, both values."""

    tick: int
    t: float
    column: str
    values: tuple[float, float]


@dataclass(frozen=True)
class Column:
    """One column in two runs, over the rows that both have.

    ``largest`` is the largest absolute difference, at time ``at`` (s); ``rms`` the root of the
    mean square one. ``beyond`` counts the rows beyond tolerance, from time ``since`` (s) on.
    """

    label: str
    unit: str
    largest: float
    at: float
    rms: float
    beyond: int
    since: float | None


@dataclass(frozen=True)
class Pair:
    """One probe in two runs; the rows that both recorded stand beside each other.

    t : times (k,) of the shared rows (s). a, b : the values, (k, columns) both.
    rows : the number of rows in each. fault : why the two cannot be compared; '' if they can.
    dt : the first run's base step (s).
    """

    name: str
    t: FloatArray
    a: FloatArray
    b: FloatArray
    labels: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[int, int]
    fault: str
    dt: float

    @property
    def is_whole(self) -> bool:
        """Whether both have the same rows, at the same times."""
        return not self.fault and self.rows == (len(self.t), len(self.t))

    @cached_property
    def parted(self) -> BoolArray:
        """Where the bits of two values differ, (k, columns)."""
        parted: BoolArray = self.a.view(np.int64) != self.b.view(np.int64)
        return parted

    @property
    def differing(self) -> int:
        """How many shared rows hold a value whose bits differ."""
        return int(self.parted.any(axis=1).sum())

    def first(self) -> Place | None:
        """The first shared row and column whose bits differ; None if all are equal."""
        rows = self.parted.any(axis=1)
        if not rows.any():
            return None
        row = int(rows.argmax())
        column = int(self.parted[row].argmax())
        values = (float(self.a[row, column]), float(self.b[row, column]))
        t = float(self.t[row])
        return Place(round(t / self.dt), t, self.labels[column], values)

    def columns(self, rtol: float, atol: float) -> list[Column]:
        """Every column's differences, beyond ``atol + rtol * |a|`` or not.

        Values that are equal differ by nothing, infinite ones too; a number and none by infinity.
        """
        if not len(self.t):
            return []
        # Some columns at a time: a recording may take a good part of the memory.
        size = max(1, BLOCK // len(self.t))
        starts = range(0, len(self.labels), size)
        return [column for i in starts for column in self._columns(i, i + size, rtol, atol)]

    def _columns(self, start: int, stop: int, rtol: float, atol: float) -> Iterator[Column]:
        a, b = self.a[:, start:stop], self.b[:, start:stop]
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.abs(a - b)
            within = apart <= atol + rtol * np.abs(a)
        apart[(a == b) | (np.isnan(a) & np.isnan(b))] = 0.0
        apart[np.isnan(apart)] = np.inf
        beyond = (apart > 0.0) & (~within | np.isinf(apart))
        for i in range(apart.shape[1]):
            yield self._column(start + i, apart[:, i], beyond[:, i])

    def _column(self, i: int, apart: FloatArray, beyond: BoolArray) -> Column:
        worst = int(apart.argmax())
        scale = float(apart[worst])
        # Scaled, since the square of a small difference may be nothing.
        rms = scale
        if 0.0 < scale < np.inf:
            rms *= float(np.sqrt(np.mean((apart / scale) ** 2)))
        return Column(
            label=self.labels[i],
            unit=self.units[i],
            largest=scale,
            at=float(self.t[worst]),
            rms=rms,
            beyond=int(beyond.sum()),
            since=float(self.t[int(beyond.argmax())]) if beyond.any() else None,
        )


def pair(a: Recorded, b: Recorded, dt: float) -> Pair:
    """Put two recordings of a probe side by side.

    Parameters
    ----------
    a, b : the recordings; rows are matched by their times.
    dt : the first run's base step (s).
    """
    fault = _fault(a, b)
    rows = (len(a.t), len(b.t))
    if fault:
        b = replace(b, t=b.t[:0], values=a.values[:0])
    left, right = _shared(a.t, b.t, RESOLUTION * dt)
    labels, units = _names(a)
    return Pair(
        name=a.name,
        t=a.t[left],
        a=_flat(a.values[left]),
        b=_flat(b.values[right]),
        labels=labels,
        units=units,
        rows=rows,
        fault=fault,
        dt=dt,
    )


def _fault(a: Recorded, b: Recorded) -> str:
    """Why two recordings cannot be compared; '' if they can."""
    if a.values.shape[1:] != b.values.shape[1:]:
        shapes = [r.values.shape[1:] or (1,) for r in (a, b)]
        counts = [" x ".join(map(str, shape)) for shape in shapes]
        return f"{counts[0]} columns in one, {counts[1]} in the other"
    if a.units != b.units:
        return f"[{', '.join(a.units)}] in one, [{', '.join(b.units)}] in the other"
    return ""


def _shared(a: FloatArray, b: FloatArray, apart: float) -> tuple[IntArray, IntArray]:
    """Indices of the rows whose times are in both; times less than ``apart`` (s) are the same."""
    here, there = (np.rint(t / apart).astype(np.int64) for t in (a, b))
    _, left, right = np.intersect1d(here, there, return_indices=True)
    return left, right


def _names(recorded: Recorded) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """A label and a unit for each number of a row, those of tables too."""
    count = int(np.prod(recorded.values.shape[1:]))
    if len(recorded.labels) == count:
        return recorded.labels, recorded.units
    inner = len(recorded.labels)
    if inner == recorded.values.shape[-1]:
        # The points of a path or a cloud, each with its coordinates.
        points = range(count // inner)
        labels = tuple(f"{label}[{i}]" for i in points for label in recorded.labels)
        return labels, recorded.units * len(points)
    return tuple(f"{recorded.name}[{i}]" for i in range(count)), ("",) * count


def _flat(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values.reshape(len(values), int(np.prod(values.shape[1:]))))
