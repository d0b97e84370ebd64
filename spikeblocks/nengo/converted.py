"""How a network is converted, and what a graph is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from blocks.core import FloatArray
from spikeblocks.nengo.flow import Population
from spikeblocks.nengo.probing import Recording


@dataclass(frozen=True)
class Options:
    """How to convert: dt and until (s), a seed of the network, whether neurons are drawn anew.

    live : whether the graph is run in this process alone, and calls Python functions as they are.
    """

    dt: float = 0.001
    until: float = 1.0
    seed: int | None = None
    redraw: bool = False
    live: bool = False


@dataclass
class Converted:
    """What a graph consists of.

    recordings : for each probe where it is recorded.
    populations : for each ensemble's block the members, in order.
    simulator : Nengo's, which was built for it.
    """

    blocks: dict[str, dict[str, Any]] = field(default_factory=dict)
    wires: dict[str, dict[str, Any]] = field(default_factory=dict)
    probes: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    classes: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    tables: dict[str, FloatArray] = field(default_factory=dict)
    recordings: dict[str, Recording] = field(default_factory=dict)
    populations: dict[str, Population] = field(default_factory=dict)
    calls: list[int] = field(default_factory=list)
    simulator: Any = None
