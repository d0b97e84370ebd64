"""What looks wrong in a network that can run: edges that no tick shows, bodies that pass walls.

In goes a network, out come notes; times that are within a 1e-9th of a tick count as the tick's::

    block 'pulse': 10 of its pulses or pauses are shorter than a tick, the shortest 0.001 s ...
    block 'car': passes through the walls of the world: nothing stops or measures it ...
"""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray, Pose
from blocks.messages import Note
from runtime.network.network import Network

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


def contact_notes(network: Network) -> list[Note]:
    """The moving bodies of a graph with a world that no surface stops and no block measures.

    A body is what turns commands into a pose: a block with states, an output Pose and no input of
    that type, which sensors, estimators and followers of paths have. One with an output
    ``contact`` of its own, such as a robot with physics, has a body unless its radius is 0.
    """
    if network.world is None:
        return []
    measured = {
        (wire.source.block, wire.source.port)
        for wire in network.wires
        if "contact" in network.entries[wire.block].cls.spec.outputs
    }
    notes = []
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        poses = [port for port in spec.outputs if network.types.get((name, port)) == Pose]
        takes_poses = any(network.types.get((name, port)) == Pose for port in spec.inputs)
        if entry.block_or_none is None or not poses or takes_poses:
            continue
        radius = getattr(entry.block, "body_radius", None)
        stopped = bool(radius) or (radius is None and "contact" in spec.outputs)
        moves = spec.update is not None or spec.continuous
        if moves and not stopped and measured.isdisjoint((name, port) for port in poses):
            give = "give it a body_radius, or " if radius is not None else ""
            text = (
                f"block '{name}': passes through the walls of the world: nothing stops or measures "
                f"it; {give}wire {name}.{poses[0]} to a Contact"
            )
            notes.append(Note(text, "passes-walls", block=name))
    return notes
