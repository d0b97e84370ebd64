"""How often each signal is new, for blocks that count what they get.

In: a network with types. Out: how long each output holds, and what blocks say of their inputs::

    plant ─▶ Hold (dt: 0.2) ─▶ Gain ─▶ filter (dt: 0.004)        steps["gain", "out"] = 0.2
    block 'filter': measurement 'gps' is new every 0.2 s, and is used every 0.004 s ...
"""

from __future__ import annotations

import math

from blocks.core import Block
from blocks.messages import Note
from runtime.network.network import Network, Port


def rate_notes(network: Network) -> list[Note]:
    """What blocks find wrong with their place in a graph that is right."""
    with_notes = [
        (name, entry.block)
        for name, entry in network.entries.items()
        if entry.block_or_none is not None and entry.cls.notes is not Block.notes
    ]
    if not with_notes:
        return []
    steps, notes = _Steps(network), list[Note]()
    for name, block in with_notes:
        into: dict[str, list[float]] = {}
        for wire in network.driving:
            if wire.block == name:
                step = steps.of((wire.source.block, wire.source.port))
                into.setdefault(wire.port, []).append(step)
        given = {port: tuple(found) for port, found in into.items()}
        notes += [
            Note(f"block '{name}': {text}", "block-note", block=name)
            for text in block.notes(network.context(name), given)
        ]
    return notes


class _Steps:
    """How long outputs hold (s)."""

    def __init__(self, network: Network) -> None:
        self.network = network
        self.found: dict[Port, float] = {}
        self.sources: dict[Port, list[Port]] = {}
        for wire in network.driving:
            source = (wire.source.block, wire.source.port)
            self.sources.setdefault((wire.block, wire.port), []).append(source)

    def of(self, port: Port) -> float:
        """0 of what moves between ticks, infinity of a constant.

        What a block without memory computes is new with the first of the inputs that it reads.
        """
        waiting = [port]
        while waiting:
            at = waiting[-1]
            missing = [each for each in self._read(at) if each not in self.found]
            if at not in self.found and missing:
                # A loop of blocks without memory, which a solver breaks, waits for itself.
                self.found[at] = 0.0
                waiting += missing
                continue
            self.found[at] = self._step(at)
            waiting.pop()
        return self.found[port]

    def _read(self, port: Port) -> list[Port]:
        name, output = port
        entry = self.network.entries[name]
        if entry.block_or_none is None or not entry.is_memoryless:
            return []
        needs = [n for call in entry.evaluations if output in call.outputs for n in call.needs]
        return [source for need in needs for source in self.sources.get((name, need), ())]

    def _step(self, port: Port) -> float:
        name, output = port
        entry = self.network.entries[name]
        if entry.block_or_none is None or port in self.network.moving:
            return 0.0
        call = next(call for call in entry.evaluations if output in call.outputs)
        if entry.cls.spec.is_constant(call):
            return math.inf
        if not entry.is_memoryless:
            return self.network.dt * entry.every
        if call.timed and not call.needs:
            return 0.0
        return min((self.found[each] for each in self._read(port)), default=math.inf)
