"""The network: blocks, wires and types of a graph that was checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from blocks.core import Block, BlockContext, SignalType, hint
from blocks.world import World
from runtime.document import Node
from runtime.errors import Where
from runtime.network.addresses import Endpoint
from runtime.network.scope import Scope


@dataclass
class Entry:
    """A block of the network. ``block`` is None where it could not be constructed."""

    name: str
    scope: Scope
    node: Node
    cls: type[Block]
    block: Block | None
    every: int = 1

    @property
    def short(self) -> str:
        """The name inside its own graph."""
        return self.name.removeprefix(self.scope.prefix)

    @property
    def address(self) -> str:
        return self.scope.path("blocks", self.short)

    @property
    def made(self) -> Block:
        if self.block is None:
            raise ValueError(f"block '{self.name}' was not constructed")
        return self.block


@dataclass(frozen=True)
class Wire:
    """A wire into one input; ``term`` counts the wires of an input that takes many.

    ``via`` names the inputs of parts through which it comes, the nearest first. A wire may also
    end at a part: ``block`` is then the part, and ``port`` its input.
    """

    source: Endpoint
    block: str
    port: str
    term: int | None
    where: Where
    address: str
    via: tuple[str, ...] = ()
    written: str = ""

    @property
    def message(self) -> str:
        """The source in the words of the graph."""
        return self.written or str(self.source)

    @property
    def target(self) -> str:
        return f"{self.block}.{self.port}" + ("" if self.term is None else f"[{self.term}]")


@dataclass
class Network:
    """A graph, typed and checked; what the plan, the diagram and the probes are made from.

    ``types`` maps (block, port) to the signal type; ``terms`` an input that takes many wires to
    one flag per wire as written. ``removed`` says for each block that is out of the run how:
    "without" or "bypass"; its entry and its wires stay in ``ghosts``. ``part_wires`` end at
    parts, whose typed inputs ``declared`` lists. ``asked`` is the name that took a block out:
    its own, or that of its part. ``document`` has its ``$params`` filled in. ``kinds`` are the
    signal types that the graph's own blocks bring, and ``notes`` what looks wrong but can run.
    """

    title: str
    dt: float
    until: float
    seed: int
    scope: Scope
    entries: dict[str, Entry] = field(default_factory=dict)
    wires: list[Wire] = field(default_factory=list)
    terms: dict[tuple[str, str], tuple[bool, ...]] = field(default_factory=dict)
    types: dict[tuple[str, str], SignalType] = field(default_factory=dict)
    removed: dict[str, str] = field(default_factory=dict)
    asked: dict[str, str] = field(default_factory=dict)
    straight: dict[str, Endpoint] = field(default_factory=dict)
    ghosts: dict[str, Entry] = field(default_factory=dict)
    ghost_wires: list[Wire] = field(default_factory=list)
    part_wires: list[Wire] = field(default_factory=list)
    declared: dict[str, SignalType] = field(default_factory=dict)
    kinds: dict[str, SignalType] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    engine: str = "auto"
    memory: int = 0
    world: World | None = None
    document: Node = field(default_factory=lambda: Node({}))

    @property
    def ticks(self) -> int:
        return round(self.until / self.dt)

    def is_typed(self, name: str) -> bool:
        """Whether all ports of a block have their types, so that its setting is known."""
        spec = self.entries[name].cls.spec
        return all((name, port) in self.types for port in (*spec.inputs, *spec.outputs))

    def context(self, name: str) -> BlockContext:
        """Where a block finds itself: its step, its types, its wires."""
        entry = self.entries[name]
        ports = (*entry.cls.spec.inputs, *entry.cls.spec.outputs)
        return BlockContext(
            dt=self.dt * entry.every,
            types={port: self.types[name, port] for port in ports if (name, port) in self.types},
            terms={
                port: self.terms.get((name, port), ())
                for port, declared in entry.cls.spec.inputs.items()
                if declared.variadic
            },
            world=self.world,
        )


def check_output(network: Network, end: Endpoint, states: bool = False) -> str:
    """What is wrong with an address that should be an output (or a state); '' if nothing is."""
    entry = network.entries.get(end.block) or network.ghosts.get(end.block)
    if entry is None:
        return ""
    spec = entry.cls.spec
    known = {**spec.outputs, **spec.states} if states else spec.outputs
    if not end.port:
        listed = ", ".join(f"{end.block}.{name}" for name in known) or "none"
        return f"'{end.block}' is a block; expected one of its outputs: {listed}"
    if end.port not in known:
        if end.port in spec.states:
            return f"'{end.port}' of '{end.block}' is a state; it can be probed but not wired"
        noun = "output or state" if states else "output"
        suggestion = hint(end.port, known) or f"; it has {', '.join(known) or 'none'}"
        return f"'{end.block}' has no {noun} '{end.port}'{suggestion}"
    return ""
