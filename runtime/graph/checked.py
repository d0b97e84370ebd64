"""What a checked graph consists of, as plain read-only data, for verbs and scripts of others.

In: a network, in which parts are expanded and what is left out is gone. Out: blocks, wires and the
types of ports::

    graph.blocks["lqr"].type           # "LQR"
    graph.wires[0]                     # WireInfo("plant.pose", "error.pose")
    graph.types["lqr.command"]         # Twist
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from blocks.core import SignalType
from runtime.network import Network


@dataclass(frozen=True)
class BlockInfo:
    """A block of a checked graph.

    name : in a part with the name of the part before it: ``adaptive.snn_v``.
    type : the name of its type.
    parameters : all of them, those that the graph does not write with their defaults.
    dt : its step (s).
    inputs, outputs : the names of its ports.
    """

    name: str
    type: str
    parameters: Mapping[str, Any]
    dt: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class WireInfo:
    """A wire between two blocks, or into one input: ``error.state`` to ``lqr.error``.

    source : block and output, perhaps with a component: ``plant.pose.x``.
    target : block and input, with its number if the input takes several wires: ``sum.terms[0]``.
    """

    source: str
    target: str


def blocks_of(network: Network) -> Mapping[str, BlockInfo]:
    """The blocks by name, in the order of the graph."""
    return MappingProxyType(
        {
            name: BlockInfo(
                name=name,
                type=entry.cls.__name__,
                parameters=MappingProxyType(entry.block.parameters()),
                dt=network.dt * entry.every,
                inputs=tuple(entry.cls.spec.inputs),
                outputs=tuple(entry.cls.spec.outputs),
            )
            for name, entry in network.entries.items()
        }
    )


def wires_of(network: Network) -> tuple[WireInfo, ...]:
    """The wires into blocks; those through the ports of parts from end to end."""
    return tuple(WireInfo(str(wire.source), wire.target) for wire in network.wires)


def types_of(network: Network) -> Mapping[str, SignalType]:
    """The type of each wired or known port, by ``block.port``."""
    return MappingProxyType({f"{block}.{port}": t for (block, port), t in network.types.items()})
