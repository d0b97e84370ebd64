"""What changes between two ticks although nothing moves it: signals that jump at events and edges.

In goes a network, out come ports and times. Of an Integrator that a Relay reads, the output moves;
the Relay's changes where the input meets a threshold, and with it that of a Gain behind it. Solvers
hold both, so that the stages of a step see no jump; they are computed again where one happened.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from blocks.core import FloatArray, PartEnable
from runtime.errors import GraphError, Problem
from runtime.network import Network, Wire, off_ticks
from runtime.plan.values import Port, Signal

# "level" is either direction, and the start if the guard is above zero there.
LEVEL = 3.0
DIRECTIONS = {"rising": 1.0, "falling": -1.0, "either": 0.0, "level": LEVEL}
MOST_EDGES = 10_000_000
# Events that a run records at most.
MOST_EVENTS = 1 << 20
Wires = Mapping[Port, Sequence[Wire]]
Switches = Mapping[str, Sequence[Signal]]


def directions(network: Network, name: str, is_adaptive: bool) -> tuple[float, ...]:
    """The directions of the guards of a block; none if its events are not located.

    A corner is located for a solver that chooses its steps: it saves rejected ones.
    """
    entry = network.entries[name]
    spec, follows = entry.cls.spec, entry.cls.follows
    if spec.guards is None or not network.is_located(name) or (follows and not is_adaptive):
        return ()
    return tuple(DIRECTIONS[each] for each in entry.block.crossings(network.context(name)))


def changing(
    network: Network, wires: Wires, switches: Switches, guarded: Collection[str], edged: set[str]
) -> frozenset[Port]:
    """The outputs that may change between two ticks: those that move, and those that jump.

    Parameters
    ----------
    guarded : the blocks that have guards. edged : sources that jump between ticks.
    """
    readers: dict[Port, list[Port]] = {}
    found: list[Port] = list(network.moving)
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        varying = [each for each in entry.evaluations if not spec.is_constant(each)]
        ports = [(name, port) for each in varying for port in each.outputs]
        found += ports if name in edged else []
        is_switch = name in guarded and network.holds(name)
        momentary = [s for s in switches.get(name, ()) if is_momentary(network, s.block)]
        for read in (signal.key for signal in momentary):
            readers.setdefault(read, []).extend(ports)
        if not (is_switch or spec.continuous or entry.is_memoryless):
            continue
        for each in varying:
            own = ports if is_switch else [(name, port) for port in each.outputs]
            needs = {*each.needs, *(spec.guards.needs if is_switch and spec.guards else ())}
            for port in needs:
                for read in _sources(wires, name, port):
                    readers.setdefault(read, []).extend(own)
            for signal in switches.get(name, ()) if each.needs or each.timed else ():
                readers.setdefault(signal.key, []).extend(own)
    result: set[Port] = set()
    while found:
        port_now = found.pop()
        if port_now not in result:
            result.add(port_now)
            found += readers.get(port_now, ())
    return frozenset(result)


def meets(network: Network, wires: Wires, name: str, changed: Collection[Port]) -> bool:
    """Whether the guards of a block may change between two ticks."""
    spec = network.entries[name].cls.spec
    needs = () if spec.guards is None else spec.guards.needs
    read = (source for port in needs for source in _sources(wires, name, port))
    return bool(spec.continuous) or any(source in changed for source in read)


def edges_between(network: Network, names: Iterable[str]) -> dict[str, FloatArray]:
    """The edges of sources that are not on ticks, of those blocks that have some.

    Raises
    ------
    GraphError : there are too many.
    """
    found = {}
    for name in names if network.events == "located" else ():
        entry = network.entries[name]
        if entry.sampled:
            continue
        times = off_ticks(np.asarray(entry.block.edges(network.until), dtype=float), network.dt)
        times = times[(times > 0.0) & (times < network.until)]
        if len(times) > MOST_EDGES:
            message = f"{len(times)} edges between ticks; at most {MOST_EDGES} can be located: run "
            message += "shorter, or choose run: {events: ticks}"
            raise GraphError([Problem(entry.node.key, entry.address, message)])
        if len(times):
            found[name] = times
    return found


def padded(edges: Sequence[FloatArray]) -> FloatArray:
    """All edges in order, and infinity up to a power of two: plans of other lengths are alike."""
    times = np.unique(np.concatenate([*edges, np.empty(0)]))
    found = np.full(1 << len(times).bit_length(), np.inf)
    found[: len(times)] = times
    return found


def is_momentary(network: Network, name: str) -> bool:
    """Whether a block runs its part at single times."""
    cls = network.entries[name].cls
    return issubclass(cls, PartEnable) and cls.momentary


def _sources(wires: Wires, name: str, port: str) -> list[Port]:
    """What an input reads; an output of the block itself is read as it is."""
    found = [(wire.source.block, wire.source.port) for wire in wires.get((name, port), ())]
    return found or [(name, port)]
