"""Differences of two recordings of one probe: by column, and the first one.

In: a probe of two runs. Out: a :class:`Pair` with the rows that both recorded::

    t 0, 1, 2 and 0, 2  ->  rows 0 and 2; the largest difference, its time, and the first one
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from blocks.core import FloatArray
from runtime.observation import Recording
from runtime.streaming import row_blocks

RESOLUTION = 1e-3  # ticks: times that are closer are the same
IntArray = npt.NDArray[np.signedinteger[Any]]


@dataclass(frozen=True)
class FirstDifference:
    """The first differing value of a probe: tick and time (s), its column, both values."""

    tick: int
    t: float
    column: str
    values: tuple[float, float]


@dataclass(frozen=True)
class Column:
    """The differences of one column, over the rows that both runs have.

    ``largest`` is the largest absolute difference, at time ``at`` (s); ``rms`` the root
    mean square. ``beyond`` counts the rows beyond tolerance, from time ``since`` (s) on.
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
    """One probe in two runs, with the rows that both recorded.

    t : times (k,) of the shared rows (s). a, b : the values, (k, columns) both.
    rows : the number of rows in each. fault : why the two cannot be compared, or ''.
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
    def _differences(self) -> tuple[int, FirstDifference | None]:
        """The number of shared rows with a value whose bits differ, and the first such value."""
        count, at = 0, None
        for rows, (a, b) in row_blocks(self.a, self.b):
            differs = _bits(a) != _bits(b)
            differing = np.flatnonzero(differs.any(axis=1))
            count += len(differing)
            if at is None and len(differing):
                row = int(differing[0])
                at = self._difference_at(rows.start + row, int(differs[row].argmax()))
        return count, at

    def _difference_at(self, row: int, column: int) -> FirstDifference:
        values = (float(self.a[row, column]), float(self.b[row, column]))
        t = float(self.t[row])
        return FirstDifference(round(t / self.dt), t, self.labels[column], values)

    @property
    def differing(self) -> int:
        """The number of shared rows with a value whose bits differ."""
        return self._differences[0]

    @property
    def first_difference(self) -> FirstDifference | None:
        """The first value whose bits differ; None if all are equal."""
        return self._differences[1]

    def columns(self, rtol: float, atol: float) -> list[Column]:
        """Every column's differences, with the tolerance ``atol + rtol * |a|``.

        The difference of equal values is 0, of infinities and NaN too; of a number and NaN it is
        infinite.
        """
        if not len(self.t):
            return []
        count = len(self.labels)
        largest, rms = np.zeros(count), np.zeros(count)
        worst, since = np.zeros(count, dtype=np.int64), np.full(count, -1)
        beyond = np.zeros(count, dtype=np.int64)
        for rows, (a, b) in row_blocks(self.a, self.b):
            difference, outside = _absolute_differences(a, b, rtol, atol)
            at = difference.argmax(axis=0)
            most = difference[at, np.arange(count)]
            rms = _add_squares(rms, largest, difference, most)
            worst = np.where(most > largest, rows.start + at, worst)
            largest = np.maximum(largest, most)
            first = (since < 0) & outside.any(axis=0)
            since = np.where(first, rows.start + outside.argmax(axis=0), since)
            beyond += outside.sum(axis=0)
        with np.errstate(invalid="ignore"):
            rms = np.where(np.isinf(largest), np.inf, largest * np.sqrt(rms / len(self.t)))
        return [
            Column(
                label=self.labels[i],
                unit=self.units[i],
                largest=float(largest[i]),
                at=float(self.t[worst[i]]),
                rms=float(rms[i]),
                beyond=int(beyond[i]),
                since=float(self.t[since[i]]) if since[i] >= 0 else None,
            )
            for i in range(count)
        ]


def _bits(values: FloatArray) -> IntArray:
    bits: IntArray = np.ascontiguousarray(values).view(np.int64)
    return bits


def _absolute_differences(
    a: FloatArray, b: FloatArray, rtol: float, atol: float
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Absolute differences, and which of them are beyond tolerance."""
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(a - b)
        within = difference <= atol + rtol * np.abs(a)
    difference[(a == b) | (np.isnan(a) & np.isnan(b))] = 0.0
    difference[np.isnan(difference)] = np.inf
    return difference, (difference > 0.0) & (~within | np.isinf(difference))


def _add_squares(
    before: FloatArray, scale: FloatArray, difference: FloatArray, most: FloatArray
) -> FloatArray:
    """Add a block to sums of squared differences, which are scaled by the largest difference.

    Without scaling, the squares of small differences may underflow, those of large ones overflow.
    """
    new = np.maximum(scale, most)
    unit = np.where((new > 0.0) & np.isfinite(new), new, 1.0)
    with np.errstate(invalid="ignore", over="ignore"):
        sums = before * (scale / unit) ** 2 + ((difference / unit) ** 2).sum(axis=0)
    return np.where(np.isfinite(new), sums, 0.0)


def pair(a: Recording, b: Recording, dt: float) -> Pair:
    """Match the rows of two recordings of a probe.

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
    # A slice does not copy the rows, which may be mapped from disk.
    here, there = (
        slice(None) if len(i) == n else i for i, n in ((left, len(a.t)), (right, len(b.t)))
    )
    labels, units = _names(a)
    return Pair(
        name=a.name,
        t=a.t[here],
        a=a.columns[here],
        b=b.columns[there],
        labels=labels,
        units=units,
        rows=rows,
        fault=fault,
        dt=dt,
    )


def _fault(a: Recording, b: Recording) -> str:
    """Why two recordings cannot be compared, or ''."""
    if a.values.shape[1:] != b.values.shape[1:]:
        shapes = [r.values.shape[1:] or (1,) for r in (a, b)]
        counts = [" x ".join(map(str, shape)) for shape in shapes]
        return f"{counts[0]} columns in one, {counts[1]} in the other"
    if a.units != b.units:
        return f"[{', '.join(a.units)}] in one, [{', '.join(b.units)}] in the other"
    return ""


def _shared(a: FloatArray, b: FloatArray, resolution: float) -> tuple[IntArray, IntArray]:
    """Indices of the rows whose times are in both, to a ``resolution`` (s)."""
    if len(a) == len(b) and np.abs(a - b).max(initial=0.0) < 0.5 * resolution:
        return (np.arange(len(a)),) * 2
    here, there = (np.rint(t / resolution).astype(np.int64) for t in (a, b))
    _, left, right = np.intersect1d(here, there, return_indices=True)
    return left, right


def _names(recorded: Recording) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """A label and a unit for each number of a row, also of tables."""
    count = int(np.prod(recorded.values.shape[1:]))
    if len(recorded.labels) == count:
        return recorded.labels, recorded.units
    inner = len(recorded.labels)
    if inner == recorded.values.shape[-1]:
        # The points of a path or a point cloud, each with its coordinates.
        points = range(count // inner)
        labels = tuple(f"{label}[{i}]" for i in points for label in recorded.labels)
        return labels, recorded.units * len(points)
    return tuple(f"{recorded.name}[{i}]" for i in range(count)), ("",) * count
