"""The log of a session: what was changed, and before which tick.

In: changes and writes, as they come. Out: all of them in order, as entries of a file, and copies
that go their own way. Writes may be one a tick, and are rows of numbers, 18 bytes for a Scalar::

    log.note(Change(20, "set", ("gain.gain", 2.0)))   {"tick": 20, "call": "set", "arguments": ...}
    log.write(20, "push", 0.5)                        {"ticks": [20, 21], "ports": ["push", "push"],
    log.write(21, "push", 0.6)                         "values": [0.5, 0.6]}
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from blocks.core import FloatArray
from runtime.files import check_form

TOGETHER = 1024  # writes in one entry, which is what a copy of a log copies
_CHANGE = {"tick": int, "call": str, "arguments": list}
_WRITES = {"ticks": [int], "ports": [str], "values": list}


class Change(NamedTuple):
    """One change: the tick before which it was made, the method and its arguments."""

    tick: int
    call: str
    arguments: tuple[Any, ...]

    def __str__(self) -> str:
        return f"tick {self.tick}: {self.call}({', '.join(map(repr, self.arguments))})"


class _Writes:
    """Writes with no other change between them, so that each port has one shape."""

    def __init__(self) -> None:
        self.ports: dict[str, int] = {}
        self.shapes: list[tuple[int, ...]] = []
        self.ticks, self.which, self.values = array("q"), array("H"), array("d")

    def append(self, tick: int, port: str, value: float | FloatArray) -> None:
        number = self.ports.get(port)
        if number is None:
            number = self.ports[port] = len(self.shapes)
            self.shapes.append(np.shape(value))
        self.ticks.append(tick)
        self.which.append(number)
        if type(value) is float:
            self.values.append(value)
        else:
            self.values.extend(np.ravel(value).tolist())

    def __iter__(self) -> Iterator[Change]:
        names, first = list(self.ports), 0
        for tick, number in zip(self.ticks, self.which, strict=True):
            shape = self.shapes[number]
            last = first + math.prod(shape)
            value: Any = self.values[first]
            if shape:
                value = np.reshape(self.values[first:last], shape).tolist()
            yield Change(tick, "write", (names[number], value))
            first = last

    def copy(self) -> _Writes:
        other = _Writes()
        other.ports, other.shapes = dict(self.ports), list(self.shapes)
        other.ticks, other.which, other.values = self.ticks[:], self.which[:], self.values[:]
        return other


class Log:
    """Changes in the order in which they were made."""

    def __init__(self) -> None:
        self._parts: list[Change | _Writes] = []
        self._open = _Writes()  # the last part, if the last change was a write

    def note(self, change: Change) -> None:
        """Add a change that is no write."""
        self._close()
        self._parts.append(change)

    def write(self, tick: int, port: str, value: float | FloatArray) -> None:
        """Add a write."""
        if len(self._open.ticks) == TOGETHER:
            self._close()
        self._open.append(tick, port, value)

    def _close(self) -> None:
        """What is added from now on comes after the writes so far, which never change again."""
        if self._open.ticks:
            self._parts.append(self._open)
            self._open = _Writes()

    def __len__(self) -> int:
        closed = (len(p.ticks) if isinstance(p, _Writes) else 1 for p in self._parts)
        return sum(closed) + len(self._open.ticks)

    def __iter__(self) -> Iterator[Change]:
        for part in (*self._parts, self._open):
            if isinstance(part, _Writes):
                yield from part
            else:
                yield part

    def copy(self) -> Log:
        """A log with the same changes, to which others are added."""
        other = Log()
        other._parts, other._open = list(self._parts), self._open.copy()
        return other

    def entries(self) -> Iterator[dict[str, Any]]:
        """The log as plain values, an entry for each change or for some writes."""
        for part in (*self._parts, self._open):
            if isinstance(part, Change):
                tick, call, arguments = part
                yield {"tick": tick, "call": call, "arguments": list(arguments)}
            elif part.ticks:
                ticks, _, written = zip(*part, strict=True)
                ports, values = zip(*written, strict=True)
                yield {"ticks": list(ticks), "ports": list(ports), "values": list(values)}


def repeat(session: Any, changes: Iterable[Change]) -> None:
    """Make changes again in a session, each before its tick."""
    for tick, call, arguments in changes:
        session.step(tick - session.tick)
        getattr(session, call)(*arguments)


def changes_of(entry: Any) -> Iterator[Change]:
    """The changes in an entry.

    Raises
    ------
    ValueError : it has another form.
    """
    if isinstance(entry, Mapping) and "ticks" in entry:
        check_form(entry, _WRITES)
        for tick, *written in zip(entry["ticks"], entry["ports"], entry["values"], strict=True):
            yield Change(tick, "write", tuple(written))
    else:
        check_form(entry, _CHANGE)
        yield Change(entry["tick"], entry["call"], tuple(entry["arguments"]))
