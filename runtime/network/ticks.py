"""The ticks of blocks, pulses that are shorter than one, and how often signals are new.

In: ``dt`` and ``offset`` as a block writes them, or a network with types. Out: both in base ticks
(steps of ``run.dt``), and notes on signals that fall between ticks, or are counted several times::

    run: {dt: 0.001}      {type: PID, dt: 0.01, offset: 0.002}      every 10, from tick 2 on
    plant ─▶ Hold (dt: 0.2) ─▶ Gain ─▶ filter (dt: 0.004)           gain.out is new every 0.2 s
    block 'filter': measurement 'gps' is new every 0.2 s, and is used every 0.004 s ...
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import Block, FloatArray
from blocks.messages import Message, Note, Replace
from runtime.document import MAX_TICKS, Node, seconds
from runtime.errors import Problems
from runtime.network.network import Network, Port


def sampling(
    node: Node, cls: type[Block], network: Network, address: str, problems: Problems
) -> tuple[int, int]:
    """How many base ticks lie between two ticks of a block, and how many before its first one."""
    every = _ticks(node.get("dt"), network, f"{address}.dt", problems)
    # Of a Sine and its like, the offset is that of the signal.
    offset = None if "offset" in cls.spec.params else node.get("offset")
    if offset is None or offset.value in (0, 0.0):
        return every, 0
    first = _ticks(offset, network, f"{address}.offset", problems)
    if not first < every:
        step = every * network.dt
        message = f"expected less than the block's dt = {step:g} {network.time_unit}"
        problems.add(offset.where, f"{address}.offset", f"{message}, got {offset.describe()}")
        return every, 0
    return every, first


def _ticks(node: Node | None, network: Network, address: str, problems: Problems) -> int:
    """A time in base ticks; 1 if there is none, or a wrong one."""
    value = None if node is None else seconds(node, address, problems)
    if node is None or value is None:
        return 1
    base, unit = network.dt, network.time_unit
    ratio = value / base
    # 0.3 / 0.1 is 2.9999999999999996: whole numbers up to rounding count.
    whole = round(ratio) if ratio < MAX_TICKS else 0
    if whole < 1 or abs(ratio - whole) > 1e-6:
        near = max(1, whole) * base
        message = f"{value:g} {unit} is not a multiple of run.dt = {base:g} {unit}; "
        message += f"the nearest is {near:g}"
        fixes = [Replace(f"{near:g}", title=f"Replace by {near:g}")]
        problems.add(node.where, address, Message(message, "invalid-value", fixes))
        return 1
    return whole


ON_TICK = 1e-9


def off_ticks(times: FloatArray, dt: float) -> FloatArray:
    """The times that are not at a tick."""
    times = times[np.isfinite(times)]  # a Ramp without an end has its end at infinity
    ticks = times / dt
    rounding = np.maximum(ON_TICK, 4.0 * np.finfo(float).eps * np.abs(ticks))
    off: FloatArray = times[np.abs(ticks - np.round(ticks)) > rounding]
    return off


def edge_notes(network: Network) -> list[Note]:
    """The sources whose pulses are shorter than a tick, in a graph that sees ticks alone."""
    is_continuous = any(entry.cls.spec.continuous for entry in network.entries.values())
    notes = []
    for name, entry in network.entries.items():
        if (
            entry.block_or_none is None
            or not entry.block.stepwise
            or (is_continuous and network.is_located(name))
        ):
            continue
        times = np.unique(np.asarray(entry.block.edges(network.until), dtype=float))
        times = times[(times >= 0.0) & (times < network.until)]
        dt = network.dt * entry.every
        spans = np.diff(times)
        short = spans[spans < dt * (1.0 - ON_TICK)]
        if not (len(short) and len(off_ticks(times, dt))):
            continue
        unit = network.time_unit
        text = (
            f"block '{name}': {len(short)} of its pulses or pauses are shorter than a tick, the "
            f"shortest {short.min():.3g} {unit} at dt = {dt:g} {unit}: one lasts a tick, or is lost"
        )
        notes.append(Note(text, "short-pulse", block=name))
    return notes


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
