"""Probes: the recorded signals, with the name and unit of each column.

In: an address and the network. Out: a :class:`Signal`, and a :class:`Probe` of one or several::

    probes: {errors: {of: [error.position, error.heading], every: 10}}
    labels ("error.position.x", "error.position.y", "error.heading"), units ("m", "m", "rad")
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

from blocks.core import SignalType, Vector, misspelt, state_shape
from blocks.neural import Synapse, table_shape
from runtime.document import TIME_UNITS, Node, in_time, strings
from runtime.errors import Problems
from runtime.network import (
    Endpoint,
    Network,
    columns,
    component_type,
    is_range,
    unknown_component,
)

MAX_RECORDING = 1024**4
PROBE_KEYS = {
    "of": "an address, or several side by side",
    "every": "base ticks between two rows, or {period, offset, mean: true}, a mean of each period",
    "synapse": "filter of the values: a time constant in s, or alpha(tau), second_order(...)",
    "label": "what figures call it: a string for each signal, or for each column",
    "unit": "of signals that have none: a string for each signal, or for each column",
    "events": "blocks of which the times of events are recorded, in place of 'of'",
}


@dataclass(frozen=True)
class Signal:
    """A recorded output or state: its source, its shape, the names of its columns.

    ``address`` is written in the graph, ``end`` is its source once removed blocks are bypassed.
    ``name`` is what figures call it, '' for its address, and ``column_names`` what they call each
    column. ``publisher`` is the method of the block that describes the neurons behind a signal, if
    it is their tuning that is recorded. ``held`` tells whether it keeps its value between ticks.
    ``every`` are the ticks between two new values, ``first`` is that of the first one.
    """

    address: str
    end: Endpoint
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    kind: str
    every: int
    is_state: bool = False
    is_event: bool = False
    constant: bool = False
    name: str = ""
    column_names: tuple[str, ...] = ()
    publisher: str = ""
    held: bool = False
    first: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """What figures call each column; '' for its label."""
        if self.column_names:
            return self.column_names
        if not self.name or len(self.labels) < 2:
            return (self.name,) * len(self.labels)
        return tuple(f"{self.name}{label[len(self.address) :]}" for label in self.labels)

    @property
    def width(self) -> int:
        """Number of columns in a probe of several signals."""
        return self.shape[0] if self.shape else 1


Describe = Callable[[Sequence[Signal], Sequence[str]], Sequence[Signal]]


@dataclass(frozen=True)
class Probe:
    """One recorded array: one signal in its own shape, or several signals as columns.

    ``every`` are the ticks between two rows, ``first`` is that of the first row. A ``synapse``
    filters the values of all ticks, of which the rows then show the filtered ones. With ``mean``, a
    row is the mean of the ``every`` ticks that end with its own.
    """

    name: str
    signals: tuple[Signal, ...]
    every: int
    auto: bool = False
    synapse: Synapse | None = None
    first: int = 0
    mean: bool = False

    @property
    def is_filtered(self) -> bool:
        """Whether rows are made of the values of all ticks."""
        late = self.first >= self.every > 0  # rows at the same phase come before the first one
        return not self.constant and (self.synapse is not None or self.mean or late)

    @cached_property
    def inputs(self) -> tuple[int, int]:
        """Ticks between two values that are read, and the first of these ticks.

        For a synapse these are those at which the signal is new, from the first row on.
        """
        if not self.is_filtered:
            return self.every, self.first
        every, first = own_ticks(self.signals)
        return (every, first) if first <= self.first else (math.gcd(every, first), 0)

    @cached_property
    def constant(self) -> bool:
        return all(signal.constant for signal in self.signals)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one row."""
        if len(self.signals) == 1:
            return self.signals[0].shape
        # Side by side; a signal alone keeps its own shape, so that a scalar is (rows,).
        return (sum(signal.width for signal in self.signals),)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        return tuple(label for signal in self.signals for label in signal.labels)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What figures call each column; '' for its label."""
        return tuple(name for signal in self.signals for name in signal.names)

    @cached_property
    def units(self) -> tuple[str, ...]:
        return tuple(unit for signal in self.signals for unit in signal.units)

    @cached_property
    def held(self) -> tuple[bool, ...]:
        """Whether each column keeps its value from one row to the next; a filtered one does not."""
        return tuple(s.held and not self.is_filtered for s in self.signals for _ in s.labels)

    def clash(self) -> str:
        """Why the signals cannot share a probe; '' if they can."""
        if len(self.signals) > 1 and any(len(signal.shape) > 1 for signal in self.signals):
            return "a table needs a probe of its own"
        if len({signal.constant for signal in self.signals}) > 1:
            return "constant and changing signals need separate probes"
        if self.synapse is not None and self.constant:
            return "a constant needs no synapse"
        return self.missed_event()

    def missed_event(self) -> str:
        """Which event a probe would miss or repeat; '' if none."""
        for signal in self.signals:
            # A row is the signal at its tick: an event between two rows would be lost, and one that
            # is held would be counted twice.
            if signal.is_event and (signal.every, signal.first) != self.inputs:
                new = "on each tick" if signal.every == 1 else f"every {signal.every} ticks"
                message = (
                    f"'{signal.end}' is new {new}: every {self.every} would miss or repeat some"
                )
                return f"{message}; probe it alone, without 'every' or with a 'synapse'"
        return ""

    def rows(self, ticks: int) -> int:
        """Rows of so many ticks, from the start."""
        return 1 if self.constant else _due(ticks, self.every, self.first)

    def values_read(self, ticks: int) -> int:
        """Values of so many ticks, of which a synapse makes rows."""
        return _due(ticks, *self.inputs)

    @property
    def row_bytes(self) -> int:
        """Bytes of one row."""
        return 8 * math.prod(self.shape)

    def size(self, ticks: int) -> int:
        """Bytes of the recording."""
        return self.row_bytes * self.rows(ticks)


def event_blocks(network: Network, node: Node, address: str, problems: Problems) -> tuple[str, ...]:
    """The blocks whose events a probe records; those that are removed are left out."""
    found = []
    for item, place in strings(node, address, "a block, as in relay", problems):
        entry = network.entries.get(item.value)
        if entry is None and item.value not in network.removed_entries:
            text = f"there is no block '{item.value}'"
            message = misspelt("unknown-block", text, item.value, network.entries)
            problems.add(item.where, place, message)
        elif entry is not None and entry.cls.spec.guards is None:
            text = f"a {entry.cls.__name__} has no events; expected a block such as Relay"
            problems.add(item.where, place, text)
        elif entry is not None:
            found.append(item.value)
    return tuple(found)


def _due(ticks: int, every: int, first: int) -> int:
    """How many of the first ticks are ``first``, ``first + every``, ..."""
    return max(0, -(-(ticks - first) // every))


def own_ticks(signals: Sequence[Signal]) -> tuple[int, int]:
    """Ticks between two new values of the fastest of some signals, and the first of these ticks.

    If signals begin at different ticks, as few ticks as have all of these in them.
    """
    first = min(signal.first for signal in signals)
    late = (signal.first - first for signal in signals)
    return math.gcd(min(signal.every for signal in signals), *late), first


def ticks_of_rows(signals: Sequence[Signal], every: int) -> tuple[int, int]:
    """Ticks between two rows, and the first one; ``every`` is what is written, 0 for nothing.

    Rows that are as far apart as ticks of the block, or a multiple of that, are on its own ticks.
    """
    own, first = own_ticks(signals)
    every = every or own
    return every, 0 if every % own else first


def describe_signals(
    signals: list[Signal | None],
    node: Node | None,
    address: str,
    describe: Describe,
    problems: Problems,
) -> list[Signal | None]:
    """The signals of a probe, None for one of a removed block, with the names or units written.

    How many columns a removed block had is not known: a list by column is then left out.
    """
    if node is None:
        return signals
    words = [item.value for item, _ in strings(node, address, "a string", problems)]
    if not words or (None in signals and len(words) != len(signals)):
        return signals
    present = [signal for signal in signals if signal is not None]
    if len(present) < len(signals):
        words = [text for text, signal in zip(words, signals, strict=True) if signal]
    try:
        return list(describe(present, words)) if present else signals
    except ValueError as error:
        problems.add(node.where, address, str(error))
        return signals


def with_names(signals: Sequence[Signal], names: Sequence[str]) -> list[Signal]:
    """Signals with names for figures: one for each signal, or one for each column.

    Raises
    ------
    ValueError : another number of names.
    """
    if len(names) == len(signals):
        return [replace(each, name=name) for each, name in zip(signals, names, strict=True)]
    rows = _by_column(signals, names)
    return [replace(each, column_names=row) for each, row in zip(signals, rows, strict=True)]


def with_units(signals: Sequence[Signal], units: Sequence[str]) -> list[Signal]:
    """Signals with units: one for each signal, or one for each column.

    Raises
    ------
    ValueError : another number of units, or a signal has a unit of its own.
    """
    if len(units) == len(signals):
        units = [u for u, each in zip(units, signals, strict=True) for _ in each.labels]
    rows = _by_column(signals, units)
    for each, row in zip(signals, rows, strict=True):
        if any(each.units) and each.units != row:
            own = ", ".join(unit or "none" for unit in dict.fromkeys(each.units))
            raise ValueError(f"'{each.address}' has a unit of its own: {own}")
    return [replace(each, units=row) for each, row in zip(signals, rows, strict=True)]


def _by_column(signals: Sequence[Signal], words: Sequence[str]) -> list[tuple[str, ...]]:
    """The words for each signal's columns."""
    counts = [len(signal.labels) for signal in signals]
    if len(words) != sum(counts):
        each = f"each of the {len(signals)} signals" if len(signals) > 1 else "the signal"
        columns = f", or for each of the {sum(counts)} columns" if sum(counts) > len(counts) else ""
        raise ValueError(f"expected a string for {each}{columns}; got {len(words)}")
    rest = iter(words)
    return [tuple(islice(rest, count)) for count in counts]


def no_component(network: Network, end: Endpoint) -> str:
    """The error of an address for which :func:`make_signal` returns None."""
    if (end.block, end.port) in network.types:
        return unknown_component(network.types[end.block, end.port], end)
    return f"state '{end.block}.{end.port}' has no component '{end.component}'"


def make_signal(network: Network, end: Endpoint, label: str) -> Signal | None:
    """The signal at ``end``; None if the component does not exist."""
    entry = network.entries[end.block]
    spec = entry.cls.spec
    if end.port in spec.states:
        state = spec.states[end.port]
        shape = state_shape(entry.block, state, network.context(end.block))
        kind = state.signal.name if state.signal is not None else "State"
        unit = in_time(state.unit, network.time_unit)
        if is_range(end.component):
            part = columns(Vector(shape[0]), end.component) if len(shape) == 1 else None
            if not isinstance(part, slice):
                return None
            shape = (part.stop - part.start,)
        elif end.component:
            number = int(end.component) if end.component.isdecimal() else -1
            if len(shape) != 1 or not 0 <= number < shape[0] or str(number) != end.component:
                return None
            shape = ()
        count = shape[0] if shape else 1
        labels = (label,) if not shape else tuple(f"{label}[{i}]" for i in range(count))
        units = (unit,) * count
        return Signal(
            *(label, end, shape, labels, units, kind, entry.every, True, state.event),
            held=not state.continuous,
            first=entry.offset,
        )
    whole = network.types[end.block, end.port]
    kind_at = component_type(whole, end)
    if kind_at is None:
        return None
    labels, units = _columns(whole, end, label, entry.block.port_unit(end.port))
    units = tuple(in_time(unit, network.time_unit) for unit in units)
    constant = spec.outputs[end.port].constant
    shape, name = kind_at.shape, kind_at.name
    name_shown = "" if end.component or shape else spec.outputs[end.port].label
    # Figures draw steps for what is held between ticks, and straight lines for what moves.
    held = (end.block, end.port) not in network.moving
    every, offset = entry.output_rate
    return Signal(
        *(label, end, shape, labels, units, name, every),
        constant=constant,
        name=name_shown,
        held=held,
        first=0 if constant else offset,
    )


def make_tuning(network: Network, end: Endpoint, label: str) -> Signal | None:
    """The tuning of the neurons of a block, recorded once; None if it publishes none."""
    outputs = network.entries[end.block].cls.spec.outputs
    published = [(name, port.publishes) for name, port in outputs.items() if port.publishes]
    if not published or end.component:
        return None
    (port, method), lengths = published[0], network.context(end.block).lengths
    every, end = network.entries[end.block].every, Endpoint(end.block, port)
    # Dimensions that nothing decides are a problem by themselves, and the graph does not run.
    shape, address = table_shape({"d": 1, **lengths}), f"{label}.tuning"
    return Signal(
        *(address, end, shape, (address,), (TIME_UNITS[network.time_unit],), "Tuning", every),
        constant=True,
        publisher=method,
    )


def _columns(
    whole: SignalType, end: Endpoint, label: str, unit: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    part = columns(whole, end.component) if is_range(end.component) else None
    own_units = tuple(own for _, own in whole.rows)
    if isinstance(part, slice):
        base = label.split("[")[0]
        units = whole.units or (unit,)
        each = units if whole.form == "record" else (unit or units[0],) * whole.shape[0]
        return tuple(f"{base}.{name}" for name in whole.names[part]), (own_units or each)[part]
    if whole.rows:
        if end.component or whole.form == "scalar":
            return (label,), (own_units[whole.column(end.component) or 0],)
        return tuple(f"{label}.{name}" for name in whole.names), own_units
    if whole.form == "record":
        if end.component:
            return (label,), (whole.units[whole.column(end.component) or 0],)
        return tuple(f"{label}.{c}" for c in whole.components), whole.units
    if whole.form == "scalar" or end.component:
        return (label,), (unit,)
    if whole.components:
        return tuple(f"{label}.{c}" for c in whole.components), whole.units
    count = whole.shape[0]
    unit = unit or (whole.units[0] if whole.units else "")
    labels = (label,) if count == 1 else tuple(f"{label}.{i}" for i in range(count))
    return labels, (unit,) * count
