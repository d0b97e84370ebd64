"""Parts that run only at times: which blocks say so, and what they switch.

In: a network. Out: for each block the Enable or Trigger blocks that switch it::

    inner.gain in part outer.inner, each with a block 'on':   ("outer.on", "outer.inner.on")
"""

from __future__ import annotations

from collections.abc import Iterator

from blocks.core import GraphInput, PartEnable
from runtime.errors import Problems
from runtime.network.network import Network, NetworkEntry
from runtime.network.scope import INPUTS

# What a part has that is there while it is off.
FROM_OUTSIDE = (PartEnable, GraphInput)


def enables_of(network: Network) -> dict[str, tuple[str, ...]]:
    """The blocks that switch each block, those of outer parts first; only of blocks that have any.

    A block that switches a part is itself switched by those of the parts around it only.
    """
    result: dict[str, tuple[str, ...]] = {}
    # By depth: a part inside of one that is off is off, whatever its own block says.
    enables = sorted(_enables(network), key=lambda entry: (len(entry.scope.prefix), entry.name))
    for name, entry in network.entries.items():
        above = tuple(
            enable.name
            for enable in enables
            if name.startswith(enable.scope.prefix)
            and not (issubclass(entry.cls, FROM_OUTSIDE) and entry.scope is enable.scope)
        )
        if above:
            result[name] = above
    return result


def resets(network: Network, name: str) -> bool:
    """Whether a block resets the part that it is in while it is off."""
    block = network.entries[name].block_or_none
    return isinstance(block, PartEnable) and block.resets


def check_enabling(network: Network, problems: Problems) -> None:
    """Report blocks that switch no part, or that what they switch would have to switch on."""
    for enable in _enables(network):
        kind, prefix = enable.cls.__name__, enable.scope.prefix
        if enable.scope.parent is None:
            message = f"{kind} switches the part that it is in, but this is not in one; move it, "
            message += "with the blocks that it switches, to a part ({graph: part.yaml})"
            problems.add(enable.node.key, enable.address, message)
            continue
        for wire in network.wires:
            inside = wire.source.block.startswith(prefix)
            is_input = wire.source.block.startswith(f"{prefix}{INPUTS}")
            if wire.block == enable.name and inside and not is_input:
                message = f"'{wire.source}' is in the part that '{enable.name}' switches, and would"
                message += (
                    " not change once the part is off; wire a signal from outside of the part"
                )
                problems.add(wire.where, wire.address, message)
        is_momentary = issubclass(enable.cls, PartEnable) and enable.cls.momentary
        for name, entry in network.entries.items():
            # A solver integrates over the time between ticks; a part that runs on single ticks has
            # none.
            if is_momentary and name.startswith(prefix) and entry.cls.spec.continuous:
                message = f"its states are continuous, but '{enable.name}' runs the part on single "
                message += "ticks; use Enable, or a block in discrete time"
                problems.add(entry.node.key, entry.address, message)


def _enables(network: Network) -> Iterator[NetworkEntry]:
    return (each for each in network.entries.values() if issubclass(each.cls, PartEnable))
