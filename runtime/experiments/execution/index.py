"""``index.csv``: one line per trial, appended atomically as the trial ends.

In: a :class:`Row`. Out: a line with a checksum, or an error that names file, line and field::

    Row(3, ("1.0",), seed=1, "ok", ...)  ->  3,1.0,1,ok,,0.25,9f3a11c2,62954aa1,0.0132
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import os
import re
import zlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol, get_args

from blocks.files import lines
from blocks.limits import INDEX, LINE
from runtime.errors import UsageError, one_line
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import Status, TrialResult
from runtime.files import lock, open_file, write_whole

FIRST, MIDDLE, LAST = ("trial",), ("seed", "status", "reason"), ("signals", "check", "wall_s")
RESERVED = (*FIRST, *MIDDLE, *LAST)
OLD_FIRST = "point"  # the same column in indexes of earlier versions
STATUSES = get_args(Status)
NO_SIGNAL = "-"
LONGEST_REASON = 2000  # characters that are written
LONGEST_FIELD = LINE  # characters that are read; the csv module stops at 128 KiB by default
# A spreadsheet would interpret such a string as a formula, and run it.
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


@dataclass(frozen=True)
class Row:
    """One trial that has ended.

    ``metrics`` holds None where a metric has no value, and infinity for what was never reached.
    ``signals`` has for each metric a hash of what it measured, '' where there is none.
    """

    trial: int
    cells: tuple[str, ...]
    seed: int
    status: str
    reason: str
    metrics: tuple[float | None, ...]
    wall_s: float
    signals: tuple[str, ...] = ()

    @classmethod
    def of(cls, trial: Trial, done: TrialResult, metrics: Sequence[str]) -> Row:
        values = tuple(done.metrics.get(name) for name in metrics)
        cells, wall_s = trial.configuration.cells, round(done.wall_s, 4)
        reason = _shorten(done.reason)
        signals = tuple(done.signals.get(name, "") for name in metrics)
        return cls(trial.number, cells, trial.seed, done.status, reason, values, wall_s, signals)


@dataclass(frozen=True)
class Columns:
    """The columns of an index that depend on the experiment."""

    factors: tuple[str, ...]
    metrics: tuple[str, ...]

    @property
    def header(self) -> list[str]:
        return [*FIRST, *self.factors, *MIDDLE, *self.metrics, *LAST]

    def line(self, row: Row) -> str:
        values = ["" if value is None else repr(value) for value in row.metrics]
        middle = [str(row.seed), row.status, _escape(row.reason)]
        cells = map(_escape, row.cells)
        signals = " ".join(signal or NO_SIGNAL for signal in row.signals)
        fields = [str(row.trial), *cells, *middle, *values, signals]
        return csv_line([*fields, _check(fields), repr(row.wall_s)])

    def row(self, fields: Sequence[str]) -> Row:
        """Read a line's fields.

        Raises
        ------
        ValueError : the line does not fit these columns, or was changed after it was written.
        """
        if len(fields) != len(self.header):
            raise ValueError(f"expected {len(self.header)} fields, got {len(fields)}")
        if fields[-2] != _check(fields[:-2]):
            raise ValueError("its check shows that it was changed after it was written")
        factors, rest = fields[1 : 1 + len(self.factors)], fields[1 + len(self.factors) :]
        values = tuple(float(text) if text else None for text in rest[3:-3])
        signals = tuple("" if text == NO_SIGNAL else text for text in rest[-3].split())
        if signals and len(signals) != len(values):
            raise ValueError(f"expected {len(values)} signals, got {len(signals)}")
        seed, status = int(rest[0]), rest[1]
        if status not in STATUSES:
            raise ValueError(f"expected a status ({', '.join(STATUSES)}), got '{status}'")
        cells, reason = tuple(map(_unescape, factors)), _unescape(rest[2])
        wall_s = float(rest[-1])
        if not 0.0 <= wall_s < math.inf:
            raise ValueError(f"expected a duration in wall_s, got '{rest[-1]}'")
        return Row(int(fields[0]), cells, seed, status, reason, values, wall_s, signals)


def _shorten(reason: str) -> str:
    if len(reason) <= LONGEST_REASON:
        return reason
    return f"{reason[:LONGEST_REASON]}... ({len(reason)} characters)"


def _escape(text: str) -> str:
    """A string that no spreadsheet interprets as a formula; numbers stay numbers."""
    if not _FORMULA.match(text):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def _unescape(text: str) -> str:
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def csv_line(fields: Iterable[str]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(fields)
    return buffer.getvalue()


def _check(fields: Sequence[str]) -> str:
    """A checksum of a row without its duration, which differs when the same trial runs again.

    A changed digit of a metric is a valid row otherwise, and nothing else would show it.
    """
    text = csv_line(fields).encode("utf-8", "surrogateescape")
    return f"{zlib.crc32(text):08x}"


def read_rows(path: Path, columns: Columns) -> Iterator[Row]:
    """The rows of an index, one by one.

    Raises
    ------
    UsageError : it cannot be read, is not an index of this experiment, or is damaged: a row was
        changed, or a trial has two.
    """
    csv.field_size_limit(max(csv.field_size_limit(), LONGEST_FIELD))
    try:
        # A byte that is no UTF-8 is found by the check of its row, which gives the line.
        reader = csv.reader(lines(path, INDEX, errors="surrogateescape"))
        yield from _check_rows(path, columns, reader)
    except OSError as error:
        raise UsageError(f"cannot read '{path}': {error}") from None


def _check_rows(path: Path, columns: Columns, reader: _CsvReader) -> Iterator[Row]:
    number, seen = 1, _Seen()
    try:
        header = next(reader, [])
        names = [*FIRST, *header[1:]] if header[:1] == [OLD_FIRST] else header
        if names != columns.header:
            want, got = ", ".join(columns.header), one_line(", ".join(header)) or "nothing"
            raise UsageError(
                f"'{path}' belongs to a different plan: expected the columns {want}; got {got}"
            )
        number += 1
        for fields in reader:
            row = columns.row(fields)
            if not seen.add(row.trial):
                raise ValueError(f"trial {row.trial} has a row above")
            yield row
            number = reader.line_num + 1  # a damaged row may go on over several lines
    except (ValueError, csv.Error) as error:
        message = f"{path}:{number}: not a row of this plan: {one_line(str(error))}"
        advice = "remove this line, and --resume runs its trial again"
        raise UsageError(f"{message}; {advice}") from None


class _CsvReader(Protocol):
    """What ``csv.reader`` returns: the fields of one row after the other."""

    @property
    def line_num(self) -> int: ...

    def __iter__(self) -> Iterator[list[str]]: ...

    def __next__(self) -> list[str]: ...


class _Seen:
    """The trials that have a row: all below ``least``, and the few above that ended before it."""

    def __init__(self) -> None:
        self.least = 0
        self.above: set[int] = set()

    def add(self, trial: int) -> bool:
        """Add a trial; False if it is there already."""
        if trial < self.least or trial in self.above:
            return False
        self.above.add(trial)
        while self.least in self.above:
            self.above.remove(self.least)
            self.least += 1
        return True


class Index:
    """An index open for writing, by one process at a time.

    A row is appended in one call that leaves no buffer in this process: after SIGKILL the file
    holds complete lines and at most one incomplete last line, which is cut off when the index is
    opened again. If a row does not fit on the disk, the rows before it stay readable.

    Parameters
    ----------
    again : statuses whose rows are removed first, so that their trials run again.

    Raises
    ------
    UsageError : the file cannot be written, or another process is writing it.
    """

    def __init__(self, path: Path, columns: Columns, again: Collection[str] = ()) -> None:
        self.path = path
        self.columns = columns
        self._open()
        if again and any(row.status in again for row in self.rows()):
            kept = [row for row in self.rows() if row.status not in again]
            write_whole(path, "".join([csv_line(columns.header), *map(columns.line, kept)]))
            self.close()
            self._open()

    def _open(self) -> None:
        with _write_errors(self.path):
            self._file = open_file(self.path, os.O_RDWR | os.O_APPEND)
        try:
            if not lock(self._file):
                raise UsageError(f"'{self.path}' is being written by another process")
            self._cut_incomplete_line()
        except BaseException:
            os.close(self._file)
            raise

    @staticmethod
    def create(path: Path, columns: Columns) -> None:
        """Write an index without rows."""
        write_whole(path, csv_line(columns.header))

    def _cut_incomplete_line(self) -> None:
        """Remove a last line that is incomplete because its writer was killed.

        A file whose first line is not the header was written by something else, and is not cut.
        """
        header = csv_line(self.columns.header).encode()
        os.lseek(self._file, 0, os.SEEK_SET)
        first = os.read(self._file, len(header) + 1).replace(b"\r\n", b"\n")
        older = header.replace(FIRST[0].encode(), OLD_FIRST.encode(), 1)
        if not first.startswith((header, older)):
            return  # reading its rows says what is wrong
        size = os.fstat(self._file).st_size
        end = size
        while end and self._byte(end - 1) != b"\n":
            end -= 1
        if end < size:
            os.ftruncate(self._file, end)

    def _byte(self, place: int) -> bytes:
        os.lseek(self._file, place, os.SEEK_SET)  # rows are appended wherever this is
        return os.read(self._file, 1)

    def append(self, row: Row) -> None:
        """Add a row.

        Raises
        ------
        UsageError : it could not be written; no part of it is left in the file.
        """
        data = self.columns.line(row).encode()
        with _write_errors(self.path):
            before = os.fstat(self._file).st_size
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._file, data[written:])
            except OSError:
                os.ftruncate(self._file, before)
                raise

    def rows(self) -> Iterator[Row]:
        """The rows so far, in the order of writing."""
        return read_rows(self.path, self.columns)

    @cached_property
    def by_trial(self) -> dict[int, Row]:
        """The rows that it has when they are first asked for, by the numbers of their trials."""
        return {row.trial: row for row in self.rows()}

    def close(self) -> None:
        """Flush the file to the disk, and let other processes write it."""
        if self._file >= 0:
            file, self._file = self._file, -1
            with _write_errors(self.path):
                try:
                    os.fsync(file)
                finally:
                    os.close(file)


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """Report an error of the operating system as a ``UsageError``."""
    try:
        yield
    except OSError as error:
        message = f"cannot write '{path}': {error.strerror}"
        raise UsageError(f"{message}; what was written before is intact") from None


def remaining(index: Index, trials: Iterator[Trial]) -> Iterator[Trial]:
    """The trials that have no row yet; the rows of the others are checked against the plan.

    Only the trials skipped while looking for rows are held in memory: as many as ran in parallel.

    Raises
    ------
    UsageError : a row does not belong to this plan, or is a duplicate.
    """
    ahead: dict[int, Trial] = {}
    for row in index.rows():
        passed = -1
        while row.trial not in ahead and passed < row.trial:
            trial = next(trials, None)
            if trial is None:
                break
            ahead[trial.number] = trial
            passed = trial.number
        trial_of_row = ahead.pop(row.trial, None)
        if trial_of_row is None:
            raise UsageError(
                f"'{index.path}': trial {row.trial} is a duplicate, or is not in the plan"
            )
        check_row(trial_of_row, row, index.path)
    return itertools.chain(ahead.values(), trials)


def check_row(trial: Trial, row: Row, path: Path) -> None:
    """Check that a row of the index at ``path`` is that of a trial.

    Raises
    ------
    UsageError : it has other values or another seed.
    """
    if (trial.configuration.cells, trial.seed) != (row.cells, row.seed):
        raise UsageError(
            f"'{path}' belongs to a different plan: its trial {row.trial} is "
            f"{', '.join(row.cells)} with seed {row.seed}, ours "
            f"{', '.join(trial.configuration.cells)} with seed {trial.seed}"
        )
