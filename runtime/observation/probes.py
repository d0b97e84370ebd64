"""Recording signals: what a probe sees at an address, column by column with names and units."""

from __future__ import annotations

import math
from dataclasses import dataclass

from blocks.core import SignalType
from runtime.network import Endpoint, Network, component_type, state_shape, unknown_component

MAX_RECORDING = 1024**4


@dataclass(frozen=True)
class Signal:
    """A recorded output or state: where it comes from, its shape, its columns' names.

    ``address`` is what the graph calls it, ``end`` where that leads once blocks are taken out.
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

    @property
    def width(self) -> int:
        """Number of columns, beside others."""
        return self.shape[0] if self.shape else 1


@dataclass(frozen=True)
class Probe:
    """One recorded array: a signal in its own shape, or several side by side as columns."""

    name: str
    signals: tuple[Signal, ...]
    every: int
    auto: bool = False

    @property
    def constant(self) -> bool:
        return all(signal.constant for signal in self.signals)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one row."""
        if len(self.signals) == 1:
            return self.signals[0].shape
        return (sum(signal.width for signal in self.signals),)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label for signal in self.signals for label in signal.labels)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(unit for signal in self.signals for unit in signal.units)

    def clash(self) -> str:
        """Why the signals cannot stand side by side; '' if they can."""
        if len(self.signals) > 1 and any(len(signal.shape) > 1 for signal in self.signals):
            return "a table cannot stand beside others; probe it alone"
        if len({signal.constant for signal in self.signals}) > 1:
            return "constant and moving signals need probes of their own"
        return self.missed()

    def missed(self) -> str:
        """Which event would be missed or repeated; '' if none."""
        for signal in self.signals:
            if signal.is_event and signal.every != self.every:
                new = "on each tick" if signal.every == 1 else f"every {signal.every} ticks"
                message = (
                    f"'{signal.end}' is new {new}: every {self.every} would miss or repeat some"
                )
                return f"{message}; probe it alone, without 'every'"
        return ""

    def rows(self, ticks: int) -> int:
        return 1 if self.constant else -(-ticks // self.every)

    @property
    def row_bytes(self) -> int:
        """Bytes of one row."""
        return 8 * math.prod(self.shape)

    def size(self, ticks: int) -> int:
        """Bytes that its recording takes."""
        return self.row_bytes * self.rows(ticks)


def readable_bytes(size: float) -> str:
    """A number of bytes for people: 512 MiB."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if size < 1024:
            return f"{size:.4g} {unit}"
        size /= 1024
    return f"{size:.4g} TiB"


def no_component(network: Network, end: Endpoint) -> str:
    """What is wrong with an address for which :func:`make_signal` finds nothing."""
    if (end.block, end.port) in network.types:
        return unknown_component(network.types[end.block, end.port], end)
    return f"state '{end.block}.{end.port}' has no component '{end.component}'"


def make_signal(network: Network, end: Endpoint, label: str) -> Signal | None:
    """Describe what a probe at ``end`` sees; None where the component does not exist."""
    entry = network.entries[end.block]
    spec = entry.cls.spec
    if end.port in spec.states:
        state = spec.states[end.port]
        shape = state_shape(entry.made.sizes(), state, network.context(end.block), spec)
        kind = state.signal.name if state.signal is not None else "State"
        unit = state.unit
        if end.component:
            number = int(end.component) if end.component.isdecimal() else -1
            if len(shape) != 1 or not 0 <= number < shape[0] or str(number) != end.component:
                return None
            shape = ()
        count = shape[0] if shape else 1
        labels = (label,) if not shape else tuple(f"{label}[{i}]" for i in range(count))
        units = (unit,) * count
        return Signal(label, end, shape, labels, units, kind, entry.every, True, state.event)
    whole = network.types[end.block, end.port]
    kind_at = component_type(whole, end)
    if kind_at is None:
        return None
    labels, units = _columns(whole, end, label, spec.outputs[end.port].unit)
    constant = spec.outputs[end.port].constant
    shape, name = kind_at.shape, kind_at.name
    return Signal(label, end, shape, labels, units, name, entry.every, constant=constant)


def _columns(
    whole: SignalType, end: Endpoint, label: str, unit: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
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
