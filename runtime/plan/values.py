"""The values of a plan: signals, states, and what reads them.

``plant.pose.x`` is the source of component ``x`` of the signal ``plant.pose``; the argument of an
input is what is wired to it, in the type that the method takes. All continuous states of a graph
are one row, in which a state has a slot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from blocks.core import SignalType
from runtime.network import Endpoint, columns, component_type

Port = tuple[str, str]  # a block and one of its outputs


@dataclass(frozen=True)
class Signal:
    """An output of a block, with its type."""

    block: str
    port: str
    kind: SignalType

    @property
    def key(self) -> Port:
        return self.block, self.port

    def __str__(self) -> str:
        return f"{self.block}.{self.port}"


@dataclass(frozen=True)
class StateArray:
    """A declared state of a block, with its shape."""

    block: str
    name: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def __str__(self) -> str:
        return f"{self.block}.{self.name}"


@dataclass(frozen=True)
class Slot(StateArray):
    """A continuous state, and where it begins in the row of all continuous states of a graph.

    As what a call writes, it is the state's rate of change. ``names`` are those of its components,
    if they have any.
    """

    start: int
    names: tuple[str, ...] = ()

    @property
    def stop(self) -> int:
        return self.start + self.size

    def address(self, column: int) -> str:
        """The address of one number of the row, as probes write it."""
        if self.names:
            return f"{self}.{self.names[column - self.start]}"
        return str(self) + (f".{column - self.start}" if self.shape else "")

    def component(self, column: int) -> str:
        """The address of one number of the row, for messages."""
        if self.names:
            return self.names[column - self.start]
        inside = f"[{column - self.start}]" if self.shape else ""
        return f"{self.name}{inside}"


@dataclass(frozen=True)
class GuardSlot(Slot):
    """The guards of a block, and where they begin in the row of all guards of a graph."""


@dataclass(frozen=True)
class Source:
    """What is read: a signal or a state, or a component of it."""

    whole: Signal | StateArray
    component: str = ""

    @property
    def kind(self) -> SignalType:
        """The type of what is read of a signal."""
        if not isinstance(self.whole, Signal):
            raise TypeError(f"{self.whole} is a state")
        end = Endpoint(*self.whole.key, self.component)
        return component_type(self.whole.kind, end) or self.whole.kind

    @property
    def columns(self) -> int | slice | None:
        """The index, or the indices, of the component of a signal."""
        return columns(self.whole.kind, self.component) if isinstance(self.whole, Signal) else None

    def __str__(self) -> str:
        inside = f"[{self.component}]" if ":" in self.component else f".{self.component}"
        return f"{self.whole}{inside}" if self.component else str(self.whole)


@dataclass(frozen=True)
class Argument:
    """What a method of a block takes for one of its parameters.

    port : an input, or an output of the block itself.
    kind : the type in which the method takes each source.
    sources : what is wired to it: one, none if the input is open, any number if it is variadic.
    default : the value of an open input.
    fills : whether a source that is one number counts for all components of the kind.
    """

    block: str
    port: str
    kind: SignalType
    sources: tuple[Source, ...]
    is_variadic: bool = False
    default: float = 0.0
    fills: bool = False

    def __str__(self) -> str:
        texts = ", ".join(map(str, self.sources))
        if self.is_variadic:
            return f"({texts})"
        return texts or f"{self.default:g}"


@dataclass(frozen=True)
class Row:
    """The row of all continuous states of a graph, which a solver integrates."""

    slots: tuple[Slot, ...] = ()

    @property
    def size(self) -> int:
        """The number of continuous states, each component counted."""
        return self.slots[-1].stop if self.slots else 0

    @cached_property
    def by_block(self) -> dict[str, tuple[Slot, ...]]:
        """The slots of each block that has some."""
        found: dict[str, tuple[Slot, ...]] = {}
        for slot in self.slots:
            found[slot.block] = (*found.get(slot.block, ()), slot)
        return found

    def of(self, block: str) -> tuple[Slot, ...]:
        return self.by_block.get(block, ())

    def at(self, column: int) -> Slot:
        """The slot of a number of the row."""
        return next(slot for slot in self.slots if slot.start <= column < slot.stop)


Target = Signal | StateArray
