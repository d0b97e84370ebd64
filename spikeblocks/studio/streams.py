"""What of a session's recordings a page gets: few enough rows to draw, each of them once.

In: the probes of a graph, and the rows of a session since the last frame. Out: a frame, which is a
head in JSON, padded, and float32 numbers. A stream is one of

    curves   the least and the largest value of each ``stride`` rows, so that no peak is lost
    rows     every ``stride``-th row: poses, scans, paths
    events   pairs (row, neuron), one for each spike
    constant one row, sent once
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from runtime.observation import Probe

Array = npt.NDArray[np.float64]
Mode = Literal["curves", "rows", "events", "constant"]
ROWS = 6000  # of a stream up to the end of the run
NUMBERS = 4_000_000  # of a stream up to the end of the run, at most


class Stream:
    """One probe on its way to a page.

    Parameters
    ----------
    mode : see above. ticks : of the whole run.
    """

    def __init__(self, probe: Probe, mode: Mode, ticks: int) -> None:
        self.probe, self.mode = probe, "constant" if probe.constant else mode
        rows = max(1, probe.rows(ticks))
        width = max(1, math.prod(probe.shape))
        most = max(200, min(ROWS, NUMBERS // width))
        self.stride = 1 if self.mode in ("events", "constant") else max(1, -(-rows // most))
        if self.mode == "curves" and self.stride > 1:
            self.stride *= 2  # of which two rows are made
        self.taken = 0  # rows of the probe that were sent

    @property
    def next_tick(self) -> int:
        """The tick of the first row that was not sent."""
        return self.probe.first + self.taken * self.probe.every

    def describe(self, dt: float) -> dict[str, Any]:
        """What the page needs to know: the time of row k is ``start + k * step``."""
        probe = self.probe
        is_pair = self.mode == "curves" and self.stride > 1
        return {
            "mode": self.mode,
            "shape": list(probe.shape),
            "width": 2 if self.mode == "events" else max(1, math.prod(probe.shape)),
            "start": probe.first * dt,
            "step": probe.every * dt * (self.stride / 2 if is_pair else self.stride),
            "kind": probe.signals[0].kind if len(probe.signals) == 1 else "",
        }

    def go_back(self, tick: int) -> None:
        """Send the rows from a tick on again, which have changed."""
        before = max(0, -(-(tick - self.probe.first) // max(1, self.probe.every)))
        self.taken = min(self.taken, before // self.stride * self.stride)

    def take(self, first: int, rows: Array) -> tuple[int, Array] | None:
        """The rows that are sent of those from number ``first`` on, and the number of the first.

        For events, that is the number of the row from which on they are new.
        """
        new = rows[max(0, self.taken - first) :]
        start = max(first, self.taken)
        if self.mode == "constant":
            if start or not len(new):
                return None
            self.taken = 1
            return 0, new
        full = len(new) // self.stride * self.stride
        # Rows that run.keep has dropped in between leave a gap, which is filled by what follows.
        if full == 0:
            return None
        self.taken = start + full
        new = new[:full]
        if self.mode == "events":
            at, neuron = np.nonzero(new.reshape(len(new), -1))
            return start, np.column_stack([at + start, neuron]).astype(np.float64)
        if self.mode == "rows" or self.stride == 1:
            return start // self.stride, new[:: self.stride]
        grouped = new.reshape(full // self.stride, self.stride, -1)
        with np.errstate(invalid="ignore"):
            ends = np.stack([grouped.min(axis=1), grouped.max(axis=1)], axis=1)
        return 2 * (start // self.stride), ends.reshape(2 * len(grouped), -1)


class Streams:
    """All streams of a graph.

    Parameters
    ----------
    probes : by name. modes : of those that a page draws. ticks : of the run. dt : its step.
    """

    def __init__(
        self, probes: Mapping[str, Probe], modes: Mapping[str, Mode], ticks: int, dt: float
    ) -> None:
        self.dt = dt
        self.streams = {n: Stream(probes[n], mode, ticks) for n, mode in modes.items()}

    def describe(self) -> dict[str, Any]:
        """What the page needs to know of each."""
        return {name: stream.describe(self.dt) for name, stream in self.streams.items()}

    @property
    def since(self) -> int:
        """The tick from which on rows are needed."""
        moving = [s.next_tick for s in self.streams.values() if s.mode != "constant" or not s.taken]
        return min(moving, default=0)

    def go_back(self, tick: int) -> None:
        """Send all rows from a tick on again."""
        for stream in self.streams.values():
            stream.go_back(tick)

    def begin_again(self) -> None:
        """Send everything again."""
        for stream in self.streams.values():
            stream.taken = 0

    def take(self, rows: Mapping[str, tuple[Array, Array]]) -> Iterable[tuple[str, int, Array]]:
        """What is new of a session's rows."""
        for name, stream in self.streams.items():
            if name not in rows:
                continue
            probe = stream.probe
            times, values = rows[name]
            # Those that run.keep has dropped are not there.
            is_late = len(times) and not probe.constant
            first = round((times[0] / self.dt - probe.first) / probe.every) if is_late else 0
            found = stream.take(first, values)
            if found is not None:
                yield (name, *found)


def pack(head: Mapping[str, Any], parts: Iterable[tuple[str, int, Array]]) -> bytes:
    """A frame: the length of the head, the head padded to four bytes, the numbers."""
    blobs, described, offset = [], [], 0
    for name, first, values in parts:
        numbers = np.ascontiguousarray(values, dtype="<f4").ravel()
        described.append([name, first, offset, len(numbers)])
        offset += len(numbers)
        blobs.append(numbers.tobytes())
    text = json.dumps({**head, "parts": described}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *blobs])
