"""The network: blocks, wires and types of a graph that was checked.

In: what :func:`runtime.network.build` found. Out: one frozen description that plan, diagram, probes
and reports read::

    network.entries["lqr"].block          # the block; names in parts are 'adaptive.snn_v'
    network.types["lqr", "command"]       # Twist
    network.context("lqr").dt             # 0.01
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from blocks.core import Block, BlockContext, Evaluation, FloatArray, SignalType, misspelt
from blocks.messages import Message, Note
from blocks.world import World
from runtime.document import Node, RunSection
from runtime.errors import Problem, Where
from runtime.network.addresses import Endpoint
from runtime.network.components import component_names
from runtime.network.declared_port import PortDeclaration
from runtime.network.scope import Scope

Port = tuple[str, str]


def place_of(node: Node, parameter: str) -> Where:
    """Where a parameter is written, or the part of it that ``a.b`` or ``a[1]`` names; else the
    block.
    """
    where, item = node.key, node
    for name in re.findall(r"[^.\[\]]+", parameter):
        inner = item.get(name) if item.is_map else None
        if item.is_list and name.isdecimal() and int(name) < len(item.value):
            inner = item.value[int(name)]
        if inner is None:
            break
        where, item = inner.where, inner
    return where


@dataclass(frozen=True)
class NetworkEntry:
    """A block of the network; ``block`` is None if it could not be constructed.

    ``every`` is its step in base ticks; ``sampled`` tells whether the graph gives it a step, and
    ``offset`` is the tick of its first one; ``seed`` stands in for the run's.
    """

    name: str
    scope: Scope
    node: Node
    cls: type[Block]
    block_or_none: Block | None
    every: int = 1
    sampled: bool = False
    offset: int = 0
    seed: int | None = None

    @property
    def grid(self) -> int:
        """The largest number of base ticks of which all ticks of the block are multiples."""
        return math.gcd(self.every, self.offset)

    @property
    def output_rate(self) -> tuple[int, int]:
        """The base ticks between two values of an output, and the tick of its first one."""
        glides = self.block_or_none is not None and self.block_or_none.glides
        return (1, 0) if glides else (self.every, self.offset)

    @property
    def short(self) -> str:
        """The name inside its own graph."""
        return self.name.removeprefix(self.scope.prefix)

    @property
    def plain_name(self) -> str:
        """The name without the copies that it leads through: ``robots.snn`` in each robot."""
        return self.scope.plain_prefix + self.short

    def is_named(self, name: str) -> bool:
        """Whether a name stands for the block: its own, that of a part, or of all copies."""
        return any(f"{each}.".startswith(f"{name}.") for each in (self.name, self.plain_name))

    @property
    def address(self) -> str:
        return self.scope.path_of(self.short)

    def problem(self, parameter: str, text: str) -> Problem:
        """What is wrong with a parameter, at the place where it is written."""
        return Problem(place_of(self.node, parameter), f"{self.address}.{parameter}", text)

    @property
    def evaluations(self) -> tuple[Evaluation, ...]:
        """The calls of output methods, without the inputs that the block declares indirect."""
        return self.cls.spec.evaluations if self.block_or_none is None else self.block.evaluations

    @property
    def is_memoryless(self) -> bool:
        """Whether the outputs depend on the time and the inputs alone, and are not sampled."""
        return self.cls.spec.update is None and not (self.sampled or self.block.stepwise)

    @property
    def block(self) -> Block:
        """The block.

        Raises
        ------
        ValueError : it could not be constructed, which a check before has reported.
        """
        if self.block_or_none is None:
            raise ValueError(f"block '{self.name}' was not constructed")
        return self.block_or_none


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
    def source_text(self) -> str:
        """The source as the graph writes it."""
        return self.written or str(self.source)

    @property
    def target(self) -> str:
        return f"{self.block}.{self.port}" + ("" if self.term is None else f"[{self.term}]")


@dataclass(frozen=True, kw_only=True)
class Network(RunSection):
    """A graph, typed and checked: the source of the plan, the diagram and the probes.

    Its section ``run`` is part of it: ``network.dt``, ``network.seed``.

    document : the graph with its ``$params`` filled in; scope : the names in it.
    signal_types : those that the graph's own blocks define, by name.
    notes : what looks wrong but can run.
    wires : into blocks; part_wires : into parts, whose typed inputs ``part_inputs`` lists.
    terms : (block, port) of a variadic input to one flag per wire as written: whether it is kept.
    types : (block, port) to signal type; lengths : block to its known lengths, by symbol.
    initial : block to the states, by name, that it takes from an earlier run when it starts.
    removed : blocks that are left out, each with "without" or "bypass".
    removed_by : the name in ``without`` that removed a block: its own, or that of its part.
    removed_entries, removed_wires : removed blocks, and wires that went or moved with them.
    bypass_sources : output of a bypassed block to what is wired to the input it passes through.
    units : (block, type variable) to the unit that it passes on, where one is known.
    inputs, outputs : the ports of the graph itself.
    """

    title: str
    scope: Scope
    document: Node
    world: World | None = None
    signal_types: Mapping[str, SignalType] = field(default_factory=dict)
    entries: Mapping[str, NetworkEntry] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    wires: tuple[Wire, ...] = ()
    part_wires: tuple[Wire, ...] = ()
    part_inputs: Mapping[str, SignalType] = field(default_factory=dict)
    terms: Mapping[tuple[str, str], tuple[bool, ...]] = field(default_factory=dict)
    types: Mapping[tuple[str, str], SignalType] = field(default_factory=dict)
    lengths: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    initial: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    removed: Mapping[str, str] = field(default_factory=dict)
    removed_by: Mapping[str, str] = field(default_factory=dict)
    removed_entries: Mapping[str, NetworkEntry] = field(default_factory=dict)
    removed_wires: tuple[Wire, ...] = ()
    bypass_sources: Mapping[str, Endpoint] = field(default_factory=dict)
    units: Mapping[Port, str] = field(default_factory=dict)
    inputs: Mapping[str, PortDeclaration] = field(default_factory=dict)
    outputs: Mapping[str, PortDeclaration] = field(default_factory=dict)

    @property
    def ticks(self) -> int:
        return round(self.until / self.dt)

    @cached_property
    def driving(self) -> tuple[Wire, ...]:
        """The wires as blocks read them: into an input that spreads, one for each component."""
        wires: list[Wire] = []
        for wire in self.wires:
            inputs = self.entries[wire.block].cls.spec.inputs
            wires += self._spread(wire) if inputs[wire.port].spread else [wire]
        return tuple(wires)

    @cached_property
    def is_continuous(self) -> bool:
        """Whether a solver integrates states of some block."""
        return any(entry.cls.spec.continuous for entry in self.entries.values())

    @cached_property
    def moving(self) -> frozenset[Port]:
        """The outputs that may change between two ticks; all others hold their value of a tick.

        They are outputs of blocks with continuous states or that glide, and of blocks without
        memory that read the time or such an output, or recall one. Other sampled blocks hold, and
        thereby noise and spikes.
        """
        sources: dict[Port, list[Port]] = {}
        for wire in self.driving:
            source = (wire.source.block, wire.source.port)
            sources.setdefault((wire.block, wire.port), []).append(source)
        waiting: list[Port] = []
        readers: dict[Port, list[Port]] = {}
        for name, entry in self.entries.items():
            spec = entry.cls.spec
            if entry.block_or_none is None:
                continue
            recalled = () if entry.sampled else entry.block.recalls
            if entry.block.glides:
                waiting += [(name, port) for call in entry.evaluations for port in call.outputs]
                continue
            if self.holds(name) or not (spec.continuous or entry.is_memoryless or recalled):
                continue
            for call in entry.evaluations:
                # An output moves with an input that its method needs; what it does not read cannot
                # move it.
                ports = [(name, port) for port in call.outputs]
                if spec.is_constant(call):
                    continue
                if spec.continuous or (call.timed and not recalled):
                    waiting += ports
                for port in recalled or call.needs:
                    for read in sources.get((name, port), [(name, port)]):
                        readers.setdefault(read, []).extend(ports)
        # All outputs that can be reached from those that move by themselves, along the wires and
        # through the memoryless blocks that read them.
        result: set[Port] = set()
        while waiting:
            port_now = waiting.pop()
            if port_now not in result:
                result.add(port_now)
                waiting += readers.get(port_now, ())
        return frozenset(result)

    def _spread(self, wire: Wire) -> list[Wire]:
        kind = self.types.get((wire.source.block, wire.source.port))
        if kind is None:
            return [wire]  # the block's own problem is reported
        # One wire for each number, so that terms and their order are those of components.
        names = component_names(kind, wire.source)
        return [replace(wire, source=replace(wire.source, component=name)) for name in names]

    def is_typed(self, name: str) -> bool:
        """Whether all ports of a block have their types."""
        spec = self.entries[name].cls.spec
        return all((name, port) in self.types for port in (*spec.inputs, *spec.outputs))

    def waits(self, name: str) -> bool:
        """Whether what a block receives from others depends on types that are open.

        The lengths of a Decoder are those of the Ensemble whose spikes it reads, which may have no
        input yet; that is reported of the Ensemble.
        """
        return any(not self.is_typed(end.block) for _, end in self.publications(name))

    def context(self, name: str) -> BlockContext:
        """What a block knows about its place in the graph: step, types, wires, world."""
        entry = self.entries[name]
        ports = (*entry.cls.spec.inputs, *entry.cls.spec.outputs)
        return BlockContext(
            dt=self.dt * entry.every,
            types={port: self.types[name, port] for port in ports if (name, port) in self.types},
            terms={
                port: self._flags(name, port, bool(input_port.spread))
                for port, input_port in entry.cls.spec.inputs.items()
                if input_port.variadic
            },
            world=self.world,
            lengths=self.lengths.get(name, {}),
            published={
                port: self.entries[source.block].block for port, source in self.publications(name)
            },
            until=self.until,
            moving=self._moving_inputs(entry),
            located=self.is_located(name),
            wired=frozenset(wire.port for wire in self.into.get(name, ())),
            sampled=entry.sampled,
            neighbour=lambda other: self._neighbour(entry, other),
        )

    def _neighbour(self, entry: NetworkEntry, name: str) -> tuple[Block, BlockContext] | None:
        """A block of the same part, or of the whole graph."""
        for each in (entry.scope.prefix + name, name):
            other = self.entries.get(each)
            if other is not None and other.block_or_none is not None and self.is_typed(each):
                return other.block, self.context(each)
        return None

    def holds(self, name: str) -> bool:
        """Whether the outputs of a block change at ticks and at its located events alone."""
        cls = self.entries[name].cls
        is_switch = cls.spec.guards is not None and not (cls.spec.continuous or cls.follows)
        return is_switch and self.is_located(name)

    def is_located(self, name: str) -> bool:
        """Whether the events of a block are between ticks, where its signals change there."""
        return self.events == "located" and not self.entries[name].sampled

    def _moving_inputs(self, entry: NetworkEntry) -> tuple[str, ...]:
        """The inputs that a block recalls and that move between ticks."""
        recalled = () if entry.block_or_none is None or entry.sampled else entry.block.recalls
        into = self.into.get(entry.name, ()) if recalled else ()
        sources = [(w.port, (w.source.block, w.source.port)) for w in into if w.port in recalled]
        return tuple(dict.fromkeys(port for port, source in sources if source in self.moving))

    def _flags(self, name: str, port: str, spread: bool) -> tuple[bool, ...]:
        """Whether each term of a variadic input is connected."""
        flags = self.terms.get((name, port), ())
        if not spread:
            return flags
        widths = Counter(
            wire.term
            for whole in self.into.get(name, ())
            for wire in (self._spread(whole) if whole.port == port else ())
        )
        # A wire of three columns into an input that spreads counts as three terms.
        return tuple(flag for i, flag in enumerate(flags) for _ in range(widths[i] if flag else 1))

    def changed(self, **changes: Any) -> Network:
        """A copy with other values of some fields, but the same wires."""
        network = replace(self, **changes)
        network.__dict__["into"] = self.into
        return network

    @cached_property
    def into(self) -> Mapping[str, Sequence[Wire]]:
        """The wires into each block."""
        result: dict[str, list[Wire]] = {}
        for wire in self.wires:
            result.setdefault(wire.block, []).append(wire)
        return result

    def publications(self, name: str) -> list[tuple[str, Endpoint]]:
        """The inputs of a block that receive a published description, and from which output."""
        return [
            (wire.port, wire.source)
            for wire in self.into.get(name, ())
            if not wire.source.component
            and (entry := self.entries.get(wire.source.block)) is not None
            and entry.cls.spec.outputs[wire.source.port].publishes
        ]


def check_output(network: Network, end: Endpoint, states: bool = False) -> Message | None:
    """What is wrong with an address that should be an output (or a state); None if nothing is."""
    entry = network.entries.get(end.block) or network.removed_entries.get(end.block)
    if entry is None:
        return None
    spec = entry.cls.spec
    known = {**spec.outputs, **spec.states} if states else spec.outputs
    if not end.port:
        listed = ", ".join(f"{end.block}.{name}" for name in known) or "none"
        text = f"'{end.block}' is a block; expected one of its outputs: {listed}"
        return Message(text, "unknown-output")
    if end.port in known:
        return None
    if end.port in spec.states:
        text = f"'{end.port}' of '{end.block}' is a state; it can be probed but not wired"
        return Message(text, "unknown-output")
    noun = "output or state" if states else "output"
    text, other = f"'{end.block}' has no {noun} '{end.port}'", ", ".join(known) or "none"
    return misspelt("unknown-output", text, end.port, known, f"; it has {other}")
