"""What one engine takes over from another: the state of a run, by names.

In: a run that has come to a tick. Out: the same in an engine that has not begun: of the same graph,
so that it goes on with the same bits (a copy, a checkpoint), or of a changed one. There a block of
the same name, type and shapes keeps what the run has moved; what ``start`` computed and the run has
not touched since, such as the gains of neurons, follows the graph's new parameters::

    state             began as    is now     begins in the changed graph as    taken over
    integral          0           1.7        0.5                               1.7
    gain              200         200        150                               150
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine.engine import Engine
from runtime.engine.naming import undeclared
from runtime.engine.recorder import Rows, Saved
from runtime.engine.state import Begun, RunState
from runtime.memory import alike
from runtime.observation import Probe
from runtime.plan import Port

# The entries of the solver's control that follow from the graph: tolerances and the longest step.
TOLERANCES = slice(1, 4)


@dataclass(frozen=True)
class Carried:
    """The state of a run by names, in copies.

    arrays : by ``block.state`` or ``run/name``. held : the signals that outlive a tick.
    generators : states of bit generators, by ``block.attribute``.
    own : what own blocks keep undeclared, by block and attribute.
    recording : the rows so far. log : the located events so far.
    unchanged : the attributes of own blocks that are as ``start`` leaves them, if not in ``own``.
    python_from : the tick from which a compiled run is under the Python engine; ``notes`` say why.
    """

    tick: int
    arrays: Mapping[str, FloatArray]
    held: Mapping[Port, Any]
    generators: Mapping[str, Mapping[str, Any]]
    own: Mapping[str, Mapping[str, Any]]
    recording: Saved
    log: FloatArray | None
    python_from: int | None = None
    notes: tuple[str, ...] = ()
    unchanged: Mapping[str, Sequence[str]] = field(default_factory=dict)


def carried(engine: Engine, moves: bool = False) -> Carried:
    """What another engine needs to go on.

    Parameters
    ----------
    moves : whether this engine is of no use afterwards, so that what runs share is the other's.

    Raises
    ------
    NotCopiedError : an own block keeps what cannot be copied.
    """
    state = engine.state
    if state.own:
        state.own_state.check_shared(moves)
    return Carried(
        state.tick,
        state.copies(),
        {signal.key: value for signal, value in zip(engine.plan.held, state.held, strict=True)},
        state.drawn(),
        {name: state.own_state.copies(name) for name in state.own},
        engine.recorder.saved(state.tick),
        None if engine.log is None else engine.log.copy(),
        None if engine.exact is None else engine.exact.python_from,
        () if engine.exact is None else tuple(engine.exact.notes),
    )


def adopt(engine: Engine, given: Carried) -> None:
    """Go on in a prepared engine of the same graph as if it had run up to here."""
    state = engine.state
    for name, array in state.arrays.items():
        array[...] = given.arrays[name]
    state.set_drawn(given.generators)  # first, since other memory may refer to a generator
    for name in state.own:
        first = engine.begun.own.get(name, {}) if name in given.unchanged else {}
        own = {key: first[key] for key in given.unchanged.get(name, ()) if key in first}
        own |= given.own.get(name, {})
        for key in undeclared(state.blocks[name]) - own.keys():
            if f"{name}.{key}" not in given.generators:
                delattr(state.blocks[name], key)
        state.own_state.take(name, own)
    _go_on(engine, given)
    engine.recorder.restore(given.recording)
    engine.is_checked = given.tick > 0
    if engine.exact is not None and given.python_from is not None:
        engine.exact.leave(given.python_from, given.notes)


def without_rows(given: Carried) -> Carried:
    """A state that holds the number of its rows only; :func:`with_rows` completes it."""
    recording: Saved = {
        name: ((), rows, rows, memory) for name, (_, rows, _, memory) in given.recording.items()
    }
    return replace(given, recording=recording)


def with_rows(given: Carried, probes: Mapping[str, Probe], source: Engine | None) -> Carried:
    """A state that was copied without rows, with those that another engine of its run has.

    Parameters
    ----------
    probes : of the state. source : has recorded the same up to there; without one, the recordings
        begin at the state.
    """
    if source is None:
        return given
    source.recorder.flush(source.state.tick, all=True)
    recording: Saved = {}
    for name, (parts, rows, left, memory) in given.recording.items():
        sink, old = source.recorder.sinks.get(name), source.recorder.probes.get(name)
        if isinstance(sink, Rows) and old is not None and _meaning(old) == _meaning(probes[name]):
            parts, left = sink.before(rows)
        recording[name] = parts, rows, left, memory
    return replace(given, recording=recording)


def adopt_changed(engine: Engine, before: Engine, given: Carried) -> list[str]:
    """Go on in a prepared engine of a changed graph, with what is the same in both.

    Returns
    -------
    The blocks that keep their state; the others begin.
    """
    state, entries = engine.state, engine.network.entries
    taken: list[str] = []
    for name, entry in entries.items():
        old = before.network.entries.get(name)
        if old is None or old.cls.__name__ != entry.cls.__name__:
            continue
        keys = [key for key in _keys(state, name) if not entry.cls.spec.states[key].cached]
        if any(f"{name}.{key}" not in given.arrays for key in keys):
            continue
        if any(
            given.arrays[f"{name}.{k}"].shape != state.arrays[f"{name}.{k}"].shape for k in keys
        ):
            continue
        for key in keys:
            _take(state.arrays[f"{name}.{key}"], f"{name}.{key}", given, before.begun)
        taken.append(name)
        first = before.begun.own.get(name, {})
        moved = {k: v for k, v in given.own.get(name, {}).items() if not alike(v, first.get(k))}
        state.own_state.take(name, moved)
        engine.starting.guard(name, partial(entry.block.resume, state.blocks[name]))
    drawn = state.drawn()
    for key, bits in given.generators.items():
        if key.rpartition(".")[0] in taken:
            drawn[key] = bits
    state.set_drawn(drawn)
    _take_run(engine, before, given)
    _go_on(engine, given)
    engine.recorder.restore(_same_probes(engine, before, given.recording))
    # Compiled ticks go on where the plan is the same, since Python may round differently.
    engine.is_checked = before.is_checked and engine.plan == before.plan
    return taken


def _keys(state: RunState, name: str) -> list[str]:
    """The declared states of a block."""
    return sorted(vars(state.blocks[name])["_declared"])


def _fits(array: FloatArray, given: FloatArray | None) -> bool:
    return given is not None and given.shape == array.shape


def _take(array: FloatArray, name: str, given: Carried, first: Begun) -> None:
    """Take over a state that has moved, or that begins as it did before."""
    now, start = given.arrays[name], first.arrays[name]
    if now.tobytes() != start.tobytes() or array.tobytes() == start.tobytes():
        array[...] = now


def _go_on(engine: Engine, given: Carried) -> None:
    """The tick, the signals that hold, and the events so far."""
    state = engine.state
    state.tick = given.tick
    held = []
    for signal in engine.plan.held:
        value = given.held.get(signal.key)
        if isinstance(value, np.ndarray) and value.shape == signal.kind.shape:
            value = signal.kind.pack(value)
        fits = value is not None and signal.kind.holds(value, exact=False)
        held.append(value if fits else signal.kind.zero())
    state.held = engine.runner.adopt(tuple(held))
    if given.log is not None and "log" in engine.namespace:
        count = min(len(given.log), len(engine.namespace["log"]))
        engine.namespace["log"][:count] = given.log[:count]
        state.arrays["run/count"][0] = count


def _take_run(engine: Engine, before: Engine, given: Carried) -> None:
    """The solver's step, the sides of guards, and the last solutions of loops."""
    arrays, old, new = engine.state.arrays, before.plan, engine.plan
    if "run/control" in arrays and old.integration and old.solver == new.solver:
        kept = arrays["run/control"][TOLERANCES].copy()
        arrays["run/control"][:] = given.arrays["run/control"]
        arrays["run/control"][TOLERANCES] = kept
    if "run/sides" in arrays and "run/sides" in given.arrays:
        first = {str(c.guards): c for c in old.integration.crossings}  # type: ignore[union-attr]
        for crossing in new.integration.crossings:  # type: ignore[union-attr]
            same = first.get(str(crossing.guards))
            if same is not None and same.directions == crossing.directions:
                sides = given.arrays["run/sides"][:, same.start : same.stop]
                arrays["run/sides"][:, crossing.start : crossing.stop] = sides
    solved = {tuple(s.key for s in loop.unknowns): loop.number for loop in old.loops}
    for loop in new.loops:
        number = solved.get(tuple(signal.key for signal in loop.unknowns))
        if number is not None:
            arrays[f"run/loop_{loop.number}"][...] = given.arrays[f"run/loop_{number}"]
    if old.can_stop and before.program.observation.stop == engine.program.observation.stop:
        arrays["run/stop"][...] = given.arrays["run/stop"]


def _same_probes(engine: Engine, before: Engine, rows: Saved) -> Saved:
    """The rows of probes that record the same; the others have none before this tick."""
    found: Saved = {}
    tick = engine.state.tick
    for name in engine.recorder.sinks:
        probe, old = engine.recorder.probes[name], before.recorder.probes.get(name)
        if old is not None and name in rows and _meaning(probe) == _meaning(old):
            found[name] = rows[name]
        else:
            memory = None
            if probe.is_filtered:
                filtering = engine.recorder.filters[name]
                filtering.taken, filtering.made = probe.values_read(tick), probe.rows(tick)
                memory = filtering.saved()
            found[name] = (), probe.rows(tick), probe.rows(tick), memory
    return found


def _meaning(probe: Probe) -> Any:
    signals = tuple((s.address, str(s.kind), s.labels) for s in probe.signals)
    rows = probe.every, probe.first, probe.mean
    return signals, rows, str(probe.synapse), probe.shape
