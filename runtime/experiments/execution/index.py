"""``index.csv``: one line a point, appended as it ends, whole or not at all."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from runtime.errors import UsageError
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import TrialResult

FIRST, MIDDLE, LAST = ("point",), ("seed", "status", "reason"), ("wall_s",)
RESERVED = (*FIRST, *MIDDLE, *LAST)
LONGEST_REASON = 2000  # characters that are written
LONGEST_FIELD = 1 << 27  # characters that are read; the csv module stops at 128 KiB by default
# A spreadsheet takes such a text for a formula, and runs it.
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


@dataclass(frozen=True)
class Row:
    """One point that has ended. ``metrics`` holds None where a metric has no value."""

    point: int
    cells: tuple[str, ...]
    seed: int
    status: str
    reason: str
    metrics: tuple[float | None, ...]
    wall_s: float

    @classmethod
    def of(cls, point: Trial, done: TrialResult, metrics: Sequence[str]) -> Row:
        values = tuple(done.metrics.get(name) for name in metrics)
        cells, wall_s = point.configuration.cells, round(done.wall_s, 4)
        reason = _shortened(done.reason)
        return cls(point.number, cells, point.seed, done.status, reason, values, wall_s)


@dataclass(frozen=True)
class Columns:
    """The columns of an index that differ from one experiment to the next."""

    factors: tuple[str, ...]
    metrics: tuple[str, ...]

    @property
    def header(self) -> list[str]:
        return [*FIRST, *self.factors, *MIDDLE, *self.metrics, *LAST]

    def line(self, row: Row) -> str:
        values = ["" if value is None else repr(value) for value in row.metrics]
        middle = [str(row.seed), row.status, _guarded(row.reason)]
        cells = map(_guarded, row.cells)
        return csv_line([str(row.point), *cells, *middle, *values, repr(row.wall_s)])

    def row(self, fields: Sequence[str]) -> Row:
        """Read a line's fields.

        Raises
        ------
        ValueError : it is no line of such an index.
        """
        if len(fields) != len(self.header):
            raise ValueError(f"expected {len(self.header)} fields, got {len(fields)}")
        factors, rest = fields[1 : 1 + len(self.factors)], fields[1 + len(self.factors) :]
        values = tuple(float(text) if text else None for text in rest[3:-1])
        seed, status = int(rest[0]), rest[1]
        cells, reason = tuple(map(_unguarded, factors)), _unguarded(rest[2])
        return Row(int(fields[0]), cells, seed, status, reason, values, float(rest[-1]))


def _shortened(reason: str) -> str:
    if len(reason) <= LONGEST_REASON:
        return reason
    return f"{reason[:LONGEST_REASON]}... ({len(reason)} characters)"


def _guarded(text: str) -> str:
    """A text that no spreadsheet takes for a formula; numbers stay numbers."""
    if not _FORMULA.match(text):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def _unguarded(text: str) -> str:
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def csv_line(fields: Iterable[str]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(fields)
    return buffer.getvalue()


def read_rows(path: Path, columns: Columns) -> Iterator[Row]:
    """The rows of an index, one by one.

    Raises
    ------
    UsageError : it is no index of this experiment.
    """
    csv.field_size_limit(max(csv.field_size_limit(), LONGEST_FIELD))
    try:
        with path.open(encoding="utf-8", newline="") as lines:
            reader = csv.reader(lines)
            header = next(reader, [])
            if header != columns.header:
                want, got = ", ".join(columns.header), ", ".join(header) or "nothing"
                raise UsageError(
                    f"'{path}' is of another plan: expected the columns {want}; got {got}"
                )
            for number, fields in enumerate(reader, start=2):
                try:
                    yield columns.row(fields)
                except ValueError as error:
                    raise UsageError(f"{path}:{number}: no row of this plan: {error}") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"cannot read '{path}': {error}") from None


class Index:
    """An index that is being written, by one process at a time.

    A row is appended in one call and flushed out of this process at once: what SIGKILL leaves are
    whole lines and at most one torn one at the end, which is cut off when the index is opened
    again. Where a row does not fit on the disk, what was there before stays readable.

    Raises
    ------
    UsageError : the file cannot be written, or another process is at it.
    """

    def __init__(self, path: Path, columns: Columns) -> None:
        self.path = path
        self.columns = columns
        with self._told():
            self._file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            self._lock()
            self._mend()
        except BaseException:
            os.close(self._file)
            raise

    @staticmethod
    def create(path: Path, columns: Columns) -> None:
        """Write an index without rows."""
        path.write_text(csv_line(columns.header), encoding="utf-8")

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:  # where there is none, two sweeps in one folder are not noticed
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(f"'{self.path}' is being written by another process") from None

    def _mend(self) -> None:
        """Cut off a line that was torn when its writer was killed."""
        size = os.fstat(self._file).st_size
        end = size
        while end and os.pread(self._file, 1, end - 1) != b"\n":
            end -= 1
        if end < size:
            os.ftruncate(self._file, end)

    def append(self, row: Row) -> None:
        """Add a row.

        Raises
        ------
        UsageError : it could not be written; nothing of it is left in the file.
        """
        data = self.columns.line(row).encode()
        with self._told():
            before = os.fstat(self._file).st_size
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._file, data[written:])
            except OSError:
                os.ftruncate(self._file, before)
                raise

    def rows(self) -> Iterator[Row]:
        """The rows so far, in the order in which they were written."""
        return read_rows(self.path, self.columns)

    def close(self) -> None:
        """Let others write; what is in the file reaches the disk."""
        if self._file >= 0:
            file, self._file = self._file, -1
            with self._told():
                try:
                    os.fsync(file)
                finally:
                    os.close(file)

    def _told(self) -> _Told:
        return _Told(self.path)


@dataclass(frozen=True)
class _Told:
    """Turns an error of the operating system into one that says what to do."""

    path: Path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            message = f"cannot write '{self.path}': {error.strerror}"
            raise UsageError(f"{message}; what was written before is intact") from None


def remaining(index: Index, points: Iterator[Trial]) -> Iterator[Trial]:
    """The points that have no row yet; the others' rows are held against the plan.

    Only those are held in memory that were passed by while looking for rows: as many as ran side
    by side.

    Raises
    ------
    UsageError : a row is not of this plan, or stands twice.
    """
    ahead: dict[int, Trial] = {}
    for row in index.rows():
        passed = -1
        while row.point not in ahead and passed < row.point:
            point = next(points, None)
            if point is None:
                break
            ahead[point.number] = point
            passed = point.number
        found = ahead.pop(row.point, None)
        if found is None:
            raise UsageError(
                f"'{index.path}': point {row.point} stands twice, or is not in the plan"
            )
        if (found.configuration.cells, found.seed) != (row.cells, row.seed):
            raise UsageError(
                f"'{index.path}' is of another plan: its point {row.point} is "
                f"{', '.join(row.cells)} with seed {row.seed}, "
                f"ours {', '.join(found.configuration.cells)} with seed {found.seed}"
            )
    return _chained(ahead, points)


def _chained(ahead: dict[int, Trial], points: Iterator[Trial]) -> Iterator[Trial]:
    yield from ahead.values()
    yield from points
