"""Recording of probes: in arrays in memory, or in files on disk if memory would not suffice.

A recording on disk is one ``.npy`` file per probe. Rows are collected in a buffer that is appended
when it is full; the file's header is updated each time, so that a killed run leaves a readable
file.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Mapping
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


def buffered(probe: Probe, gathered: Mapping[str, int]) -> int:
    """Rows of the buffer that the plan fills again and again; 0 if it fills the whole recording."""
    return gathered.get(probe.name, 0) if probe.synapse is None else FILTERED_AT_ONCE


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


class Recorder:
    """The arrays that a run's probes fill.

    Parameters
    ----------
    probes : by name.
    ticks : of the whole run. dt : its base step (s).
    gathered : rows of the buffers of the probes that go to disk, see :func:`buffer_rows`.
    folder : for their files; None for a temporary folder that is removed with the recorder.

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
    ) -> None:
        self.probes, self.gathered = probes, gathered
        self.streams: dict[str, Stream] = {}
        self.full = False
        self.constants_saved = False
        self.folder: Path | None = None
        # Each row with its time; a stream is written once more, into the run's own file.
        size = sum(probe.size(ticks) + 8 * probe.rows(ticks) for probe in probes.values())
        if gathered:
            self.folder = self._opened(folder, 2 * size)
            for name in gathered:
                path = self.folder / recording_file(name)
                try:
                    self.streams[name] = Stream(path, probes[name].shape)
                except OSError as error:
                    raise UsageError(f"cannot record to '{path}': {error.strerror}") from None
        elif folder is not None:
            _check_room(folder.parent, size)
        self.arrays = {
            name: np.full((buffered(probe, gathered) or probe.rows(ticks), *probe.shape), np.nan)
            for name, probe in probes.items()
        }
        self.filters = {
            name: ProbeFilter(probe, probe.synapse, ticks, dt)
            for name, probe in probes.items()
            if probe.synapse is not None
        }
        self.filtered = {
            name: np.full((probes[name].rows(ticks), *probes[name].shape), np.nan)
            for name in self.filters.keys() - self.streams.keys()
        }

    def _opened(self, folder: Path | None, size: int) -> Path:
        try:
            if folder is None:
                folder = Path(mkdtemp(prefix="spikeblocks-"))
                # A mapped file stays readable after it is removed.
                finalize(self, shutil.rmtree, folder, ignore_errors=True)
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"cannot record to '{folder}': {error.strerror or error}") from None
        _check_room(folder, size)
        return folder

    def boundary(self) -> int:
        """How many ticks may be done before :meth:`flush` must be called."""
        ends = [
            (stream.rows + self.gathered[name]) * self.probes[name].every
            for name, stream in self.streams.items()
            if name not in self.filters
        ]
        ends += [
            (each.taken + FILTERED_AT_ONCE) * each.probe.input_every
            for each in self.filters.values()
        ]
        return min(ends, default=sys.maxsize)

    def flush(self, tick: int) -> None:
        """Write the buffers that are full once ``tick`` ticks are done.

        Raises
        ------
        UsageError : the disk is full or not available.
        """
        for name, stream in self.streams.items():
            is_full = self.probes[name].rows(tick) - stream.rows >= self.gathered[name]
            if name not in self.filters and is_full:
                self._append(stream, self.arrays[name])
        for name, each in self.filters.items():
            if -(-tick // each.probe.input_every) - each.taken >= FILTERED_AT_ONCE:
                self._filter(name, FILTERED_AT_ONCE)
        if self.folder is not None and not self.constants_saved:
            self.constants_saved = True
            for name in self.probes.keys() - self.streams.keys():
                np.save(self.folder / recording_file(name), self.arrays[name])

    def _filter(self, name: str, count: int) -> None:
        """Pass the next values of a probe through its synapse, and keep the rows."""
        made = self.filters[name].made
        rows = self.filters[name].take(self.arrays[name][:count])
        if name in self.streams:
            self._append(self.streams[name], rows)
        else:
            self.filtered[name][made : made + len(rows)] = rows

    def _append(self, stream: Stream, rows: FloatArray) -> None:
        try:
            stream.append(rows)
        except OSError as error:
            self.full = True
            message = f"cannot record to '{stream.path}': {error.strerror or error}"
            raise UsageError(f"{message}; {stream.rows} rows of it are kept") from None

    def finish(self, tick: int) -> dict[str, FloatArray]:
        """The rows of all probes after the last tick, the ``tick``-th."""
        found = {}
        for name, probe in self.probes.items():
            filled = min(1, tick) if probe.constant else probe.rows(tick)
            if name in self.filters and not self.full:
                with suppress(UsageError):
                    self._filter(name, -(-tick // probe.input_every) - self.filters[name].taken)
            if name not in self.streams:
                found[name] = self.filtered.get(name, self.arrays[name])[:filled]
                continue
            stream = self.streams[name]
            left = filled - stream.rows
            if name not in self.filters and left > 0 and not self.full:
                # On a full disk the last rows are lost; the others are kept.
                with suppress(UsageError):
                    self._append(stream, self.arrays[name][:left])
            found[name] = stream.close()[:filled]
        return found

    def times(self, name: str, rows: int, dt: float) -> FloatArray:
        """The times (s) of a probe's rows, k * every * dt, on disk if the rows are."""
        step = self.probes[name].every * dt
        if self.folder is None or name not in self.streams:
            return np.arange(rows, dtype=np.float64) * step
        try:
            stream = Stream(self.folder / recording_file(f"{name}.time"), ())
            for first in range(0, rows, TIMES_AT_ONCE):
                last = min(rows, first + TIMES_AT_ONCE)
                stream.append(np.arange(first, last, dtype=np.float64) * step)
            return stream.close()
        except OSError:  # a full disk must not lose the recording for its times
            return np.arange(rows, dtype=np.float64) * step


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
