"""A signal that was recorded in a file."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    SignalType,
    check_ascending,
    hint,
    param,
)
from blocks.sources.time_tables import METHODS, Table

MAX_BYTES = 64 * 2**20
TIMES = ("time", "t")
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
        path = Path(self.path)
        try:
            with path.open("rb") as file:
                data = file.read(MAX_BYTES + 1)
        except OSError as error:
            message = f"cannot read '{path}': {error.strerror}"
            raise ParameterError([("file", message)]) from None
        if len(data) > MAX_BYTES:
            message = f"'{path}' is larger than {MAX_BYTES // 2**20} MiB; record fewer rows"
            raise ParameterError([("file", message)])
        return data

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        suffix = Path(self.path).suffix.lower()
        if suffix not in (".csv", ".npz"):
            message = f"expected a file that ends in .csv or .npz, got '{Path(self.path).name}'"
            raise ParameterError([("file", message)])
        content = self.content
        try:
            columns = _csv(content) if suffix == ".csv" else _npz(content)
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
        for name in (times, *names):
            # Whether a type has infinite values is known once the type is: `check_type`.
            is_wrong = ~np.isfinite(columns[name]) if name == times else np.isnan(columns[name])
            if is_wrong.any():
                row = int(np.argmax(is_wrong))
                message = f"column '{name}', row {row + 1}: expected a finite number, "
                raise ParameterError([("file", f"{message}got {columns[name][row]:g}")])
        return columns[times], table[:, 0] if table.shape[1] == 1 else table

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
            for name in self.columns:
                inner = [each for each in columns if each.startswith(f"{name}[")]
                if not inner:
                    self._check_known("columns", name, columns)
                names += inner or [name]
        if not names:
            raise ParameterError([("file", "the file has no column beside the times")])
        return names

    def _check_known(self, parameter: str, name: str, columns: RecordedColumns) -> None:
        if name not in columns:
            suggestion = hint(name, columns) or f"; the file has {', '.join(list(columns)[:20])}"
            raise ParameterError([(parameter, f"there is no column '{name}'{suggestion}")])

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
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("the file is not UTF-8") from None
    lines = text.splitlines()
    content_lines = [
        (i, each) for i, each in enumerate(lines, 1) if each.strip() and each[0] != "#"
    ]
    if not content_lines:
        raise ValueError("the file is empty")
    separator = max(",;\t", key=content_lines[0][1].count)
    try:
        cells = list(csv.reader((each for _, each in content_lines), delimiter=separator))
    except csv.Error as error:
        raise ValueError(f"not a csv file: {error}") from None
    if len(cells) != len(content_lines):
        raise ValueError("a string in quotes goes over several lines; expected numbers")
    named = any(_number(cell) is None for cell in cells[0])
    names = [cell.strip() for cell in cells[0]] if named else list(map(str, range(len(cells[0]))))
    repeated = [name for i, name in enumerate(names) if name in names[:i]]
    if repeated:
        raise ValueError(f"two columns are named '{repeated[0]}'")
    rows = []
    for (line, _), row in list(zip(content_lines, cells, strict=True))[named:]:
        if len(row) != len(names):
            raise ValueError(f"line {line}: expected {len(names)} numbers, got {len(row)}")
        rows.append([_parsed(cell, line, name) for cell, name in zip(row, names, strict=True)])
    table = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    return {name: table[:, i].copy() for i, name in enumerate(names)}


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _parsed(cell: str, line: int, name: str) -> float:
    number = _number(cell)
    if number is None:
        raise ValueError(f"line {line}, column '{name}': expected a number, got '{cell[:40]}'")
    return number


def _npz(content: bytes) -> RecordedColumns:
    """The arrays of an npz file by name; those of two dimensions as one entry per column.

    Raises
    ------
    ValueError : it cannot be read, or an array is not a column or table of numbers.
    """
    columns: RecordedColumns = {}
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            loaded = {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise ValueError(f"not an npz file of numbers: {error}") from None
    for name, array in loaded.items():
        if array.dtype.kind not in "fiub" or array.ndim not in (1, 2):
            message = f"array '{name}': expected n or n x k numbers, got {array.dtype} of shape"
            raise ValueError(f"{message} {array.shape}")
        values = array.astype(np.float64)
        if array.ndim == 1:
            columns[name] = values
        else:
            columns |= {f"{name}[{j}]": values[:, j].copy() for j in range(values.shape[1])}
    if not columns:
        raise ValueError("the file holds no arrays")
    return columns
