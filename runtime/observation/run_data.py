"""The data of a run: recorded signals with times and units, metrics, and their origin.

In: recordings and metrics. Out: what a user asks of a finished run::

    result["plant.pose"]                     # array (rows, 3)
    result["plant.pose.theta"]               # array (rows,), a column of that recording
    result.time("plant.pose"), result.metrics["miss"]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

from blocks.core import FloatArray, hint
from blocks.world import World
from runtime.document import SECOND
from runtime.observation.plots import PlotSpec
from runtime.terminal import number


@dataclass(frozen=True)
class Recording:
    """One probe's recording.

    t : times (rows,) in ``time_unit``. values : (rows,) for a scalar, (rows, columns) for a record
    or several signals, (rows, n, columns) for a table. ``addresses`` gives each signal its columns.
    ``names`` are what figures call the columns, '' for those that are called by their label.
    ``held`` tells of each column whether it keeps its value from one row to the next.
    """

    name: str
    t: FloatArray
    values: FloatArray
    labels: tuple[str, ...]
    units: tuple[str, ...]
    kinds: tuple[str, ...]
    addresses: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    auto: bool = False
    names: tuple[str, ...] = ()
    held: tuple[bool, ...] = ()
    time_unit: str = SECOND

    @property
    def display_names(self) -> tuple[str, ...]:
        """What figures call the columns."""
        names = self.names or ("",) * len(self.labels)
        return tuple(name or label for name, label in zip(names, self.labels, strict=True))

    @property
    def columns(self) -> FloatArray:
        """The values as (rows, columns), also those of a scalar or a table."""
        return self.values.reshape(len(self.values), math.prod(self.values.shape[1:]))

    def column(self, address: str) -> FloatArray:
        """The values of one of the signals that the probe holds."""
        start, stop = self.addresses[address]
        if len(self.addresses) == 1:
            return self.values
        return self.values[:, start] if stop == start + 1 else self.values[:, start:stop]


OriginFiles = tuple[dict[str, str], dict[str, bytes]]


def _constant_origin(texts: dict[str, str], files: dict[str, bytes]) -> OriginFiles:
    return texts, files


@dataclass
class RunData:
    """A run: ``result["plant.pose"]`` is an array, ``result.metrics`` a dict.

    Names are those of probes, or the addresses that they record. ``world`` holds the graph's
    walls, if any, ``states`` the blocks' states at the end of the run, ``units`` the units of the
    metrics that have one, and ``never`` what no value of a metric means. ``origin`` returns the
    graph's texts and the files of its own blocks, by name; it is called only when they are needed,
    which is rare in a sweep.
    """

    title: str
    probes: dict[str, Recording]
    metrics: dict[str, float | None]
    plots: list[PlotSpec]
    manifest: dict[str, Any]
    origin: Callable[[], OriginFiles] = lambda: ({}, {})
    notes: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    world: World | None = None
    units: dict[str, str] = field(default_factory=dict)
    states: dict[str, FloatArray] = field(default_factory=dict)
    never: dict[str, str] = field(default_factory=dict)

    def metric_text(self, name: str) -> str:
        """A metric's value in words: a number, ``never settled``, or a dash for no value."""
        value = self.metrics.get(name)
        if value is None and name in self.metrics and self.status != "interrupted":
            return self.never.get(name, number(value))
        return number(value)

    @cached_property
    def _made(self) -> OriginFiles:
        return self.origin()

    @cached_property
    def texts(self) -> dict[str, str]:
        """The graph as written and as run, by file name."""
        return self._made[0]

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The files of the graph's own blocks, by their names in the graph's text."""
        return self._made[1]

    def __getstate__(self) -> dict[str, Any]:
        # `origin` refers to the graph and its blocks, which a worker cannot send; its results it
        # can.
        texts, files = self.texts, self.files
        kept = {name: value for name, value in self.__dict__.items() if name != "_made"}
        return kept | {"origin": partial(_constant_origin, texts, files)}

    @property
    def status(self) -> str:
        """complete, interrupted or failed."""
        return str(self.manifest["status"])

    @property
    def time_unit(self) -> str:
        """What its times are in."""
        return str(self.manifest.get("time_unit", SECOND))

    @property
    def ticks(self) -> int:
        return int(self.manifest["ticks"])

    def __getitem__(self, name: str) -> FloatArray:
        recording, address = self._find(name)
        return recording.column(address) if address else recording.values

    def time(self, name: str) -> FloatArray:
        """Times (s) of the rows of ``result[name]``."""
        return self._find(name)[0].t

    def recording(self, name: str) -> Recording:
        """The signals of ``result[name]`` with their times, labels and units."""
        whole_recording, address = self._find(name)
        if not address:
            return whole_recording
        start, stop = whole_recording.addresses[address]
        return replace(
            whole_recording,
            name=name,
            values=whole_recording.column(address),
            labels=whole_recording.labels[start:stop],
            units=whole_recording.units[start:stop],
            names=whole_recording.names[start:stop],
            held=whole_recording.held[start:stop],
            addresses={address: (0, stop - start)},
        )

    def __contains__(self, name: object) -> bool:
        return name in set(self)

    def __iter__(self) -> Iterator[str]:
        yield from self.probes
        for recording in self.probes.values():
            yield from (a for a in recording.addresses if a not in self.probes)

    def _find(self, name: str) -> tuple[Recording, str]:
        if name in self.probes:
            return self.probes[name], ""
        for recording in self.probes.values():
            if name in recording.addresses:
                return recording, name
        whole, _, _ = name.rpartition(".")
        for recording in self.probes.values():
            if whole in recording.addresses and name in recording.labels:
                at = recording.labels.index(name)
                values = recording.values[:, at]
                unit = (recording.units[at],)
                return Recording(
                    *(name, recording.t, values, (name,), unit, ("Scalar",), {name: (0, 1)}),
                    held=recording.held[at : at + 1],
                    time_unit=recording.time_unit,
                ), ""
        known = sorted(self)
        raise KeyError(f"'{name}' was not recorded{hint(name, known) or ': ' + ', '.join(known)}")

    def __repr__(self) -> str:
        metrics = ", ".join(
            f"{k}={v:.4g}" if v is not None else f"{k}=None" for k, v in self.metrics.items()
        )
        state = f"{self.status}, {self.ticks} ticks"
        return f"<{type(self).__name__} of '{self.title}': {state}; {metrics}>"
