"""The steps of a plan, and the wires that they read."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from blocks.core import Evaluation
from runtime.network import Network, Wire


@dataclass(frozen=True)
class Step:
    """One evaluation of one block, every ``every`` base ticks.

    ``enables`` names the blocks without whose ``on`` it is left out: those of the parts around it.
    """

    block: str
    evaluation: Evaluation
    every: int
    constant: bool = False
    enables: tuple[str, ...] = ()


def drivers(network: Network) -> dict[tuple[str, str], list[Wire]]:
    """The wires into each input, in the order of an input's terms."""
    found: dict[tuple[str, str], list[Wire]] = defaultdict(list)
    for wire in network.driving:
        found[wire.block, wire.port].append(wire)
    return found
