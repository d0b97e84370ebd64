"""Recording of probes: in arrays as long as the run, or in buffers that are emptied when full.

In: rows, which the plan's text writes by ``y[k] = plant_out``. Out: an array for each probe. What
is in a full buffer is appended to a file on disk if memory would not suffice for a run, and to
rows in memory if nobody knows how long it will be, as in a session. A recording on disk is one
``.npy`` file per probe, whose header is updated each time, so that a killed run leaves a readable
file.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import BinaryIO
from weakref import finalize

import numpy as np

from blocks.core import FloatArray
from runtime.engine.filtering import ProbeFilter
from runtime.errors import UsageError
from runtime.files import slug
from runtime.observation import Probe
from runtime.terminal import readable_bytes

TIMES_AT_ONCE = 1 << 20
FILTERED_AT_ONCE = 512  # values
BUFFER = 1 << 22  # bytes, the largest buffer of one probe
GROWING_ROWS, GROWING_BYTES = 1024, 1 << 18  # of a buffer before rows in memory
PART = 1 << 18  # bytes, of rows in memory that are copied together


def buffer_rows(probes: Mapping[str, Probe], ticks: int, memory: int) -> dict[str, int]:
    """Buffer rows of each probe that goes to disk; empty if all fits into ``memory`` bytes."""
    moving = {name: probe for name, probe in probes.items() if not probe.constant}
    if sum(probe.size(ticks) for probe in probes.values()) <= memory:
        return {}
    share = min(BUFFER, memory // max(1, len(moving)))
    return {
        name: min(probe.rows(ticks), max(1, share // probe.row_bytes))
        for name, probe in moving.items()
    }


def growing_rows(probes: Mapping[str, Probe]) -> dict[str, int]:
    """Buffer rows of each probe of a run whose length is not known."""
    return {
        name: max(1, min(GROWING_ROWS, GROWING_BYTES // max(1, probe.row_bytes)))
        for name, probe in probes.items()
        if not probe.constant
    }


def buffered(probe: Probe, gathered: Mapping[str, int]) -> int:
    """Rows of the buffer that the plan fills again and again; 0 if it fills the whole recording."""
    return FILTERED_AT_ONCE if probe.is_filtered else gathered.get(probe.name, 0)


class Rows:
    """One probe's rows in memory: parts that never change, so that copies of a run share them."""

    def __init__(self, shape: tuple[int, ...], keep: int | None = None) -> None:
        self.shape, self.keep = shape, keep
        self.parts: tuple[FloatArray, ...] = ()
        self.rows = self.left = 0

    def append(self, rows: FloatArray) -> None:
        """Add rows (n, ...) at the end."""
        rows = rows.copy()
        self.rows += len(rows)
        parts = list(self.parts)
        # Parts of at least half of the next one's size: few of them, and each is copied seldom. A
        # full one is never copied again, so that all copies of a run hold the same.
        while parts and len(parts[-1]) <= 2 * len(rows) and parts[-1].nbytes + rows.nbytes <= PART:
            rows = np.concatenate([parts.pop(), rows])
        parts.append(rows)
        if self.keep is not None:
            while self.rows - self.left - len(parts[0]) >= self.keep:
                self.left += len(parts.pop(0))
        self.parts = tuple(parts)

    @property
    def first(self) -> int:
        """The number of the first row that is kept."""
        return self.left if self.keep is None else max(self.left, self.rows - self.keep)

    def since(self, row: int) -> tuple[int, FloatArray]:
        """The rows that are kept from number ``row`` on, and the number of the first of them."""
        row = min(max(row, self.first), self.rows)
        end, parts = self.rows, []
        for part in reversed(self.parts):
            if end <= row:
                break
            begin = end - len(part)
            parts.append(part[max(0, row - begin) :])
            end = begin
        return row, np.concatenate([np.empty((0, *self.shape)), *reversed(parts)])

    def before(self, row: int) -> tuple[tuple[FloatArray, ...], int]:
        """The parts with the rows before number ``row``, and the number of the first of them."""
        parts, end = [], self.left
        for part in self.parts:
            if end >= row:
                break
            parts.append(part[: row - end])
            end += len(part)
        return tuple(parts), self.left if parts else row

    def close(self) -> FloatArray:
        """All rows that are kept, the last ``keep`` of them."""
        whole = np.concatenate([np.empty((0, *self.shape)), *self.parts])
        return whole[self.first - self.left :]


class Stream:
    """One probe's file, open for appending rows of ``shape``."""

    def __init__(self, path: Path, shape: tuple[int, ...]) -> None:
        self.path, self.shape = path, shape
        self.rows = 0
        self.file: BinaryIO = path.open("w+b")
        self._header()
        self.start = self.file.tell()

    def _header(self) -> None:
        self.file.seek(0)
        # numpy leaves room in a header for its first axis to grow.
        described = {"descr": "<f8", "fortran_order": False, "shape": (self.rows, *self.shape)}
        np.lib.format.write_array_header_1_0(self.file, described)

    def append(self, rows: FloatArray) -> None:
        """Add rows (n, ...) at the end, over what an interrupted append left there."""
        self.file.seek(self.start + 8 * self.rows * math.prod(self.shape))
        self.file.write(np.ascontiguousarray(rows, dtype="<f8").data)
        self.rows += len(rows)
        self._header()
        self.file.flush()

    def close(self) -> FloatArray:
        """The whole recording, mapped from the file; it stays readable when the file is removed."""
        with self.file:
            try:
                self._header()
                self.file.flush()
            except OSError:
                pass  # full disk: the rows are there, and their number is known
            if not self.rows or not math.prod(self.shape):
                return np.empty((self.rows, *self.shape))
            shape = (self.rows, *self.shape)
            mapped = np.memmap(self.file, "<f8", "r", self.start, shape)
        return np.asarray(mapped)


Saved = dict[str, tuple[tuple[FloatArray, ...], int, int, FloatArray | None]]


class Recorder:
    """The arrays that a run's probes fill.

    Parameters
    ----------
    probes : by name.
    ticks : of the whole run. dt : its base step (s).
    gathered : rows of the buffers of the probes that have one, see :func:`buffer_rows`.
    folder : for their files; None for a temporary folder that is removed with the recorder.
    growing : to rows in memory instead of to files, unless there is a folder.
    keep : the ticks of which rows in memory are kept, the last ones; None for all.

    Raises
    ------
    UsageError : the disk has no room for the recordings and the run's own file.
    """

    def __init__(
        self,
        probes: Mapping[str, Probe],
        ticks: int,
        dt: float,
        gathered: Mapping[str, int],
        folder: Path | None = None,
        growing: bool = False,
        keep: int | None = None,
    ) -> None:
        self.probes, self.gathered = probes, gathered
        self.sinks: dict[str, Rows | Stream] = {}
        self.full = False
        self.constants_saved = False
        self._boundary: int | None = None
        self._remove: Callable[[], object] | None = None
        self.folder: Path | None = None
        # Each row with its time.
        self.size = sum(probe.size(ticks) + 8 * probe.rows(ticks) for probe in probes.values())
        if gathered and not (growing and folder is None):
            self._open(folder)
        elif folder is not None:
            _check_room(folder.parent, self.size)
        self.dt, self.keep = dt, keep
        self._in_memory()
        # The rows of the buffer of each probe that does not fill the whole recording.
        self.buffers = {name: buffered(probes[name], gathered) for name in self.sinks}
        self.arrays = {
            name: np.full((self.buffers.get(name) or probe.rows(ticks), *probe.shape), np.nan)
            for name, probe in probes.items()
        }

    def _in_memory(self) -> None:
        """Filters that have seen nothing, and no rows in memory."""
        self.filters = {
            name: ProbeFilter(probe, self.dt)
            for name, probe in self.probes.items()
            if probe.is_filtered
        }
        for name in self.gathered.keys() | self.filters.keys():
            if not isinstance(self.sinks.get(name), Stream):
                rows = None if self.keep is None else -(-self.keep // self.probes[name].every)
                self.sinks[name] = Rows(self.probes[name].shape, rows)

    def begin_again(self) -> None:
        """Forget what a run has recorded, but what is constant; files stay, and others begin.

        Raises
        ------
        UsageError : the disk has no room for them.
        """
        self.full = self.constants_saved = False
        self._boundary = None
        if self.folder is not None:
            self._open(None)
        for name, array in self.arrays.items():
            if not self.probes[name].constant:
                array.fill(np.nan)
        self._in_memory()

    def _open(self, folder: Path | None) -> None:
        """Begin the files."""
        if self._remove is not None:
            self._remove()
        # A stream is written once more, into the run's own file.
        self.folder = self._open_folder(folder, 2 * self.size)
        for name in self.gathered:
            path = self.folder / recording_file(name)
            try:
                self.sinks[name] = Stream(path, self.probes[name].shape)
            except OSError as error:
                raise UsageError(f"cannot record to '{path}': {error.strerror}") from None

    def _open_folder(self, folder: Path | None, size: int) -> Path:
        try:
            if folder is None:
                folder = Path(mkdtemp(prefix="spikeblocks-"))
                # A mapped file stays readable after it is removed.
                self._remove = finalize(self, shutil.rmtree, folder, ignore_errors=True)
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"cannot record to '{folder}': {error.strerror or error}") from None
        _check_room(folder, size)
        return folder

    def boundary(self) -> int:
        """How many ticks may be done before :meth:`flush` must be called."""
        if self._boundary is None:
            self._boundary = min(map(self._due, self.sinks), default=sys.maxsize)
        return self._boundary

    def _due(self, name: str) -> int:
        """The tick at which a buffer is full."""
        rows, taken, probe = self.buffers[name], self._taken(name), self.probes[name]
        every, first = probe.inputs
        return first + (taken // rows + 1) * rows * every

    def _taken(self, name: str) -> int:
        """The rows of a buffer that were taken out of it so far."""
        return self.filters[name].taken if name in self.filters else self.sinks[name].rows

    def flush(self, tick: int, all: bool = False) -> None:
        """Empty the buffers that are full once ``tick`` ticks are done, or ``all`` of them.

        Raises
        ------
        UsageError : the disk is full or not available.
        """
        if all or tick >= self.boundary():
            for name in self.sinks:
                if all or tick >= self._due(name):
                    self._empty(name, tick)
        if self.folder is not None and not self.constants_saved:
            self.constants_saved = True
            for name in self.probes.keys() - self.sinks.keys():
                np.save(self.folder / recording_file(name), self.arrays[name])

    def _empty(self, name: str, tick: int) -> None:
        """Take the rows that are new out of a buffer; they are at most to its end."""
        self._boundary = None
        probe, taken, size = self.probes[name], self._taken(name), self.buffers[name]
        first = taken % size
        rows = self.arrays[name][first : min(size, first + probe.values_read(tick) - taken)]
        if len(rows) and name in self.filters:
            rows = self.filters[name].take(rows)
        if len(rows):
            self._append(self.sinks[name], rows)

    def _append(self, sink: Rows | Stream, rows: FloatArray) -> None:
        try:
            sink.append(rows)
        except OSError as error:
            self.full = True
            path = sink.path if isinstance(sink, Stream) else ""
            message = f"cannot record to '{path}': {error.strerror or error}"
            raise UsageError(f"{message}; {sink.rows} rows of it are kept") from None

    def finish(self, tick: int) -> dict[str, FloatArray]:
        """The rows of all probes after the last tick, the ``tick``-th."""
        for name in () if self.full else self.sinks:
            # On a full disk the last rows are lost; the others are kept.
            with suppress(UsageError):
                self._empty(name, tick)
        return {name: self._rows(name, tick) for name in self.probes}

    def _rows(self, name: str, tick: int) -> FloatArray:
        probe = self.probes[name]
        filled = min(1, tick) if probe.constant else probe.rows(tick)
        if name not in self.sinks:
            return self.arrays[name][:filled]
        sink = self.sinks[name]
        first = sink.first if isinstance(sink, Rows) else 0
        return sink.close()[: max(0, filled - first)]

    def saved(self, tick: int) -> Saved:
        """The rows so far, and what the filters remember."""
        self.flush(tick, all=True)
        found: Saved = {}
        for name, sink in self.sinks.items():
            # Rows in a file stay there.
            parts, left = (sink.parts, sink.left) if isinstance(sink, Rows) else ((), 0)
            memory = self.filters[name].saved() if name in self.filters else None
            found[name] = parts, sink.rows, left, memory
        return found

    def restore(self, saved: Saved) -> None:
        """Put back what :meth:`saved` returned, of this recorder or of one with the same probes."""
        self._boundary = None
        for name, (parts, rows, left, memory) in saved.items():
            sink = self.sinks[name]
            if isinstance(sink, Rows):
                sink.parts, sink.rows, sink.left = parts, rows, left
            elif not sink.rows:
                for part in parts:
                    self._append(sink, part)
            if memory is not None:
                self.filters[name].restore(memory)

    def since(self, name: str, tick: int, done: int) -> tuple[FloatArray, FloatArray]:
        """The rows of a probe at ticks from ``tick`` on, of ``done`` ticks, and their times."""
        probe, sink = self.probes[name], self.sinks.get(name)
        wanted = max(0, -(-(tick - probe.first) // max(1, probe.every)))
        if isinstance(sink, Rows):
            first, rows = sink.since(wanted)
        else:
            # Constant ones have one row.
            filled = min(1, done) if probe.constant else probe.rows(done)
            first, rows = min(wanted, filled), self.arrays[name][min(wanted, filled) : filled]
        step, late = probe.every * self.dt, probe.first * self.dt
        return row_times(first, first + len(rows), step, late), rows

    def times(self, name: str, rows: int, dt: float) -> FloatArray:
        """The times (s) of a probe's rows, those of their ticks, on disk if the rows are."""
        probe = self.probes[name]
        step, late = probe.every * dt, probe.first * dt
        sink = self.sinks.get(name)
        if self.folder is None or not isinstance(sink, Stream):
            first = sink.first if isinstance(sink, Rows) else 0
            return row_times(first, first + rows, step, late)
        try:
            stream = Stream(self.folder / recording_file(f"{name}.time"), ())
            for first in range(0, rows, TIMES_AT_ONCE):
                last = min(rows, first + TIMES_AT_ONCE)
                stream.append(row_times(first, last, step, late))
            return stream.close()
        except OSError:  # a full disk must not lose the recording for its times
            return row_times(0, rows, step, late)


def row_times(first: int, last: int, step: float, late: float) -> FloatArray:
    """The times (s) of some rows; the first one of all is that late."""
    times = np.arange(first, last, dtype=np.float64) * step
    return times + late if late else times


def recording_file(name: str) -> str:
    """The name of the file that a probe is recorded to."""
    return f"{slug(name, 'probe')}.npy"


def _check_room(folder: Path, size: float) -> None:
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        raise UsageError(f"cannot record to '{folder}': {error.strerror or error}") from None
    if size > free:
        text = f"recording needs {readable_bytes(size)} while it runs, and '{folder}' has "
        text += f"{readable_bytes(free)}; record less often, as with 'every: 100', or less"
        raise UsageError(text)
