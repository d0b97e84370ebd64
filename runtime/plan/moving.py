"""What moves between two ticks: the continuous states, and the outputs that follow them.

A solver asks for derivatives at times between ticks. An output is computed again there if it may
change between ticks (``Network.moving``); everything else holds its value of the tick. Of a Pulse
with a ``dt`` that feeds an Integrator through a Gain, nothing is computed again: the Gain's output
holds, too. With a Sum that also reads the Integrator, the Sum is.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

from blocks.core import state_shape
from runtime.network import Network
from runtime.plan.operations import Call, Operation, Solve, Stop
from runtime.plan.values import Port, Row, Signal, Slot, StateArray

Evaluated = tuple[Call | Solve, tuple[Operation, ...]]  # a call, or a loop, and its tests


def declared_states(network: Network, name: str) -> tuple[StateArray, ...]:
    """The states of a block."""
    entry, spec = network.entries[name], network.entries[name].cls.spec
    if not spec.states:
        return ()
    context = network.context(name)
    return tuple(
        StateArray(name, state, state_shape(entry.block, declared, context))
        for state, declared in spec.states.items()
    )


def continuous_row(network: Network) -> Row:
    """The continuous states of a graph: by block, in the order of declaration."""
    slots: list[Slot] = []
    for name, entry in sorted(network.entries.items()):
        continuous = entry.cls.spec.continuous
        states = declared_states(network, name) if continuous else ()
        for state in states:
            if state.name in continuous:
                start = slots[-1].stop if slots else 0
                names = entry.block.state_names.get(state.name, ())
                slots.append(Slot(name, state.name, state.shape, start, names))
    return Row(tuple(slots))


def again(
    wanted: Iterable[Port], evaluations: Sequence[Evaluated], moving: Container[Port]
) -> tuple[Operation, ...]:
    """The operations, in order, that compute some outputs anew between two ticks.

    Parameters
    ----------
    wanted : what is read there.
    evaluations : all of a tick, in order.
    moving : the outputs that may change.
    """
    ports, found = set(wanted), list[Evaluated]()
    for call, rest in reversed(evaluations):
        if any(signal.key in ports and signal.key in moving for signal in call.outputs):
            found.append((call, rest))
            ports.update(read_by([call]))
    return tuple(each for call, rest in reversed(found) for each in (call, *rest))


def read_by(operations: Iterable[Operation]) -> list[Port]:
    """The signals that calls, and the conditions of a stop, read."""
    found: list[Signal] = []
    for each in operations:
        if isinstance(each, (Call, Solve)):
            found += [*each.reads, *each.gate.switches]
        elif isinstance(each, Stop) and isinstance(each.source.whole, Signal):
            found.append(each.source.whole)
    return [signal.key for signal in found]
