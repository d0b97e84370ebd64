"""The continuous part of a plan: which states a solver integrates, and what each stage computes.

A solver asks for derivatives at times between ticks. An output is computed again there if it may
change between ticks (``Network.moving``). Everything else holds its value of the tick.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from blocks.core import Evaluation
from runtime.document import SECOND
from runtime.engine.steps import Step
from runtime.network import Network, Wire, state_shape

# The compiled text writes states of up to so many components one by one.
UNROLLED = 8
Port = tuple[str, str]
Wires = Mapping[tuple[str, str], Sequence[Wire]]


@dataclass(frozen=True)
class Slot:
    """Where a continuous state is in the row of all continuous states of a graph."""

    block: str
    state: str
    start: int
    shape: tuple[int, ...]

    @property
    def stop(self) -> int:
        return self.start + math.prod(self.shape)

    @property
    def place(self) -> str:
        """The subscript of the state in a row."""
        return f"{self.start}:{self.stop}" if self.shape else str(self.start)

    def address(self, column: int) -> str:
        """The address of one number of the row, as probes write it."""
        return f"{self.block}.{self.state}" + (f".{column - self.start}" if self.shape else "")

    def component(self, column: int) -> str:
        """The address of one number of the row, for messages."""
        inside = f"[{column - self.start}]" if self.shape else ""
        return f"{self.state}{inside}"


@dataclass(frozen=True)
class Continuous:
    """The continuous part of a plan.

    slots : the continuous states in the order of the row.
    steps : the evaluations that every stage repeats, in order.
    derivatives, projected : blocks with their derivative, and those with a ``project``.
    moving : the outputs that may change between ticks.
    time_unit : what times are in, for messages.
    """

    slots: tuple[Slot, ...]
    steps: tuple[Step, ...]
    derivatives: tuple[tuple[str, Evaluation], ...]
    projected: tuple[str, ...]
    moving: frozenset[Port]
    time_unit: str = SECOND

    @property
    def size(self) -> int:
        """The number of continuous states, each component counted."""
        return self.slots[-1].stop

    @property
    def blocks(self) -> set[str]:
        """The blocks that take part."""
        return {step.block for step in self.steps} | {slot.block for slot in self.slots}

    def slots_of(self, block: str) -> list[Slot]:
        return [slot for slot in self.slots if slot.block == block]

    def at(self, column: int) -> Slot:
        """The slot of a number of the row."""
        return next(slot for slot in self.slots if slot.start <= column < slot.stop)


def continuous_part(network: Network, order: list[Step], wires: Wires) -> Continuous | None:
    """The continuous part of a plan; None for a graph without continuous states.

    Parameters
    ----------
    order : the plan's evaluations.
    wires : the wires into each input.
    """
    found = slots(network)
    if not found:
        return None
    blocks = dict.fromkeys(slot.block for slot in found)
    specs = {name: network.entries[name].cls.spec for name in blocks}
    derivatives = tuple((name, d) for name, spec in specs.items() if (d := spec.derivative))
    moving = network.moving
    wanted = [
        source
        for name, derivative in derivatives
        for port in derivative.needs
        for source in _sources(name, port, wires)
    ]
    steps = needed(wanted, order, wires, moving)
    projected = tuple(name for name, spec in specs.items() if spec.projects)
    return Continuous(found, steps, derivatives, projected, moving, network.time_unit)


def needed(
    wanted: Iterable[Port], order: Sequence[Step], wires: Wires, moving: Container[Port]
) -> tuple[Step, ...]:
    """The evaluations, in order, that compute some outputs anew between two ticks."""
    ports, steps = set(wanted), []
    for step in reversed(order):
        outputs = {(step.block, port) for port in step.evaluation.outputs}
        if any(port in ports and port in moving for port in outputs):
            steps.append(step)
            for port in step.evaluation.needs:
                ports.update(_sources(step.block, port, wires))
    return tuple(reversed(steps))


def slots(network: Network) -> tuple[Slot, ...]:
    """The continuous states of a graph, in the order of the row."""
    found: list[Slot] = []
    for name, entry in sorted(network.entries.items()):
        spec = entry.cls.spec
        for state in spec.continuous:
            context = network.context(name)
            shape = state_shape(entry.block, spec.states[state], context, spec)
            found.append(Slot(name, state, found[-1].stop if found else 0, shape))
    return tuple(found)


def _sources(block: str, port: str, wires: Wires) -> list[tuple[str, str]]:
    """The outputs that a method's argument reads: those wired to an input, or the block's own."""
    found = wires.get((block, port))
    if found is None:
        return [(block, port)]
    return [(wire.source.block, wire.source.port) for wire in found]
