"""Runs that go on, and sessions that are computed again, from what was saved of them.

In: the folder of a run with a checkpoint. Out: its graph, and the checkpoint with its rows. In: the
folder of a session. Out: a session that has come to the tick at which it was saved.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from blocks.core import FloatArray, hint
from runtime.errors import UsageError
from runtime.files import check_form, read_text
from runtime.graph.graph import Graph
from runtime.graph.loading import load
from runtime.runs import (
    BEFORE,
    CHECKPOINT,
    MANIFEST,
    RESOLVED,
    leftovers,
    read_run,
    recover,
    remove,
    restored,
    run_folder,
)
from runtime.sessions import CALLS, GRAPH, SESSION, VERSION, Session

_CHANGE = {"tick": int, "call": str, "arguments": list}
_FORM = {"session": int, "ticks": int, "changes": [_CHANGE]}


def is_session(path: str | Path) -> bool:
    """Whether a path is the folder of a saved session."""
    return (Path(path) / SESSION).is_file()


def open_session(folder: str | Path) -> Session:
    """Compute a saved session again: its graph, its changes at their ticks, up to its last tick.

    Raises
    ------
    UsageError : there is no session, or its files are damaged or of another version.
    """
    place = Path(folder)
    path = place / SESSION
    try:
        stored = json.loads(read_text(path))
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    if not isinstance(stored, dict) or stored.get("session") != VERSION:
        raise UsageError(f"'{path}' is not a session of version {VERSION}, which this is")
    try:
        check_form(stored, _FORM)
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    session = load(place / GRAPH).session()
    for each in stored["changes"]:
        if each["call"] not in CALLS:
            call = each["call"]
            raise UsageError(f"'{path}': a session has no method '{call}'{hint(call, CALLS)}")
        session.step(each["tick"] - session.tick)
        getattr(session, each["call"])(*each["arguments"])
    return session.step(stored["ticks"] - session.tick)


@dataclass(frozen=True)
class Resumable:
    """A run that can go on: its folder, its graph, a checkpoint, and the rows before it."""

    folder: Path
    graph: Graph
    source: tuple[Path, Mapping[str, FloatArray]]


def resumable(path: str | Path, until: float | None = None) -> Resumable:
    """A run that can go on from its last checkpoint that can be read.

    Parameters
    ----------
    path : of a run folder, or of the folder of a graph's runs: the newest one there, one that was
        killed included.
    until : a longer end of the run, in its unit of time.

    Raises
    ------
    UsageError : there is no run, no checkpoint that can be used, or nothing is left to run.
    """
    folder = _newest(Path(path))
    run = read_run(folder)
    graph = load(folder / RESOLVED)
    if until is not None:
        graph = graph.set("run.until", until)
    found = [folder / name for name in (CHECKPOINT, BEFORE) if (folder / name).is_file()]
    if not found:
        raise UsageError(
            f"'{folder}' has no checkpoint; a run with --checkpoint 60s writes one a minute. "
            "'--from' begins a new run with the states that one ended with"
        )
    if run.status == "stopped":
        raise UsageError(f"run.stop ended '{folder}' at t = {run.manifest['stopped_at']:g}")
    if run.status == "complete" and run.ticks >= graph.network.ticks:
        end, unit = graph.network.until, graph.network.time_unit
        raise UsageError(f"'{folder}' is complete up to {end:g} {unit}; --until is how it goes on")
    rows = {name: recording.values for name, recording in run.probes.items()}
    wrong: list[str] = []
    for checkpoint in found:
        try:
            tick = restored(checkpoint, rows)[0].tick
        except UsageError as error:
            wrong.append(str(error))
            continue
        # A run that was killed while it was written has nothing left to run, but no metrics yet.
        if tick > graph.network.ticks:
            end = tick * graph.network.dt
            raise UsageError(f"'{folder}' has come to {end:g} already; --until is how it goes on")
        return Resumable(folder, graph, (checkpoint, rows))
    raise UsageError("; ".join(wrong))


def _newest(path: Path) -> Path:
    """The folder of a run; that of a killed run is recovered first."""
    if path.is_dir() and not (path / MANIFEST).is_file():
        # 'latest' is a link to one of them.
        runs = [m for m in path.glob(f"*/{MANIFEST}") if not m.parent.is_symlink()]
        complete = {_age(m.parent.name, m.stat().st_mtime): m.parent for m in runs}
        killed = {
            _age(each.name, each.changed_at): each
            for each in leftovers(path)
            if each.has_recording and not (path / each.name).exists()
        }
        newest = max(killed.keys() | complete.keys(), default=None)
        if newest in complete:
            return complete[newest]
        if newest is not None:
            folder = recover(killed[newest])
            remove(killed[newest])
            return folder
    return run_folder(path)


def _age(name: str, changed_at: float) -> tuple[str, float, str]:
    """By what runs are sorted: names begin with date and time, but two may share a second."""
    return name[: len("20260131-235959")], changed_at, name
