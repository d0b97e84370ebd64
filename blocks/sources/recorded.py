"""A signal that was recorded in a file."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    BoolArray,
    FloatArray,
    ParameterError,
    SignalType,
    check_ascending,
    misspelt,
    param,
)
from blocks.files import DAMAGED, UnfitError, archive, array_header, read, read_array
from blocks.limits import GRAPH_ARRAYS, RECORDED, RECORDED_COLUMNS, RECORDED_NUMBERS
from blocks.sources.time_tables import METHODS, Table

TIMES = ("time", "t")
TOO_MANY = f"it holds more than {RECORDED_NUMBERS:,} numbers"
RecordedColumns = dict[str, FloatArray]


class FromFile(Table):
    """The columns of a file over time: csv, or npz with one array per signal.

        [ FromFile ] ─▶ out

    Between two rows the value holds, or changes linearly, or along the cubic spline through all
    points (scipy's CubicSpline, not-a-knot). A csv file has one row per time; its first line may
    name the columns, which are numbered from 0 otherwise; ',', ';' or a tab separates them, lines
    that begin with '#' are skipped. In an npz file, an array of n numbers is a column, and one of
    n x k numbers is k of them. The probes.npz of a run is such a file. A ``signal`` that is a Scan
    may have ``inf`` for misses, with ``method: hold``. ``file`` is relative to the graph's own
    file.
    """

    path: str = param(name="file", doc="a .csv or .npz file")
    columns: tuple[str, ...] | None = param(
        None, doc="names or numbers of columns, one per component; default all but the time"
    )
    time: str | None = param(
        None, doc="the column of the times (s), in ascending order; default time, t or the first"
    )
    begin: str = param(
        "file",
        name="start",
        choices=("file", "first"),
        doc="what is time 0: that of the file's times, or its first row",
    )
    method: str = param("linear", choices=METHODS, doc="what lies between two rows")
    outside: str = param(
        "error",
        choices=("error", "hold", "zero"),
        doc="what lies before the first time, and after the last one: an error, its value, or 0",
    )
    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default Scalar, or Vector for many columns"
    )

    def validate(self) -> None:
        check_ascending(self.rows[0], "file", "times", "s")
        self.check_type("file")

    def validate_in(self, context: BlockContext) -> None:
        times = self.rows[0]
        # The last value counts for as long as the one before it.
        begin, end = float(times[0]), float(2.0 * times[-1] - times[-2])
        tolerance = 1e-9 * max(context.dt, end - begin)
        if self.outside != "error" or context.until is None:
            return
        if begin > tolerance or end < context.until - tolerance:
            message = f"'{Path(self.path).name}' has values from {begin:g} s to {times[-1]:g} s, "
            message += f"but the run takes {context.until:g} s; choose 'outside: hold' or 'zero', "
            raise ParameterError([("file", f"{message}or another run.until")])

    @property
    def files(self) -> Mapping[str, bytes]:
        return {str(Path(self.path).resolve()): self.content}

    @cached_property
    def content(self) -> bytes:
        """The file as it was read; it is read once."""
        try:
            return read(self.path, RECORDED)
        except OSError as error:
            message = f"cannot read '{self.path}': {error.strerror}"
            raise ParameterError([("file", message)]) from None

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        suffix = Path(self.path).suffix.lower()
        if suffix not in (".csv", ".npz"):
            message = f"expected a file that ends in .csv or .npz, got '{Path(self.path).name}'"
            raise ParameterError([("file", message)])
        content = self.content
        try:
            columns = _csv(content) if suffix == ".csv" else _npz(content, self._is_needed)
        except ValueError as error:
            raise ParameterError([("file", f"{Path(self.path).name}: {error}")]) from None
        times = self._times(columns)
        names = self._names(columns, times)
        short = [name for name in names if len(columns[name]) != len(columns[times])]
        if short:
            message = f"expected {len(columns[times])} values, one per time, got "
            raise ParameterError(
                [("columns", f"{message}{len(columns[short[0]])} of '{short[0]}'")]
            )
        table = np.column_stack([columns[name] for name in names])
        # Whether a type has infinite values is known once the type is: `check_type`.
        _refuse(~np.isfinite(columns[times]), columns[times], [times])
        _refuse(np.isnan(table), table, names)
        start = columns[times][0] if self.begin == "first" else 0.0
        return columns[times] - start, table[:, 0] if table.shape[1] == 1 else table

    def _is_needed(self, name: str) -> bool:
        """Whether an array of a file with many can be one of the columns, or the times."""
        if self.columns is None or name in (self.time, *TIMES):
            return True
        return any(each.partition("[")[0] == name.partition(".time")[0] for each in self.columns)

    def _times(self, columns: RecordedColumns) -> str:
        """The name of the column with the times."""
        if self.time is not None:
            self._check_known("time", self.time, columns)
            return self.time
        own = [f"{name}.time" for name in self.columns or ()]
        return next((name for name in (*own, *TIMES) if name in columns), next(iter(columns)))

    def _names(self, columns: RecordedColumns, times: str) -> list[str]:
        if self.columns is None:
            names = [name for name in columns if name != times and not name.endswith(".time")]
        else:
            names = []
            parts: dict[str, list[str]] = {}
            for each in columns:
                parts.setdefault(each.rpartition("[")[0], []).append(each)
            for name in self.columns:
                if name not in parts:
                    self._check_known("columns", name, columns)
                names += parts.get(name, [name])
        if not names:
            raise ParameterError([("file", "the file has no column beside the times")])
        return names

    def _check_known(self, parameter: str, name: str, columns: RecordedColumns) -> None:
        if name not in columns:
            text, other = f"there is no column '{name}'", ", ".join(list(columns)[:20])
            message = misspelt("unknown-name", text, name, columns, f"; the file has {other}")
            raise ParameterError([(parameter, message)])

    @property
    def how(self) -> str:
        return self.method

    @property
    def stated(self) -> SignalType | None:
        return self.kind

    def output(self, state: BlockState, t: float) -> Any:
        if self.outside == "zero" and (
            t < state.times[0] - state.early or t > state.times[len(state.times) - 1] + state.early
        ):
            return state.zero
        return self.at(state, t)

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.zero = self.resolved.zero()


def _csv(content: bytes) -> RecordedColumns:
    """The columns of a csv file by name.

    Raises
    ------
    ValueError : it is not a table of numbers; the message names the line.
    """
    # As text line by line: a list of all cells would take ten times the file's size.
    text = io.TextIOWrapper(io.BytesIO(content), "utf-8-sig")
    try:
        return _table(text)
    except UnicodeDecodeError:
        raise ValueError("the file is not UTF-8") from None
    except csv.Error as error:
        raise ValueError(f"not a csv file: {error}") from None


def _table(text: Iterable[str]) -> RecordedColumns:
    written = (
        (i, each) for i, each in enumerate(text, 1) if each.strip() and not each.startswith("#")
    )
    number, first = next(written, (0, ""))
    if not first:
        raise ValueError("the file is empty")
    separator = max(",;\t", key=first.count)
    if first.count(separator) >= RECORDED_COLUMNS:
        raise ValueError(f"it has more than {RECORDED_COLUMNS:,} columns")
    cells = _cells(first, separator)
    named = any(_number(cell) is None and not _is_foreign(cell) for cell in cells)
    names = [cell.strip() for cell in cells] if named else list(map(str, range(len(cells))))
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ValueError(f"two columns are named '{name}'")
        seen.add(name)
    numbers = array("d")
    for line, row in written if named else chain([(number, first)], written):
        found = _cells(row, separator)
        if len(found) != len(names):
            raise ValueError(f"line {line}: expected {len(names)} numbers, got {len(found)}")
        numbers.extend(_parsed(cell, line, name) for cell, name in zip(found, names, strict=True))
        if len(numbers) > RECORDED_NUMBERS:
            raise ValueError(f"{TOO_MANY}; record fewer rows or columns")
    table = np.frombuffer(numbers, dtype=np.float64).reshape(-1, len(names))
    return {name: table[:, i] for i, name in enumerate(names)}


def _cells(line: str, separator: str) -> list[str]:
    """The cells of one line."""
    if '"' not in line:
        return line.rstrip("\r\n").split(separator)
    rows = list(csv.reader([line], delimiter=separator, strict=True))
    return rows[0]


def _number(cell: str) -> float | None:
    """A number in ASCII; Python also reads ``1_000`` and the digits of other scripts."""
    try:
        return None if _is_foreign(cell) else float(cell)
    except ValueError:
        return None


def _is_foreign(cell: str) -> bool:
    """Whether only Python reads a cell as a number."""
    if cell.isascii() and "_" not in cell:
        return False
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _parsed(cell: str, line: int, name: str) -> float:
    number = _number(cell)
    if number is None:
        raise ValueError(f"line {line}, column '{name}': expected a number, got '{cell[:40]}'")
    return number


def _npz(content: bytes, is_needed: Callable[[str], bool]) -> RecordedColumns:
    """The arrays of an npz file by name; those of two dimensions as one entry per column.

    Those that are not needed are left empty. What all hold is known before one is unpacked.

    Raises
    ------
    ValueError : it cannot be read, or an array is not a column or table of numbers.
    """
    try:
        with archive(io.BytesIO(content), GRAPH_ARRAYS) as members:
            shapes = {name: _shape(members, name) for name in members.namelist()}
            needed = [n for i, n in enumerate(shapes) if not i or is_needed(n.removesuffix(".npy"))]
            if sum(math.prod(shapes[name]) for name in needed) > RECORDED_NUMBERS:
                raise ValueError(f"{TOO_MANY}; name fewer columns, or record fewer rows")
            columns: RecordedColumns = {}
            for name, shape in shapes.items():
                values = np.empty((0, *shape[1:]))
                if name in needed:
                    values = read_array(members, name, 8 * RECORDED_NUMBERS).astype(np.float64)
                name = name.removesuffix(".npy")
                if len(shape) == 1:
                    columns[name] = values
                elif len(columns) + shape[1] > RECORDED_COLUMNS:
                    raise ValueError(f"it has more than {RECORDED_COLUMNS:,} columns")
                else:
                    columns |= {f"{name}[{j}]": values[:, j] for j in range(shape[1])}
    except (UnfitError, _ShapeError) as error:
        raise ValueError(str(error)) from None
    except DAMAGED as error:
        raise ValueError(f"not an npz file of numbers: {error}") from None
    if not columns:
        raise ValueError("the file holds no arrays")
    return columns


class _ShapeError(Exception):
    """An array of an npz file is no column and no table of numbers."""


def _shape(members: ZipFile, name: str) -> tuple[int, ...]:
    with members.open(name) as member:
        shape, _, kind = array_header(member)
    if kind.kind not in "fiub" or len(shape) not in (1, 2):
        message = f"array '{name.removesuffix('.npy')}': expected n or n x k numbers, got {kind}"
        raise _ShapeError(f"{message} of shape {shape}")
    return shape


def _refuse(is_wrong: BoolArray, values: FloatArray, names: Sequence[str]) -> None:
    wrong = np.flatnonzero(is_wrong)
    if len(wrong):
        row, column = divmod(int(wrong[0]), len(names))
        message = f"column '{names[column]}', row {row + 1}: expected a finite number, got "
        raise ParameterError([("file", f"{message}{values.reshape(-1)[wrong[0]]:g}")])
